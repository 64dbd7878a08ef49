//! What a scenario says about an arm.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RobotError;

/// Which arm, and which of its links and joints play which part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name in tables and folders.
    pub name: String,
    /// URDF file, relative to [the project folder](super::Robot::load).
    pub urdf: PathBuf,
    /// Link whose frame is the base frame; z must be up.
    pub base_link: String,
    /// End frame of the bare arm.
    pub tip_link: String,
    /// Link whose origin is the controlled point; must hang on the last joint.
    pub tool_link: String,
    /// Link at whose origin a wrist sensor measures; must hang on the last joint.
    pub wrist_link: String,
    /// Revolute or continuous joints that move, base first.
    pub actuated_joints: Vec<String>,
    /// All other moving joints below the base, and where they are held: rad, or m for prismatic ones.
    #[schemars(extend("x-unit" = "rad or m"))]
    pub locked_joints: BTreeMap<String, f64>,
    /// Joint positions, rad, that a redundant arm tends to.
    pub home_rad: Vec<f64>,
    /// Rows of R(base ← tool), the orientation that the tool keeps.
    pub tool_rotation: [[f64; 3]; 3],
}

/// What a joint can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimit {
    /// Lowest position, rad; −∞ for a continuous joint.
    pub lower_rad: f64,
    /// Highest position, rad; +∞ for a continuous joint.
    pub upper_rad: f64,
    /// Fastest, rad/s.
    pub velocity_rps: f64,
    /// Strongest torque, N·m.
    pub effort_nm: f64,
}

impl JointLimit {
    /// Whether a position, rad, is within the limits.
    #[must_use]
    pub fn contains(&self, position_rad: f64) -> bool {
        (self.lower_rad..=self.upper_rad).contains(&position_rad)
    }
}

/// Largest deviation of `tool_rotation` from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-6;

impl RobotConfig {
    /// Checks home and tool rotation.
    pub(super) fn check_values(&self, limits: &[JointLimit]) -> Result<(), RobotError> {
        let robot = self.name.clone();
        if self.home_rad.len() != limits.len() {
            let expected = format!("{}, one per actuated joint", limits.len());
            return Err(RobotError::JointCount { robot, key: "home_rad", found: self.home_rad.len(), expected });
        }
        for (j, (home, limit)) in self.home_rad.iter().zip(limits).enumerate() {
            if !(home.is_finite() && limit.contains(*home)) {
                return Err(RobotError::Value {
                    robot,
                    key: format!("home_rad[{j}]"),
                    value: home.to_string(),
                    expected: format!("{} to {} rad", limit.lower_rad, limit.upper_rad),
                });
            }
        }
        let r = Matrix3::from_fn(|row, column| self.tool_rotation[row][column]);
        let deviation = (r * r.transpose() - Matrix3::identity()).amax();
        // A comparison with NaN is false: then it is no rotation either.
        if !(deviation <= ROTATION_TOLERANCE && r.determinant() > 0.0) {
            return Err(RobotError::Value {
                robot,
                key: "tool_rotation".into(),
                value: format!("{:?}", self.tool_rotation),
                expected: "rows of a right-handed rotation".into(),
            });
        }
        Ok(())
    }
}
