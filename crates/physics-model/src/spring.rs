//! A tool that a spring holds where it is commanded to be: a kinematic arm that gives way.
//!
//! The command moves the tool's rest position and velocity; what differs from them is the deflection e of a spring K with damping D and mass m.
//! The step of duration h is solved implicitly: m ë = −K (e + h ė + h² ë) − D (ė + h ë) + f with the contact forces f is a body of mass
//! m + h D + h² K under the force −K (e + h ė) − D ė, so that contacts meet the stiffness of the spring and any K is stable.

use rapier3d::prelude::{LockedAxes, MassProperties, PhysicsWorld, RigidBodyHandle, RigidBodyType, Vector};

use crate::arm::LINK;
use crate::world::vector;

/// Mass m of the hand, kg: small against what it pushes, so that its own inertia does not show.
const HAND_KG: f64 = 0.1;

pub(crate) struct ToolSpring {
    stiffness_npm: f64,
    damping_nspm: f64,
    period_secs: f64,
    rest: Vector,
    rest_mps: Vector,
}

impl ToolSpring {
    /// Hangs `tool`, at rest where it is, on a critically damped spring.
    pub(crate) fn new(physics: &mut PhysicsWorld, tool: RigidBodyHandle, stiffness_npm: f64, period_secs: f64) -> Self {
        // As for the dynamic arm: the pass that corrects velocities would else meet a spring that has not moved (see `arm`).
        physics.integration_parameters.friction_in_bias_pass = true;
        let damping_nspm = 2.0 * (stiffness_npm * HAND_KG).sqrt();
        let mass = HAND_KG + period_secs * damping_nspm + period_secs * period_secs * stiffness_npm;
        let rigid = &mut physics.bodies[tool];
        rigid.set_body_type(RigidBodyType::Dynamic, true);
        rigid.set_gravity_scale(0.0, true);
        rigid.set_locked_axes(LockedAxes::ROTATION_LOCKED, true);
        rigid.set_additional_mass_properties(MassProperties::new(Vector::ZERO, mass as f32, Vector::splat(1.0)), true);
        rigid.activation_mut().normalized_linear_threshold = -1.0;
        rigid.user_data = LINK;
        let (rest, colliders) = (rigid.translation(), rigid.colliders().to_vec());
        for collider in colliders {
            physics.colliders[collider].set_density(0.0);
        }
        Self { stiffness_npm, damping_nspm, period_secs, rest, rest_mps: Vector::ZERO }
    }

    /// The same with its slack end at `position_m`: the tool hangs deflected.
    pub(crate) fn rest_at(&mut self, position_m: [f64; 3]) {
        self.rest = vector(position_m);
    }

    /// Commands that the tool, were it free, be at `position_m` at the end of the coming control step.
    pub(crate) fn command(&mut self, physics: &mut PhysicsWorld, tool: RigidBodyHandle, position_m: [f64; 3]) {
        let rigid = &mut physics.bodies[tool];
        let period = self.period_secs as f32;
        let target = vector(position_m);
        let (deflection, rate) = (rigid.translation() - self.rest, rigid.linvel() - self.rest_mps);
        self.rest_mps = (target - self.rest) / period;
        self.rest = target;
        rigid.set_linvel(self.rest_mps + rate, true);
        let force = -(deflection + rate * period) * self.stiffness_npm as f32 - rate * self.damping_nspm as f32;
        rigid.reset_forces(false);
        rigid.add_force(force, true);
    }
}
