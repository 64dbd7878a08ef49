//! Static friction: what sticks is held by more than what slips.
//!
//! μ = μ_s while the contact is slower than 0.5 mm/s, else μ_k = μ.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | μ_s / μ_k | `ratio` | – | 1.05 to 1.6 | engineering judgement |
//!
//! Shows in the force just before the object starts to slide: it rises above the force of the slide, then falls.
//!
//! Acts on the contacts of free bodies with the table (K). The speed below which a contact sticks is above the creep that the solver leaves to
//! contacts at rest, and far below the Stribeck velocity. That longer rest raises μ_s is left out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, TableContact};

/// Slip, m/s, below which a contact sticks.
const STICKING_MPS: f64 = 0.0005;

/// More friction before the slip; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StaticFriction {
    /// μ_s / μ_k.
    pub ratio: f64,
}

parametric!(StaticFriction, "static_friction", {
    ratio: Parameter::new("", [1.05, 1.6], [1.0, 10.0], Neutral::Value(1.0)),
});

impl Effect for StaticFriction {
    fn hooks(&self) -> Hooks {
        Hooks::FRICTION.when(self.ratio != 1.0)
    }

    fn friction(&self, contact: &TableContact) -> f64 {
        if contact.speed_mps() < STICKING_MPS { self.ratio } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_sticks_is_held_by_more() {
        let effect = StaticFriction { ratio: 1.4 };
        let at = |speed: f64| effect.friction(&TableContact { position_m: [0.0; 3], slip_mps: [0.0, speed, 0.0] });
        assert_eq!([at(0.0), at(0.0004), at(0.0006), at(0.1)], [1.4, 1.4, 1.0, 1.0]);
    }
}
