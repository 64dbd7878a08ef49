//! A tether: a spring from the object to a fixed point at its height.
//!
//! F = −k (x − a), horizontally.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | k | `stiffness_npm` | N/m | 0.5 to 20 | engineering judgement: a power cord, a rubber band |
//! | a | `anchor_x_m`, `anchor_y_m` | m | where things can be in reach of an arm | – |
//!
//! Shows in force and path: the farther from the anchor, the stronger the pull back to it.
//!
//! Acts as a force (F) at the object's centre of mass, by where the centre of its shape is. Alone it lets the object swing with the period
//! 2π √(m / k).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{BodyRole, BodyView, Effect, Hooks, Load, Surroundings};

/// A spring from the object to a point; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tether {
    /// k, N/m.
    pub stiffness_npm: f64,
    /// Where the spring is slack, x, m, base frame.
    pub anchor_x_m: f64,
    /// Where the spring is slack, y, m, base frame.
    pub anchor_y_m: f64,
}

parametric!(Tether, "tether", {
    stiffness_npm: Parameter::new("N/m", [0.5, 20.0], [0.0, 10_000.0], Neutral::Value(0.0)),
    anchor_x_m: Parameter::new("m", [-1.0, 1.0], [-10.0, 10.0], Neutral::Free(0.0)),
    anchor_y_m: Parameter::new("m", [-1.0, 1.0], [-10.0, 10.0], Neutral::Free(0.0)),
});

impl Effect for Tether {
    fn hooks(&self) -> Hooks {
        Hooks::LOAD.and(Hooks::UNREST).and(Hooks::ASTRAY).when(self.stiffness_npm != 0.0)
    }

    fn load(&self, surroundings: &Surroundings, body: &BodyView, load: &mut Load) {
        if body.role != BodyRole::Object {
            return;
        }
        // An explicit spring swings up above 4 m / dt²; a quarter of that leaves room for what else acts.
        let k = self.stiffness_npm.min(body.mass_kg / surroundings.period_secs.powi(2));
        for ((force, at), anchor) in
            load.force_n.iter_mut().zip(body.position_m).zip([self.anchor_x_m, self.anchor_y_m])
        {
            *force -= k * (at - anchor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_body_swings_with_the_period_of_the_closed_form() {
        let effect = Tether { stiffness_npm: 8.0, anchor_x_m: 0.3, anchor_y_m: -0.1 };
        let surroundings = Surroundings { gravity_mps2: 9.81, period_secs: 1e-4 };
        let mut body = BodyView { position_m: [0.4, -0.1, 0.7], ..BodyView::on_table(0.5) };
        let mut crossings = Vec::new();
        for step in 0..40_000 {
            let mut load = Load::default();
            effect.load(&surroundings, &body, &mut load);
            assert!(load.force_n[1].abs() < 1e-12 && load.force_n[2] == 0.0, "{load:?}");
            body.linear_mps[0] += load.force_n[0] / body.mass_kg * surroundings.period_secs;
            let before = body.position_m[0];
            body.position_m[0] += body.linear_mps[0] * surroundings.period_secs;
            if before > 0.3 && body.position_m[0] <= 0.3 {
                crossings.push(f64::from(step) * surroundings.period_secs);
            }
        }
        // 2π √(0.5 / 8) = π / 2.
        let period = crossings[1] - crossings[0];
        assert!((period - std::f64::consts::FRAC_PI_2).abs() < 1e-3, "{period}");
    }
}
