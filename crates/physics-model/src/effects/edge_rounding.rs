//! Edges and corners that are round where the model has them sharp.
//!
//! The shape is a smaller one, by r on every side, swept by a ball of radius r. Faces stay where they are. An edge of a box on the table lies
//! lower by (√2 − 1) r, a corner by (√3 − 1) r. The sole ends r before the sides do.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | r | `radius_m` | m | 0.0005 to 0.02 | engineering judgement |
//!
//! Shows in height and tilt when a thrown object lands on an edge or a corner and tips over it.
//!
//! Acts on the object's collider (N): boxes and cylinders; a sphere has no edges, and an outline of a log (prism) keeps its own. Mass and inertia stay those
//! of the nominal model. The radius is held to nine tenths of the smallest half length. Shows in what tumbles; of what is pushed upright only the sole is
//! smaller, as with `pressure_distribution`. Whether a pose overlaps the table (`feasible`) is asked of the sharp shape.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};
use crate::theta::ObjectShape;

/// Largest radius, in the smallest half length.
const LARGEST: f64 = 0.9;

/// Round edges; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EdgeRounding {
    /// r, m.
    pub radius_m: f64,
}

parametric!(EdgeRounding, "edge_rounding", {
    radius_m: Parameter::new("m", [0.0005, 0.02], [0.0, 0.1], Neutral::Value(0.0)),
});

impl Effect for EdgeRounding {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL.when(self.radius_m != 0.0)
    }

    fn nominal(&self, nominal: &mut Nominal) {
        let object = &nominal.theta.object;
        if object.shape == ObjectShape::Sphere {
            return;
        }
        let smallest = object.shape.half_extents_m(object.size_m).into_iter().fold(f64::INFINITY, f64::min);
        nominal.edge_radius_m = (nominal.edge_radius_m + self.radius_m).min(LARGEST * smallest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn the_radius_is_held_within_the_object() {
        let mut world = nominal();
        world.theta.object.size_m = [0.08, 0.06, 0.1];
        EdgeRounding { radius_m: 0.005 }.nominal(&mut world);
        assert!((world.edge_radius_m - 0.005).abs() < 1e-15);
        EdgeRounding { radius_m: 0.1 }.nominal(&mut world);
        assert!((world.edge_radius_m - 0.9 * 0.03).abs() < 1e-15);
        assert!(!EdgeRounding { radius_m: 0.0 }.hooks().contains(Hooks::NOMINAL));
    }
}
