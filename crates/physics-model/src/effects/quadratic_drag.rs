//! Quadratic drag of translation.
//!
//! F = −k |v| v.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | k = ½ ρ c_d A | `coefficient_ns2pm2` | N·s²/m² | 0.1 to 4 | ½ ρ c_d A: 80 cm² in water with c_d = 1 has 4; in air a thousandth |
//!
//! Shows in force and pose at high speed: twice the speed takes four times as much more force.
//!
//! Acts as a force (F) at the centre of mass of every free body. Alone it lets the speed decay as v₀ / (1 + k v₀ t / m).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{BodyView, Effect, Hooks, Load, Surroundings};

/// F = −k |v| v on every free body; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuadraticDrag {
    /// k, N·s²/m².
    pub coefficient_ns2pm2: f64,
}

parametric!(QuadraticDrag, "quadratic_drag", {
    coefficient_ns2pm2: Parameter::new("N·s²/m²", [0.1, 4.0], [0.0, 1000.0], Neutral::Value(0.0)),
});

impl Effect for QuadraticDrag {
    fn hooks(&self) -> Hooks {
        Hooks::LOAD
    }

    fn load(&self, surroundings: &Surroundings, body: &BodyView, load: &mut Load) {
        let speed = body.linear_mps.iter().map(|v| v * v).sum::<f64>().sqrt();
        // The mean over the step of the closed form: exact at any step, and it never turns the velocity round.
        let slowing = 1.0 + self.coefficient_ns2pm2 * speed * surroundings.period_secs / body.mass_kg;
        for (f, v) in load.force_n.iter_mut().zip(body.linear_mps) {
            *f -= self.coefficient_ns2pm2 * speed * v / slowing;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_decays_as_the_closed_form_says_at_any_step() {
        let effect = QuadraticDrag { coefficient_ns2pm2: 1.5 };
        for steps in [10, 1000] {
            let surroundings = Surroundings { gravity_mps2: 9.81, period_secs: 1.0 / f64::from(steps) };
            let mut v = [0.6, -0.8, 0.0];
            for _ in 0..steps {
                let body = BodyView { linear_mps: v, ..BodyView::on_table(0.5) };
                let mut load = Load::default();
                effect.load(&surroundings, &body, &mut load);
                for (v, f) in v.iter_mut().zip(load.force_n) {
                    *v += f / body.mass_kg * surroundings.period_secs;
                }
            }
            // v0 / (1 + k v0 t / m) with v0 = 1 m/s, k / m = 3 /m, t = 1 s.
            assert!((v[0] - 0.6 / 4.0).abs() < 1e-12 && (v[1] + 0.8 / 4.0).abs() < 1e-12, "{v:?}");
        }
    }
}
