//! A slow force sensor.
//!
//! τ ḟ_read = f − f_read.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | τ | `time_constant_secs` | s | 0.005 to 0.08 | filters of force sensors from 30 Hz down to 2 Hz |
//!
//! Shows in the force at contact onset and at release: its edges are late and rounded, while poses are right.
//!
//! Acts on the force readings (O), solved exactly for forces that are constant in a control step. It starts settled at its first reading: the arm
//! has stood still before.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::world::Wrench;

/// The force sensor is slow; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceLowPass {
    /// τ, s.
    pub time_constant_secs: f64,
}

parametric!(ForceLowPass, "force_low_pass", {
    time_constant_secs: Parameter::new("s", [0.005, 0.08], [0.0, 10.0], Neutral::Value(0.0)),
});

impl Effect for ForceLowPass {
    fn hooks(&self) -> Hooks {
        Hooks::FORCE.when(self.time_constant_secs != 0.0)
    }

    fn force(&self, period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        // A time constant of 0 keeps nothing of the past: exp(−∞).
        let kept = (-period_secs / self.time_constant_secs).exp();
        Some(Box::new(LowPass { kept, last: None }))
    }
}

#[derive(Debug)]
struct LowPass {
    kept: f64,
    last: Option<Wrench>,
}

impl ForceFilter for LowPass {
    fn apply(&mut self, _moment: &ToolMoment, wrench: &mut Wrench) {
        if let Some(last) = self.last {
            let mut filtered = Wrench::default();
            filtered.add_scaled(&last, self.kept);
            filtered.add_scaled(wrench, 1.0 - self.kept);
            *wrench = filtered;
        }
        self.last = Some(*wrench);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn a_step_is_read_as_an_exponential() {
        let mut filter = ForceLowPass { time_constant_secs: 0.04 }.force(0.01).unwrap();
        let mut read = |force: f64| {
            let mut wrench = Wrench { force_n: [force, 0.0, 0.0], torque_nm: [0.0, 2.0 * force, 0.0] };
            filter.apply(&moment(0.0), &mut wrench);
            assert!((wrench.torque_nm[1] - 2.0 * wrench.force_n[0]).abs() < 1e-12);
            wrench.force_n[0]
        };
        assert_eq!(read(0.0), 0.0);
        for step in 1..=12 {
            let expected = 3.0 * (1.0 - (-0.25 * f64::from(step)).exp());
            assert!((read(3.0) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_sustained_force_is_read_from_the_start() {
        let mut filter = ForceLowPass { time_constant_secs: 0.04 }.force(0.01).unwrap();
        let mut wrench = Wrench { force_n: [3.0, 0.0, 0.0], torque_nm: [0.0; 3] };
        filter.apply(&moment(0.0), &mut wrench);
        assert_eq!(wrench.force_n[0], 3.0);
    }
}
