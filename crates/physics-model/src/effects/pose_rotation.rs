//! A pose sensor whose frame is turned about the vertical.
//!
//! p_read = R_z(θ) p, about the origin of the base frame.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | θ | `yaw_rad` | rad | up to 0.0873 (5°) either way | hand-eye calibrations, engineering judgement |
//!
//! Shows in the path: the object seems to leave the line of the push at a constant angle.
//!
//! Acts on the pose readings (O), orientations and velocities included.

use nalgebra::{UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};
use crate::state::{BodyState, unit_quaternion};

/// The pose sensor's frame is turned; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseRotation {
    /// θ, rad, from +x towards +y.
    pub yaw_rad: f64,
}

parametric!(PoseRotation, "pose_rotation", {
    yaw_rad: Parameter::new("rad", [-0.0873, 0.0873], [-3.2, 3.2], Neutral::Value(0.0)),
});

fn turn(body: &mut BodyState, yaw_rad: f64) {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    for v in [&mut body.position_m, &mut body.linear_mps, &mut body.angular_rps] {
        *v = (rotation * Vector3::from(*v)).into();
    }
    let turned = rotation * unit_quaternion(body.orientation);
    body.orientation = [turned.i, turned.j, turned.k, turned.w];
}

impl Effect for PoseRotation {
    fn hooks(&self) -> Hooks {
        Hooks::POSE.when(self.yaw_rad != 0.0)
    }

    fn read(&self, body: &mut BodyState) {
        turn(body, self.yaw_rad);
    }

    fn unread(&self, body: &mut BodyState) {
        turn(body, -self.yaw_rad);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::assert_unread;

    #[test]
    fn a_move_along_x_is_read_with_a_drift_to_the_side() {
        let effect = PoseRotation { yaw_rad: 0.05 };
        let read = |x: f64| {
            let mut body = BodyState::at_rest([x, 0.0, 0.04], 0.3);
            body.linear_mps = [0.1, 0.0, 0.0];
            effect.read(&mut body);
            body
        };
        let (from, to) = (read(0.4), read(0.5));
        let drift = (to.position_m[1] - from.position_m[1]) / (to.position_m[0] - from.position_m[0]);
        assert!((drift - 0.05_f64.tan()).abs() < 1e-12, "{drift}");
        assert!((to.yaw_rad() - 0.35).abs() < 1e-12 && to.position_m[2] == 0.04);
        assert!((to.linear_mps[1] - 0.1 * 0.05_f64.sin()).abs() < 1e-12);
        assert_unread(&effect);
    }
}
