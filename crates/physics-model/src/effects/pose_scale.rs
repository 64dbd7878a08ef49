//! Distances that are read longer or shorter.
//!
//! p_read = s p, about the origin of the base frame.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | s | `scale` | – | 0.94 to 1.06 | a wrong size of the calibration pattern, engineering judgement |
//!
//! Shows in the pose in proportion to the distance from the base, and in the height at rest.
//!
//! Acts on the pose readings (O) and on their velocities. In free fall it changes the apparent gravity by s; heights at rest tell it from a wrong
//! clock.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};
use crate::state::BodyState;

/// Distances are read longer or shorter; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseScale {
    /// s.
    pub scale: f64,
}

parametric!(PoseScale, "pose_scale", {
    scale: Parameter::new("", [0.94, 1.06], [0.1, 10.0], Neutral::Value(1.0)),
});

impl PoseScale {
    fn stretch(body: &mut BodyState, factor: f64) {
        for value in body.position_m.iter_mut().chain(&mut body.linear_mps) {
            *value *= factor;
        }
    }
}

impl Effect for PoseScale {
    fn hooks(&self) -> Hooks {
        Hooks::POSE.when(self.scale != 1.0)
    }

    fn read(&self, body: &mut BodyState) {
        Self::stretch(body, self.scale);
    }

    fn unread(&self, body: &mut BodyState) {
        Self::stretch(body, self.scale.recip());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::assert_unread;

    #[test]
    fn places_and_velocities_are_stretched_about_the_origin_of_the_frame() {
        let effect = PoseScale { scale: 1.05 };
        let mut body = BodyState::at_rest([0.4, -0.2, 0.1], 0.3);
        body.linear_mps = [1.0, 0.0, -2.0];
        body.angular_rps = [0.0, 0.0, 3.0];
        let before = body;
        effect.read(&mut body);
        for (found, expected) in body.position_m.iter().zip([0.42, -0.21, 0.105]) {
            assert!((found - expected).abs() < 1e-12, "{body:?}");
        }
        assert!((body.linear_mps[2] + 2.1).abs() < 1e-12);
        assert_eq!((body.orientation, body.angular_rps), (before.orientation, before.angular_rps));
        let mut origin = BodyState::at_rest([0.0; 3], 0.0);
        effect.read(&mut origin);
        assert_eq!(origin.position_m, [0.0; 3]);
        assert_unread(&effect);
    }
}
