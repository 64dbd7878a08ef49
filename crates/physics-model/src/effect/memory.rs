//! What of an effect's past the next action needs.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::state::{BodyState, MAX_JOINTS, unit_quaternion};

/// Part of a hypothesis where a listed effect needs it; absent otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// Time since the episode began, s: the sum of its actions' durations.
    pub elapsed_secs: f64,
    /// Where each joint stands in its play, rad: the joint's position less that of its drive.
    pub play_rad: [f64; MAX_JOINTS],
    /// How far the object's pose that was read last lay behind the true one: position, m, base axes.
    pub lag_m: [f64; 3],
    /// The same of the orientation: rotation vector, rad, base axes.
    pub lag_rad: [f64; 3],
    /// Bodies that only effects know of, in the order of the effects; empty before the first action.
    pub hidden: Vec<BodyState>,
}

impl Default for Memory {
    fn default() -> Self {
        Self { elapsed_secs: 0.0, play_rad: [0.0; MAX_JOINTS], lag_m: [0.0; 3], lag_rad: [0.0; 3], hidden: Vec::new() }
    }
}

impl Memory {
    /// Notes that `seen` was read of a body that is at `now`.
    pub fn note_lag(&mut self, seen: &BodyState, now: &BodyState) {
        self.lag_m = std::array::from_fn(|i| seen.position_m[i] - now.position_m[i]);
        self.lag_rad =
            (unit_quaternion(seen.orientation) * unit_quaternion(now.orientation).inverse()).scaled_axis().into();
    }

    /// Moves a body to where the lag lets it appear.
    pub fn apply_lag(&self, body: &mut BodyState) {
        for (position, lag) in body.position_m.iter_mut().zip(self.lag_m) {
            *position += lag;
        }
        if self.lag_rad != [0.0; 3] {
            let turned =
                UnitQuaternion::from_scaled_axis(Vector3::from(self.lag_rad)) * unit_quaternion(body.orientation);
            body.orientation = [turned.i, turned.j, turned.k, turned.w];
        }
    }
}
