//! From URDF to a chain: follows the actuated joints, freezes the others, lumps masses.
//!
//! Every link below the base belongs to the base or to the last actuated joint above it. A segment's frame is the URDF joint frame turned so
//! that the joint's axis is +z; with the axis `0 0 1`, as in our files, that turn is exactly none.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::chain::{Chain, Frame, Inertia, Segment};
use super::error::{joint_error, link_error, listed, quoted, unknown_link};
use super::shapes::{ToolShape, link_shapes};
use super::{JointLimit, RobotConfig, RobotError};
use crate::state::MAX_JOINTS;
use urdf_file::{Joint, JointKind, Link, Urdf};

/// No arm is longer, m, heavier, kg, or more inert, kg·m²: beyond it sums and products leave the finite numbers.
const LONGEST_M: f64 = 1000.0;
const HEAVIEST_KG: f64 = 1e6;
const MOST_INERT_KGM2: f64 = 1e9;

/// A link: the segment that carries it (`None`: the base) and its fixed place there.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    pub(super) segment: Option<usize>,
    pub(super) segment_from_link: Frame,
}

/// What the URDF says about an arm.
#[derive(Debug)]
pub(super) struct Arm {
    pub(super) chain: Chain,
    pub(super) limits: Vec<JointLimit>,
    pub(super) links: BTreeMap<String, Placed>,
    description: Urdf,
}

impl Arm {
    /// Builds the chain of `config.actuated_joints` below `config.base_link`.
    pub(super) fn new(config: &RobotConfig, description: Urdf, path: &Path) -> Result<Self, RobotError> {
        let joints = joint_table(&description, path)?;
        check_names(config, &joints, path)?;
        if !description.links.iter().any(|link| link.name == config.base_link) {
            let names = description.links.iter().map(|link| link.name.as_str());
            return Err(unknown_link(path, "base_link", &config.base_link, names));
        }
        let mut children: BTreeMap<&str, Vec<&Joint>> = BTreeMap::new();
        for joint in &description.joints {
            children.entry(&joint.parent).or_default().push(joint);
        }
        let mut arm = Walk { config, path, children, links: BTreeMap::new(), segments: Vec::new(), limits: Vec::new() };
        arm.visit(&config.base_link, None, &Frame::identity())?;
        if let Some(missing) = config.actuated_joints.get(arm.segments.len()) {
            let problem = match arm.segments.len().checked_sub(1) {
                None => format!("does not move with {:?}, expected the first joint above the base", config.base_link),
                Some(last) => {
                    format!("does not move with {:?}, expected a serial chain", config.actuated_joints[last])
                }
            };
            return Err(joint_error(path, missing, &problem));
        }
        let Walk { links, mut segments, limits, .. } = arm;
        for link in &description.links {
            let Some(placed) = links.get(&link.name) else { continue };
            let inertia = inertia(link, path)?;
            if let Some(index) = placed.segment {
                let segment: &mut Segment = &mut segments[index];
                segment.inertia = segment.inertia.joined(&inertia.moved(&placed.segment_from_link));
            }
        }
        for (segment, joint) in segments.iter().zip(&config.actuated_joints) {
            if segment.inertia.mass_kg <= 0.0 {
                return Err(joint_error(path, joint, "the links that it carries have no mass, expected some"));
            }
        }
        Ok(Self { chain: Chain { segments }, limits, links, description })
    }

    /// The link called `name`, which `key` of the configuration asks for.
    pub(super) fn link(&self, path: &Path, key: &'static str, name: &str) -> Result<&Placed, RobotError> {
        self.links.get(name).ok_or_else(|| unknown_link(path, key, name, self.links.keys().map(String::as_str)))
    }

    /// Shapes of everything that `tool` is rigidly attached to, beyond the last joint, in the tool's frame.
    pub(super) fn tool_shapes(&self, tool: &Placed, path: &Path) -> Result<Vec<ToolShape>, RobotError> {
        let tool_from_segment = tool.segment_from_link.inverse();
        let mut shapes = Vec::new();
        for link in &self.description.links {
            let Some(placed) = self.links.get(&link.name).filter(|placed| placed.segment == tool.segment) else {
                continue;
            };
            let tool_from_link = tool_from_segment.then(&placed.segment_from_link);
            shapes
                .extend(link_shapes(link, &tool_from_link).map_err(|problem| link_error(path, &link.name, &problem))?);
        }
        Ok(shapes)
    }
}

struct Walk<'a> {
    config: &'a RobotConfig,
    path: &'a Path,
    children: BTreeMap<&'a str, Vec<&'a Joint>>,
    links: BTreeMap<String, Placed>,
    segments: Vec<Segment>,
    limits: Vec<JointLimit>,
}

impl<'a> Walk<'a> {
    /// Whether an actuated joint or a link with a part to play hangs below `link`, or is it.
    fn leads_to_the_arm(&self, link: &str) -> bool {
        let config = self.config;
        let (mut open, mut seen) = (vec![link], 0);
        while let Some(next) = open.pop() {
            seen += 1;
            let children = self.children.get(next).map_or(&[][..], Vec::as_slice);
            let named = [&config.tip_link, &config.tool_link, &config.wrist_link].iter().any(|name| *name == next);
            // A loop is for the walk to find.
            if named
                || seen > self.children.len() + 1000
                || children.iter().any(|j| config.actuated_joints.contains(&j.name))
            {
                return true;
            }
            open.extend(children.iter().map(|joint| joint.child.as_str()));
        }
        false
    }

    /// Places `link`, then all below it, depth first.
    fn visit(&mut self, link: &str, segment: Option<usize>, segment_from_link: &Frame) -> Result<(), RobotError> {
        let placed = Placed { segment, segment_from_link: *segment_from_link };
        if self.links.insert(link.to_owned(), placed).is_some() {
            return Err(link_error(self.path, link, "has two parents, expected a tree"));
        }
        let children: Vec<&'a Joint> = self.children.get(link).cloned().unwrap_or_default();
        for joint in children {
            let origin = Frame::from_xyz_rpy(joint.origin.xyz, joint.origin.rpy);
            if !believable(&origin) {
                let problem = format!("origin is {:?}, expected finite values within {LONGEST_M} m", joint.origin.xyz);
                return Err(joint_error(self.path, &joint.name, &problem));
            }
            let segment_from_joint = segment_from_link.then(&origin);
            if let Some(index) = self.config.actuated_joints.iter().position(|name| *name == joint.name) {
                if segment.map_or(0, |s| s + 1) != index || self.segments.len() != index {
                    let problem = format!(
                        "comes after {:?} in robot.actuated_joints but does not move with it, expected a serial chain in order",
                        index.checked_sub(1).map_or("the base", |i| self.config.actuated_joints[i].as_str())
                    );
                    return Err(joint_error(self.path, &joint.name, &problem));
                }
                let turn = joint_from_axis(&unit_axis(joint, self.path)?);
                self.limits.push(limit(joint, self.path)?);
                let mount = segment_from_joint.then(&turn);
                self.segments.push(Segment { mount, inertia: Inertia::zero() });
                self.visit(&joint.child, Some(index), &turn.inverse())?;
            } else if is_free(joint) && !self.leads_to_the_arm(&joint.child) {
                // An object beside the arm: what it does is not the arm's business.
            } else {
                let frozen = frozen(joint, self.config.locked_joints.get(&joint.name), self.path)?;
                self.visit(&joint.child, segment, &segment_from_joint.then(&frozen))?;
            }
        }
        Ok(())
    }
}

/// Whether a joint leaves what hangs on it free in more than one direction.
fn is_free(joint: &Joint) -> bool {
    matches!(joint.kind, JointKind::Floating | JointKind::Planar | JointKind::Spherical)
}

/// What a joint is called that cannot be used, and what would do.
fn unusable(kind: &JointKind, expected: &str) -> String {
    format!("is {}, expected {expected}", kind.name())
}

/// Joints by name, checked to be unique and to form no loop of links.
fn joint_table<'a>(description: &'a Urdf, path: &Path) -> Result<BTreeMap<&'a str, &'a Joint>, RobotError> {
    let mut joints = BTreeMap::new();
    let mut parents = BTreeMap::new();
    for joint in &description.joints {
        if joints.insert(joint.name.as_str(), joint).is_some() {
            return Err(joint_error(path, &joint.name, "occurs twice, expected unique names"));
        }
        for link in [&joint.parent, &joint.child] {
            if !description.links.iter().any(|l| l.name == *link) {
                return Err(joint_error(path, &joint.name, &format!("connects link {link:?}, which does not exist")));
            }
        }
        if let Some(other) = parents.insert(joint.child.as_str(), joint.name.as_str()) {
            let problem = format!("has two parent joints, {other:?} and {:?}, expected a tree", joint.name);
            return Err(link_error(path, &joint.child, &problem));
        }
    }
    Ok(joints)
}

fn check_names(config: &RobotConfig, joints: &BTreeMap<&str, &Joint>, path: &Path) -> Result<(), RobotError> {
    let actuated = config.actuated_joints.iter().map(|name| ("actuated_joints", name));
    let locked = config.locked_joints.keys().map(|name| ("locked_joints", name));
    for (key, name) in actuated.chain(locked) {
        if !joints.contains_key(name.as_str()) {
            let movable =
                |kind: &JointKind| matches!(kind, JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic);
            let moving = joints.values().filter(|j| movable(&j.kind)).map(|j| j.name.as_str());
            let known = listed(moving);
            return Err(RobotError::UnknownJoint { path: path.into(), key, name: quoted(name), known });
        }
        if key == "actuated_joints" && config.locked_joints.contains_key(name) {
            return Err(joint_error(path, name, "is in robot.actuated_joints and in robot.locked_joints"));
        }
    }
    let count = config.actuated_joints.len();
    let distinct = config.actuated_joints.iter().collect::<std::collections::BTreeSet<_>>().len();
    if !(1..=MAX_JOINTS).contains(&count) || distinct != count {
        return Err(RobotError::JointCount {
            robot: config.name.clone(),
            key: "actuated_joints",
            found: distinct,
            expected: format!("1 to {MAX_JOINTS} different joints"),
        });
    }
    Ok(())
}

/// Joint frame ← link frame of a joint that does not move here.
fn frozen(joint: &Joint, locked: Option<&f64>, path: &Path) -> Result<Frame, RobotError> {
    let position = match (&joint.kind, locked) {
        (JointKind::Fixed, None) => return Ok(Frame::identity()),
        (JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic, Some(position)) => *position,
        (kind, Some(_)) => {
            let problem = unusable(kind, "revolute, continuous or prismatic in robot.locked_joints");
            return Err(joint_error(path, &joint.name, &problem));
        }
        (kind, None) => {
            let expected = match kind {
                JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => {
                    "it in robot.actuated_joints, or in robot.locked_joints with a value"
                }
                _ => "fixed, revolute, continuous or prismatic between base and tool: give it another type in the URDF",
            };
            let problem = unusable(kind, expected);
            return Err(joint_error(path, &joint.name, &problem));
        }
    };
    let (lower, upper) = match joint.kind {
        JointKind::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
        _ => (joint.limit.lower, joint.limit.upper),
    };
    let most = if joint.kind == JointKind::Prismatic { LONGEST_M } else { f64::MAX };
    if !(position.abs() <= most && (lower..=upper).contains(&position)) {
        let problem = format!("is locked at {position}, expected {lower} to {upper}");
        return Err(joint_error(path, &joint.name, &problem));
    }
    let axis = unit_axis(joint, path)?;
    Ok(if joint.kind == JointKind::Prismatic {
        Frame { rotation: Matrix3::identity(), position: *axis * position }
    } else {
        Frame { rotation: *Rotation3::from_axis_angle(&axis, position).matrix(), position: Vector3::zeros() }
    })
}

/// A turn that brings +z to the axis.
fn joint_from_axis(axis: &Unit<Vector3<f64>>) -> Frame {
    let rotation = if **axis == Vector3::z() {
        Rotation3::identity()
    } else {
        let half_turn = || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        Rotation3::rotation_between(&Vector3::z(), axis).unwrap_or_else(half_turn)
    };
    Frame { rotation: *rotation.matrix(), position: Vector3::zeros() }
}

fn unit_axis(joint: &Joint, path: &Path) -> Result<Unit<Vector3<f64>>, RobotError> {
    let axis = Vector3::from(joint.axis);
    Unit::try_new(axis, 1e-6)
        // An overflow of the norm leaves nothing of the direction.
        .filter(|unit| (unit.norm() - 1.0).abs() < 1e-6)
        .ok_or_else(|| joint_error(path, &joint.name, &format!("axis is {:?}, expected a direction", joint.axis)))
}

fn limit(joint: &Joint, path: &Path) -> Result<JointLimit, RobotError> {
    let (lower_rad, upper_rad) = match joint.kind {
        JointKind::Revolute => (joint.limit.lower, joint.limit.upper),
        JointKind::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
        _ => {
            let problem = unusable(&joint.kind, "revolute or continuous in robot.actuated_joints");
            return Err(joint_error(path, &joint.name, &problem));
        }
    };
    let (velocity_rps, effort_nm) = (joint.limit.velocity, joint.limit.effort);
    if !(lower_rad < upper_rad && velocity_rps >= 0.0 && effort_nm >= 0.0) {
        let problem = format!(
            "limit is {lower_rad} to {upper_rad} rad, {velocity_rps} rad/s, {effort_nm} N m; expected lower below upper, others at least 0"
        );
        return Err(joint_error(path, &joint.name, &problem));
    }
    Ok(JointLimit { lower_rad, upper_rad, velocity_rps, effort_nm })
}

fn inertia(link: &Link, path: &Path) -> Result<Inertia, RobotError> {
    let (mass_kg, [ixx, ixy, ixz, iyy, iyz, izz]) = (link.inertial.mass_kg, link.inertial.inertia);
    let origin = Frame::from_xyz_rpy(link.inertial.origin.xyz, link.inertial.origin.rpy);
    let moment = Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz);
    let inert = moment.iter().all(|v| v.abs() <= MOST_INERT_KGM2);
    if !((0.0..=HEAVIEST_KG).contains(&mass_kg) && inert && believable(&origin)) {
        let problem = format!(
            "inertial has mass {mass_kg} kg, expected 0 to {HEAVIEST_KG}, an origin within {LONGEST_M} m and inertia within {MOST_INERT_KGM2} kg m²"
        );
        return Err(link_error(path, &link.name, &problem));
    }
    if mass_kg > 0.0 && moment.symmetric_eigenvalues().min() <= 0.0 {
        return Err(link_error(path, &link.name, "inertia is not positive definite, expected it to be"));
    }
    Ok(Inertia { mass_kg, com: Vector3::zeros(), moment }.moved(&origin))
}

/// Whether an origin is one of a thing that exists.
fn believable(origin: &Frame) -> bool {
    origin.position.iter().all(|v| v.abs() <= LONGEST_M) && origin.rotation.iter().all(|v| v.is_finite())
}
