//! Bodies that bounce.
//!
//! v_after = −e v_before along the normal of a new contact.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | e | `coefficient` | – | 0 to 0.8 | 0: clay; 0.8: a rubber ball |
//!
//! Shows in the pose after an impact: the object leaves the tool or the table with a share of the speed.
//!
//! Acts on all materials (N); the larger coefficient of two bodies counts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};

/// Bodies bounce; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Restitution {
    /// e.
    pub coefficient: f64,
}

parametric!(Restitution, "restitution", {
    coefficient: Parameter::new("", [0.0, 0.8], [0.0, 1.0], Neutral::Restitution),
});

impl Effect for Restitution {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL
    }

    fn nominal(&self, nominal: &mut Nominal) {
        nominal.world.restitution = self.coefficient;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn the_coefficient_replaces_that_of_the_world() {
        let mut world = nominal();
        Restitution { coefficient: 0.6 }.nominal(&mut world);
        assert_eq!(world.world.restitution, 0.6);
    }
}
