//! The one place where rapier's friction is corrected.
//!
//! Coulomb friction is opposite to the slip. Rapier's solver (0.36) iterates `λ ← cap(λ − K⁻¹ v, μ λₙ)` for the friction impulse λ of
//! every contact point, with v the slip velocity and K the 2×2 inverse effective mass of the point in the tangent plane. Where the impulse is
//! at its cap, the fixed point is `λ ∥ −K⁻¹ v`, and not `−v`: at the corner of a sliding box the yaw inertia couples the two tangents
//! (K₁₂ = −r₁ r₂ / I), so that friction is turned away from the slip by 20° for a cube and by 31° for a flat box, and the sum over the
//! corners is 6 to 14 % short of μ m g.
//!
//! The solver takes a surface velocity u for every contact and iterates with v + u in place of v. With
//! `u = (2 / tr K) K v − v` the fixed point becomes `λ ∥ −v`. The velocity at the beginning of the step stands for v (that
//! of a kinematic tool is one step older): exact for steady slip, and 0 where nothing slips, so that sticking contacts do not creep.

use rapier3d::prelude::{ContactModificationContext, PhysicsHooks, RigidBody, Vector};

use crate::arm::LINK;

/// Square of a slip, m²/s², that has no direction.
const NO_SLIP: f32 = 1e-12;

/// Hook that makes friction oppose the slip; see the module.
pub(crate) struct OpposeSlip;

impl PhysicsHooks for OpposeSlip {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext) {
        oppose(context, 1.0);
    }
}

/// Makes friction oppose the slip as far as a cone of this shape does (see [`by_cone`]); 1: Coulomb's.
pub(crate) fn oppose(context: &mut ContactModificationContext, exponent: f32) {
    let bodies = context.bodies;
    let first = context.rigid_body1.and_then(|handle| bodies.get(handle));
    let second = context.rigid_body2.and_then(|handle| bodies.get(handle));
    // A link of the arm stands firm like a kinematic tool: its servos hold it, not its own small mass.
    let free = [first, second].map(|body| body.filter(|b| b.is_dynamic() && b.user_data != LINK));
    if free.iter().all(Option::is_none) {
        return;
    }
    let Some(manifold) = context.rigid_mut() else { return };
    let normal = *manifold.normal;
    for contact in manifold.solver_contacts.iter_mut() {
        let point = (contact.anchor1 + contact.anchor2) * 0.5;
        let velocity = |body: Option<&RigidBody>| body.map_or(Vector::ZERO, |b| b.velocity_at_point(point));
        let slip = velocity(first) - velocity(second);
        let slip = slip - normal * slip.dot(normal);
        if slip.length_squared() < NO_SLIP {
            continue;
        }
        let response =
            |along: Vector| free.into_iter().flatten().map(|body| response(body, point, along)).sum::<Vector>();
        // What friction opposes, as long as the slip.
        let opposed = if exponent == 1.0 { slip } else { by_cone(slip, exponent).normalize_or_zero() * slip.length() };
        // Two orthogonal tangents give K's trace; K v follows from linearity.
        let across = normal.cross(opposed);
        let k_slip = response(opposed);
        let k_slip = k_slip - normal * k_slip.dot(normal);
        let squared = slip.length_squared();
        let trace = (k_slip.dot(opposed) + response(across).dot(across)) / squared;
        contact.tangent_velocity = k_slip * (2.0 / trace) - slip;
    }
}

/// Direction that friction on a level table opposes, times the share of μ that it has, for a slip in it.
///
/// Friction of most dissipation in the unit ball of a p-norm in x and y: `g_i = sign(v_i) |v_i|^e / ‖v‖_(e+1)^e` with e = 1 / (p − 1). Coulomb's cone is
/// e = 1, a pyramid with its edges on the axes is e → ∞ (friction is less between the axes), one with its faces across them e → 0 (it is more).
fn by_cone(slip: Vector, exponent: f32) -> Vector {
    let largest = slip.x.abs().max(slip.y.abs());
    if largest == 0.0 {
        return Vector::ZERO;
    }
    let power = |v: f32| (v / largest).abs().powf(exponent);
    let (x, y) = (power(slip.x), power(slip.y));
    let norm = (x * (slip.x / largest).abs() + y * (slip.y / largest).abs()).powf(exponent / (exponent + 1.0));
    Vector::new(x.copysign(slip.x), y.copysign(slip.y), 0.0) / norm
}

/// Share of μ that friction on a level table has in a cone of this shape.
pub(crate) fn share(slip: Vector, exponent: f32) -> f32 {
    if exponent == 1.0 || slip.length_squared() < NO_SLIP { 1.0 } else { by_cone(slip, exponent).length() }
}

/// Velocity that a unit impulse `along` at `point` gives to that point of a free body.
fn response(body: &RigidBody, point: Vector, along: Vector) -> Vector {
    let mass = body.mass_properties();
    let arm = point - mass.world_com;
    let turn = mass.effective_world_inv_inertia * arm.cross(along);
    mass.effective_inv_mass * along + turn.cross(arm)
}
