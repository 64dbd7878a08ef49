//! What effects do to a live world in each control step: loads on bodies, mass, friction of contacts, attraction of the tool.

use rapier3d::geometry::NEW_CONTACT_BIT;
use rapier3d::parry::query;
use rapier3d::prelude::{
    ColliderHandle, ColliderSet, ContactModificationContext, PhysicsHooks, PhysicsWorld, RigidBody, RigidBodyHandle,
    SolverContact, Vector,
};

use crate::bodies::Body;
use crate::config::WorldConfig;
use crate::effect::{BodyView, Effects, Hooks, Load, Surroundings, TableContact};
use crate::friction::{oppose, share};
use crate::theta::ObjectShape;
use crate::world::{Wrench, array, vector};

/// Height over the resting height, m, up to which a body is on the table.
const ON_TABLE_M: f64 = 0.002;
/// Distance, m, up to which the engine is asked for the gap between tool and object.
const GAP_LIMIT_M: f32 = 0.002;

impl Effects<'_> {
    /// Mass and loads of a body during the coming control step.
    pub(crate) fn apply(self, physics: &mut PhysicsWorld, config: &WorldConfig, body: &Body, time_secs: f64) {
        if !body.dynamic {
            return;
        }
        let rigid = &mut physics.bodies[body.handle];
        let mut share = 1.0;
        if self.hooks.contains(Hooks::MASS) && body.role == crate::effect::BodyRole::Object {
            share = self.list.iter().map(|effect| effect.mass_share(time_secs)).product();
            body.spec.set_mass_share(rigid, share);
        }
        if !self.hooks.contains(Hooks::LOAD) {
            return;
        }
        let surroundings = Surroundings { gravity_mps2: config.gravity_mps2, period_secs: config.control_period_secs };
        let height = f64::from(rigid.translation().z) - config.table_height_m;
        let view = BodyView {
            role: body.role,
            mass_kg: body.spec.total_mass_kg(share),
            friction: body.spec.friction,
            rolling_radius_m: (body.spec.shape == ObjectShape::Sphere).then_some(body.spec.size_m[0]),
            on_table: height < body.half_height_m + ON_TABLE_M,
            position_m: array(rigid.translation()),
            linear_mps: array(rigid.linvel()),
            angular_rps: array(rigid.angvel()),
        };
        let mut load = Load::default();
        for effect in self.list {
            effect.load(&surroundings, &view, &mut load);
        }
        rigid.reset_forces(false);
        rigid.reset_torques(false);
        rigid.add_force(vector(load.force_n), true);
        rigid.add_torque(vector(load.torque_nm), true);
    }

    /// Pulls the object and the tool at their nearest points together; the wrench on the tool about its centre. After [`Self::apply`].
    pub(crate) fn attract(
        self,
        physics: &mut PhysicsWorld,
        object: &Body,
        tool: RigidBodyHandle,
        tool_colliders: &[ColliderHandle],
    ) -> Wrench {
        let Some((gap_m, at_tool, at_object, towards_object)) = nearest(&physics.colliders, tool_colliders, object)
        else {
            return Wrench::default();
        };
        let size: f64 = self.list.iter().map(|effect| effect.attraction(f64::from(gap_m))).sum();
        let on_tool = towards_object * size as f32;
        let loaded = self.hooks.contains(Hooks::LOAD);
        let rigid = &mut physics.bodies[object.handle];
        if !loaded {
            rigid.reset_forces(false);
            rigid.reset_torques(false);
        }
        rigid.add_force_at_point(-on_tool, at_object, true);
        let rigid = &mut physics.bodies[tool];
        let arm = at_tool - rigid.translation();
        if rigid.is_dynamic() {
            rigid.add_force(on_tool, true);
        }
        Wrench { force_n: array(on_tool), torque_nm: array(arm.cross(on_tool)) }
    }
}

/// Gap, m, between tool and object, the nearest points of both, and the direction from the tool to the object.
fn nearest(
    colliders: &ColliderSet,
    tool_colliders: &[ColliderHandle],
    object: &Body,
) -> Option<(f32, Vector, Vector, Vector)> {
    let other = &colliders[object.collider];
    let contacts = tool_colliders.iter().filter_map(|handle| {
        let part = &colliders[*handle];
        query::contact(part.position(), part.shape(), other.position(), other.shape(), GAP_LIMIT_M).ok().flatten()
    });
    let contact = contacts.min_by(|a, b| a.dist.total_cmp(&b.dist))?;
    Some((contact.dist, contact.point1, contact.point2, contact.normal1))
}

/// Hook of a world whose contacts have other friction than their materials.
pub(crate) struct ContactFriction<'a> {
    pub(crate) effects: Effects<'a>,
    pub(crate) table: ColliderHandle,
    pub(crate) rig: Option<RigFriction>,
}

/// What the contacts of a rig have beyond their materials: the pair tool–object has its own coefficient, and bounces have all of their friction.
///
/// The engine adds the impulse of restitution after the friction of a step, so that a body that bounces is held back by μ times the first part
/// of the normal impulse alone, 1 / (1 + e) of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigFriction {
    /// Tool and object.
    pub(crate) pair: [RigidBodyHandle; 2],
    /// Of that pair.
    pub(crate) coefficient: f32,
    /// What gravity adds to a speed in a step, m/s.
    pub(crate) fall_mps: f32,
    /// Slip below which friction of that pair is in proportion to it, m/s; 0: never.
    pub(crate) slip_mps: f32,
    /// Shape of the cone of friction on the table (see [`crate::friction`]); 1: Coulomb's.
    pub(crate) exponent: f32,
}

impl RigFriction {
    fn set(&self, context: &mut ContactModificationContext) {
        let (bodies, found) = (context.bodies, [context.rigid_body1, context.rigid_body2]);
        let [first, second] = found.map(|handle| handle.and_then(|handle| bodies.get(handle)));
        let Some(manifold) = context.rigid_mut() else { return };
        let [a, b] = self.pair.map(Some);
        let normal = *manifold.normal;
        let velocity = |contact: &SolverContact| {
            let point = (contact.anchor1 + contact.anchor2) * 0.5;
            let of = |body: Option<&RigidBody>| body.map_or(Vector::ZERO, |b| b.velocity_at_point(point));
            of(first) - of(second)
        };
        if found == [a, b] || found == [b, a] {
            *manifold.friction = self.coefficient;
            if self.slip_mps > 0.0 {
                let slip = |contact: &SolverContact| velocity(contact).reject_from_normalized(normal).length();
                let fastest = manifold.solver_contacts.iter().map(slip).fold(0.0, f32::max);
                *manifold.friction *= (fastest / self.slip_mps).min(1.0);
            }
        }
        if *manifold.restitution == 0.0 || manifold.solver_contacts.is_empty() {
            return;
        }
        let bounce = |contact: &SolverContact| {
            // As the engine decides: what was pushed before rests.
            if contact.contact_id[0] & NEW_CONTACT_BIT == 0 {
                return 0.0;
            }
            let speed = velocity(contact).dot(normal).max(0.0);
            // The rest of the first part is what holds the weight.
            speed / (speed + self.fall_mps)
        };
        let mean = manifold.solver_contacts.iter().map(bounce).sum::<f32>() / manifold.solver_contacts.len() as f32;
        *manifold.friction *= 1.0 + *manifold.restitution * mean;
    }
}

impl PhysicsHooks for ContactFriction<'_> {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext) {
        if let Some(rig) = &self.rig {
            rig.set(context);
        }
        let body = match self.table {
            table if table == context.collider1 => context.rigid_body2,
            table if table == context.collider2 => context.rigid_body1,
            _ => None,
        };
        let body = body.and_then(|handle| context.bodies.get(handle)).filter(|body| body.is_dynamic());
        let exponent = self.rig.filter(|_| body.is_some()).map_or(1.0, |rig| rig.exponent);
        if (self.effects.hooks.contains(Hooks::FRICTION) || exponent != 1.0)
            && let Some(body) = body
            && let Some(manifold) = context.rigid_mut()
            && !manifold.solver_contacts.is_empty()
        {
            let normal = *manifold.normal;
            let factor = |point: Vector| {
                let velocity = body.velocity_at_point(point);
                let slip = velocity - normal * velocity.dot(normal);
                let contact = TableContact { position_m: array(point), slip_mps: array(slip) };
                f64::from(share(slip, exponent))
                    * self.effects.list.iter().map(|effect| effect.friction(&contact)).product::<f64>()
            };
            // The engine has one coefficient for all points of two shapes.
            let sum: f64 = manifold.solver_contacts.iter().map(|c| factor((c.anchor1 + c.anchor2) * 0.5)).sum();
            *manifold.friction *= (sum / manifold.solver_contacts.len() as f64) as f32;
        }
        oppose(context, exponent);
    }
}
