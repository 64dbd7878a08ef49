//! A mass on the hand that the sensors' compensation does not know: a cable, a camera, a heavier tool.
//!
//! f = m (g − a), τ = R c × f about the tool centre, a: acceleration of the tool, R: its orientation.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | m | `mass_kg` | kg | 0.1 to 5 | what arms of this size may carry |
//! | c | `com_x_m`, `com_y_m`, `com_z_m` | m | up to 0.1 either way | engineering judgement; axes and origin of the tool |
//!
//! Shows in the force without contact: the weight is always there, and inertia adds to it when the tool speeds up.
//!
//! Acts on the force readings (O): at the wrist, or as the torques −Jᵀ f that the motors give. A position-controlled arm holds the weight: the
//! tool does not sink.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::state::unit_quaternion;
use crate::world::Wrench;

/// The hand carries an unknown mass; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WristPayload {
    /// m, kg.
    pub mass_kg: f64,
    /// Centre of mass along the tool's x, m.
    pub com_x_m: f64,
    /// Along its y, m.
    pub com_y_m: f64,
    /// Along its z, m.
    pub com_z_m: f64,
}

const COM: Parameter = Parameter::new("m", [-0.1, 0.1], [-1.0, 1.0], Neutral::Free(0.0));

parametric!(WristPayload, "wrist_payload", {
    mass_kg: Parameter::new("kg", [0.1, 5.0], [-5.0, 50.0], Neutral::Value(0.0)),
    com_x_m: COM,
    com_y_m: COM,
    com_z_m: COM,
});

impl Effect for WristPayload {
    fn hooks(&self) -> Hooks {
        Hooks::FORCE.when(self.mass_kg != 0.0)
    }

    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        Some(Box::new(self.clone()))
    }
}

impl ForceFilter for WristPayload {
    fn apply(&mut self, moment: &ToolMoment, wrench: &mut Wrench) {
        let gravity = Vector3::new(0.0, 0.0, -moment.gravity_mps2);
        let force = (gravity - Vector3::from(moment.acceleration_mps2)) * self.mass_kg;
        let arm = unit_quaternion(moment.orientation) * Vector3::new(self.com_x_m, self.com_y_m, self.com_z_m);
        wrench.add_scaled(&Wrench { force_n: force.into(), torque_nm: arm.cross(&force).into() }, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn the_hand_feels_weight_and_inertia_at_the_centre_of_mass() {
        let effect = WristPayload { mass_kg: 2.0, com_x_m: 0.1, com_y_m: 0.0, com_z_m: 0.0 };
        // The tool is turned by 90° about z: the mass lies on +y of the base frame.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let moment =
            ToolMoment { orientation: [0.0, 0.0, half, half], acceleration_mps2: [1.0, 0.0, 0.0], ..moment(0.0) };
        let mut wrench = Wrench::default();
        effect.force(0.01).unwrap().apply(&moment, &mut wrench);
        // r × f = (0, 0.1, 0) × (−2, 0, −2 g) = (−0.2 g, 0, 0.2).
        let expected = ([-2.0, 0.0, -2.0 * 9.81], [-0.2 * 9.81, 0.0, 0.2]);
        for i in 0..3 {
            assert!((wrench.force_n[i] - expected.0[i]).abs() < 1e-12, "{wrench:?}");
            assert!((wrench.torque_nm[i] - expected.1[i]).abs() < 1e-12, "{wrench:?}");
        }
    }
}
