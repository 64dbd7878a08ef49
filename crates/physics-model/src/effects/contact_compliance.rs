//! Softer or stiffer contacts than the model's.
//!
//! A contact is a spring and a damper of natural frequency f and damping ratio ζ: under its own weight a body sinks by g / (2π f)².
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | f | `frequency_hz` | Hz | 20 to 200 | engineering judgement |
//! | ζ | `damping_ratio` | – | 0.5 to 10 | engineering judgement |
//!
//! Shows in the force at contact onset, which rises slowly or rings, and in the height at rest.
//!
//! Acts on all contacts (N): the engine has one softness for a world.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};

/// Softness of contacts; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactCompliance {
    /// f, Hz.
    pub frequency_hz: f64,
    /// ζ.
    pub damping_ratio: f64,
}

parametric!(ContactCompliance, "contact_compliance", {
    frequency_hz: Parameter::new("Hz", [20.0, 200.0], [1.0, 10_000.0], Neutral::ContactFrequency),
    damping_ratio: Parameter::new("", [0.5, 10.0], [0.01, 1000.0], Neutral::ContactDamping),
});

impl Effect for ContactCompliance {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL
    }

    fn nominal(&self, nominal: &mut Nominal) {
        nominal.world.contact_frequency_hz = self.frequency_hz;
        nominal.world.contact_damping_ratio = self.damping_ratio;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn the_softness_replaces_that_of_the_world() {
        let mut world = nominal();
        ContactCompliance { frequency_hz: 30.0, damping_ratio: 2.0 }.nominal(&mut world);
        assert_eq!([world.world.contact_frequency_hz, world.world.contact_damping_ratio], [30.0, 2.0]);
    }
}
