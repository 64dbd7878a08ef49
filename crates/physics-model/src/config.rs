//! What a scenario says about the world and the arm in it. Every quantity carries its unit in its name.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the obstacle, if there is one, can do: part of the domain, not of Θ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObstacleMobility {
    /// Fixed to the table.
    Fixed,
    /// Slides on the table like the object.
    Movable,
}

/// Time base, contact and solver settings of the rapier world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldConfig {
    /// Duration of one control step, s.
    pub control_period_secs: f64,
    /// Control steps of one action.
    pub control_steps: u32,
    /// Rapier solver iterations (substeps) in a control step.
    pub solver_iterations: u32,
    /// Natural frequency of the contact springs, Hz.
    pub contact_frequency_hz: f64,
    /// Damping ratio of the contact springs.
    pub contact_damping_ratio: f64,
    /// Height of the table over the robot's base, m.
    pub table_height_m: f64,
    /// Magnitude of gravity, m/s², along −z.
    pub gravity_mps2: f64,
    /// Friction coefficient of the tool; a contact takes the smaller one of its two bodies.
    pub tool_friction: f64,
    /// Friction coefficient of the obstacle, taken likewise.
    pub obstacle_friction: f64,
    /// Stiffness of the arm, N/m, against what blocks it: the tool's overlap times this is felt as force.
    pub arm_stiffness_npm: f64,
    /// Coefficient of restitution of all contacts.
    pub restitution: f64,
    /// Whether the obstacle can move.
    pub obstacle_mobility: ObstacleMobility,
}

impl WorldConfig {
    /// The same world, whose actions last as long in other steps.
    #[must_use]
    pub fn in_steps(&self, control_steps: u32, solver_iterations: u32) -> Self {
        let control_period_secs = self.control_period_secs * f64::from(self.control_steps) / f64::from(control_steps);
        Self { control_period_secs, control_steps, solver_iterations, ..self.clone() }
    }
}

/// How the arm follows its commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ArmConfig {
    /// The tool is where it is commanded to be, whatever it touches.
    Kinematic,
    /// The links have their masses and the joints are servos: a load deflects the arm.
    Dynamic(ServoConfig),
}

/// Position servo of every joint: torque = K (q_d − q) + D (q̇_d − q̇) + M q̈_d, with gravity compensated.
///
/// This is the joint impedance that torque-controlled arms let their users set (Albu-Schäffer, Ott and Hirzinger, "A unified passivity-based
/// control framework for position, torque and impedance control of flexible joint robots", IJRR 26(1), 2007). One stiffness serves all
/// joints, because a measured deflection of the tool cannot tell those of seven joints apart. It is a stiffness and no natural
/// frequency: a stiffness is read off a static test, and the links' inertia without that of the rotors, which URDF does not know, would make
/// the wrist a thousand times as soft as the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ServoConfig {
    /// K, N·m/rad. A force f deflects the tool by J Jᵀ f / K.
    pub stiffness_nmprad: f64,
    /// D = 2 · ratio · √(K Mⱼⱼ), with Mⱼⱼ of the posture in which the action starts: 1 is critical damping of each joint alone.
    pub damping_ratio: f64,
}

impl ArmConfig {
    /// What is wrong with the values, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let Self::Dynamic(servo) = self else { return None };
        let limits = [
            ("stiffness_nmprad", servo.stiffness_nmprad, [1.0, 1e6], " N·m/rad"),
            ("damping_ratio", servo.damping_ratio, [0.1, 100.0], ""),
        ];
        limits.into_iter().find_map(|(key, value, [low, high], unit)| {
            // Also false for NaN.
            let good = (low..=high).contains(&value);
            (!good).then(|| format!("dynamic.{key}: expected {low} to {high}{unit}, found {value}"))
        })
    }
}
