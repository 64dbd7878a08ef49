//! Poses that are read late.
//!
//! p_read(t) = p(t − d).
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | d | `delay_secs` | s | 0.005 to 0.1 | exposure and processing of cameras, engineering judgement |
//!
//! Shows in the pose while the object moves: it is late by the same time. At rest it is right.
//!
//! Acts on the pose readings (O), by interpolation between control steps; several delays add up. An action ends with what is read at the end of its
//! nominal duration: how far that lags behind outlives the action ([`crate::effect::Memory`]), the line of older poses does not.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};

/// Poses are read late; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseDelay {
    /// d, s.
    pub delay_secs: f64,
}

parametric!(PoseDelay, "pose_delay", {
    delay_secs: Parameter::new("s", [0.005, 0.1], [0.0, 1.0], Neutral::Value(0.0)),
});

impl Effect for PoseDelay {
    fn hooks(&self) -> Hooks {
        Hooks::POSE_DELAY.and(Hooks::MEMORY).when(self.delay_secs != 0.0)
    }

    fn pose_delay_secs(&self) -> f64 {
        self.delay_secs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::signal::PoseChain;
    use crate::state::BodyState;

    #[test]
    fn a_moving_body_is_read_where_it_was() {
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(PoseDelay { delay_secs: 0.025 })];
        let at = |time: f64| {
            let mut body = BodyState::at_rest([0.2 * time, 0.0, 0.0], 0.4 * time);
            body.linear_mps = [0.2, 0.0, 0.0];
            body
        };
        let mut chain = PoseChain::new(&effects, 0.01, &at(0.0));
        for step in 1..=12 {
            let time = 0.01 * f64::from(step);
            let read = chain.read(&effects, &at(time));
            let then = at((time - 0.025).max(0.0));
            assert!((read.position_m[0] - then.position_m[0]).abs() < 1e-12, "{step}: {read:?}");
            assert!((read.yaw_rad() - then.yaw_rad()).abs() < 1e-9, "{step}: {read:?}");
        }
    }
}
