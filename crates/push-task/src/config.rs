//! What a scenario says about the task and the sensors. Every quantity carries its unit in its name.

use physics_model::EffectConfig;
use physics_model::config::{ArmConfig, WorldConfig};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Axis-aligned box that the tool centre may occupy, m, base frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReachConfig {
    /// Smallest and largest x, m.
    pub x_m: [f64; 2],
    /// Smallest and largest y, m.
    pub y_m: [f64; 2],
    /// Smallest and largest z, m.
    pub z_m: [f64; 2],
}

impl ReachConfig {
    /// Whether the point lies inside, with a nanometre of tolerance for moves along the border.
    #[must_use]
    pub fn contains(&self, point_m: [f64; 3]) -> bool {
        [self.x_m, self.y_m, self.z_m].iter().zip(point_m).all(|([low, high], v)| v >= low - 1e-9 && v <= high + 1e-9)
    }
}

/// Circle on the table that the object's centre has to reach.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalConfig {
    /// Centre x, m, base frame.
    pub x_m: f64,
    /// Centre y, m, base frame.
    pub y_m: f64,
    /// Radius, m.
    pub radius_m: f64,
}

/// Rewards of one action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RewardConfig {
    /// Every action.
    pub step: f64,
    /// A wrist force or joint torque above the limit.
    pub large_force: f64,
    /// A move that would leave the reachable region.
    pub out_of_reach: f64,
    /// The object moved for the first time in the episode.
    pub object_moved: f64,
    /// The object is in the goal region: ends the episode.
    pub goal: f64,
    /// Displacement of the object in one action that counts as moving it, m.
    pub moved_threshold_m: f64,
}

/// The task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TaskConfig {
    /// Most actions in an episode.
    pub horizon: usize,
    /// Discount γ.
    pub discount: f64,
    /// Length of a tool move, m.
    pub step_m: f64,
    /// Where the tool centre starts, m, base frame.
    pub tool_start_m: [f64; 3],
    /// Reachable region of the tool centre.
    pub reach: ReachConfig,
    /// Goal region of the object's centre.
    pub goal: GoalConfig,
    /// Rewards.
    pub reward: RewardConfig,
}

impl TaskConfig {
    /// Discounted reward of steps that lead nowhere after this one, up to the horizon. A world that diverges costs as much: ending without
    /// a cost it would be the way out of every situation that looks bad.
    #[must_use]
    pub fn endless_cost(&self) -> f64 {
        (1..self.horizon).map(|step| self.reward.step * self.discount.powi(step as i32)).sum()
    }
}

/// Standard deviations of the sensors' Gaussian noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseConfig {
    /// Joint positions, rad.
    pub joint_rad: f64,
    /// Each component of the wrist force, N.
    pub force_n: f64,
    /// Each component of the wrist torque, N·m.
    pub torque_nm: f64,
    /// Each joint torque, N·m.
    pub joint_torque_nm: f64,
    /// Each coordinate of the object's position, m.
    pub position_m: f64,
    /// Each component of the rotation vector of the orientation error, rad.
    pub orientation_rad: f64,
}

/// What the arm senses at its wrist or joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ForceSensing {
    /// Joint positions, and force and torque at the wrist (Sawyer): 7 + 6 values.
    Wrist,
    /// Joint torques (Jaco): 6 values.
    JointTorques,
}

/// Sensors and force limits of an arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// What is sensed besides the object's pose.
    pub force: ForceSensing,
    /// Force at the wrist (N) or torque at a joint (N·m) above which a force is large: the arm stops its move there.
    #[schemars(extend("x-unit" = "N or N·m"))]
    pub large_force_limit: f64,
    /// Noise.
    pub noise: NoiseConfig,
}

/// Gaussian noise of artificial reinvigoration: standard deviation of each kind of value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerturbConfig {
    /// Positions of object and obstacle, m, horizontally.
    pub position_m: f64,
    /// Yaw of object and obstacle, rad.
    pub yaw_rad: f64,
    /// Linear velocities, m/s.
    pub linear_mps: f64,
    /// Angular velocities, rad/s.
    pub angular_rps: f64,
    /// Masses, as a share of the mass.
    pub mass_share: f64,
    /// Centre of mass, m.
    pub com_m: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Sizes, m.
    pub size_m: f64,
}

/// Noise of the transition s' ~ f(s, a | Θ): standard deviations of Gaussians, in the true world and in the model alike. 0 is a world without noise.
///
/// The pose is disturbed in an action in which the tool touched something or the object moved; an object at rest stays where it is. Pushes of
/// one object on one table scatter by about a tenth of the motion (Yu, Bauza, Fazeli and Rodriguez, "More than a million ways to be pushed", IROS
/// 2016).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransitionNoise {
    /// x and y of the object, m.
    pub position_m: f64,
    /// Yaw of the object, rad.
    pub yaw_rad: f64,
    /// Mean wrist force and torque of an action, each component, as a share of their magnitude.
    pub force_share: f64,
    /// Mean of each joint torque of an action in which the tool touched something, N·m.
    pub joint_torque_nm: f64,
}

/// Everything that turns (s, Θ, action) into a transition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PushConfig {
    /// World.
    pub world: WorldConfig,
    /// The arm that moves in it.
    pub arm: ArmConfig,
    /// Task.
    pub task: TaskConfig,
    /// Sensors.
    pub sensor: SensorConfig,
    /// Noise of reinvigoration.
    pub perturb: PerturbConfig,
    /// Noise of the transition.
    pub transition_noise: TransitionNoise,
    /// Effects beyond rigid bodies with Coulomb friction.
    pub effects: Vec<EffectConfig>,
}
