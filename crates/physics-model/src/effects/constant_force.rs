//! A constant horizontal force on the object: a draught, a cable's pull, a magnet far away.
//!
//! F = (F_x, F_y), independent of mass and place.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | F_x, F_y | `force_x_n`, `force_y_n` | N | magnitude 0.02 to 0.5 | engineering judgement |
//!
//! Shows in path and force: what slides drifts along the force, and pushes against it take more.
//!
//! Acts as a force (F) at the object's centre of mass. A tilt pulls in proportion to the mass instead: a known added weight tells them apart.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{BodyRole, BodyView, Effect, Hooks, Load, Surroundings};

/// A horizontal force on the object; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantForce {
    /// Along x of the base frame, N.
    pub force_x_n: f64,
    /// Along y of the base frame, N.
    pub force_y_n: f64,
}

parametric!(ConstantForce, "constant_force", {
    force_x_n: Parameter::new("N", [-0.5, 0.5], [-100.0, 100.0], Neutral::Value(0.0)),
    force_y_n: Parameter::new("N", [-0.5, 0.5], [-100.0, 100.0], Neutral::Value(0.0)),
});

impl Effect for ConstantForce {
    fn hooks(&self) -> Hooks {
        Hooks::LOAD.and(Hooks::UNREST).and(Hooks::ASTRAY).when(self.force_x_n != 0.0 || self.force_y_n != 0.0)
    }

    fn load(&self, _surroundings: &Surroundings, body: &BodyView, load: &mut Load) {
        if body.role == BodyRole::Object {
            load.force_n[0] += self.force_x_n;
            load.force_n[1] += self.force_y_n;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_is_the_same_for_every_mass_and_on_the_object_alone() {
        let effect = ConstantForce { force_x_n: 0.2, force_y_n: -0.1 };
        let surroundings = Surroundings { gravity_mps2: 9.81, period_secs: 0.01 };
        let force = |body: BodyView| {
            let mut load = Load::default();
            effect.load(&surroundings, &body, &mut load);
            load.force_n
        };
        assert_eq!(force(BodyView::on_table(0.1)), [0.2, -0.1, 0.0]);
        assert_eq!(force(BodyView::on_table(3.0)), [0.2, -0.1, 0.0]);
        assert_eq!(force(BodyView { role: BodyRole::Obstacle, ..BodyView::on_table(0.1) }), [0.0; 3]);
    }
}
