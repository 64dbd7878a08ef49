//! Another friction coefficient of the pair object–table than Θ has.
//!
//! |F| ≤ μ N.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | μ | `coefficient` | – | 0.1 to 0.8 | dry sliding of common materials, engineering judgement |
//!
//! Shows in the force of every push by the same factor, and in how far the object slides after it is let go.
//!
//! Acts on the object's material (N). It is what Θ's own friction is, so that a model in which that one is unknown has no use for this: it is for
//! logs whose friction was given as known.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};

/// Another friction coefficient; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionLevel {
    /// μ.
    pub coefficient: f64,
}

parametric!(FrictionLevel, "friction_level", {
    coefficient: Parameter::new("", [0.1, 0.8], [0.0, 2.0], Neutral::Friction),
});

impl Effect for FrictionLevel {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL
    }

    fn nominal(&self, nominal: &mut Nominal) {
        nominal.theta.object.friction = self.coefficient;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn the_coefficient_replaces_that_of_the_object() {
        let mut world = nominal();
        FrictionLevel { coefficient: 0.7 }.nominal(&mut world);
        assert_eq!(world.theta.object.friction, 0.7);
    }
}
