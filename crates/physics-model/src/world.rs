//! A rapier world built afresh from (s, Θ).
//!
//! A world is never reset in place: setting poses in a used world leaves solver caches behind, so that its future would
//! depend on its past. A fresh one costs about a microsecond and is a pure function of (s, Θ).
//!
//! Friction is rapier's Coulomb model with contact recycling off: the default model puts friction at the unweighted centre
//! of the contacts, which hides the centre of mass, and recycled contacts change friction.

use rapier3d::prelude::{
    ActiveCollisionTypes, ActiveHooks, Ball, CoefficientCombineRule, ColliderBuilder, ColliderHandle, Cuboid, Cylinder,
    FrictionModel, MassProperties, PhysicsWorld, Pose, RigidBodyBuilder, RigidBodyHandle, Rotation, SharedShape,
    SpringCoefficients, Vector,
};
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::config::{ObstacleMobility, ServoConfig, WorldConfig};
use crate::contact::{lowest_point, table_wrench, tool_wrench, touches};
use crate::effect::{BodyView, Effect, Load, Surroundings};
use crate::friction::OpposeSlip;
use crate::robot::{Robot, ToolShape};
use crate::state::BodyState;
use crate::theta::{ObjectShape, Theta};

/// Fastest body, m/s, that a push of 0.1 m/s can plausibly cause.
const SPEED_LIMIT_MPS: f64 = 5.0;
/// Height over the table, m, below which a body's centre has sunk into it.
const SUNK_LIMIT_M: f64 = 0.004;

/// Pose of the tool: position in m and unit quaternion x, y, z, w, base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolPose {
    /// Tool centre, m.
    pub position_m: [f64; 3],
    /// R(base ← tool).
    pub orientation: [f64; 4],
}

/// Force and torque that the world exerts on the tool, about the tool centre, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Torque about the tool centre, N·m.
    pub torque_nm: [f64; 3],
}

impl Wrench {
    /// Adds `weight` times `other`.
    pub fn add_scaled(&mut self, other: &Self, weight: f64) {
        for i in 0..3 {
            self.force_n[i] += weight * other.force_n[i];
            self.torque_nm[i] += weight * other.torque_nm[i];
        }
    }

    /// Magnitude of the force, N.
    #[must_use]
    pub fn force_magnitude_n(&self) -> f64 {
        self.force_n.iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

struct Body {
    handle: RigidBodyHandle,
    collider: ColliderHandle,
    shape: ObjectShape,
    mass_kg: f64,
    half_height_m: f64,
    radius_m: f64,
    dynamic: bool,
}

/// What a simulation must not end in: no push of 0.1 m/s does this to rigid bodies, so that the hypothesis is not a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Divergence {
    /// A pose or velocity is not finite.
    NotFinite,
    /// A body is faster than 5 m/s.
    Flies,
    /// A body's centre has sunk into the table.
    Sank,
    /// Two bodies overlap by more than [`crate::feasible::OVERLAP_LIMIT_M`].
    Overlaps,
}

/// A live world: table, tool, object and perhaps an obstacle.
pub struct World<'a> {
    config: &'a WorldConfig,
    effects: &'a [Box<dyn Effect>],
    physics: PhysicsWorld,
    tool: RigidBodyHandle,
    tool_colliders: Vec<ColliderHandle>,
    /// Lowest point of the tool from its centre, m, base axes.
    tool_lowest: Vector,
    normal_n: [f64; 3],
    object: Body,
    obstacle: Option<Body>,
    arm: Option<Arm<'a>>,
}

impl<'a> World<'a> {
    /// Builds the world of `theta` in the state given by the bodies and the tool pose. Values must have passed
    /// [`crate::feasible::check_theta`].
    #[must_use]
    pub fn restore(
        config: &'a WorldConfig,
        effects: &'a [Box<dyn Effect>],
        theta: &Theta,
        object: &BodyState,
        obstacle: Option<&BodyState>,
        tool: &ToolPose,
        tool_shapes: &[ToolShape],
    ) -> Self {
        let mut physics = PhysicsWorld::new();
        let mut gravity = [0.0, 0.0, -config.gravity_mps2];
        for effect in effects {
            effect.gravity(&mut gravity);
        }
        physics.gravity = vector(gravity);
        let parameters = &mut physics.integration_parameters;
        parameters.dt = config.control_period_secs as f32;
        parameters.num_solver_iterations = config.solver_iterations as usize;
        parameters.friction_model = FrictionModel::Coulomb;
        parameters.contact_recycling = false;
        parameters.contact_clustering = false;
        parameters.max_ccd_substeps = 0;
        // The size of the things that are pushed: with rapier's metre, pairs are looked into from 8 cm apart, at a quarter more time.
        parameters.length_unit = 0.1;
        parameters.normalized_max_corrective_velocity *= 10.0;
        let softness = SpringCoefficients {
            natural_frequency: config.contact_frequency_hz as f32,
            damping_ratio: config.contact_damping_ratio as f32,
        };
        parameters.contact_softness = softness;
        parameters.static_contact_softness = softness;

        physics.insert(
            RigidBodyBuilder::fixed().translation(vector([0.0, 0.0, config.table_height_m])),
            material(ColliderBuilder::new(SharedShape::halfspace(Vector::Z)), 1.0, config),
        );
        let object_body = insert_body(&mut physics, config, true, &BodySpec::object(theta), object);
        let obstacle_body = match (&theta.obstacle, obstacle) {
            (Some(parameters), Some(state)) => {
                let spec = BodySpec {
                    shape: parameters.shape,
                    size_m: parameters.size_m,
                    mass_kg: parameters.mass_kg,
                    com_m: [0.0; 3],
                    friction: config.obstacle_friction,
                };
                let movable = config.obstacle_mobility == ObstacleMobility::Movable;
                Some(insert_body(&mut physics, config, movable, &spec, state))
            }
            _ => None,
        };
        let tool_body = physics
            .insert_body(RigidBodyBuilder::kinematic_position_based().pose(pose(tool.position_m, tool.orientation)));
        let tool_colliders = tool_shapes
            .iter()
            .map(|shape| {
                let builder = match shape {
                    ToolShape::Ball { center_m, radius_m } => {
                        ColliderBuilder::ball(*radius_m as f32).translation(vector(*center_m))
                    }
                    ToolShape::Capsule { a_m, b_m, radius_m } => {
                        ColliderBuilder::capsule_from_endpoints(vector(*a_m), vector(*b_m), *radius_m as f32)
                    }
                };
                physics.insert_collider(material(builder, config.tool_friction, config), Some(tool_body))
            })
            .collect();
        Self {
            config,
            effects,
            physics,
            tool: tool_body,
            tool_colliders,
            tool_lowest: lowest_point(tool, tool_shapes),
            normal_n: [0.0; 3],
            object: object_body,
            obstacle: obstacle_body,
            arm: None,
        }
    }

    /// The same world with the tool on a dynamic arm, at rest at `joints_rad`, which must be those of the tool's pose. Only for a
    /// world that has not made a step.
    ///
    /// # Panics
    ///
    /// If `joints_rad` has not one value per joint.
    #[must_use]
    pub fn with_dynamic_arm(mut self, robot: &'a Robot, servo: &ServoConfig, joints_rad: &[f64]) -> Self {
        self.arm = Some(Arm::new(&mut self.physics, self.tool, robot, servo, joints_rad));
        self
    }

    /// Advances one control step, at whose end the tool is at `position_m` (base frame); its orientation stays.
    /// Returns the mean wrench on the tool during the step.
    pub fn step(&mut self, position_m: [f64; 3]) -> Wrench {
        self.apply_effects();
        self.physics.bodies[self.tool].set_next_kinematic_translation(vector(position_m));
        self.physics.step_with_events(&OpposeSlip, &());
        let mut wrench = self.tool_wrench(position_m, self.config.arm_stiffness_npm);
        let table = table_wrench(self.config, position_m, self.tool_lowest);
        wrench.add_scaled(&table, 1.0);
        self.normal_n[2] += table.force_n[2];
        wrench
    }

    /// The part of the last step's force on the tool that acts along the contact normals, N: without friction.
    #[must_use]
    pub fn normal_force_n(&self) -> [f64; 3] {
        self.normal_n
    }

    /// Advances one control step, at whose end the dynamic arm's joints are commanded to be at `joints_rad`. Returns the mean wrench on
    /// the tool during the step, about the centre that the tool has then.
    ///
    /// # Panics
    ///
    /// In a world without a dynamic arm.
    pub fn step_arm(&mut self, joints_rad: &[f64]) -> Wrench {
        self.apply_effects();
        let arm = self.arm.as_mut().expect("a world with a dynamic arm");
        arm.command(&mut self.physics, joints_rad);
        self.physics.step_with_events(&OpposeSlip, &());
        // This arm's stiffness is that of its servos.
        self.tool_wrench(self.tool_position_m(), 0.0)
    }

    fn tool_wrench(&mut self, center_m: [f64; 3], stiffness_npm: f64) -> Wrench {
        let (physics, period_secs) = (&self.physics, self.config.control_period_secs);
        let tool = &self.tool_colliders;
        let (wrench, normal_n) =
            tool_wrench(&physics.narrow_phase, &physics.colliders, tool, center_m, period_secs, stiffness_npm);
        self.normal_n = normal_n;
        wrench
    }

    /// Joint positions of the dynamic arm, rad.
    #[must_use]
    pub fn arm_joints_rad(&self) -> Option<Vec<f64>> {
        self.arm.as_ref().map(|arm| arm.joints_rad(&self.physics))
    }

    /// Where the tool centre is, m, base frame.
    #[must_use]
    pub fn tool_position_m(&self) -> [f64; 3] {
        array(self.physics.bodies[self.tool].translation())
    }

    /// State of the object.
    #[must_use]
    pub fn object(&self) -> BodyState {
        self.body_state(&self.object)
    }

    /// State of the obstacle.
    #[must_use]
    pub fn obstacle(&self) -> Option<BodyState> {
        self.obstacle.as_ref().map(|body| self.body_state(body))
    }

    /// Why the world as it is now makes its hypothesis impossible, if it does. Overlaps are not looked for here: see
    /// [`crate::feasible::check_overlaps`].
    #[must_use]
    pub fn divergence(&self) -> Option<Divergence> {
        if self.arm_joints_rad().is_some_and(|joints| joints.iter().any(|v| !v.is_finite())) {
            return Some(Divergence::NotFinite);
        }
        for body in std::iter::once(&self.object).chain(&self.obstacle) {
            let state = self.body_state(body);
            if !state.to_array().iter().all(|v| v.is_finite()) {
                return Some(Divergence::NotFinite);
            }
            if state.linear_mps.iter().map(|v| v * v).sum::<f64>().sqrt() > SPEED_LIMIT_MPS {
                return Some(Divergence::Flies);
            }
            if state.position_m[2] < self.config.table_height_m + SUNK_LIMIT_M {
                return Some(Divergence::Sank);
            }
        }
        None
    }

    /// Whether the object or the tool touches the obstacle.
    #[must_use]
    pub fn obstacle_touched(&self) -> bool {
        self.obstacle.as_ref().is_some_and(|obstacle| {
            std::iter::once(&self.object.collider)
                .chain(&self.tool_colliders)
                .any(|other| self.physics.narrow_phase.contact_pair(obstacle.collider, *other).is_some_and(touches))
        })
    }

    fn apply_effects(&mut self) {
        if self.effects.is_empty() {
            return;
        }
        let surroundings =
            Surroundings { gravity_mps2: self.config.gravity_mps2, period_secs: self.config.control_period_secs };
        for body in std::iter::once(&self.object).chain(&self.obstacle) {
            if !body.dynamic {
                continue;
            }
            let rigid = &mut self.physics.bodies[body.handle];
            let height = f64::from(rigid.translation().z) - self.config.table_height_m;
            let view = BodyView {
                mass_kg: body.mass_kg,
                rolling_radius_m: (body.shape == ObjectShape::Sphere).then_some(body.radius_m),
                on_table: height < body.half_height_m + 0.002,
                linear_mps: array(rigid.linvel()),
                angular_rps: array(rigid.angvel()),
            };
            let mut load = Load::default();
            for effect in self.effects {
                effect.load(&surroundings, &view, &mut load);
            }
            rigid.reset_forces(false);
            rigid.reset_torques(false);
            rigid.add_force(vector(load.force_n), true);
            rigid.add_torque(vector(load.torque_nm), true);
        }
    }

    fn body_state(&self, body: &Body) -> BodyState {
        let rigid = &self.physics.bodies[body.handle];
        let rotation = rigid.rotation();
        let angular = rigid.angvel();
        // rapier's linear velocity is that of the centre of mass; ours is that of the centre of the shape.
        let arm = rigid.translation() - rigid.center_of_mass();
        BodyState {
            position_m: array(rigid.translation()),
            orientation: [rotation.x, rotation.y, rotation.z, rotation.w].map(f64::from),
            linear_mps: array(rigid.linvel() + angular.cross(arm)),
            angular_rps: array(angular),
        }
    }
}

struct BodySpec {
    shape: ObjectShape,
    size_m: [f64; 3],
    mass_kg: f64,
    com_m: [f64; 3],
    friction: f64,
}

impl BodySpec {
    fn object(theta: &Theta) -> Self {
        let o = &theta.object;
        Self { shape: o.shape, size_m: o.size_m, mass_kg: o.mass_kg, com_m: o.com_m, friction: o.friction }
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
}

fn insert_body(
    physics: &mut PhysicsWorld,
    config: &WorldConfig,
    movable: bool,
    spec: &BodySpec,
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
    builder = builder.pose(pose).additional_mass_properties(MassProperties::new(
        vector(spec.com_m),
        spec.mass_kg as f32,
        vector(spec.inertia_kgm2()),
    ));
    let mut collider =
        ColliderBuilder::new(shared_shape(spec.shape, spec.size_m)).rotation(shape_axis_angle(spec.shape)).density(0.0);
    if !movable {
        // A kinematic tool and a fixed body do not move each other, but the arm feels it (see `contact`).
        collider =
            collider.active_collision_types(ActiveCollisionTypes::default() | ActiveCollisionTypes::KINEMATIC_FIXED);
    }
    let (handle, collider) = physics.insert(builder, material(collider, spec.friction, config));
    Body {
        handle,
        collider,
        shape: spec.shape,
        mass_kg: spec.mass_kg,
        half_height_m: spec.shape.half_height_m(spec.size_m),
        radius_m: spec.size_m[0],
        dynamic: movable,
    }
}

fn material(builder: ColliderBuilder, friction: f64, config: &WorldConfig) -> ColliderBuilder {
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

pub(crate) fn vector(v: [f64; 3]) -> Vector {
    Vector::new(v[0] as f32, v[1] as f32, v[2] as f32)
}

pub(crate) fn array(v: Vector) -> [f64; 3] {
    [v.x, v.y, v.z].map(f64::from)
}

pub(crate) fn pose(position_m: [f64; 3], orientation: [f64; 4]) -> Pose {
    let [x, y, z, w] = orientation.map(|v| v as f32);
    Pose::from_parts(vector(position_m), Rotation::from_xyzw(x, y, z, w).normalize())
}
