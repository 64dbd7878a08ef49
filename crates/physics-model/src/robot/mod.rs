//! Arms read from URDF: where the tool is, which joints bring it somewhere, and what torques contact and gravity cause.
//!
//! Conventions, all SI and radians:
//!
//! - Poses are `base_from_…`, in the frame of `base_link`, z up.
//! - Jacobians are geometric, along base axes, linear rows first.
//! - At rest the motors hold `gravity_torque − contact_torque`: g(q) − Jᵀw, with w the wrench exerted **by the environment on the tool**.
//! - Slices of joints have one entry per actuated joint, in the order of [`RobotConfig::actuated_joints`]; vectors that come back have
//!   [`MAX_JOINTS`](crate::state::MAX_JOINTS) places, 0 where the arm has no joint.

mod chain;
mod error;
mod ik;
mod shapes;
mod urdf;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Point3, Vector6};
use serde::{Deserialize, Serialize};

pub use chain::{GRAVITY_MPS2, Jacobian, JointVector, MassMatrix};
pub use error::{IkError, RobotError};
pub use ik::IkOptions;
pub use shapes::ToolShape;

use chain::{Chain, Frame, Posture};

/// Which arm, and which of its links and joints play which part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name in tables and folders.
    pub name: String,
    /// URDF file, relative to the folder that [`Robot::load`] is given.
    pub urdf: PathBuf,
    /// Link whose frame is the base frame; z must be up.
    pub base_link: String,
    /// End frame of the bare arm.
    pub tip_link: String,
    /// Link whose origin is the controlled point; must hang on the last joint.
    pub tool_link: String,
    /// Link at whose origin a wrist sensor measures; must hang on the last joint.
    pub wrist_link: String,
    /// Revolute or continuous joints that move, base first.
    pub actuated_joints: Vec<String>,
    /// All other moving joints below the base, and where they are held: rad, or m for prismatic ones.
    pub locked_joints: BTreeMap<String, f64>,
    /// Joint positions, rad, that a redundant arm tends to.
    pub home_rad: Vec<f64>,
    /// Rows of R(base ← tool), the orientation that the tool keeps.
    pub tool_rotation: [[f64; 3]; 3],
}

/// What a joint can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimit {
    /// Lowest position, rad; −∞ for a continuous joint.
    pub lower_rad: f64,
    /// Highest position, rad; +∞ for a continuous joint.
    pub upper_rad: f64,
    /// Fastest, rad/s.
    pub velocity_rps: f64,
    /// Strongest torque, N·m.
    pub effort_nm: f64,
}

impl JointLimit {
    /// Whether a position, rad, is within the limits.
    #[must_use]
    pub fn contains(&self, position_rad: f64) -> bool {
        (self.lower_rad..=self.upper_rad).contains(&position_rad)
    }
}

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
        let description = urdf::read(&path)?;
        Self::build(config, description, &path)
    }

    fn build(config: &RobotConfig, description: urdf_rs::Robot, path: &Path) -> Result<Self, RobotError> {
        let arm = urdf::Arm::new(config, description, path)?;
        check_values(config, &arm.limits)?;
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
                    value: format!("{name:?}"),
                    expected: format!("a link that moves with {:?}", config.actuated_joints.last()),
                });
            }
        }
        let tool_shapes = arm.tool_shapes(&arm.links[&config.tool_link], path)?;
        if tool_shapes.is_empty() {
            return Err(RobotError::Link {
                path: path.into(),
                link: config.tool_link.clone(),
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
    pub fn solve_ik(&self, seed: &[f64], base_from_target: &Isometry3<f64>) -> Result<Vec<f64>, IkError> {
        self.solve_ik_with(seed, base_from_target, &IkOptions::default())
    }

    /// As [`Self::solve_ik`], with options.
    ///
    /// # Errors
    ///
    /// [`IkError`] if the target is out of reach from there, or if a value is not finite.
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

/// Largest deviation of `tool_rotation` from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-6;

fn check_values(config: &RobotConfig, limits: &[JointLimit]) -> Result<(), RobotError> {
    let robot = config.name.clone();
    if config.home_rad.len() != limits.len() {
        let expected = format!("{}, one per actuated joint", limits.len());
        return Err(RobotError::JointCount { robot, key: "home_rad", found: config.home_rad.len(), expected });
    }
    for (j, (home, limit)) in config.home_rad.iter().zip(limits).enumerate() {
        if !(home.is_finite() && limit.contains(*home)) {
            return Err(RobotError::Value {
                robot,
                key: format!("home_rad[{j}]"),
                value: home.to_string(),
                expected: format!("{} to {} rad", limit.lower_rad, limit.upper_rad),
            });
        }
    }
    let r = Matrix3::from_fn(|row, column| config.tool_rotation[row][column]);
    let deviation = (r * r.transpose() - Matrix3::identity()).amax();
    // A comparison with NaN is false: then it is no rotation either.
    if !(deviation <= ROTATION_TOLERANCE && r.determinant() > 0.0) {
        return Err(RobotError::Value {
            robot,
            key: "tool_rotation".into(),
            value: format!("{:?}", config.tool_rotation),
            expected: "rows of a right-handed rotation".into(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
