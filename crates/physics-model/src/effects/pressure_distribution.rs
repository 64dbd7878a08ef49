//! Where the object bears on the table: a sole that is hollow, crowned or stands on feet.
//!
//! The torsional moment of friction is τ = μ N r_eff. A flat disc that presses evenly has r_eff = 2/3 R (∫ r dA / A); the engine bears a box on its
//! corners and a cylinder on points of its rim, r_eff = R.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | r_eff / R | `radius_share` | – | 0 to 0.7 | 0: a point; 0.67: even pressure of a disc |
//!
//! Shows in the yaw: pushed beside its middle, the object turns further.
//!
//! Acts on the object's colliders (N): four points at that share of the way from the centre to the corners (box) or the rim (cylinder) touch the table in
//! their place. The rest of the sole hangs 0.3 mm higher and catches what would tip off them. A sphere touches at a point anyway: no effect.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};

/// Support points nearer to the centre; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureDistribution {
    /// r_eff / R; 1 is the engine's own support at corners or rim.
    pub radius_share: f64,
}

parametric!(PressureDistribution, "pressure_distribution", {
    radius_share: Parameter::new("", [0.0, 0.7], [0.0, 1.0], Neutral::Value(1.0)),
});

impl Effect for PressureDistribution {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL.when(self.radius_share != 1.0)
    }

    fn nominal(&self, nominal: &mut Nominal) {
        let share = nominal.support_share.unwrap_or(1.0);
        nominal.support_share = Some(share * self.radius_share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn the_support_moves_to_its_share_of_the_radius() {
        let mut world = nominal();
        PressureDistribution { radius_share: 0.5 }.nominal(&mut world);
        assert_eq!(world.support_share, Some(0.5));
        assert!(!PressureDistribution { radius_share: 1.0 }.hooks().contains(Hooks::NOMINAL));
    }
}
