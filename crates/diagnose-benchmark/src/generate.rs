//! Logs of a rig with a known world.

use std::collections::BTreeMap;

use measured_log::{
    Axis, Channel, Component, Episode, Header, Log, Noise, Number, Object, Readings, Robot, Shape, SplitConfig, Table,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::Effect;
use physics_model::rig::{Rig, RigObject, RigShape, RigStart, RigTool};
use physics_model::{BodyState, EffectConfig, ObjectShape};
use pomdp::{Purpose, Seed};
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::actions::{Scene, Script, designed, passive};

/// What is done while the log is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Actions {
    /// Chosen to tell effects apart.
    Designed,
    /// As they come.
    Passive,
}

/// A set to generate.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SetSpec {
    /// Seed of everything that is drawn.
    pub seed: u64,
    /// Shape of the object.
    pub shape: ObjectShape,
    /// What the true world has and the nominal model lacks.
    pub effects: Vec<EffectConfig>,
    /// True value over nominal: of mass and friction.
    pub nominal_errors: [f64; 2],
    /// Factor on the sensors' noise.
    pub noise: f64,
    /// What is done.
    pub actions: Actions,
    /// Engine of the true world: steps a tick, solver iterations, contact frequency.
    pub engine: (u32, u32, f64),
}

const PERIOD_SECS: f64 = 0.01;
const TOOL_RADIUS_M: f64 = 0.02;
const TOOL_FRICTION: f64 = 0.1;
const MASS_KG: f64 = 0.5;
const FRICTION: f64 = 0.35;

/// The log of a set.
///
/// # Panics
///
/// Where the true world diverges: a set whose effects cannot be.
#[must_use]
pub fn generate(spec: &SetSpec) -> Log {
    let size_m = match spec.shape {
        ObjectShape::Box => [0.08, 0.06, 0.05],
        ObjectShape::Cylinder => [0.035, 0.05, 0.0],
        ObjectShape::Sphere => [0.03, 0.0, 0.0],
    };
    let half_height_m = spec.shape.half_height_m(size_m);
    let reach_m = spec.shape.footprint_radius_m(size_m);
    let scene = Scene {
        period_secs: PERIOD_SECS,
        tool_height_m: half_height_m.min(0.03),
        touch_m: reach_m + TOOL_RADIUS_M,
        half_width_m: if spec.shape == ObjectShape::Box { 0.03 } else { 0.7 * reach_m },
        centre_m: [0.0, 0.0],
    };
    let seed = Seed(spec.seed);
    let mut rng = seed.stream(Purpose::World, 0);
    let scripts = match spec.actions {
        Actions::Designed => designed(&scene, &mut rng),
        Actions::Passive => passive(&scene, &mut rng),
    };
    let (refinement, iterations, frequency) = spec.engine;
    let rig = Rig {
        world: WorldConfig {
            control_period_secs: PERIOD_SECS / f64::from(refinement),
            control_steps: 1,
            solver_iterations: iterations,
            contact_frequency_hz: frequency,
            contact_damping_ratio: 5.0,
            table_height_m: 0.0,
            gravity_mps2: 9.81,
            tool_friction: TOOL_FRICTION,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0,
            restitution: 0.0,
            obstacle_mobility: ObstacleMobility::Movable,
        },
        tick_steps: refinement,
        tool: RigTool::Ball { radius_m: TOOL_RADIUS_M },
    };
    let shape = RigShape::Solid { shape: spec.shape, size_m };
    let noise = Noise {
        object_position_m: Some(0.0005 * spec.noise),
        object_orientation_rad: Some(0.003 * spec.noise),
        tool_position_m: Some(0.0001 * spec.noise),
        wrist_force_n: Some(0.05 * spec.noise),
        wrist_torque_nm: Some(0.002 * spec.noise),
        ..Noise::default()
    };
    let effects: Vec<Box<dyn Effect>> = spec.effects.iter().map(EffectConfig::build).collect();
    let episodes = scripts
        .iter()
        .enumerate()
        .map(|(index, script)| {
            let mut object =
                RigObject::new(shape.clone(), MASS_KG * spec.nominal_errors[0], FRICTION * spec.nominal_errors[1]);
            object.added_mass_kg = script.added_mass_kg;
            let mut rng = seed.stream(Purpose::Truth, index as u64);
            episode(index as u64, &rig, &object, &effects, script, half_height_m, &noise, &mut rng)
        })
        .collect();
    let fixed = Number::Fixed;
    let header = Header {
        robot: Robot::None,
        period_secs: PERIOD_SECS,
        tool_radius_m: Some(TOOL_RADIUS_M),
        tool_friction: Some(fixed(TOOL_FRICTION)),
        gravity_mps2: 9.81,
        table: Table { height_m: fixed(0.0), friction: Number::Uncertain { mean: FRICTION, stddev: 0.15 * FRICTION } },
        object: Object {
            shape: match spec.shape {
                ObjectShape::Box => Shape::Box { size_m: size_m.map(fixed) },
                ObjectShape::Cylinder => Shape::Cylinder { radius_m: fixed(size_m[0]), height_m: fixed(size_m[1]) },
                ObjectShape::Sphere => Shape::Sphere { radius_m: fixed(size_m[0]) },
            },
            mass_kg: Number::Uncertain { mean: MASS_KG, stddev: 0.15 * MASS_KG },
            com_m: [fixed(0.0); 3],
            inertia_kgm2: None,
            restitution: None,
        },
        noise,
        split: SplitConfig { holdout_fraction: 0.3 },
    };
    Log { header, episodes }
}

#[expect(clippy::too_many_arguments, reason = "one caller")]
fn episode(
    id: u64,
    rig: &Rig,
    object: &RigObject,
    effects: &[Box<dyn Effect>],
    script: &Script,
    half_height_m: f64,
    noise: &Noise,
    rng: &mut pomdp::Rng,
) -> Episode {
    let [x, y] = script.place_m;
    let body = BodyState::at_rest([x, y, half_height_m + script.lift_m], script.yaw_rad);
    let seen = physics_model::effect::signal::read(effects, &body);
    let start = RigStart::of_episode(seen, Some(script.commands[0]));
    let readings = rig.run(object, effects, &start, &script.commands[1..]).expect("a true world that is one");
    let mut normal = |stddev: Option<f64>| {
        let z: f64 = StandardNormal.sample(rng);
        z * stddev.unwrap_or(0.0)
    };
    let mut channels: BTreeMap<Channel, Readings> = BTreeMap::new();
    let mut push = |channel: Channel, value: Option<f64>| channels.entry(channel).or_default().push(value);
    for (row, command) in script.commands.iter().enumerate() {
        let reading = row.checked_sub(1).map(|row| &readings[row]);
        let (object, tool) = reading.map_or((seen, *command), |r| (r.object, r.tool_m.unwrap_or(*command)));
        let turn = Vector3::from_fn(|_, _| normal(noise.object_orientation_rad));
        let [qx, qy, qz, qw] = object.orientation;
        let q =
            UnitQuaternion::from_scaled_axis(turn) * UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            push(Channel::Command(axis), Some(command[i]));
            push(Channel::Tool(axis), Some(tool[i] + normal(noise.tool_position_m)));
            let wrench = reading.map(|r| (r.wrench.force_n[i], r.wrench.torque_nm[i]));
            push(Channel::WristForce(axis), wrench.map(|w| w.0 + normal(noise.wrist_force_n)));
            push(Channel::WristTorque(axis), wrench.map(|w| w.1 + normal(noise.wrist_torque_nm)));
            push(Channel::ObjectPosition(axis), Some(object.position_m[i] + normal(noise.object_position_m)));
        }
        for (component, value) in Component::ALL.into_iter().zip([q.i, q.j, q.k, q.w]) {
            push(Channel::ObjectOrientation(component), Some(value));
        }
        push(Channel::AddedMass, Some(script.added_mass_kg));
    }
    let time_secs = (0..script.commands.len()).map(|row| row as f64 * PERIOD_SECS).collect();
    Episode { id, time_secs, action: None, channels }
}
