//! Viscous damping of translation.

use serde::{Deserialize, Serialize};

use crate::effect::{BodyView, Effect, Load, Surroundings};

/// F = −c v on every free body. Plausible: 0.1 to 2 N·s/m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViscousDamping {
    /// c, N·s/m.
    pub coefficient_nspm: f64,
}

impl Effect for ViscousDamping {
    fn load(&self, surroundings: &Surroundings, body: &BodyView, load: &mut Load) {
        // An explicit force must not turn the velocity round within one step: c dt ≤ m.
        let c = self.coefficient_nspm.min(body.mass_kg / surroundings.period_secs);
        for (f, v) in load.force_n.iter_mut().zip(body.linear_mps) {
            *f -= c * v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_decays_as_the_closed_form_says() {
        let effect = ViscousDamping { coefficient_nspm: 0.5 };
        let surroundings = Surroundings { gravity_mps2: 9.81, period_secs: 1e-4 };
        let mut v = 1.0;
        for _ in 0..10_000 {
            let body = BodyView {
                mass_kg: 2.0,
                rolling_radius_m: None,
                on_table: true,
                linear_mps: [v, 0.0, 0.0],
                angular_rps: [0.0; 3],
            };
            let mut load = Load::default();
            effect.load(&surroundings, &body, &mut load);
            v += load.force_n[0] / body.mass_kg * surroundings.period_secs;
        }
        // v(t) = v0 exp(−c t / m) after 1 s.
        assert!((v - (-0.25_f64).exp()).abs() < 1e-4, "{v}");
    }
}
