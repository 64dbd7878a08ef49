//! Logs of a rig with a known world.

use std::path::Path;

use measured_log::{Header, Log, Noise, Number, Object, Robot, Shape, SplitConfig, Table};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::rig::{Rig, RigObject, RigShape, RigTool};
use physics_model::{EffectConfig, ObjectShape};
use pomdp::{Purpose, Seed};
use serde::{Deserialize, Serialize};

use crate::actions::{Scene, Script, avoid, designed, passive};
use crate::recording::{RecordError, Recording};
use crate::unknown::Unknown;

/// What is done while the log is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Actions {
    /// Chosen to tell effects apart.
    Designed,
    /// As they come.
    Passive,
}

impl Actions {
    /// In tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Designed => "designed",
            Self::Passive => "passive",
        }
    }
}

/// A set to generate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetSpec {
    /// Seed of what is done and of the noise.
    pub seed: u64,
    /// The arm, or none.
    pub robot: RobotName,
    /// Shape of the object.
    pub shape: ObjectShape,
    /// What the true world has and the nominal model lacks.
    pub effects: Vec<EffectConfig>,
    /// The same, of no catalogue.
    pub unknown: Option<Unknown>,
    /// True value over nominal: of mass and friction.
    pub nominal_errors: [f64; 2],
    /// Whether the log gives the friction as fixed. Then it is exact, unless the effect is another friction.
    pub fixed_friction: bool,
    /// Factor on the sensors' noise.
    pub noise: f64,
    /// What is done.
    pub actions: Actions,
    /// Engine of the true world: steps a tick, solver iterations, contact frequency.
    pub engine: (u32, u32, f64),
}

/// The arm of a log, as a truth file says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RobotName {
    /// A ball without an arm.
    None,
    /// Rethink Sawyer with its ball.
    Sawyer,
}

/// Engines of true worlds. The model's is one step a tick, 4 iterations, 60 Hz.
pub const ENGINES: [(u32, u32, f64); 6] =
    [(3, 6, 80.0), (2, 4, 60.0), (4, 2, 60.0), (2, 8, 100.0), (5, 4, 70.0), (3, 3, 45.0)];

pub(crate) const MASS_KG: f64 = 0.5;
pub(crate) const FRICTION: f64 = 0.35;
const PERIOD_SECS: f64 = 0.01;
const TOOL_FRICTION: f64 = 0.1;
/// Standard deviation of what a log says of mass and friction, as a share.
const SHARE: f64 = 0.15;

impl SetSpec {
    /// Sizes of the object, m, as in `ObjectTheta`.
    #[must_use]
    pub fn size_m(&self) -> [f64; 3] {
        match self.shape {
            ObjectShape::Box => [0.08, 0.06, 0.05],
            ObjectShape::Cylinder => [0.035, 0.05, 0.0],
            ObjectShape::Sphere => [0.03, 0.0, 0.0],
        }
    }

    /// Radius of the tool as the log says it, m, and height of the table, m.
    fn geometry(&self) -> (f64, f64) {
        match self.robot {
            RobotName::None => (0.02, 0.0),
            // scenarios/robots/sawyer.toml, assets/robots/sawyer.urdf.
            RobotName::Sawyer => (0.025, -0.1),
        }
    }

    /// Where and how things are done.
    #[must_use]
    pub fn scene(&self) -> Scene {
        let size_m = self.size_m();
        let reach_m = self.shape.footprint_radius_m(size_m);
        let (tool_m, table_m) = self.geometry();
        Scene {
            period_secs: PERIOD_SECS,
            tool_height_m: table_m + self.shape.half_height_m(size_m).max(tool_m + 0.005).min(0.03),
            touch_m: reach_m + tool_m,
            clear_m: reach_m + tool_m,
            face_m: if self.shape == ObjectShape::Box { 0.5 * size_m[0] } else { reach_m } + tool_m,
            rolls: self.shape == ObjectShape::Sphere,
            half_width_m: if self.shape == ObjectShape::Box { 0.03 } else { 0.7 * reach_m },
            centre_m: match self.robot {
                RobotName::None => [0.0, 0.0],
                RobotName::Sawyer => [0.53, 0.0],
            },
        }
    }

    /// What is done, if nothing stands in the way.
    #[must_use]
    pub fn scripts(&self) -> Vec<Script> {
        let mut rng = Seed(self.seed).stream(Purpose::World, 0);
        let scene = self.scene();
        let mut scripts = match self.actions {
            Actions::Designed => designed(&scene, &mut rng),
            Actions::Passive => passive(&scene, &mut rng),
        };
        if self.robot == RobotName::Sawyer {
            // The rectangle over which the inverse kinematics holds.
            scripts.iter_mut().for_each(|script| script.fit_into([0.34, -0.45], [0.72, 0.45]));
        }
        if let Some(obstacle) = self.obstacle() {
            avoid(&mut scripts, &scene, obstacle, &mut rng);
        }
        scripts
    }

    /// Place and radius of a hidden obstacle, m.
    fn obstacle(&self) -> Option<([f64; 2], f64)> {
        self.effects.iter().find_map(|effect| match effect {
            EffectConfig::HiddenObstacle(body) => Some(([body.x_m, body.y_m], body.size_m[0])),
            _ => None,
        })
    }

    /// What the log says of itself: the nominal model.
    #[must_use]
    pub fn header(&self) -> Header {
        let (fixed, size_m) = (Number::Fixed, self.size_m());
        let (tool_m, table_m) = self.geometry();
        let uncertain = |mean: f64| Number::Uncertain { mean, stddev: SHARE * mean };
        let arm = self.robot != RobotName::None;
        Header {
            robot: if arm { Robot::Sawyer } else { Robot::None },
            period_secs: PERIOD_SECS,
            tool_radius_m: Some(tool_m),
            tool_friction: Some(fixed(TOOL_FRICTION)),
            gravity_mps2: 9.81,
            table: Table {
                height_m: fixed(table_m),
                friction: if self.fixed_friction { fixed(FRICTION) } else { uncertain(FRICTION) },
            },
            object: Object {
                shape: match self.shape {
                    ObjectShape::Box => Shape::Box { size_m: size_m.map(fixed) },
                    ObjectShape::Cylinder => Shape::Cylinder { radius_m: fixed(size_m[0]), height_m: fixed(size_m[1]) },
                    ObjectShape::Sphere => Shape::Sphere { radius_m: fixed(size_m[0]) },
                },
                mass_kg: uncertain(MASS_KG),
                com_m: [fixed(0.0); 3],
                inertia_kgm2: None,
                restitution: None,
            },
            noise: Noise {
                object_position_m: Some(0.0005 * self.noise),
                object_orientation_rad: Some(0.003 * self.noise),
                tool_position_m: Some(0.0001 * self.noise),
                wrist_force_n: Some(0.05 * self.noise),
                wrist_torque_nm: Some(0.002 * self.noise),
                joint_position_rad: arm.then_some(0.0002 * self.noise),
                joint_torque_nm: arm.then_some(0.02 * self.noise),
                ..Noise::default()
            },
            split: SplitConfig { holdout_fraction: 0.3 },
        }
    }

    /// The true header: as the log's, with what is true of mass and friction, and no doubt.
    #[must_use]
    pub fn true_header(&self) -> Header {
        let mut header = self.header();
        header.table.friction = Number::Fixed(FRICTION * self.nominal_errors[1]);
        header.object.mass_kg = Number::Fixed(MASS_KG * self.nominal_errors[0]);
        header
    }
}

/// The log of a set. `root`: folder of the project, for arms.
///
/// # Errors
///
/// [`RecordError`]: a true world that cannot be, to be drawn anew, or an arm that cannot be read.
pub fn generate(spec: &SetSpec, root: Option<&Path>) -> Result<Log, RecordError> {
    generate_part(spec, root, usize::MAX)
}

/// Every so many episodes of [`generate`], so that about `count` remain.
///
/// # Errors
///
/// As [`generate`].
pub fn generate_part(spec: &SetSpec, root: Option<&Path>, count: usize) -> Result<Log, RecordError> {
    let header = spec.header();
    let (_, table_height_m) = spec.geometry();
    let tool = match (spec.robot, &spec.unknown) {
        (RobotName::None, Some(Unknown::ToolRadius { radius_m })) => RigTool::Ball { radius_m: *radius_m },
        (RobotName::None, _) => RigTool::Ball { radius_m: spec.geometry().0 },
        (RobotName::Sawyer, _) => discrepancy::rig_tool(&Log { header: header.clone(), episodes: Vec::new() }, root)?,
    };
    let (refinement, iterations, frequency) = spec.engine;
    let rig = Rig {
        world: WorldConfig {
            control_period_secs: PERIOD_SECS / f64::from(refinement),
            control_steps: 1,
            solver_iterations: iterations,
            contact_frequency_hz: frequency,
            contact_damping_ratio: 5.0,
            table_height_m,
            gravity_mps2: 9.81,
            tool_friction: TOOL_FRICTION,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0,
            restitution: 0.0,
            obstacle_mobility: ObstacleMobility::Movable,
        },
        tick_steps: refinement,
        tool,
        tool_slip_mps: 0.0,
        cone_exponent: 1.0,
    };
    let [mass, friction] = spec.nominal_errors;
    let shape = RigShape::Solid { shape: spec.shape, size_m: spec.size_m() };
    let recording = Recording {
        rig,
        object: RigObject::new(shape, MASS_KG * mass, FRICTION * friction),
        effects: spec.effects.iter().map(EffectConfig::build).chain(spec.unknown.iter().map(Unknown::build)).collect(),
        height_m: table_height_m + spec.shape.half_height_m(spec.size_m()),
        seed: Seed(spec.seed),
    };
    let scripts = spec.scripts();
    recording.log(header, scripts.iter().enumerate().step_by((scripts.len() / count).max(1)))
}
