//! A centre of mass elsewhere than Θ has it.
//!
//! c = c_Θ + (s_x a_x, s_y a_y, s_z a_z), a: full lengths of the shape along its axes; kept within 45 % of them.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | s | `share_x`, `share_y`, `share_z` | – | up to 0.3 either way | engineering judgement |
//!
//! Shows in the yaw: pushed through the middle of a face, the object turns.
//!
//! Acts on the object's mass properties (N); its inertia about the centre of mass stays. A sphere has no axes: its centre of mass gets as deep as
//! the three shares together.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};
use crate::theta::ObjectShape;

/// Largest distance of the centre of mass from the centre, as a share of the full length.
const LARGEST: f64 = 0.45;

/// Another centre of mass; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ComOffset {
    /// s_x, share of the length along the object's x.
    pub share_x: f64,
    /// s_y.
    pub share_y: f64,
    /// s_z.
    pub share_z: f64,
}

const SHARE: Parameter = Parameter::new("", [-0.3, 0.3], [-0.45, 0.45], Neutral::Value(0.0));

parametric!(ComOffset, "com_offset", { share_x: SHARE, share_y: SHARE, share_z: SHARE });

impl Effect for ComOffset {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL
    }

    fn nominal(&self, nominal: &mut Nominal) {
        let object = &mut nominal.theta.object;
        let half = object.shape.half_extents_m(object.size_m);
        let shares = match object.shape {
            ObjectShape::Box | ObjectShape::Cylinder => [self.share_x, self.share_y, self.share_z],
            ObjectShape::Sphere => [0.0, 0.0, -self.share_x.hypot(self.share_y).hypot(self.share_z)],
        };
        for ((com, half), share) in object.com_m.iter_mut().zip(half).zip(shares) {
            if share != 0.0 {
                let limit = 2.0 * LARGEST * half;
                *com = (*com + 2.0 * half * share).clamp(-limit, limit);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn the_centre_of_mass_moves_by_its_share_of_the_full_length() {
        let mut world = nominal();
        world.theta.object.size_m = [0.08, 0.06, 0.1];
        world.theta.object.com_m = [0.002, 0.0, 0.0];
        ComOffset { share_x: 0.1, share_y: -0.2, share_z: 0.3 }.nominal(&mut world);
        let expected = [0.01, -0.012, 0.03];
        for (found, expected) in world.theta.object.com_m.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{:?}", world.theta.object.com_m);
        }
    }
}
