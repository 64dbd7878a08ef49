//! Arms read from URDF: where the tool is, which joints bring it somewhere, and what torques contact and gravity cause.
//!
//! Conventions, all SI and radians:
//!
//! - Poses are `base_from_…`, in the frame of `base_link`, z up.
//! - Jacobians are geometric, along base axes, linear rows first.
//! - At rest the motors hold `gravity_torque − contact_torque`: g(q) − Jᵀw, with w the wrench exerted **by the environment on the tool**.
//! - Slices of joints have one entry per actuated joint, in the order of [`RobotConfig::actuated_joints`]; vectors that come back have
//!   [`MAX_JOINTS`](crate::state::MAX_JOINTS) places, 0 where the arm has no joint.

mod bodies;
mod chain;
mod config;
mod description;
mod dynamics;
mod error;
mod ik;
mod shapes;
mod urdf;

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector6};

pub use chain::{GRAVITY_MPS2, Jacobian, JointVector, MassMatrix};
pub use config::{JointLimit, RobotConfig};
pub use description::{check_root, find_root};
pub use error::{IkError, RobotError};
pub use ik::IkOptions;
pub use shapes::ToolShape;

pub(crate) use bodies::ArmBody;
use chain::{Chain, Frame, Posture};

/// A link of one [`Robot`]; see [`Robot::frame`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FrameId(usize);

/// A link: how many joints move it, and its fixed place on the last of them.
#[derive(Clone, Copy, Debug)]
struct LinkFrame {
    moving: usize,
    segment_from_link: Frame,
}

/// An arm. Immutable; share it between threads.
#[derive(Clone, Debug)]
pub struct Robot {
    name: String,
    chain: Chain,
    limits: Vec<JointLimit>,
    names: Vec<String>,
    links: Vec<LinkFrame>,
    tip: FrameId,
    tool: FrameId,
    wrist: FrameId,
    home_rad: Vec<f64>,
    tool_rotation: [[f64; 3]; 3],
    tool_shapes: Vec<ToolShape>,
}

impl Robot {
    /// Reads the arm that `config` describes; `config.urdf` is relative to `base_dir`.
    ///
    /// # Errors
    ///
    /// If the file is missing or no URDF, if a link or joint is missing or unfit for its part, or if a value is impossible.
    pub fn load(config: &RobotConfig, base_dir: &Path) -> Result<Self, RobotError> {
        let path = base_dir.join(&config.urdf);
        let description = urdf_file::read(&path)?;
        Self::build(config, description, &path)
    }

    fn build(config: &RobotConfig, description: urdf_file::Urdf, path: &Path) -> Result<Self, RobotError> {
        let arm = urdf::Arm::new(config, description, path)?;
        config.check_values(&arm.limits)?;
        let names: Vec<String> = arm.links.keys().cloned().collect();
        let id = |key, name: &str| -> Result<FrameId, RobotError> {
            arm.link(path, key, name)?;
            Ok(FrameId(names.iter().position(|n| n == name).unwrap_or_default()))
        };
        let tip = id("tip_link", &config.tip_link)?;
        let (tool, wrist) = (id("tool_link", &config.tool_link)?, id("wrist_link", &config.wrist_link)?);
        for (key, name) in [("tool_link", &config.tool_link), ("wrist_link", &config.wrist_link)] {
            if arm.links[name].segment != Some(arm.limits.len() - 1) {
                return Err(RobotError::Value {
                    robot: config.name.clone(),
                    key: key.into(),
                    value: format!("{:?}", whole_file::one_line(name, 100)),
                    expected: whole_file::one_line(
                        &format!(
                            "a link that moves with {:?}",
                            config.actuated_joints.last().map_or("", String::as_str)
                        ),
                        200,
                    ),
                });
            }
        }
        let tool_shapes = arm.tool_shapes(&arm.links[&config.tool_link], path)?;
        if tool_shapes.is_empty() {
            return Err(RobotError::Link {
                path: path.into(),
                link: whole_file::one_line(&config.tool_link, 100),
                problem: "nothing that moves with it has a collision shape, expected a tool that can touch".into(),
            });
        }
        let place = |placed: &urdf::Placed| LinkFrame {
            moving: placed.segment.map_or(0, |index| index + 1),
            segment_from_link: placed.segment_from_link,
        };
        Ok(Self {
            name: config.name.clone(),
            links: arm.links.values().map(place).collect(),
            chain: arm.chain,
            limits: arm.limits,
            names,
            tip,
            tool,
            wrist,
            home_rad: config.home_rad.clone(),
            tool_rotation: config.tool_rotation,
            tool_shapes,
        })
    }

    /// Name in tables and folders.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of actuated joints.
    #[must_use]
    pub fn joint_count(&self) -> usize {
        self.limits.len()
    }

    /// Limits, one per actuated joint.
    #[must_use]
    pub fn limits(&self) -> &[JointLimit] {
        &self.limits
    }

    /// Home posture, rad.
    #[must_use]
    pub fn home_rad(&self) -> &[f64] {
        &self.home_rad
    }

    /// Rows of R(base ← tool), the orientation that the tool keeps.
    #[must_use]
    pub fn tool_rotation(&self) -> [[f64; 3]; 3] {
        self.tool_rotation
    }

    /// R(base ← tool), the orientation that the tool keeps.
    #[must_use]
    pub fn tool_orientation(&self) -> UnitQuaternion<f64> {
        let r = self.tool_rotation;
        let rotation = Matrix3::from_fn(|row, column| r[row][column]);
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation))
    }

    /// Collision primitives of the hand and all that is fixed to it, in the frame of the tool link: spheres and capsules (a cylinder
    /// with spheres at its ends). A cylinder that is not longer than its diameter and has no spheres at its ends is a flange and left out.
    #[must_use]
    pub fn tool_shapes(&self) -> &[ToolShape] {
        &self.tool_shapes
    }

    /// The link called `name`, if it hangs below the base.
    #[must_use]
    pub fn frame(&self, name: &str) -> Option<FrameId> {
        self.names.iter().position(|n| n == name).map(FrameId)
    }

    /// The frame of `tip_link`.
    #[must_use]
    pub fn tip(&self) -> FrameId {
        self.tip
    }

    /// The frame of `tool_link`.
    #[must_use]
    pub fn tool(&self) -> FrameId {
        self.tool
    }

    /// The frame of `wrist_link`.
    #[must_use]
    pub fn wrist(&self) -> FrameId {
        self.wrist
    }

    /// Pose of a link in the base frame (m) at joint positions `q` (rad).
    ///
    /// # Panics
    ///
    /// If `q` has not one value per joint, as in all methods that take `q`.
    #[must_use]
    pub fn base_from_link(&self, q: &[f64], frame: FrameId) -> Isometry3<f64> {
        self.place(&self.chain.posture(q), frame).isometry()
    }

    /// Poses, in the base frame (m), of the frames in which the joints turn (about z), the base's first, at `q` (rad): the arm as a line of
    /// joints, to be drawn.
    #[must_use]
    pub fn base_from_joints(&self, q: &[f64]) -> Vec<Isometry3<f64>> {
        let posture = self.chain.posture(q);
        (0..self.joint_count()).map(|index| posture.frame(index).isometry()).collect()
    }

    /// Pose of the controlled point in the base frame (m) at `q` (rad).
    #[must_use]
    pub fn base_from_tool(&self, q: &[f64]) -> Isometry3<f64> {
        self.base_from_link(q, self.tool)
    }

    /// Pose of the bare arm's end in the base frame (m) at `q` (rad).
    #[must_use]
    pub fn base_from_tip(&self, q: &[f64]) -> Isometry3<f64> {
        self.base_from_link(q, self.tip)
    }

    /// Pose of the wrist sensor in the base frame (m) at `q` (rad).
    #[must_use]
    pub fn base_from_wrist(&self, q: &[f64]) -> Isometry3<f64> {
        self.base_from_link(q, self.wrist)
    }

    /// Geometric Jacobian of a link's origin at `q` (rad), base axes: rows 0–2 linear (m/rad), rows 3–5 angular.
    #[must_use]
    pub fn jacobian(&self, q: &[f64], frame: FrameId) -> Jacobian {
        let posture = self.chain.posture(q);
        let point = self.place(&posture, frame).position;
        posture.jacobian_at(self.links[frame.0].moving, &point)
    }

    /// Torques, N·m, that the motors must hold against gravity at `q` (rad): dU/dq.
    #[must_use]
    pub fn gravity_torque(&self, q: &[f64]) -> JointVector {
        self.chain.gravity_torque(&self.chain.posture(q))
    }

    /// Potential energy in gravity, J, of all that the joints move, at `q` (rad); zero for masses at the height of the base.
    #[must_use]
    pub fn potential_energy(&self, q: &[f64]) -> f64 {
        self.chain.potential_energy(&self.chain.posture(q))
    }

    /// Joint-space mass matrix, kg·m², at `q` (rad), without rotor inertia.
    #[must_use]
    pub fn mass_matrix(&self, q: &[f64]) -> MassMatrix {
        self.chain.mass_matrix(&self.chain.posture(q))
    }

    /// Torques, N·m, that the motors must give for a motion without contact: M(q) q̈ + C(q, q̇) q̇ + g(q), with `q` in rad, `rate` in rad/s and
    /// `acceleration` in rad/s². A contact adds −[`Self::contact_torque`].
    ///
    /// # Panics
    ///
    /// If the slices have not one value per joint.
    #[must_use]
    pub fn inverse_dynamics(&self, q: &[f64], rate: &[f64], acceleration: &[f64]) -> JointVector {
        self.chain.inverse_dynamics(q, rate, acceleration)
    }

    /// Torques, N·m, that a wrench at the controlled point causes at `q` (rad): Jᵀw. `wrench` is force (N) and torque (N·m), base axes,
    /// exerted by the environment on the tool. The motors hold gravity torque minus this.
    #[must_use]
    pub fn contact_torque(&self, q: &[f64], wrench: &Vector6<f64>) -> JointVector {
        self.jacobian(q, self.tool).tr_mul(wrench)
    }

    /// As [`Self::contact_torque`], for a wrench that acts at `point_m` (base frame) of a body fixed to the tool.
    #[must_use]
    pub fn contact_torque_at(&self, q: &[f64], point_m: &Point3<f64>, wrench: &Vector6<f64>) -> JointVector {
        self.chain.posture(q).jacobian_at(self.joint_count(), &point_m.coords).tr_mul(wrench)
    }

    /// Joint positions, rad, within the limits, that bring the controlled point to `base_from_target`, close to `seed` (rad): the branch
    /// is that of the seed, and continuous joints are not wrapped.
    ///
    /// # Errors
    ///
    /// [`IkError`] if the target is out of reach from there, or if a value is not finite.
    ///
    /// # Panics
    ///
    /// If `seed` has not one value per joint.
    pub fn solve_ik(&self, seed: &[f64], base_from_target: &Isometry3<f64>) -> Result<Vec<f64>, IkError> {
        self.solve_ik_with(seed, base_from_target, &IkOptions::default())
    }

    /// As [`Self::solve_ik`], with options.
    ///
    /// # Errors
    ///
    /// [`IkError`] if the target is out of reach from there, or if a value is not finite.
    ///
    /// # Panics
    ///
    /// If `seed` has not one value per joint.
    pub fn solve_ik_with(
        &self,
        seed: &[f64],
        base_from_target: &Isometry3<f64>,
        options: &IkOptions,
    ) -> Result<Vec<f64>, IkError> {
        assert_eq!(seed.len(), self.joint_count(), "a seed for {} joints", self.joint_count());
        let target = Frame {
            rotation: *base_from_target.rotation.to_rotation_matrix().matrix(),
            position: base_from_target.translation.vector,
        };
        let problem = ik::Problem {
            chain: &self.chain,
            limits: &self.limits,
            home: &self.home_rad,
            segment_from_tool: &self.links[self.tool.0].segment_from_link,
            base_from_target: &target,
        };
        problem.solve(seed, options).map(|q| q.as_slice()[..self.joint_count()].to_vec())
    }

    fn place(&self, posture: &Posture, frame: FrameId) -> Frame {
        let link = &self.links[frame.0];
        match link.moving.checked_sub(1) {
            Some(segment) => posture.frame(segment).then(&link.segment_from_link),
            None => link.segment_from_link,
        }
    }
}

#[cfg(test)]
mod tests;
