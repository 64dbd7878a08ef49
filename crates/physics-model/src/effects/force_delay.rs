//! Forces that are read late.
//!
//! f_read(t) = f(t − d).
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | d | `delay_secs` | s | 0.005 to 0.1 | buses and drivers of force sensors, engineering judgement |
//!
//! Shows in the force at contact onset and at release: its edges are late and as sharp as they are, while poses are right.
//!
//! Acts on the force readings (O), with linear interpolation between control steps. It starts settled at its first reading: the arm has stood still
//! before.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::signal::DelayLine;
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::world::Wrench;

/// Forces are read late; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceDelay {
    /// d, s.
    pub delay_secs: f64,
}

parametric!(ForceDelay, "force_delay", {
    delay_secs: Parameter::new("s", [0.005, 0.1], [0.0, 1.0], Neutral::Value(0.0)),
});

impl Effect for ForceDelay {
    fn hooks(&self) -> Hooks {
        Hooks::FORCE.when(self.delay_secs != 0.0)
    }

    fn force(&self, period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        Some(Box::new(Late { delay_secs: self.delay_secs, period_secs, line: None }))
    }
}

#[derive(Debug)]
struct Late {
    delay_secs: f64,
    period_secs: f64,
    line: Option<DelayLine<Wrench>>,
}

impl ForceFilter for Late {
    fn apply(&mut self, _moment: &ToolMoment, wrench: &mut Wrench) {
        let line = self.line.get_or_insert_with(|| DelayLine::new(self.delay_secs, self.period_secs, *wrench));
        *wrench = line.push(*wrench);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn a_step_is_read_late_and_as_sharp() {
        let mut filter = ForceDelay { delay_secs: 0.03 }.force(0.01).unwrap();
        let mut read = |force: f64| {
            let mut wrench = Wrench { force_n: [force, 0.0, 0.0], torque_nm: [0.0, 2.0 * force, 0.0] };
            filter.apply(&moment(0.0), &mut wrench);
            assert_eq!(wrench.torque_nm[1], 2.0 * wrench.force_n[0]);
            wrench.force_n[0]
        };
        let found = [1.0, 3.0, 3.0, 3.0, 3.0, 3.0].map(&mut read);
        assert_eq!(found, [1.0, 1.0, 1.0, 1.0, 3.0, 3.0]);
    }

    #[test]
    fn a_broken_number_of_steps_is_read_between_two() {
        let mut filter = ForceDelay { delay_secs: 0.015 }.force(0.01).unwrap();
        let mut read = |force: f64| {
            let mut wrench = Wrench { force_n: [force, 0.0, 0.0], torque_nm: [0.0; 3] };
            filter.apply(&moment(0.0), &mut wrench);
            wrench.force_n[0]
        };
        for step in 0..8 {
            let expected = (f64::from(step) - 1.5).max(0.0);
            assert!((read(f64::from(step)) - expected).abs() < 1e-12, "{step}");
        }
    }
}
