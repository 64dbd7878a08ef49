//! An arm that gives way.
//!
//! x = x_cmd − F / K, F: what the tool exerts on the world.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | K | `stiffness_npm` | N/m | 500 to 50000 | 0.5 to 50 N/mm is what position- and impedance-controlled arms have |
//!
//! Shows in the place of the tool under load: it stays behind its command while it pushes, and not in free motion.
//!
//! Acts between the command and the tool (A), on a kinematic arm: the tool becomes a body held by a critically damped spring of K, the same in all
//! directions, solved implicitly. A dynamic arm has the stiffness of its servos instead. Deflections do not outlive an action: the next one starts,
//! unloaded, from where the tool is. Neutral is an infinite stiffness.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};

/// The tool gives way to forces; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArmCompliance {
    /// K, N/m.
    pub stiffness_npm: f64,
}

parametric!(ArmCompliance, "arm_compliance", {
    stiffness_npm: Parameter::new("N/m", [500.0, 50_000.0], [10.0, f64::INFINITY], Neutral::Value(f64::INFINITY)).reciprocal(),
});

impl Effect for ArmCompliance {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL.and(Hooks::COMMAND).when(self.stiffness_npm.is_finite())
    }

    fn nominal(&self, nominal: &mut Nominal) {
        // Springs in a row.
        nominal.tool_stiffness_npm = (nominal.tool_stiffness_npm.recip() + self.stiffness_npm.recip()).recip();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn two_springs_in_a_row_are_as_soft_as_both() {
        let mut world = nominal();
        ArmCompliance { stiffness_npm: 2000.0 }.nominal(&mut world);
        assert!((world.tool_stiffness_npm - 2000.0).abs() < 1e-9);
        ArmCompliance { stiffness_npm: 2000.0 }.nominal(&mut world);
        assert!((world.tool_stiffness_npm - 1000.0).abs() < 1e-9);
    }
}
