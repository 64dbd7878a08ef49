//! A wrong gain of the force sensor.
//!
//! (f, τ)_read = g (f, τ).
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | g | `gain` | – | 0.75 to 1.25 | 5 to 25 % either way, engineering judgement |
//!
//! Shows in the force of every push by the same factor; poses are right, and so is the force in free motion.
//!
//! Acts on the force readings (O). From pushing alone it cannot be told from a wrong mass: a known added weight can.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::world::Wrench;

/// The force sensor has another gain; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceGain {
    /// g.
    pub gain: f64,
}

parametric!(ForceGain, "force_gain", {
    gain: Parameter::new("", [0.75, 1.25], [0.0, 10.0], Neutral::Value(1.0)),
});

impl Effect for ForceGain {
    fn hooks(&self) -> Hooks {
        Hooks::FORCE.when(self.gain != 1.0)
    }

    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        Some(Box::new(self.clone()))
    }
}

impl ForceFilter for ForceGain {
    fn apply(&mut self, _moment: &ToolMoment, wrench: &mut Wrench) {
        for value in wrench.force_n.iter_mut().chain(&mut wrench.torque_nm) {
            *value *= self.gain;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn forces_and_torques_are_read_in_proportion() {
        let mut filter = ForceGain { gain: 1.25 }.force(0.01).unwrap();
        let mut wrench = Wrench { force_n: [4.0, 0.0, -8.0], torque_nm: [0.4, 0.0, 0.0] };
        filter.apply(&moment(0.0), &mut wrench);
        assert_eq!(wrench, Wrench { force_n: [5.0, 0.0, -10.0], torque_nm: [0.5, 0.0, 0.0] });
    }
}
