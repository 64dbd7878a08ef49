//! Commands that take time to reach the arm.
//!
//! x(t) = x_cmd(t − d).
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | d | `delay_secs` | s | 0.005 to 0.1 | one control tick to a slow field bus, engineering judgement |
//!
//! Shows in tool, force and pose whenever commands change: all of them are late by the same time.
//!
//! Acts on the command (A), with linear interpolation between control steps. An action goes on after its last command until the arm has got
//! there; forces and poses are read over the nominal duration, joint positions when the arm stands.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::signal::DelayLine;
use crate::effect::{CommandFilter, CommandStart, Effect, Hooks};
use crate::state::MAX_JOINTS;

/// Commands take time; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ActuationDelay {
    /// d, s.
    pub delay_secs: f64,
}

parametric!(ActuationDelay, "actuation_delay", {
    delay_secs: Parameter::new("s", [0.005, 0.1], [0.0, 1.0], Neutral::Value(0.0)),
});

impl Effect for ActuationDelay {
    fn hooks(&self) -> Hooks {
        Hooks::COMMAND.when(self.delay_secs != 0.0)
    }

    fn command(&self, start: &CommandStart) -> Option<Box<dyn CommandFilter>> {
        let mut first = [0.0; MAX_JOINTS];
        first[..start.at.len()].copy_from_slice(start.at);
        Some(Box::new(Delay(DelayLine::new(self.delay_secs, start.period_secs, first))))
    }
}

#[derive(Debug)]
struct Delay(DelayLine<[f64; MAX_JOINTS]>);

impl CommandFilter for Delay {
    fn apply(&mut self, signal: &mut [f64]) {
        let mut sample = [0.0; MAX_JOINTS];
        sample[..signal.len()].copy_from_slice(signal);
        let delayed = self.0.push(sample);
        signal.copy_from_slice(&delayed[..signal.len()]);
    }

    fn settling_steps(&self) -> u32 {
        self.0.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::tool_start;

    #[test]
    fn the_onset_is_shifted_by_the_delay() {
        let at = [0.0; 3];
        let start = tool_start(&at);
        let delay_secs = 2.5 * start.period_secs;
        let mut filter = ActuationDelay { delay_secs }.command(&start).unwrap();
        assert_eq!(filter.settling_steps(), 3);
        for step in 1..=10 {
            let time = f64::from(step) * start.period_secs;
            let mut signal = [0.3 * time, 0.0, 0.0];
            filter.apply(&mut signal);
            let expected = 0.3 * (time - delay_secs).max(0.0);
            assert!((signal[0] - expected).abs() < 1e-12, "{step}: {signal:?}");
        }
    }
}
