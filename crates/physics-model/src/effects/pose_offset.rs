//! Poses that are read beside where they are.
//!
//! p_read = p + o.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | o | `offset_x_m`, `offset_y_m`, `offset_z_m` | m | magnitude 0.001 to 0.02 | hand-eye calibrations, engineering judgement |
//!
//! Shows in the pose at all times: the object starts to move before, or after, the tool seems to reach it.
//!
//! Acts on the pose readings (O), along the base axes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};
use crate::state::BodyState;

/// Poses are read beside where they are; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseOffset {
    /// Along x of the base frame, m.
    pub offset_x_m: f64,
    /// Along y, m.
    pub offset_y_m: f64,
    /// Along z, m.
    pub offset_z_m: f64,
}

const OFFSET: Parameter = Parameter::new("m", [-0.02, 0.02], [-1.0, 1.0], Neutral::Value(0.0));

parametric!(PoseOffset, "pose_offset", { offset_x_m: OFFSET, offset_y_m: OFFSET, offset_z_m: OFFSET });

impl PoseOffset {
    fn shift(&self, body: &mut BodyState, sign: f64) {
        for (p, offset) in body.position_m.iter_mut().zip([self.offset_x_m, self.offset_y_m, self.offset_z_m]) {
            *p += sign * offset;
        }
    }
}

impl Effect for PoseOffset {
    fn hooks(&self) -> Hooks {
        Hooks::POSE.when([self.offset_x_m, self.offset_y_m, self.offset_z_m] != [0.0; 3])
    }

    fn read(&self, body: &mut BodyState) {
        self.shift(body, 1.0);
    }

    fn unread(&self, body: &mut BodyState) {
        self.shift(body, -1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::assert_unread;

    #[test]
    fn every_place_is_read_with_the_same_offset() {
        let effect = PoseOffset { offset_x_m: 0.01, offset_y_m: -0.002, offset_z_m: 0.003 };
        let mut body = BodyState::at_rest([0.5, 0.1, 0.04], 0.3);
        effect.read(&mut body);
        assert_eq!(body, BodyState::at_rest([0.5 + 0.01, 0.1 - 0.002, 0.04 + 0.003], 0.3));
        assert_unread(&effect);
    }
}
