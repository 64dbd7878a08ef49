//! Viscous damping of translation.
//!
//! F = −c v.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | c | `coefficient_nspm` | N·s/m | 0.1 to 2 | engineering judgement: a film of oil, a brush |
//!
//! Shows in force and pose: fast pushes take more force than slow ones, and what is let go stops sooner.
//!
//! Acts as a force (F) at the centre of mass of every free body. Alone it lets the speed decay as v₀ exp(−c t / m).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{BodyView, Effect, Hooks, Load, Surroundings};

/// F = −c v on every free body; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViscousDamping {
    /// c, N·s/m.
    pub coefficient_nspm: f64,
}

parametric!(ViscousDamping, "viscous_damping", {
    coefficient_nspm: Parameter::new("N·s/m", [0.1, 2.0], [0.0, 1000.0], Neutral::Value(0.0)),
});

impl Effect for ViscousDamping {
    fn hooks(&self) -> Hooks {
        Hooks::LOAD
    }

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
            let body = BodyView { linear_mps: [v, 0.0, 0.0], ..BodyView::on_table(2.0) };
            let mut load = Load::default();
            effect.load(&surroundings, &body, &mut load);
            v += load.force_n[0] / body.mass_kg * surroundings.period_secs;
        }
        // v(t) = v0 exp(−c t / m) after 1 s.
        assert!((v - (-0.25_f64).exp()).abs() < 1e-4, "{v}");
    }
}
