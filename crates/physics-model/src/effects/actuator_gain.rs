//! Moves that are longer or shorter than commanded: a wrong gear ratio, link length or encoder scale.
//!
//! x = x₀ + g (x_cmd − x₀), x₀: where the action (in a replayed log: the episode) began.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | g | `gain` | – | 0.8 to 1.2 | engineering judgement |
//!
//! Shows in the place of the tool, in free motion too: every move is too long or too short by the same factor.
//!
//! Acts on the command (A), of the tool centre for a kinematic arm and of the joints for a dynamic one. It shows in free motion, too.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{CommandFilter, CommandStart, Effect, Hooks};
use crate::state::MAX_JOINTS;

/// Gain of the command; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ActuatorGain {
    /// g.
    pub gain: f64,
}

parametric!(ActuatorGain, "actuator_gain", {
    gain: Parameter::new("", [0.8, 1.2], [0.0, 10.0], Neutral::Value(1.0)),
});

impl Effect for ActuatorGain {
    fn hooks(&self) -> Hooks {
        Hooks::COMMAND.when(self.gain != 1.0)
    }

    fn command(&self, start: &CommandStart) -> Option<Box<dyn CommandFilter>> {
        let mut from = [0.0; MAX_JOINTS];
        from[..start.at.len()].copy_from_slice(start.at);
        Some(Box::new(Gain { gain: self.gain, from }))
    }
}

#[derive(Debug)]
struct Gain {
    gain: f64,
    from: [f64; MAX_JOINTS],
}

impl CommandFilter for Gain {
    fn apply(&mut self, signal: &mut [f64]) {
        for (value, from) in signal.iter_mut().zip(self.from) {
            *value = from + self.gain * (*value - from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::tool_start;

    #[test]
    fn a_move_is_its_gain_times_as_long() {
        let at = [0.5, -0.2, 0.1];
        let mut filter = ActuatorGain { gain: 1.1 }.command(&tool_start(&at)).unwrap();
        let mut signal = [0.52, -0.2, 0.09];
        filter.apply(&mut signal);
        for (found, expected) in signal.iter().zip([0.522, -0.2, 0.089]) {
            assert!((found - expected).abs() < 1e-12, "{signal:?}");
        }
    }
}
