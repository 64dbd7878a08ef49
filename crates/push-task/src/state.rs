//! s: joint positions, and pose and velocity of the object and of the obstacle.

use physics_model::state::{BODY_LEN, BodyState};
use serde::{Deserialize, Serialize};

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
