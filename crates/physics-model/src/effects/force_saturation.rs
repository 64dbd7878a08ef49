//! A force sensor at the end of its range.
//!
//! f_read = clamp(f, −limit, limit), each component of the force by itself.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | limit | `limit_n` | N | 1 to 50 | small tactile sensors to wrist sensors, engineering judgement |
//!
//! Shows in the peaks of the force: they are cut off at one value.
//!
//! Acts on the force readings (O), along the base axes. Neutral is an infinite limit.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::world::Wrench;

/// The force sensor has an end of its range; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceSaturation {
    /// Limit of each component, N.
    pub limit_n: f64,
}

parametric!(ForceSaturation, "force_saturation", {
    limit_n: Parameter::new("N", [1.0, 50.0], [0.01, f64::INFINITY], Neutral::Value(f64::INFINITY)).reciprocal(),
});

impl Effect for ForceSaturation {
    fn hooks(&self) -> Hooks {
        Hooks::FORCE.when(self.limit_n.is_finite())
    }

    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        Some(Box::new(self.clone()))
    }
}

impl ForceFilter for ForceSaturation {
    fn apply(&mut self, _moment: &ToolMoment, wrench: &mut Wrench) {
        for force in &mut wrench.force_n {
            *force = force.clamp(-self.limit_n, self.limit_n);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn the_top_is_clipped_and_the_rest_is_as_it_was() {
        let mut filter = ForceSaturation { limit_n: 5.0 }.force(0.01).unwrap();
        let mut wrench = Wrench { force_n: [7.0, -9.0, 4.0], torque_nm: [8.0, 0.0, 0.0] };
        filter.apply(&moment(0.0), &mut wrench);
        assert_eq!(wrench, Wrench { force_n: [5.0, -5.0, 4.0], torque_nm: [8.0, 0.0, 0.0] });
    }
}
