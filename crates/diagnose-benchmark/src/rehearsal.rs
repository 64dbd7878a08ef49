//! A log of pushes in the true world of a scenario: what a robot in that world would record before it plans there.
//!
//! The log says of the object what could be measured beforehand: shape, sizes, and that it is uniform (a ball that is not does not rest where it is
//! put). Mass and friction are as uncertain as the scenario has them. Obstacles of Θ are put aside: a log is of one object.

use std::sync::Arc;

use measured_log::{
    Axis, Channel, Episode, Header, Log, Noise, Number, Object, Robot as Arm, Shape, SplitConfig, Table,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics_model::config::WorldConfig;
use physics_model::rig::{Rig, RigObject, RigShape, RigTool};
use physics_model::robot::{Robot, ToolShape};
use physics_model::{EffectConfig, ObjectShape, ObjectTheta};
use pomdp::{Purpose, Seed};
use scenario::Problem;

use crate::actions::{Scene, Script, designed, passive};
use crate::generate::Actions;
use crate::recording::{RecordError, Recording};

/// Share of the episodes that the log keeps for before and after.
const HOLDOUT_FRACTION: f64 = 0.3;
/// Noise of the sensors at the tool, of which a scenario says nothing: m, N·m.
const TOOL_NOISE: (f64, f64) = (0.0002, 0.005);

/// No reading counts as farther apart, standard deviations: as for the logs of other engines.
const MOST: f64 = 1e3;

/// Records the pushes of `actions` on an object that `seed` draws.
///
/// # Errors
///
/// [`RecordError`]: a scenario without a possible world, an arm that logs know nothing of, or a push that goes where no log does.
pub fn record(problem: &Problem, actions: Actions, seed: Seed) -> Result<Log, RecordError> {
    let scenario = &problem.scenario;
    let mut rng = seed.stream(Purpose::World, 0);
    let world = problem.sample_world(&mut rng).map_err(|error| RecordError::Scenario(error.to_string()))?;
    let object = world.theta.object;
    let header = header(problem, &object)?;
    let config = &scenario.world;
    let tool_m = header.tool_radius_m.unwrap_or_default();
    let reach_m = object.shape.footprint_radius_m(object.size_m);
    let places = &scenario.distribution.object;
    let scene = Scene {
        period_secs: config.control_period_secs,
        tool_height_m: scenario.task.tool_start_m[2],
        touch_m: reach_m + tool_m,
        clear_m: reach_m + reach_of_tool_m(problem.truth.robot()).max(tool_m),
        face_m: if object.shape == ObjectShape::Box { 0.5 * object.size_m[0] } else { reach_m } + tool_m,
        rolls: object.shape == ObjectShape::Sphere,
        half_width_m: if object.shape == ObjectShape::Box { 0.5 * object.size_m[1] } else { 0.7 * reach_m },
        centre_m: [places.x_m.mean, places.y_m.mean],
    };
    let mut scripts: Vec<Script> = match actions {
        Actions::Designed => designed(&scene, &mut rng),
        Actions::Passive => passive(&scene, &mut rng),
    };
    let [x, y] = [scenario.task.reach.x_m, scenario.task.reach.y_m];
    scripts.iter_mut().for_each(|script| script.fit_into([x[0], y[0]], [x[1], y[1]]));
    let shape = RigShape::Solid { shape: object.shape, size_m: object.size_m };
    let recording = Recording {
        rig: Rig {
            world: WorldConfig { control_steps: 1, ..config.clone() },
            tick_steps: 1,
            tool: RigTool::Arm(Arc::new(problem.truth.robot().clone())),
            tool_slip_mps: 0.0,
            cone_exponent: 1.0,
        },
        object: RigObject::new(shape, object.mass_kg, object.friction),
        effects: scenario.effects.truth.iter().map(EffectConfig::build).collect(),
        height_m: config.table_height_m + object.shape.half_height_m(object.size_m),
        seed,
    };
    recording.log(header, scripts.iter().enumerate())
}

/// Mean square, in noise variances, by which readings of a log differ from those of another with the same pushes and noise: `detectable` of a truth.
#[must_use]
pub fn difference(log: &Log, other: &Log) -> f64 {
    let noise = &log.header.noise;
    let vectors = [
        (Channel::ObjectPosition as fn(Axis) -> Channel, noise.object_position_m),
        (Channel::Tool, noise.tool_position_m),
        (Channel::WristForce, noise.wrist_force_n),
        (Channel::WristTorque, noise.wrist_torque_nm),
    ];
    let (mut sum, mut count) = (0.0, 0.0);
    let mut add = |apart: Vector3<f64>| {
        (sum, count) = (sum + apart.map(|one| one.clamp(-MOST, MOST)).norm_squared(), count + 3.0);
    };
    for (a, b) in log.episodes.iter().zip(&other.episodes) {
        for row in 0..a.rows().min(b.rows()) {
            for (channel, stddev) in vectors {
                let read = |episode: &Episode| episode.vector(channel, row).map(Vector3::from);
                if let (Some(a), Some(b), Some(stddev)) = (read(a), read(b), stddev) {
                    add((a - b) / stddev);
                }
            }
            let turned = |episode: &Episode| {
                let [x, y, z, w] = episode.orientation(row)?;
                Some(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)))
            };
            if let (Some(a), Some(b), Some(stddev)) = (turned(a), turned(b), noise.object_orientation_rad) {
                add((a * b.inverse()).scaled_axis() / stddev);
            }
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// How far a tool reaches from its centre along the table, m. An open hand reaches farther than the first of its parts, with which it would begin in the object.
fn reach_of_tool_m(robot: &Robot) -> f64 {
    let turn = robot.tool_orientation();
    let along = |point_m: [f64; 3]| {
        let [x, y, _]: [f64; 3] = (turn * Vector3::from(point_m)).into();
        x.hypot(y)
    };
    let reach = |shape: &ToolShape| match shape {
        ToolShape::Ball { center_m, radius_m } => along(*center_m) + radius_m,
        ToolShape::Capsule { a_m, b_m, radius_m } => along(*a_m).max(along(*b_m)) + radius_m,
    };
    robot.tool_shapes().iter().map(reach).fold(0.0, f64::max)
}

fn header(problem: &Problem, object: &ObjectTheta) -> Result<Header, RecordError> {
    let scenario = &problem.scenario;
    let robot = match scenario.robot.name.as_str() {
        "sawyer" => Arm::Sawyer,
        "jaco" => Arm::Jaco,
        name => return Err(RecordError::Scenario(format!("robot: expected sawyer or jaco, found {name}"))),
    };
    let (fixed, believed, noise) = (Number::Fixed, &scenario.distribution.object, &scenario.sensor.noise);
    let tool_radius_m = problem.truth.robot().tool_shapes().first().map(|shape| match shape {
        ToolShape::Ball { radius_m, .. } | ToolShape::Capsule { radius_m, .. } => *radius_m,
    });
    let size_m = object.size_m;
    Ok(Header {
        robot,
        period_secs: scenario.world.control_period_secs,
        tool_radius_m,
        tool_friction: Some(fixed(scenario.world.tool_friction)),
        gravity_mps2: scenario.world.gravity_mps2,
        table: Table {
            height_m: fixed(scenario.world.table_height_m),
            friction: Number::Uncertain { mean: believed.friction.mean, stddev: believed.friction.stddev },
        },
        object: Object {
            shape: match object.shape {
                ObjectShape::Box => Shape::Box { size_m: size_m.map(fixed) },
                ObjectShape::Cylinder => Shape::Cylinder { radius_m: fixed(size_m[0]), height_m: fixed(size_m[1]) },
                ObjectShape::Sphere => Shape::Sphere { radius_m: fixed(size_m[0]) },
            },
            // A gamma distribution of shape k has the standard deviation mean / √k.
            mass_kg: Number::Uncertain {
                mean: believed.mass_kg.mean,
                stddev: believed.mass_kg.mean / believed.mass_kg.shape.sqrt(),
            },
            com_m: [fixed(0.0); 3],
            inertia_kgm2: None,
            restitution: None,
        },
        noise: Noise {
            object_position_m: Some(noise.position_m),
            object_orientation_rad: Some(noise.orientation_rad),
            tool_position_m: Some(TOOL_NOISE.0),
            wrist_force_n: Some(noise.force_n),
            wrist_torque_nm: Some(noise.torque_nm.max(TOOL_NOISE.1)),
            joint_position_rad: Some(noise.joint_rad),
            joint_torque_nm: Some(noise.joint_torque_nm),
            ..Noise::default()
        },
        split: SplitConfig { holdout_fraction: HOLDOUT_FRACTION },
    })
}
