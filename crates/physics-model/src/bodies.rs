//! Bodies of a world: what they are made of, and the shapes that the engine knows them by.

use rapier3d::prelude::{
    ActiveCollisionTypes, ActiveHooks, Ball, CoefficientCombineRule, ColliderBuilder, ColliderHandle, Cuboid, Cylinder,
    Group, InteractionGroups, InteractionTestMode, MassProperties, PhysicsWorld, RigidBody, RigidBodyBuilder,
    RigidBodyHandle, SharedShape, Vector,
};

use crate::config::WorldConfig;
use crate::effect::{BodyRole, HiddenBody};
use crate::state::BodyState;
use crate::theta::{ObjectShape, ObstacleTheta, Theta};
use crate::world::{pose, vector};

/// How far, m, the sole of a body on support points hangs above their ends.
const SOLE_GAP_M: f64 = 0.0003;
/// Radius, m, of a support point.
const SUPPORT_RADIUS_M: f64 = 0.002;
/// Collision groups of the table and of support points, which touch nothing else.
const TABLE: Group = Group::GROUP_1;
const SUPPORT: Group = Group::GROUP_2;

/// A body of a world, with what the engine would have to be asked for.
pub(crate) struct Body {
    pub(crate) role: BodyRole,
    pub(crate) handle: RigidBodyHandle,
    pub(crate) collider: ColliderHandle,
    pub(crate) spec: BodySpec,
    pub(crate) half_height_m: f64,
    pub(crate) dynamic: bool,
}

/// What a body is made of.
pub(crate) struct BodySpec {
    pub(crate) shape: ObjectShape,
    pub(crate) size_m: [f64; 3],
    pub(crate) mass_kg: f64,
    pub(crate) com_m: [f64; 3],
    pub(crate) friction: f64,
    /// Where it bears on the table (see [`crate::effect::Nominal::support_share`]).
    pub(crate) support_share: Option<f64>,
}

impl BodySpec {
    pub(crate) fn object(theta: &Theta, support_share: Option<f64>) -> Self {
        let o = &theta.object;
        // A sphere bears on one point anyway.
        let support_share = support_share.filter(|_| o.shape != ObjectShape::Sphere);
        Self {
            shape: o.shape,
            size_m: o.size_m,
            mass_kg: o.mass_kg,
            com_m: o.com_m,
            friction: o.friction,
            support_share,
        }
    }

    pub(crate) fn obstacle(theta: &ObstacleTheta, config: &WorldConfig) -> Self {
        Self {
            shape: theta.shape,
            size_m: theta.size_m,
            mass_kg: theta.mass_kg,
            com_m: [0.0; 3],
            friction: config.obstacle_friction,
            support_share: None,
        }
    }

    pub(crate) fn hidden(body: &HiddenBody, config: &WorldConfig) -> Self {
        Self {
            shape: body.shape,
            size_m: body.size_m,
            mass_kg: body.mass_kg,
            com_m: [0.0; 3],
            friction: config.obstacle_friction,
            support_share: None,
        }
    }

    /// Principal inertia, kg m², of a uniform solid about its centre, body axes.
    fn inertia_kgm2(&self) -> [f64; 3] {
        let m = self.mass_kg;
        let [a, b, c] = self.size_m;
        match self.shape {
            ObjectShape::Box => [b * b + c * c, a * a + c * c, a * a + b * b].map(|v| m * v / 12.0),
            ObjectShape::Cylinder => {
                let across = m * (3.0 * a * a + b * b) / 12.0;
                [across, across, m * a * a / 2.0]
            }
            ObjectShape::Sphere => [0.4 * m * a * a; 3],
        }
    }

    /// Mass properties of the share `share` of its mass.
    fn mass_properties(&self, share: f64) -> MassProperties {
        MassProperties::new(
            vector(self.com_m),
            (self.mass_kg * share) as f32,
            vector(self.inertia_kgm2().map(|v| v * share)),
        )
    }

    /// Leaves a body the share `share` of its mass.
    pub(crate) fn set_mass_share(&self, rigid: &mut RigidBody, share: f64) {
        rigid.set_additional_mass_properties(self.mass_properties(share), true);
    }

    /// Where the support points are, m, from the centre of the shape.
    fn support_points_m(&self, share: f64) -> [[f64; 2]; 4] {
        let [a, b, _] = self.shape.half_extents_m(self.size_m).map(|half| share * half);
        match self.shape {
            ObjectShape::Box => [[a, b], [a, -b], [-a, b], [-a, -b]],
            ObjectShape::Cylinder | ObjectShape::Sphere => [[a, 0.0], [-a, 0.0], [0.0, a], [0.0, -a]],
        }
    }
}

pub(crate) fn insert_body(
    physics: &mut PhysicsWorld,
    config: &WorldConfig,
    role: BodyRole,
    movable: bool,
    spec: BodySpec,
    state: &BodyState,
) -> Body {
    let pose = pose(state.position_m, state.orientation);
    let mut builder = if movable {
        let angular = vector(state.angular_rps);
        let arm = pose.transform_vector(vector(spec.com_m));
        RigidBodyBuilder::dynamic()
            .linvel(vector(state.linear_mps) + angular.cross(arm))
            .angvel(angular)
            .can_sleep(false)
    } else {
        RigidBodyBuilder::fixed()
    };
    builder = builder.pose(pose).additional_mass_properties(spec.mass_properties(1.0));
    let mut collider = main_collider(&spec);
    if !movable {
        // A kinematic tool and a fixed body do not move each other, but the arm feels it (see `contact`).
        collider =
            collider.active_collision_types(ActiveCollisionTypes::default() | ActiveCollisionTypes::KINEMATIC_FIXED);
    }
    let (handle, collider) = physics.insert(builder, material(collider, spec.friction, config));
    let half_height_m = spec.shape.half_height_m(spec.size_m);
    if let Some(share) = spec.support_share {
        for [x, y] in spec.support_points_m(share) {
            let end = ColliderBuilder::ball(SUPPORT_RADIUS_M as f32)
                .translation(vector([x, y, SUPPORT_RADIUS_M - half_height_m]))
                .density(0.0)
                .collision_groups(InteractionGroups::new(SUPPORT, TABLE, InteractionTestMode::And));
            physics.insert_collider(material(end, spec.friction, config), Some(handle));
        }
    }
    Body { role, handle, collider, spec, half_height_m, dynamic: movable }
}

fn main_collider(spec: &BodySpec) -> ColliderBuilder {
    let (mut size_m, mut shift) = (spec.size_m, Vector::ZERO);
    if spec.support_share.is_some() {
        let height = if spec.shape == ObjectShape::Box { &mut size_m[2] } else { &mut size_m[1] };
        *height -= SOLE_GAP_M;
        shift.z = (0.5 * SOLE_GAP_M) as f32;
    }
    ColliderBuilder::new(shared_shape(spec.shape, size_m))
        .translation(shift)
        .rotation(shape_axis_angle(spec.shape))
        .density(0.0)
}

/// Lets support points, if there are any, touch the table alone.
pub(crate) fn separate_supports(physics: &mut PhysicsWorld, table: ColliderHandle) {
    for (handle, collider) in physics.colliders.iter_mut() {
        if collider.collision_groups().memberships == SUPPORT {
            continue;
        }
        let memberships = if handle == table { TABLE } else { Group::ALL.difference(TABLE) };
        collider.set_collision_groups(InteractionGroups::new(memberships, Group::ALL, InteractionTestMode::And));
    }
}

pub(crate) fn material(builder: ColliderBuilder, friction: f64, config: &WorldConfig) -> ColliderBuilder {
    builder
        .friction(friction as f32)
        .active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS)
        .friction_combine_rule(CoefficientCombineRule::Min)
        .restitution(config.restitution as f32)
        .restitution_combine_rule(CoefficientCombineRule::Max)
}

pub(crate) fn shared_shape(shape: ObjectShape, size_m: [f64; 3]) -> SharedShape {
    let [a, b, c] = size_m.map(|v| v as f32);
    match shape {
        ObjectShape::Box => SharedShape::new(Cuboid::new(Vector::new(a, b, c) / 2.0)),
        ObjectShape::Cylinder => SharedShape::new(Cylinder::new(b / 2.0, a)),
        ObjectShape::Sphere => SharedShape::new(Ball::new(a)),
    }
}

/// parry's cylinders stand along y, ours along z.
pub(crate) fn shape_axis_angle(shape: ObjectShape) -> Vector {
    match shape {
        ObjectShape::Cylinder => Vector::new(std::f32::consts::FRAC_PI_2, 0.0, 0.0),
        ObjectShape::Box | ObjectShape::Sphere => Vector::ZERO,
    }
}
