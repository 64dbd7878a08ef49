//! The arm as a rapier multibody with position servos.
//!
//! The servo of a joint gives the torque K (q_d − q) + D (q̇_d − q̇) + M q̈_d. Its spring and damper are rapier's implicit joint spring and
//! damping: they enter the mass matrix as M + h D + h² K (h: duration of a substep), so that all joints are solved at once, and contacts
//! against the servos' own stiffness, stable at any gain. Rapier's joint motors are one more constraint each, relaxed in turn: with
//! 5000 N·m/rad and two substeps, and without feed-forward of the inertia, free motion lags by up to 1.6 mm with motors (model
//! `ForceBased`; `AccelerationBased` at 10 Hz: 7 mm) and by 0.4 mm with springs; with the feed-forward by 0.15 mm.
//!
//! Gravity does not act on the links: the controllers of both arms compensate it, and what the compensation misses is not modelled.
//! The links up to the hand cannot be touched.

use nalgebra::{Isometry3, UnitQuaternion};
use rapier3d::prelude::{
    GenericJointBuilder, JointAxesMask, MassProperties, Multibody, MultibodyJointHandle, PhysicsWorld, Pose,
    RigidBodyBuilder, RigidBodyHandle, RigidBodyType,
};

use crate::config::ServoConfig;
use crate::effect::{Effects, Hooks};
use crate::robot::{ArmBody, JointVector, Robot};
use crate::world::pose;

/// Marks a link, in rapier's user data: its apparent inertia is not that of its rigid body alone.
pub(crate) const LINK: u128 = 1;
/// Index of a joint's rotation among rapier's six axes: about its +z.
const TURN: usize = 5;

/// The arm in a live world.
pub(crate) struct Arm<'a> {
    robot: &'a Robot,
    tip: MultibodyJointHandle,
    stiffness: f64,
    damping: JointVector,
    period_secs: f64,
    substeps: f64,
    /// Rapier's joint coordinates count from here: single precision is best near 0.
    start_rad: JointVector,
    commanded_rad: JointVector,
    commanded_rps: JointVector,
}

impl<'a> Arm<'a> {
    /// Makes `tool`, which carries the tool's colliders, the last link of an arm at rest at `joints_rad`.
    ///
    /// # Panics
    ///
    /// If `joints_rad` has not one value per joint.
    pub(crate) fn new(
        physics: &mut PhysicsWorld,
        tool: RigidBodyHandle,
        robot: &'a Robot,
        servo: &ServoConfig,
        joints_rad: &[f64],
    ) -> Self {
        // Rapier moves the bodies after a first pass over the contacts and corrects the velocities in a second one, by default the only
        // one with friction. The second one meets M + h D + h² K without the servos having moved, so that its impulses would count
        // for less than they are and the measured friction would be wrong, for a tool that sticks by all of it.
        physics.integration_parameters.friction_in_bias_pass = true;
        let bodies = robot.bodies(joints_rad);
        let mut parent = physics.insert_body(RigidBodyBuilder::fixed());
        let mut tip = None;
        for (i, body) in bodies.iter().enumerate() {
            let link = if i + 1 == bodies.len() {
                let rigid = &mut physics.bodies[tool];
                rigid.set_body_type(RigidBodyType::Dynamic, true);
                rigid.set_gravity_scale(0.0, true);
                rigid.set_additional_mass_properties(mass_properties(body), true);
                rigid.activation_mut().normalized_linear_threshold = -1.0;
                rigid.user_data = LINK;
                for collider in rigid.colliders().to_vec() {
                    physics.colliders[collider].set_density(0.0);
                }
                tool
            } else {
                physics.insert_body(
                    RigidBodyBuilder::dynamic()
                        .pose(isometry(&body.base_from_body))
                        .gravity_scale(0.0)
                        .additional_mass_properties(mass_properties(body))
                        .can_sleep(false)
                        .user_data(LINK),
                )
            };
            let joint = GenericJointBuilder::new(JointAxesMask::all() - JointAxesMask::ANG_Z)
                .local_frame1(isometry(&body.parent_from_joint))
                .local_frame2(isometry(&body.body_from_joint));
            tip = physics.insert_multibody_joint(parent, link, joint);
            parent = link;
        }
        let tip = tip.expect("an arm has joints, and its links are new bodies in a row");
        let mut start_rad = JointVector::zeros();
        start_rad.as_mut_slice()[..joints_rad.len()].copy_from_slice(joints_rad);
        let mass = robot.mass_matrix(joints_rad);
        let stiffness = servo.stiffness_nmprad;
        let damping = JointVector::from_fn(|j, _| 2.0 * servo.damping_ratio * (stiffness * mass[(j, j)]).sqrt());
        let parameters = &physics.integration_parameters;
        let mut arm = Self {
            robot,
            tip,
            stiffness,
            damping,
            period_secs: f64::from(parameters.dt),
            substeps: parameters.num_solver_iterations as f64,
            start_rad,
            commanded_rad: start_rad,
            commanded_rps: JointVector::zeros(),
        };
        if let Some((multibody, _)) = physics.multibody_joints.get_mut(tip) {
            // Also tells the multibody that its root does not move, which settles its degrees of freedom.
            multibody.forward_kinematics(&physics.bodies, true);
            for (slot, value) in multibody.damping_mut().iter_mut().zip(&arm.damping) {
                *slot = *value as f32;
            }
        }
        arm.command(physics, Effects::new(&[]), joints_rad);
        arm
    }

    /// Commands that the joints be at `joints_rad` at the end of the coming control step. Friction in the joints, if an effect has it, works
    /// against the servos.
    pub(crate) fn command(&mut self, physics: &mut PhysicsWorld, effects: Effects, joints_rad: &[f64]) {
        let mut target = self.start_rad;
        target.as_mut_slice()[..joints_rad.len()].copy_from_slice(joints_rad);
        let rate = (target - self.commanded_rad) / self.period_secs;
        let mut torque = self.robot.mass_matrix(joints_rad) * (rate - self.commanded_rps) / self.period_secs;
        if effects.hooks.contains(Hooks::JOINT_FRICTION) {
            let mut friction = JointVector::zeros();
            for effect in effects.list {
                effect.joint_friction(&rate.as_slice()[..joints_rad.len()], &mut friction);
            }
            torque -= friction;
        }
        // Rapier holds the springs' rest positions over its substeps, at whose ends a joint that follows the command has gone
        // 1/n, 2/n, … 1 of the way: the rest positions take the mean, so that the springs' mean torque is 0.
        let share = (self.substeps + 1.0) / (2.0 * self.substeps);
        let mean = self.commanded_rad + (target - self.commanded_rad) * share;
        let rest = mean + (self.damping.component_mul(&rate) + torque) / self.stiffness - self.start_rad;
        if let Some((multibody, _)) = physics.multibody_joints.get_mut(self.tip) {
            for (link, rest) in multibody.links_mut().skip(1).zip(&rest) {
                link.joint.set_spring(TURN, self.stiffness as f32, *rest as f32);
            }
        }
        self.commanded_rad = target;
        self.commanded_rps = rate;
    }

    /// Joint positions, rad.
    pub(crate) fn joints_rad(&self, physics: &PhysicsWorld) -> Vec<f64> {
        let coordinate = |multibody: &Multibody, j: usize| {
            multibody.link(j + 1).map_or(0.0, |link| f64::from(link.joint().coords()[TURN]))
        };
        let multibody = physics.multibody_joints.get(self.tip).map(|(multibody, _)| multibody);
        (0..self.robot.joint_count())
            .map(|j| self.start_rad[j] + multibody.map_or(0.0, |multibody| coordinate(multibody, j)))
            .collect()
    }
}

fn isometry(pose_m: &Isometry3<f64>) -> Pose {
    let q: &UnitQuaternion<f64> = &pose_m.rotation;
    pose(pose_m.translation.vector.into(), [q.i, q.j, q.k, q.w])
}

fn mass_properties(body: &ArmBody) -> MassProperties {
    crate::bodies::mass_properties(body.com_m.into(), body.mass_kg, &body.moment_kgm2)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::robot::RobotConfig;
    use crate::world::vector;

    fn load(name: &str) -> Robot {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
        let text = std::fs::read_to_string(root.join(format!("scenarios/robots/{name}.toml"))).unwrap();
        let file: toml::Table = toml::from_str(&text).unwrap();
        let config: RobotConfig = file["robot"].clone().try_into().unwrap();
        Robot::load(&config, root).unwrap()
    }

    fn vector_of(values: &[f64]) -> JointVector {
        JointVector::from_fn(|j, _| values.get(j).copied().unwrap_or_default())
    }

    /// C(q, q̇) q̇ = Ṁ q̇ − ½ ∂(q̇ᵀ M q̇)/∂q, by central differences.
    fn coriolis_torque(robot: &Robot, q: &[f64], rate: &JointVector) -> JointVector {
        let h = 1e-5;
        let mut torque = JointVector::zeros();
        for j in 0..q.len() {
            let at = |side: f64| {
                let mut moved = q.to_vec();
                moved[j] += side * h;
                robot.mass_matrix(&moved)
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * h);
            torque += slope * rate * rate[j];
            torque[j] -= 0.5 * rate.dot(&(slope * rate));
        }
        torque
    }

    #[test]
    fn a_short_step_follows_the_equations_of_motion() {
        for name in ["sawyer", "jaco"] {
            let robot = load(name);
            let n = robot.joint_count();
            for turn in [0.0, 0.4, -0.7] {
                let q: Vec<f64> =
                    robot.home_rad().iter().enumerate().map(|(j, q)| q + turn * (j as f64).cos()).collect();
                let rate = vector_of(&(0..n).map(|j| 0.5 * (1.7 * j as f64 + turn).sin()).collect::<Vec<_>>());
                let torque = vector_of(
                    &(0..n).map(|j| 3.0 * (2.3 * j as f64 - turn).cos() / (1.0 + j as f64)).collect::<Vec<_>>(),
                );
                let mut physics = PhysicsWorld::new();
                physics.gravity = vector([0.0, 0.0, -crate::robot::GRAVITY_MPS2]);
                physics.integration_parameters.dt = 1e-4;
                physics.integration_parameters.num_solver_iterations = 1;
                let at = isometry(&robot.base_from_tool(&q));
                let tool = physics.insert_body(RigidBodyBuilder::kinematic_position_based().pose(at));
                // A spring too soft to matter but for the torque that it is set to.
                let servo = ServoConfig { stiffness_nmprad: 1.0, damping_ratio: 0.0 };
                let arm = Arm::new(&mut physics, tool, &robot, &servo, &q);
                let links: Vec<RigidBodyHandle> = physics
                    .bodies
                    .iter()
                    .filter(|(_, body)| body.user_data == LINK)
                    .map(|(handle, _)| handle)
                    .collect();
                assert_eq!(links.len(), n);
                for link in links {
                    physics.bodies[link].set_gravity_scale(1.0, true);
                }
                let (multibody, _) = physics.multibody_joints.get_mut(arm.tip).unwrap();
                for j in 0..n {
                    multibody.generalized_velocity_mut()[j] = rate[j] as f32;
                    multibody.link_mut(j + 1).unwrap().joint.set_spring(TURN, 1.0, torque[j] as f32);
                }
                physics.step();
                let (multibody, _) = physics.multibody_joints.get(arm.tip).unwrap();
                let after = multibody.generalized_velocity();
                let acceleration = JointVector::from_fn(|j, _| {
                    if j < n { (f64::from(after[j]) - f64::from(rate[j] as f32)) / 1e-4 } else { 0.0 }
                });
                // M q̈ = τ − C q̇ − g, compared as accelerations.
                let load = torque - coriolis_torque(&robot, &q, &rate) - robot.gravity_torque(&q);
                let mut mass = robot.mass_matrix(&q);
                for j in n..mass.nrows() {
                    mass[(j, j)] = 1.0;
                }
                let expected = mass.cholesky().unwrap().solve(&load);
                let error = (acceleration - expected).amax() / expected.amax();
                assert!(error < 1e-3, "{name}: {acceleration} and {expected}: {error}");
            }
        }
    }
}
