//! The chain of an arm: which joints move, which are locked, and what each carries.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Unit, UnitVector3, Vector3};
use urdf_file::{Joint, JointKind, Limit, Origin, Urdf, joint_error, link_error};

use crate::arm::{ArmError, ArmJoint};
use crate::mass::Mass;

/// No link is further from its joint, m.
const LONGEST_M: f64 = 1000.0;

/// A joint, and all that it carries up to the next one, in a frame whose z is the axis.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// Frame of the segment before ← this one's at position 0.
    pub(crate) mount: IsometryMatrix3<f64>,
    pub(crate) slides: bool,
    pub(crate) mass: Mass,
}

impl Segment {
    pub(crate) fn parent_from_link(&self, position: f64) -> IsometryMatrix3<f64> {
        if self.slides {
            self.mount * Translation3::new(0.0, 0.0, position)
        } else {
            self.mount * Rotation3::from_axis_angle(&Vector3::z_axis(), position)
        }
    }
}

/// A pose of a file: turns about fixed x, then y, then z.
pub(crate) fn placed(origin: &Origin) -> IsometryMatrix3<f64> {
    let [roll, pitch, yaw] = origin.rpy;
    IsometryMatrix3::from_parts(Translation3::from(origin.xyz), Rotation3::from_euler_angles(roll, pitch, yaw))
}

/// Follows `chain` from the root of the file, locks all other joints, and puts each link's mass where it moves.
pub(crate) struct Walk<'a> {
    path: &'a Path,
    chain: &'a [&'a Joint],
    children: BTreeMap<&'a str, Vec<&'a Joint>>,
    pub(crate) segments: Vec<Segment>,
    /// Segment that carries a link (none: the base), and its place there.
    pub(crate) links: BTreeMap<&'a str, (Option<usize>, IsometryMatrix3<f64>)>,
    pub(crate) notes: Vec<String>,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(path: &'a Path, urdf: &'a Urdf, chain: &'a [&'a Joint]) -> Self {
        let mut children: BTreeMap<&str, Vec<&Joint>> = BTreeMap::new();
        for joint in &urdf.joints {
            children.entry(&joint.parent).or_default().push(joint);
        }
        Self { path, chain, children, segments: Vec::new(), links: BTreeMap::new(), notes: Vec::new() }
    }

    /// Places `link` and what hangs on it.
    pub(crate) fn visit(
        &mut self,
        link: &'a str,
        segment: Option<usize>,
        segment_from_link: &IsometryMatrix3<f64>,
    ) -> Result<(), ArmError> {
        self.links.insert(link, (segment, *segment_from_link));
        for joint in self.children.get(link).cloned().unwrap_or_default() {
            let origin = placed(&joint.origin);
            if !origin.translation.vector.iter().all(|v| v.abs() <= LONGEST_M)
                || joint.origin.rpy.iter().any(|v| !v.is_finite())
            {
                let problem = format!("origin is {:?}, expected finite values within {LONGEST_M} m", joint.origin.xyz);
                return Err(joint_error(self.path, &joint.name, &problem).into());
            }
            let at = segment_from_link * origin;
            if let Some(index) = self.chain.iter().position(|chained| chained.name == joint.name) {
                let turn = turn_to(&axis(joint, self.path)?);
                let slides = joint.kind == JointKind::Prismatic;
                self.segments.push(Segment { mount: at * turn, slides, mass: Mass::zero() });
                self.visit(
                    &joint.child,
                    Some(index),
                    &IsometryMatrix3::from_parts(Translation3::identity(), turn.inverse()),
                )?;
            } else {
                let locked = self.locked(joint)?;
                self.visit(&joint.child, segment, &(at * locked))?;
            }
        }
        Ok(())
    }

    /// Joint frame ← link frame of a joint that is off the chain: at 0, or at the limit next to it.
    fn locked(&mut self, joint: &Joint) -> Result<IsometryMatrix3<f64>, ArmError> {
        match joint.kind {
            JointKind::Fixed => return Ok(IsometryMatrix3::identity()),
            JointKind::Floating | JointKind::Planar | JointKind::Spherical => {
                self.notes.push(format!("{} joint {:?} is held at 0", joint.kind.name(), joint.name));
                return Ok(IsometryMatrix3::identity());
            }
            JointKind::Continuous | JointKind::Revolute | JointKind::Prismatic => {}
        }
        let limit = &joint.limit;
        let bounded = joint.kind != JointKind::Continuous && limit.lower < limit.upper;
        let position = if bounded { 0.0_f64.clamp(limit.lower, limit.upper) } else { 0.0 };
        let follows = joint.mimic.as_ref().map(|mimic| format!(", although it follows {:?}", mimic.joint));
        let unit = if joint.kind == JointKind::Prismatic { "m" } else { "rad" };
        self.notes.push(format!(
            "joint {:?} is locked at {position} {unit}{}",
            joint.name,
            follows.unwrap_or_default()
        ));
        let axis = axis(joint, self.path)?;
        Ok(if joint.kind == JointKind::Prismatic {
            IsometryMatrix3::from_parts(Translation3::from(*axis * position), Rotation3::identity())
        } else {
            IsometryMatrix3::from_parts(Translation3::identity(), Rotation3::from_axis_angle(&axis, position))
        })
    }
}

/// Joints from the root down to `last`, base first.
pub(crate) fn path_to<'a>(urdf: &'a Urdf, path: &Path, last: &str) -> Result<Vec<&'a Joint>, ArmError> {
    let mut found = Vec::new();
    let mut link = last;
    while let Some(joint) = urdf.joints.iter().find(|joint| joint.child == link) {
        found.push(joint);
        if found.len() > urdf.joints.len() {
            return Err(link_error(path, link, "is its own ancestor, expected a tree").into());
        }
        link = &joint.parent;
    }
    found.reverse();
    Ok(found)
}

pub(crate) fn joint_of(joint: &Joint, path: &Path) -> Result<ArmJoint, ArmError> {
    let (lower, upper) = match joint.kind {
        JointKind::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
        // Many files leave out what nobody there needs.
        _ if joint.limit.lower == 0.0 && joint.limit.upper == 0.0 => (f64::NEG_INFINITY, f64::INFINITY),
        _ => (joint.limit.lower, joint.limit.upper),
    };
    let Limit { velocity, effort, .. } = joint.limit;
    // What is no number is not in order either.
    let problem = if lower.partial_cmp(&upper) != Some(Ordering::Less) {
        Some(format!("limit is {lower} to {upper}, expected lower below upper"))
    } else {
        let mut rates = [("velocity", velocity), ("effort", effort)].into_iter();
        let wrong = |(_, value): &(&str, f64)| value.is_nan() || *value < 0.0;
        rates.find(wrong).map(|(what, value)| format!("limit of {what} is {value}, expected a number of at least 0"))
    };
    if let Some(problem) = problem {
        return Err(joint_error(path, &joint.name, &problem).into());
    }
    let dynamics = joint.dynamics;
    if !(dynamics.damping >= 0.0 && dynamics.friction >= 0.0 && (dynamics.damping + dynamics.friction).is_finite()) {
        let problem =
            format!("<dynamics> is {} and {}, expected numbers of at least 0", dynamics.damping, dynamics.friction);
        return Err(joint_error(path, &joint.name, &problem).into());
    }
    Ok(ArmJoint {
        name: joint.name.clone(),
        slides: joint.kind == JointKind::Prismatic,
        lower,
        upper,
        velocity: joint.limit.velocity,
        effort: joint.limit.effort,
        damping: dynamics.damping,
        friction: dynamics.friction,
    })
}

fn axis(joint: &Joint, path: &Path) -> Result<UnitVector3<f64>, ArmError> {
    let found = Unit::try_new(Vector3::from(joint.axis), 1e-6).filter(|unit| (unit.norm() - 1.0).abs() < 1e-6);
    found.ok_or_else(|| {
        joint_error(path, &joint.name, &format!("axis is {:?}, expected a direction", joint.axis)).into()
    })
}

/// A turn that brings +z to the axis.
fn turn_to(axis: &UnitVector3<f64>) -> Rotation3<f64> {
    let half_turn = || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Rotation3::rotation_between(&Vector3::z(), axis).unwrap_or_else(half_turn)
}
