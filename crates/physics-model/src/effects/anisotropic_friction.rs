//! Anisotropic friction: a table with a grain.
//!
//! μ(φ) = μ (1 + a cos 2(φ − φ₀)), φ: direction of the slip in the base frame.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | a | `amplitude` | – | 0.1 to 0.4 | engineering judgement: brushed metal, wood along and across the grain |
//! | φ₀ | `axis_rad` | rad | 0 to π | direction of most friction |
//!
//! Shows in the force by direction: along one axis a push takes more, across it less.
//!
//! Acts on the contacts of free bodies with the table (K). Friction stays opposite to the slip. The grain belongs to the table and not to the
//! object: turning the object changes nothing. What does not slip has no direction and is held by μ.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, TableContact};

/// Slip, m/s, that has no direction yet.
const NO_SLIP_MPS: f64 = 1e-6;

/// Friction by direction; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AnisotropicFriction {
    /// a.
    pub amplitude: f64,
    /// φ₀, rad, from +x of the base frame towards +y.
    pub axis_rad: f64,
}

parametric!(AnisotropicFriction, "anisotropic_friction", {
    amplitude: Parameter::new("", [0.1, 0.4], [-0.95, 0.95], Neutral::Value(0.0)),
    axis_rad: Parameter::new("rad", [0.0, std::f64::consts::PI], [-10.0, 10.0], Neutral::Free(0.0)),
});

impl Effect for AnisotropicFriction {
    fn hooks(&self) -> Hooks {
        Hooks::FRICTION.when(self.amplitude != 0.0)
    }

    fn friction(&self, contact: &TableContact) -> f64 {
        if contact.speed_mps() < NO_SLIP_MPS {
            return 1.0;
        }
        let direction = contact.slip_mps[1].atan2(contact.slip_mps[0]);
        1.0 + self.amplitude * (2.0 * (direction - self.axis_rad)).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_a_second_harmonic_of_the_direction() {
        let effect = AnisotropicFriction { amplitude: 0.3, axis_rad: 0.5 };
        let at = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            effect.friction(&TableContact { position_m: [0.0; 3], slip_mps: [0.1 * cos, 0.1 * sin, 0.0] })
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        for (angle, expected) in
            [(0.5, 1.3), (0.5 + quarter, 0.7), (0.5 + 2.0 * quarter, 1.3), (0.5 + quarter / 2.0, 1.0)]
        {
            assert!((at(angle) - expected).abs() < 1e-12, "{angle}: {}", at(angle));
        }
    }
}
