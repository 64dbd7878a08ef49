//! A rapier world built afresh from (s, Θ).
//!
//! A world is never reset in place: setting poses in a used world leaves solver caches behind, so that its future would
//! depend on its past. A fresh one costs about a microsecond and is a pure function of (s, Θ).
//!
//! Friction is rapier's Coulomb model with contact recycling off: the default model puts friction at the unweighted centre
//! of the contacts, which hides the centre of mass, and recycled contacts change friction.

use rapier3d::prelude::{
    ColliderBuilder, ColliderHandle, FrictionModel, LockedAxes, PhysicsHooks, PhysicsWorld, Pose, RigidBodyBuilder,
    RigidBodyHandle, Rotation, SharedShape, SpringCoefficients, Vector,
};
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::bodies::{Beyond, Body, BodySpec, insert_body, material, separate_supports};
use crate::config::{ObstacleMobility, ServoConfig, WorldConfig};
use crate::contact::{lowest_point, table_wrench, tool_wrench, touches};
use crate::effect::{BodyRole, Effect, Effects, Hooks, Memory, Nominal};
use crate::friction::OpposeSlip;
use crate::loads::{ContactFriction, RigFriction};
use crate::robot::{Robot, ToolShape};
use crate::spring::ToolSpring;
use crate::state::BodyState;
use crate::theta::Theta;

/// What bodies may do in a world that is one.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Fastest body, m/s.
    speed_mps: f64,
    /// Height over the table, m, below which a body's centre has sunk into it.
    sunk_m: f64,
}

/// What a push of 0.1 m/s can plausibly cause.
const PUSH_LIMITS: Limits = Limits { speed_mps: 5.0, sunk_m: 0.004 };
/// What a toss can, below the 40 m/s at which the engine cuts velocities off. It ends within a step's way of the table, and a thin thing may start
/// by a reading's error below it.
const RIG_LIMITS: Limits = Limits { speed_mps: 30.0, sunk_m: -0.05 };
/// Friction of the table: above that of whatever stands on it, for the smaller one counts.
const TABLE_FRICTION: f64 = 1e6;

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

/// What a simulation must not end in: no push of 0.1 m/s does this to rigid bodies, so that the hypothesis is not a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Divergence {
    /// A pose or velocity is not finite.
    NotFinite,
    /// A body is faster than 5 m/s (30 m/s in a rig, see [`crate::rig`]).
    Flies,
    /// A body's centre has sunk into the table.
    Sank,
    /// Two bodies overlap by more than [`crate::feasible::OVERLAP_LIMIT_M`].
    Overlaps,
}

/// A live world: table, tool, object and perhaps an obstacle.
pub struct World<'a> {
    config: WorldConfig,
    effects: Effects<'a>,
    physics: PhysicsWorld,
    table: ColliderHandle,
    tool: RigidBodyHandle,
    tool_colliders: Vec<ColliderHandle>,
    /// Lowest point of the tool from its centre, m, base axes.
    tool_lowest: Vector,
    normal_n: [f64; 3],
    object: Body,
    obstacle: Option<Body>,
    /// Bodies that only effects know of.
    hidden: Vec<Body>,
    arm: Option<Arm<'a>>,
    spring: Option<ToolSpring>,
    /// Since the episode began.
    time_secs: f64,
    limits: Limits,
    rig_friction: Option<RigFriction>,
}

/// The object of a world, and the obstacle.
struct Hypothesis<'h> {
    theta: &'h Theta,
    beyond: Beyond,
}

impl<'a> World<'a> {
    /// Builds the world of `theta` in the state given by the bodies and the tool pose. Values must have passed
    /// [`crate::feasible::check_theta`]; those of effects are the ones in `effects`, not in `theta`.
    #[must_use]
    pub fn restore(
        config: &WorldConfig,
        effects: &'a [Box<dyn Effect>],
        theta: &Theta,
        object: &BodyState,
        obstacle: Option<&BodyState>,
        tool: &ToolPose,
        tool_shapes: &[ToolShape],
    ) -> Self {
        let hypothesis = Hypothesis { theta, beyond: Beyond::default() };
        Self::build(config, effects, hypothesis, object, obstacle, tool, tool_shapes)
    }

    /// The world of a rig: an object that may be more than Θ can say, wider limits, and `tool_friction` is that of the pair tool–object whatever
    /// the object's own.
    pub(crate) fn restore_rig(
        config: &WorldConfig,
        effects: &'a [Box<dyn Effect>],
        theta: &Theta,
        beyond: Beyond,
        object: &BodyState,
        tool: &ToolPose,
        tool_shapes: &[ToolShape],
    ) -> Self {
        let mut world = Self::build(config, effects, Hypothesis { theta, beyond }, object, None, tool, tool_shapes);
        world.limits = RIG_LIMITS;
        let fall_mps = world.config.gravity_mps2 * world.config.control_period_secs;
        world.rig_friction = Some(RigFriction {
            pair: [world.tool, world.object.handle],
            coefficient: world.config.tool_friction as f32,
            fall_mps: fall_mps as f32,
            slip_mps: 0.0,
            exponent: 1.0,
        });
        world
    }

    /// The same with the friction of a rig, see [`crate::rig::Rig::tool_slip_mps`] and [`crate::rig::Rig::cone_exponent`].
    pub(crate) fn sliding(mut self, tool_slip_mps: f64, cone_exponent: f64) -> Self {
        let (slip_mps, exponent) = (tool_slip_mps as f32, cone_exponent as f32);
        self.rig_friction = self.rig_friction.map(|friction| RigFriction { slip_mps, exponent, ..friction });
        self
    }

    fn build(
        config: &WorldConfig,
        effects: &'a [Box<dyn Effect>],
        hypothesis: Hypothesis,
        object: &BodyState,
        obstacle: Option<&BodyState>,
        tool: &ToolPose,
        tool_shapes: &[ToolShape],
    ) -> Self {
        let Hypothesis { theta, beyond } = hypothesis;
        let changed = Nominal::with_effects(config, theta, effects);
        let (config, theta) = changed.as_ref().map_or((config, theta), |nominal| (&nominal.world, &nominal.theta));
        let support_share = changed.as_ref().and_then(|nominal| nominal.support_share);
        let edge_radius_m = changed.as_ref().map_or(0.0, |nominal| nominal.edge_radius_m);
        let mut physics = engine(config, effects);
        let (_, table) = physics.insert(
            RigidBodyBuilder::fixed().translation(vector([0.0, 0.0, config.table_height_m])),
            material(ColliderBuilder::new(SharedShape::halfspace(Vector::Z)), TABLE_FRICTION, config),
        );
        let spec = BodySpec { edge_radius_m, ..BodySpec::object(theta, support_share, beyond) };
        let object = insert_body(&mut physics, config, BodyRole::Object, true, spec, object);
        let obstacle = theta.obstacle.as_ref().zip(obstacle).map(|(parameters, state)| {
            let movable = config.obstacle_mobility == ObstacleMobility::Movable;
            let spec = BodySpec::obstacle(parameters, config);
            insert_body(&mut physics, config, BodyRole::Obstacle, movable, spec, state)
        });
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
        let mut world = Self {
            config: config.clone(),
            effects: Effects::new(effects),
            physics,
            table,
            tool: tool_body,
            tool_colliders,
            tool_lowest: lowest_point(tool, tool_shapes),
            normal_n: [0.0; 3],
            object,
            obstacle,
            hidden: Vec::new(),
            arm: None,
            spring: None,
            time_secs: 0.0,
            limits: PUSH_LIMITS,
            rig_friction: None,
        };
        if let Some(nominal) = &changed {
            world.complete(nominal);
        }
        if world.object.on_supports {
            separate_supports(&mut world.physics, world.table);
        }
        world
    }

    /// Adds what only effects ask for.
    fn complete(&mut self, nominal: &Nominal) {
        for body in &nominal.hidden {
            let [x, y] = body.place_m;
            let z = self.config.table_height_m + body.shape.half_height_m(body.size_m);
            let state = BodyState::at_rest([x, y, z], body.yaw_rad);
            let spec = BodySpec::hidden(body, &self.config);
            let body = insert_body(&mut self.physics, &self.config, BodyRole::Hidden, body.movable, spec, &state);
            self.hidden.push(body);
        }
        if nominal.tool_stiffness_npm.is_finite() {
            let period_secs = self.config.control_period_secs;
            self.spring = Some(ToolSpring::new(&mut self.physics, self.tool, nominal.tool_stiffness_npm, period_secs));
        }
    }

    /// The same world later in an episode, with what its effects remember. Only for a world that has not made a step.
    #[must_use]
    pub fn with_memory(self, memory: &Memory) -> Self {
        self.later(memory.elapsed_secs, &memory.hidden)
    }

    /// The same world `time_secs` after the episode began, bodies that only effects know of where `hidden` has them. Only before its first step.
    pub(crate) fn later(mut self, time_secs: f64, hidden: &[BodyState]) -> Self {
        self.time_secs = time_secs;
        for (body, state) in self.hidden.iter().zip(hidden).filter(|(body, _)| body.dynamic) {
            let rigid = &mut self.physics.bodies[body.handle];
            rigid.set_position(pose(state.position_m, state.orientation), true);
            rigid.set_linvel(vector(state.linear_mps), true);
            rigid.set_angvel(vector(state.angular_rps), true);
        }
        self
    }

    /// The same world with the tool deflected from where it is commanded to be, `rest_m`, if it can be.
    pub(crate) fn deflected_from(mut self, rest_m: [f64; 3]) -> Self {
        if let Some(spring) = &mut self.spring {
            spring.rest_at(rest_m);
        }
        self
    }

    /// States of the bodies that only effects know of, in the order of the effects.
    #[must_use]
    pub fn hidden(&self) -> Vec<BodyState> {
        self.hidden.iter().map(|body| self.body_state(body)).collect()
    }

    /// The same world with the tool on a dynamic arm, at rest at `joints_rad`, which must be those of the tool's pose. Only before its first step.
    ///
    /// # Panics
    ///
    /// If `joints_rad` has not one value per joint.
    #[must_use]
    pub fn with_dynamic_arm(mut self, robot: &'a Robot, servo: &ServoConfig, joints_rad: &[f64]) -> Self {
        if self.spring.take().is_some() {
            // An arm of links has the stiffness of its servos.
            self.physics.bodies[self.tool].set_locked_axes(LockedAxes::empty(), true);
        }
        self.arm = Some(Arm::new(&mut self.physics, self.tool, robot, servo, joints_rad));
        self
    }

    /// Advances one control step, at whose end the tool is commanded to be at `position_m` (base frame); its orientation stays. Unless an
    /// effect lets the tool give way, that is where it is. Returns the mean wrench on the tool during the step.
    pub fn step(&mut self, position_m: [f64; 3]) -> Wrench {
        let attraction = self.apply_effects(|world| match &mut world.spring {
            None => world.physics.bodies[world.tool].set_next_kinematic_translation(vector(position_m)),
            Some(spring) => spring.command(&mut world.physics, world.tool, position_m),
        });
        self.advance();
        let mut wrench = match self.spring {
            None => {
                let mut wrench = self.tool_wrench(position_m, self.config.arm_stiffness_npm);
                let table = table_wrench(&self.config, position_m, self.tool_lowest);
                wrench.add_scaled(&table, 1.0);
                self.normal_n[2] += table.force_n[2];
                wrench
            }
            Some(_) => self.tool_wrench(self.tool_position_m(), 0.0),
        };
        if let Some(attraction) = attraction {
            wrench.add_scaled(&attraction, 1.0);
        }
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
        let attraction = self.apply_effects(|world| {
            let arm = world.arm.as_mut().expect("a world with a dynamic arm");
            arm.command(&mut world.physics, world.effects, joints_rad);
        });
        self.advance();
        // This arm's stiffness is that of its servos.
        let mut wrench = self.tool_wrench(self.tool_position_m(), 0.0);
        if let Some(attraction) = attraction {
            wrench.add_scaled(&attraction, 1.0);
        }
        wrench
    }

    fn advance(&mut self) {
        let friction = ContactFriction { effects: self.effects, table: self.table, rig: self.rig_friction };
        let changed = self.effects.hooks.contains(Hooks::FRICTION) || self.rig_friction.is_some();
        let hooks: &dyn PhysicsHooks = if changed { &friction } else { &OpposeSlip };
        self.physics.step_with_events(hooks, &());
        self.time_secs += self.config.control_period_secs;
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

    /// Whether the tool is not simply where it is commanded to be.
    #[must_use]
    pub fn tool_gives_way(&self) -> bool {
        self.spring.is_some() || self.arm.is_some()
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

    /// Why the world as it is now makes its hypothesis impossible, if it does; for overlaps see [`crate::feasible::check_overlaps`].
    #[must_use]
    pub fn divergence(&self) -> Option<Divergence> {
        if self.arm_joints_rad().is_some_and(|joints| joints.iter().any(|v| !v.is_finite())) {
            return Some(Divergence::NotFinite);
        }
        for body in std::iter::once(&self.object).chain(&self.obstacle).chain(&self.hidden) {
            let state = self.body_state(body);
            if !state.to_array().iter().all(|v| v.is_finite()) {
                return Some(Divergence::NotFinite);
            }
            if state.linear_mps.iter().map(|v| v * v).sum::<f64>().sqrt() > self.limits.speed_mps {
                return Some(Divergence::Flies);
            }
            if state.position_m[2] < self.config.table_height_m + self.limits.sunk_m {
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

    /// Sets the loads of the coming control step and gives the command; the attraction on the tool, if an effect has one.
    fn apply_effects(&mut self, command: impl FnOnce(&mut Self)) -> Option<Wrench> {
        let hooks = self.effects.hooks;
        if hooks.contains(Hooks::LOAD.and(Hooks::MASS)) {
            for body in std::iter::once(&self.object).chain(&self.obstacle).chain(&self.hidden) {
                self.effects.apply(&mut self.physics, &self.config, body, self.time_secs);
            }
        }
        command(self);
        if !hooks.contains(Hooks::ATTRACTION) {
            return None;
        }
        if self.arm.is_some() {
            self.physics.bodies[self.tool].reset_forces(false);
        }
        Some(self.effects.attract(&mut self.physics, &self.object, self.tool, &self.tool_colliders))
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

/// The engine of a world, still empty.
fn engine(config: &WorldConfig, effects: &[Box<dyn Effect>]) -> PhysicsWorld {
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
    physics
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
