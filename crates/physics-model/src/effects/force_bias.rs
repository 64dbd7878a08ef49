//! An offset of the force sensor.
//!
//! f_read = f + b.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | b | `bias_x_n`, `bias_y_n`, `bias_z_n` | N | magnitude 0.1 to 2 | sensors after taring, engineering judgement |
//!
//! Shows in the force at all times, with and without contact: always the same offset.
//!
//! Acts on the force readings (O), along the base axes at the tool centre: the tool keeps its orientation, so that axes fixed to the sensor would
//! only name the components otherwise. An arm with joint torque sensors shows the torques −Jᵀ b.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::world::Wrench;

/// The force sensor has an offset; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceBias {
    /// Along x of the base frame, N.
    pub bias_x_n: f64,
    /// Along y, N.
    pub bias_y_n: f64,
    /// Along z, N.
    pub bias_z_n: f64,
}

const BIAS: Parameter = Parameter::new("N", [-2.0, 2.0], [-500.0, 500.0], Neutral::Value(0.0));

parametric!(ForceBias, "force_bias", { bias_x_n: BIAS, bias_y_n: BIAS, bias_z_n: BIAS });

impl Effect for ForceBias {
    fn hooks(&self) -> Hooks {
        Hooks::FORCE.when([self.bias_x_n, self.bias_y_n, self.bias_z_n] != [0.0; 3])
    }

    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        Some(Box::new(self.clone()))
    }
}

impl ForceFilter for ForceBias {
    fn apply(&mut self, _moment: &ToolMoment, wrench: &mut Wrench) {
        for (force, bias) in wrench.force_n.iter_mut().zip([self.bias_x_n, self.bias_y_n, self.bias_z_n]) {
            *force += bias;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn the_offset_is_there_with_and_without_contact() {
        let mut filter = ForceBias { bias_x_n: 0.5, bias_y_n: -1.0, bias_z_n: 0.25 }.force(0.01).unwrap();
        let mut wrench = Wrench { force_n: [1.0, 2.0, 3.0], torque_nm: [4.0; 3] };
        filter.apply(&moment(0.0), &mut wrench);
        assert_eq!(wrench, Wrench { force_n: [1.5, 1.0, 3.25], torque_nm: [4.0; 3] });
    }
}
