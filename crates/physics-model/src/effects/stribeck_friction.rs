//! Stribeck friction: a sole that slips slowly is held back by more.
//!
//! μ(v) = μ (1 + Δ exp(−(v / v_s)²)): the Gaussian form in Armstrong-Hélouvry, Dupont and Canudas de Wit, "A survey of models, analysis tools and
//! compensation methods for the control of machines with friction", Automatica 30(7), 1994.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | Δ | `excess` | – | 0.2 to 1 | engineering judgement |
//! | v_s | `velocity_mps` | m/s | 0.01 to 0.1 | engineering judgement |
//!
//! Shows in force and pose when the object is slow: in slow pushes and at the end of a slide.
//!
//! Acts on the contacts of free bodies with the table (K). It shows at the end of a slide, and from v_s up hardly at all.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, TableContact};

/// More friction in slow slip; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StribeckFriction {
    /// Δ.
    pub excess: f64,
    /// v_s, m/s.
    pub velocity_mps: f64,
}

parametric!(StribeckFriction, "stribeck_friction", {
    excess: Parameter::new("", [0.2, 1.0], [-0.9, 10.0], Neutral::Value(0.0)),
    velocity_mps: Parameter::new("m/s", [0.01, 0.1], [0.001, 10.0], Neutral::Free(0.05)),
});

impl Effect for StribeckFriction {
    fn hooks(&self) -> Hooks {
        Hooks::FRICTION.when(self.excess != 0.0)
    }

    fn friction(&self, contact: &TableContact) -> f64 {
        1.0 + self.excess * (-(contact.speed_mps() / self.velocity_mps).powi(2)).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_falls_with_the_speed_as_the_published_curve_does() {
        let effect = StribeckFriction { excess: 0.8, velocity_mps: 0.05 };
        let at = |speed: f64| {
            effect.friction(&TableContact { position_m: [0.0; 3], slip_mps: [0.6 * speed, -0.8 * speed, 0.0] })
        };
        assert_eq!(at(0.0), 1.8);
        assert!((at(0.05) - (1.0 + 0.8 / std::f64::consts::E)).abs() < 1e-12);
        assert!((at(0.5) - 1.0).abs() < 1e-12);
    }
}
