//! Friction in the joints.
//!
//! τ = F_v q̇ + F_c sgn q̇.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | F_v | `viscous_nmsprad` | N·m·s/rad | 0.03 to 0.09 | what identifications of the Franka Panda report |
//! | F_c | `coulomb_nm` | N·m | 0.2 to 0.5 | the same |
//!
//! Shows in the joint torques during motion, in free motion too: the difference changes its sign with the direction.
//!
//! Acts on the torque that the motors give and their sensors read (O, for an arm with joint torque sensors), and as a load on the servos of a
//! dynamic arm (A), whose joints then lag by τ / K. The sign is softened below 0.01 rad/s. A wrist sensor on a kinematic arm reads none of
//! it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};
use crate::robot::JointVector;

/// Joint speed, rad/s, around 0 in which the sign of the motion is not yet clear.
const SOFT_RPS: f64 = 0.01;

/// Joints have friction; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointFriction {
    /// F_v, N·m·s/rad.
    pub viscous_nmsprad: f64,
    /// F_c, N·m.
    pub coulomb_nm: f64,
}

parametric!(JointFriction, "joint_friction", {
    viscous_nmsprad: Parameter::new("N·m·s/rad", [0.03, 0.09], [0.0, 1000.0], Neutral::Value(0.0)),
    coulomb_nm: Parameter::new("N·m", [0.2, 0.5], [0.0, 1000.0], Neutral::Value(0.0)),
});

impl Effect for JointFriction {
    fn hooks(&self) -> Hooks {
        Hooks::JOINT_FRICTION.when(self.viscous_nmsprad != 0.0 || self.coulomb_nm != 0.0)
    }

    fn joint_friction(&self, rate_rps: &[f64], torque_nm: &mut JointVector) {
        for (torque, rate) in torque_nm.iter_mut().zip(rate_rps) {
            *torque += self.viscous_nmsprad * rate + self.coulomb_nm * (rate / SOFT_RPS).tanh();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motors_give_viscous_and_coulomb_torque_along_the_motion() {
        let mut torque = JointVector::zeros();
        JointFriction { viscous_nmsprad: 0.05, coulomb_nm: 0.3 }.joint_friction(&[2.0, -1.0, 0.0], &mut torque);
        assert!((torque[0] - 0.4).abs() < 1e-12 && (torque[1] + 0.35).abs() < 1e-12 && torque[2] == 0.0, "{torque}");
    }
}
