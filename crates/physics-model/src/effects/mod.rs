//! One file per effect: equation, symbols, units, plausible range and its source, and a test against a closed form.
//!
//! The docs of each have one form, from which the page of effects is made: see [`crate::effect::sheet`]. Ranges without a source are
//! engineering judgement. Letters say where an effect acts, as in [`crate::effect`].

pub mod actuation_delay;
pub mod actuator_gain;
pub mod adhesion;
pub mod anisotropic_friction;
pub mod arm_compliance;
pub mod backlash;
pub mod com_offset;
pub mod constant_force;
pub mod contact_compliance;
pub mod edge_rounding;
pub mod force_bias;
pub mod force_delay;
pub mod force_drift;
pub mod force_gain;
pub mod force_low_pass;
pub mod force_saturation;
pub mod friction_level;
pub mod friction_patch;
pub mod hidden_obstacle;
pub mod joint_friction;
pub mod mass_leak;
pub mod pose_delay;
pub mod pose_offset;
pub mod pose_rotation;
pub mod pose_scale;
pub mod pressure_distribution;
pub mod quadratic_drag;
pub mod restitution;
pub mod rolling_resistance;
pub mod static_friction;
pub mod stribeck_friction;
pub mod table_tilt;
pub mod tether;
pub mod time_base;
pub mod viscous_damping;
pub mod wrist_payload;

pub use actuation_delay::ActuationDelay;
pub use actuator_gain::ActuatorGain;
pub use adhesion::Adhesion;
pub use anisotropic_friction::AnisotropicFriction;
pub use arm_compliance::ArmCompliance;
pub use backlash::Backlash;
pub use com_offset::ComOffset;
pub use constant_force::ConstantForce;
pub use contact_compliance::ContactCompliance;
pub use edge_rounding::EdgeRounding;
pub use force_bias::ForceBias;
pub use force_delay::ForceDelay;
pub use force_drift::ForceDrift;
pub use force_gain::ForceGain;
pub use force_low_pass::ForceLowPass;
pub use force_saturation::ForceSaturation;
pub use friction_level::FrictionLevel;
pub use friction_patch::FrictionPatch;
pub use hidden_obstacle::HiddenObstacle;
pub use joint_friction::JointFriction;
pub use mass_leak::MassLeak;
pub use pose_delay::PoseDelay;
pub use pose_offset::PoseOffset;
pub use pose_rotation::PoseRotation;
pub use pose_scale::PoseScale;
pub use pressure_distribution::PressureDistribution;
pub use quadratic_drag::QuadraticDrag;
pub use restitution::Restitution;
pub use rolling_resistance::RollingResistance;
pub use static_friction::StaticFriction;
pub use stribeck_friction::StribeckFriction;
pub use table_tilt::TableTilt;
pub use tether::Tether;
pub use time_base::TimeBase;
pub use viscous_damping::ViscousDamping;
pub use wrist_payload::WristPayload;

/// Names of modules, each with what stands in it: [`crate::effect::sheet`] reads their docs.
macro_rules! sources {
    ($($name:ident)+) => {
        &[$((stringify!($name), include_str!(concat!(stringify!($name), ".rs")))),+]
    };
}

pub(crate) const SOURCES: &[(&str, &str)] = sources! {
    actuation_delay actuator_gain adhesion anisotropic_friction arm_compliance backlash com_offset constant_force contact_compliance
    edge_rounding force_bias force_delay force_drift force_gain force_low_pass force_saturation friction_level friction_patch hidden_obstacle
    joint_friction mass_leak pose_delay pose_offset pose_rotation pose_scale pressure_distribution quadratic_drag restitution
    rolling_resistance static_friction stribeck_friction table_tilt tether time_base viscous_damping wrist_payload
};

#[cfg(test)]
mod tests {
    use crate::config::{ObstacleMobility, WorldConfig};
    use crate::effect::{CommandSpace, CommandStart, Effect, Nominal, ToolMoment};
    use crate::state::{BodyState, MAX_JOINTS};
    use crate::theta::{ObjectShape, ObjectTheta, Theta};

    /// The usual box in the usual world.
    pub(super) fn nominal() -> Nominal {
        let world = WorldConfig {
            control_period_secs: 1.0 / 60.0,
            control_steps: 20,
            solver_iterations: 2,
            contact_frequency_hz: 60.0,
            contact_damping_ratio: 5.0,
            table_height_m: 0.0,
            gravity_mps2: 9.81,
            tool_friction: 0.2,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0,
            restitution: 0.0,
            obstacle_mobility: ObstacleMobility::Fixed,
        };
        let object =
            ObjectTheta { shape: ObjectShape::Box, mass_kg: 0.5, com_m: [0.0; 3], friction: 0.4, size_m: [0.08; 3] };
        Nominal::new(&world, &Theta { object, obstacle: None, effects: vec![] })
    }

    /// Commands of the tool centre from `at` on, 60 a second.
    pub(super) fn tool_start(at: &[f64]) -> CommandStart<'_> {
        CommandStart { space: CommandSpace::Tool, at, period_secs: 1.0 / 60.0, play_rad: [0.0; MAX_JOINTS] }
    }

    /// An upright tool that stands still.
    pub(super) fn moment(time_secs: f64) -> ToolMoment {
        ToolMoment { time_secs, orientation: [0.0, 0.0, 0.0, 1.0], acceleration_mps2: [0.0; 3], gravity_mps2: 9.81 }
    }

    /// A reading leads back to its state.
    pub(super) fn assert_unread(effect: &dyn Effect) {
        let mut state = BodyState::at_rest([0.5, -0.2, 0.04], 0.7);
        state.linear_mps = [0.1, 0.2, -0.3];
        state.angular_rps = [1.0, -2.0, 3.0];
        let mut body = state;
        effect.read(&mut body);
        assert_ne!(body, state);
        effect.unread(&mut body);
        for (found, expected) in body.to_array().iter().zip(state.to_array()) {
            assert!((found - expected).abs() < 1e-12, "{body:?} and {state:?}");
        }
    }
}
