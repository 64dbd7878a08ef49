//! Bodies of a world: what they are made of, and the shapes that the engine knows them by.

use std::sync::Arc;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    ActiveCollisionTypes, ActiveHooks, Ball, CoefficientCombineRule, ColliderBuilder, ColliderHandle, Cuboid, Cylinder,
    Group, InteractionGroups, InteractionTestMode, MassProperties, PhysicsWorld, RigidBody, RigidBodyBuilder,
    RigidBodyHandle, SharedShape, Vector,
};

use crate::config::WorldConfig;
use crate::effect::{BodyRole, HiddenBody};
use crate::prism::Prism;
use crate::state::BodyState;
use crate::theta::{ObjectShape, ObstacleTheta, Theta};
use crate::world::{pose, vector};

/// How far, m, the sole of a body on support points hangs above their ends.
pub(crate) const SOLE_GAP_M: f64 = 0.0003;
/// Radius, m, of a support point.
const SUPPORT_RADIUS_M: f64 = 0.002;
/// Cosine of the angle between a body's axis and the vertical beyond which it lies on a side.
const UPRIGHT: f64 = 0.5;
/// Height of a body's centre above the table, in its largest half extent, below which it touches the table.
const ON_TABLE: f64 = 1.1;
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
    /// Whether it stands on points and not on its sole.
    pub(crate) on_supports: bool,
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
    /// Radius of its edges and corners, m; 0: sharp. A prism's are.
    pub(crate) edge_radius_m: f64,
    pub(crate) beyond: Beyond,
}

/// What Θ cannot say of an object: the things of measured logs. Nothing of it by default.
#[derive(Clone, Debug, Default)]
pub(crate) struct Beyond {
    /// Whether it bears on four points, corners or points of its rim, that stay the same whatever contacts the engine finds.
    pub(crate) on_points: bool,
    /// What the shape is instead of that of Θ, which is a box around it.
    pub(crate) prism: Option<Arc<Prism>>,
    /// Inertia about the centre of mass along the object's axes, kg m²; `None`: that of a uniform solid.
    pub(crate) inertia_kgm2: Option<[f64; 3]>,
    /// Point mass at the centre of the shape, kg. It does not leak.
    pub(crate) added_mass_kg: f64,
}

impl BodySpec {
    pub(crate) fn object(theta: &Theta, support_share: Option<f64>, beyond: Beyond) -> Self {
        let o = &theta.object;
        let support_share = support_share.or(beyond.on_points.then_some(1.0));
        // A sphere bears on one point anyway.
        let support_share = support_share.filter(|_| o.shape != ObjectShape::Sphere);
        Self {
            shape: o.shape,
            size_m: o.size_m,
            mass_kg: o.mass_kg,
            com_m: o.com_m,
            friction: o.friction,
            support_share,
            edge_radius_m: 0.0,
            beyond,
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
            edge_radius_m: 0.0,
            beyond: Beyond::default(),
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
            edge_radius_m: 0.0,
            beyond: Beyond::default(),
        }
    }

    /// The same for a body that begins like this over a table whose top is at `table_m`. One that lies on a side has no support points: those of its sole
    /// would be bumps there.
    fn beginning(self, state: &BodyState, table_m: f64) -> Self {
        let axis = pose(state.position_m, state.orientation).rotation * Vector::Z;
        let [a, b, c] = self.shape.half_extents_m(self.size_m);
        let largest_m = a.max(b).max(c);
        let on_table = state.position_m[2] - table_m < ON_TABLE * largest_m;
        let support_share = self.support_share.filter(|_| !on_table || f64::from(axis.z).abs() > UPRIGHT);
        Self { support_share, ..self }
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

    /// Mass, kg, with what is added, when the body has the share `share` of its own left.
    pub(crate) fn total_mass_kg(&self, share: f64) -> f64 {
        self.mass_kg * share + self.beyond.added_mass_kg
    }

    /// Centre of mass, m, from the centre of the shape, likewise.
    fn total_com_m(&self, share: f64) -> [f64; 3] {
        if self.beyond.added_mass_kg == 0.0 {
            return self.com_m;
        }
        self.com_m.map(|com| com * self.mass_kg * share / self.total_mass_kg(share))
    }

    /// Mass properties of the share `share` of its mass.
    fn mass_properties(&self, share: f64) -> MassProperties {
        let added_kg = self.beyond.added_mass_kg;
        let principal = match (self.beyond.inertia_kgm2, &self.beyond.prism) {
            (Some(inertia), _) => Some(inertia),
            (None, None) => Some(self.inertia_kgm2()),
            // Its axes need not be the principal ones.
            (None, Some(_)) => None,
        };
        match principal {
            Some(inertia) if added_kg == 0.0 => MassProperties::new(
                vector(self.com_m),
                (self.mass_kg * share) as f32,
                vector(inertia.map(|v| v * share)),
            ),
            principal => {
                let own = match (principal, &self.beyond.prism) {
                    (None, Some(prism)) => prism.inertia_kgm2(self.mass_kg * share),
                    (principal, _) => Matrix3::from_diagonal(&Vector3::from(principal.unwrap_or_default())) * share,
                };
                // Parallel axes: a point mass at distance d from the body's centre of mass adds the reduced mass times d².
                let total_kg = self.total_mass_kg(share);
                let d = Vector3::from(self.com_m);
                let turned = Matrix3::identity() * d.norm_squared() - d * d.transpose();
                let moment = own + turned * (self.mass_kg * share * added_kg / total_kg);
                mass_properties(self.total_com_m(share), total_kg, &moment)
            }
        }
    }

    /// Leaves a body the share `share` of its mass.
    pub(crate) fn set_mass_share(&self, rigid: &mut RigidBody, share: f64) {
        rigid.set_additional_mass_properties(self.mass_properties(share), true);
    }

    /// Where the support points are, m, from the centre of the shape; none where it stands on its sole.
    fn support_points_m(&self) -> Vec<[f64; 2]> {
        if let Some(prism) = &self.beyond.prism {
            return prism.support_points_m(self.support_share);
        }
        let Some(share) = self.support_share else { return Vec::new() };
        let [a, b, _] = self.shape.half_extents_m(self.size_m).map(|half| share * (half - self.edge_radius_m));
        match self.shape {
            ObjectShape::Box => vec![[a, b], [a, -b], [-a, b], [-a, -b]],
            ObjectShape::Cylinder | ObjectShape::Sphere => vec![[a, 0.0], [-a, 0.0], [0.0, a], [0.0, -a]],
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
    let spec = spec.beginning(state, config.table_height_m);
    let pose = pose(state.position_m, state.orientation);
    let mut builder = if movable {
        let angular = vector(state.angular_rps);
        let arm = pose.transform_vector(vector(spec.total_com_m(1.0)));
        RigidBodyBuilder::dynamic()
            .linvel(vector(state.linear_mps) + angular.cross(arm))
            .angvel(angular)
            .can_sleep(false)
    } else {
        RigidBodyBuilder::fixed()
    };
    builder = builder.pose(pose).additional_mass_properties(spec.mass_properties(1.0));
    let supports_m = spec.support_points_m();
    let mut collider = main_collider(&spec, !supports_m.is_empty());
    if !movable {
        // A kinematic tool and a fixed body do not move each other, but the arm feels it (see `contact`).
        collider =
            collider.active_collision_types(ActiveCollisionTypes::default() | ActiveCollisionTypes::KINEMATIC_FIXED);
    }
    let (handle, collider) = physics.insert(builder, material(collider, spec.friction, config));
    let half_height_m = spec.shape.half_height_m(spec.size_m);
    let on_supports = !supports_m.is_empty();
    for [x, y] in supports_m {
        let end = ColliderBuilder::ball(SUPPORT_RADIUS_M as f32)
            .translation(vector([x, y, SUPPORT_RADIUS_M - half_height_m]))
            .density(0.0)
            .collision_groups(InteractionGroups::new(SUPPORT, TABLE, InteractionTestMode::And));
        physics.insert_collider(material(end, spec.friction, config), Some(handle));
    }
    Body { role, handle, collider, spec, half_height_m, dynamic: movable, on_supports }
}

fn main_collider(spec: &BodySpec, on_supports: bool) -> ColliderBuilder {
    if let Some(prism) = &spec.beyond.prism {
        return ColliderBuilder::new(prism.shape(on_supports)).density(0.0);
    }
    let (mut size_m, mut shift) = (spec.size_m, Vector::ZERO);
    if on_supports {
        let height = if spec.shape == ObjectShape::Box { &mut size_m[2] } else { &mut size_m[1] };
        *height -= SOLE_GAP_M;
        shift.z = (0.5 * SOLE_GAP_M) as f32;
    }
    ColliderBuilder::new(rounded_shape(spec.shape, size_m, spec.edge_radius_m))
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

/// A shape within the same faces whose edges and corners have a radius.
fn rounded_shape(shape: ObjectShape, size_m: [f64; 3], radius_m: f64) -> SharedShape {
    let radius = radius_m as f32;
    let [a, b, c] = size_m.map(|v| v as f32);
    match shape {
        ObjectShape::Box if radius > 0.0 => {
            SharedShape::round_cuboid(a / 2.0 - radius, b / 2.0 - radius, c / 2.0 - radius, radius)
        }
        ObjectShape::Cylinder if radius > 0.0 => SharedShape::round_cylinder(b / 2.0 - radius, a - radius, radius),
        _ => shared_shape(shape, size_m),
    }
}

/// parry's cylinders stand along y, ours along z.
pub(crate) fn shape_axis_angle(shape: ObjectShape) -> Vector {
    match shape {
        ObjectShape::Cylinder => Vector::new(std::f32::consts::FRAC_PI_2, 0.0, 0.0),
        ObjectShape::Box | ObjectShape::Sphere => Vector::ZERO,
    }
}

/// Of a mass whose `moment_kgm2` is about its centre of mass, axes of the body; diagonalised in double precision.
pub(crate) fn mass_properties(com_m: [f64; 3], mass_kg: f64, moment_kgm2: &Matrix3<f64>) -> MassProperties {
    let eigen = moment_kgm2.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let moments: Vector3<f64> = eigen.eigenvalues;
    MassProperties::with_principal_inertia_frame(
        vector(com_m),
        mass_kg as f32,
        vector(moments.into()),
        pose([0.0; 3], [turn.i, turn.j, turn.k, turn.w]).rotation,
    )
}
