//! The pushing task of both arms, as the scenarios have it, with hardly any noise.

use std::path::Path;
use std::sync::Arc;

use physics_model::config::{ArmConfig, ObstacleMobility, WorldConfig};
use physics_model::robot::{Robot, RobotConfig};
use physics_model::{BodyState, ObjectShape, ObjectTheta, Theta};
use push_task::config::{
    ForceSensing, GoalConfig, NoiseConfig, PerturbConfig, ReachConfig, RewardConfig, SensorConfig, TaskConfig,
    TransitionNoise,
};
use push_task::{Particle, PushConfig, PushModel, State};

fn root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap().to_path_buf()
}

/// The model of an arm, and the joint positions at its start.
pub(crate) fn model(arm: &str, mobility: ObstacleMobility) -> (PushModel, Vec<f64>) {
    let text = std::fs::read_to_string(root().join(format!("scenarios/robots/{arm}.toml"))).unwrap();
    let file: toml::Table = toml::from_str(&text).unwrap();
    let config: RobotConfig = file["robot"].clone().try_into().unwrap();
    let robot = Arc::new(Robot::load(&config, &root()).unwrap());
    let (table, tool_start_m, sensing, limit) = match arm {
        "sawyer" => (-0.1, [0.53, -0.22, -0.05], ForceSensing::Wrist, 100.0),
        _ => (0.0, [0.46, -0.26, 0.05], ForceSensing::JointTorques, 30.0),
    };
    let push = PushConfig {
        world: WorldConfig {
            control_period_secs: 1.0 / 60.0,
            control_steps: 20,
            solver_iterations: 2,
            contact_frequency_hz: 60.0,
            contact_damping_ratio: 5.0,
            table_height_m: table,
            gravity_mps2: 9.81,
            tool_friction: 0.2,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0,
            restitution: 0.0,
            obstacle_mobility: mobility,
        },
        arm: ArmConfig::Kinematic,
        task: TaskConfig {
            horizon: 30,
            discount: 0.95,
            step_m: 0.02,
            tool_start_m,
            reach: ReachConfig { x_m: [0.35, 0.6], y_m: [-0.3, 0.3], z_m: [table + 0.04, table + 0.12] },
            goal: GoalConfig { x_m: tool_start_m[0], y_m: 0.07, radius_m: 0.05 },
            reward: RewardConfig {
                step: -1.0,
                large_force: -5.0,
                out_of_reach: -5.0,
                object_moved: 10.0,
                goal: 100.0,
                moved_threshold_m: 0.005,
            },
        },
        sensor: SensorConfig {
            force: sensing,
            large_force_limit: limit,
            noise: NoiseConfig {
                joint_rad: 1e-9,
                force_n: 1e-9,
                torque_nm: 1e-9,
                joint_torque_nm: 1e-9,
                position_m: 1e-9,
                orientation_rad: 1e-9,
            },
        },
        perturb: PerturbConfig {
            position_m: 0.01,
            yaw_rad: 0.1,
            linear_mps: 0.01,
            angular_rps: 0.1,
            mass_share: 0.2,
            com_m: 0.003,
            friction: 0.05,
            size_m: 0.005,
        },
        transition_noise: TransitionNoise::default(),
        effects: vec![],
    };
    let model = PushModel::new(push, robot);
    let joints = model.joints_for(&config.home_rad, tool_start_m).unwrap();
    (model, joints)
}

/// A box of 8 by 8 by 10 cm.
pub(crate) fn usual_box() -> ObjectTheta {
    ObjectTheta { shape: ObjectShape::Box, mass_kg: 0.5, com_m: [0.0; 3], friction: 0.4, size_m: [0.08, 0.08, 0.1] }
}

/// The usual box, `ahead_m` before the tool along +y.
pub(crate) fn particle_ahead(model: &PushModel, joints: &[f64], ahead_m: f64) -> Particle {
    let [x, y, _] = model.tool_position_m(joints);
    let body = BodyState::at_rest([x, y + ahead_m, model.config().world.table_height_m + 0.05], 0.0);
    Particle::new(
        State { joints_rad: joints.to_vec(), object: body, obstacle: None },
        Theta { object: usual_box(), obstacle: None, effects: vec![] },
    )
}
