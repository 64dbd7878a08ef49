//! Pose and velocity of a rigid body.

use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Most joints of any arm here.
pub const MAX_JOINTS: usize = 7;

/// Values of one body in the state: pose (7) and velocity (6).
pub const BODY_LEN: usize = 13;

/// Pose and velocity of a rigid body in the base frame of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyState {
    /// Centre of the shape, m, base frame.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w of R(base ← body).
    pub orientation: [f64; 4],
    /// Velocity of the centre of the shape, m/s, base axes.
    pub linear_mps: [f64; 3],
    /// Angular velocity, rad/s, base axes.
    pub angular_rps: [f64; 3],
}

impl BodyState {
    /// A body at rest, turned by `yaw_rad` about the vertical.
    #[must_use]
    pub fn at_rest(position_m: [f64; 3], yaw_rad: f64) -> Self {
        let (sin, cos) = (yaw_rad / 2.0).sin_cos();
        Self { position_m, orientation: [0.0, 0.0, sin, cos], linear_mps: [0.0; 3], angular_rps: [0.0; 3] }
    }

    /// Position, orientation, linear and angular velocity in one row.
    #[must_use]
    pub fn to_array(&self) -> [f64; BODY_LEN] {
        let mut values = [0.0; BODY_LEN];
        values[..3].copy_from_slice(&self.position_m);
        values[3..7].copy_from_slice(&self.orientation);
        values[7..10].copy_from_slice(&self.linear_mps);
        values[10..].copy_from_slice(&self.angular_rps);
        values
    }

    /// Inverse of [`Self::to_array`]; the quaternion is normalised, a zero one becomes the identity.
    #[must_use]
    pub fn from_array(values: &[f64; BODY_LEN]) -> Self {
        let mut orientation = [values[3], values[4], values[5], values[6]];
        let norm = orientation.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm > 1e-9 {
            // A unit quaternion stays as it is, bit for bit, so that states survive a write and a read. Those of the engine are unit to
            // single precision.
            if (norm - 1.0).abs() > 1e-5 {
                orientation = orientation.map(|v| v / norm);
            }
        } else {
            orientation = [0.0, 0.0, 0.0, 1.0];
        }
        Self {
            position_m: [values[0], values[1], values[2]],
            orientation,
            linear_mps: [values[7], values[8], values[9]],
            angular_rps: [values[10], values[11], values[12]],
        }
    }

    /// Rotation about the vertical, rad in (−π, π].
    #[must_use]
    pub fn yaw_rad(&self) -> f64 {
        let [x, y, z, w] = self.orientation;
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
    }
}

/// The rotation of a unit quaternion x, y, z, w.
#[must_use]
pub fn unit_quaternion([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}
