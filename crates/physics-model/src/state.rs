//! s: joint positions, and pose and velocity of the object and of the obstacle.

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

/// s without Θ. Joint positions first, then object, then obstacle (absent where Θ has none).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    /// Joint positions, rad; as many as the arm has actuated joints.
    pub joints_rad: Vec<f64>,
    /// Target object.
    pub object: BodyState,
    /// Obstacle.
    pub obstacle: Option<BodyState>,
}

impl State {
    /// Joint positions, object (13) and obstacle (13, all 0 where there is none).
    #[must_use]
    pub fn to_vec(&self) -> Vec<f64> {
        let mut values = self.joints_rad.clone();
        values.extend(self.object.to_array());
        values.extend(self.obstacle.map_or([0.0; BODY_LEN], |o| o.to_array()));
        values
    }

    /// Inverse of [`Self::to_vec`] for an arm of `joints` joints.
    ///
    /// # Panics
    ///
    /// If `values` has not `joints + 26` entries.
    #[must_use]
    pub fn from_slice(values: &[f64], joints: usize, has_obstacle: bool) -> Self {
        assert_eq!(
            values.len(),
            joints + 2 * BODY_LEN,
            "a state of {joints} joints has {} values",
            joints + 2 * BODY_LEN
        );
        let body = |at: usize| {
            let mut row = [0.0; BODY_LEN];
            row.copy_from_slice(&values[at..at + BODY_LEN]);
            BodyState::from_array(&row)
        };
        Self {
            joints_rad: values[..joints].to_vec(),
            object: body(joints),
            obstacle: has_obstacle.then(|| body(joints + BODY_LEN)),
        }
    }

    /// Names of the values of [`Self::to_vec`].
    #[must_use]
    pub fn names(joints: usize) -> Vec<String> {
        let mut names: Vec<String> = (0..joints).map(|j| format!("joint_{j}_rad")).collect();
        for body in ["object", "obstacle"] {
            for (kind, unit) in [("", "_m"), ("q", ""), ("v", "_mps"), ("w", "_rps")] {
                let axes: &[&str] = if kind == "q" { &["x", "y", "z", "w"] } else { &["x", "y", "z"] };
                names.extend(axes.iter().map(|axis| format!("{body}_{kind}{axis}{unit}")));
            }
        }
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_survives_the_way_to_a_vector_and_back() {
        let state = State {
            joints_rad: vec![0.1, -0.2, 0.3, 0.4, 0.5, 0.6, 0.7],
            object: BodyState::at_rest([0.5, 0.1, 0.04], 0.3),
            obstacle: Some(BodyState::at_rest([0.6, 0.1, 0.04], -2.0)),
        };
        assert_eq!(State::from_slice(&state.to_vec(), 7, true), state);
        assert_eq!(State::names(7).len(), state.to_vec().len());
        assert!((state.object.yaw_rad() - 0.3).abs() < 1e-12);
    }
}
