//! A patch of the table with other friction: a spill, a strip of tape, a worn place.
//!
//! μ (1 + b) inside a circle; the border is 2 mm soft, so that costs are smooth in place and size.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | b | `excess` | – | −0.6 to 1 | engineering judgement |
//! | centre | `x_m`, `y_m` | m | where things can be in reach of an arm | – |
//! | radius | `radius_m` | m | 0.02 to 0.2 | engineering judgement |
//!
//! Shows in force and yaw at one place of the table: there a push takes more or less force, or turns the object.
//!
//! Acts on the contacts of free bodies with the table (K). The engine knows one friction coefficient for all contacts of two shapes. So the
//! object gets four support points at its corners or rim, each a shape of its own: a patch under one side of the object turns it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal, TableContact};

/// Width of the border, m.
const BORDER_M: f64 = 0.002;

/// Other friction at a place; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionPatch {
    /// b.
    pub excess: f64,
    /// Centre x, m, base frame.
    pub x_m: f64,
    /// Centre y, m, base frame.
    pub y_m: f64,
    /// Radius, m.
    pub radius_m: f64,
}

parametric!(FrictionPatch, "friction_patch", {
    excess: Parameter::new("", [-0.6, 1.0], [-1.0, 10.0], Neutral::Value(0.0)),
    x_m: Parameter::new("m", [-1.0, 1.0], [-10.0, 10.0], Neutral::Free(0.0)),
    y_m: Parameter::new("m", [-1.0, 1.0], [-10.0, 10.0], Neutral::Free(0.0)),
    radius_m: Parameter::new("m", [0.02, 0.2], [0.0, 10.0], Neutral::Free(0.05)),
});

impl Effect for FrictionPatch {
    fn hooks(&self) -> Hooks {
        Hooks::FRICTION.and(Hooks::NOMINAL).when(self.excess != 0.0)
    }

    fn nominal(&self, nominal: &mut Nominal) {
        nominal.support_share.get_or_insert(1.0);
    }

    fn friction(&self, contact: &TableContact) -> f64 {
        let [x, y, _] = contact.position_m;
        let outside_m = (x - self.x_m).hypot(y - self.y_m) - self.radius_m;
        1.0 + self.excess / (1.0 + (4.0 * outside_m / BORDER_M).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_higher_inside_the_circle_alone() {
        let effect = FrictionPatch { excess: 0.5, x_m: 0.4, y_m: -0.1, radius_m: 0.03 };
        let at = |x: f64, y: f64| effect.friction(&TableContact { position_m: [x, y, 0.0], slip_mps: [0.0; 3] });
        assert!((at(0.4, -0.1) - 1.5).abs() < 1e-9);
        assert!((at(0.4, -0.065) - 1.0).abs() < 1e-4 && (at(0.435, -0.1) - 1.0).abs() < 1e-4);
        assert!((at(0.43, -0.1) - 1.25).abs() < 1e-9, "half of it on the border");
    }
}
