//! Links and joints as a URDF file says them, by the specification at <https://wiki.ros.org/urdf/XML>: what the chain of an arm needs, and nothing else.
//!
//! Visuals, meshes, transmissions and extensions of simulators are passed over.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};
use roxmltree::{Document, Node, ParsingOptions};

use crate::UrdfError;
use crate::error::{joint_error, link_error};

/// Elements, attributes and texts of a file, at most.
const MOST_NODES: u32 = 1_000_000;

/// A file.
#[derive(Debug)]
pub struct Urdf {
    /// In the order of the file.
    pub links: Vec<Link>,
    /// In the order of the file.
    pub joints: Vec<Joint>,
}

/// Place of a frame in another.
#[derive(Clone, Copy, Debug, Default)]
pub struct Origin {
    /// m.
    pub xyz: [f64; 3],
    /// Turns about fixed x, then y, then z, rad.
    pub rpy: [f64; 3],
}

/// A body.
#[derive(Debug)]
pub struct Link {
    /// As in the file.
    pub name: String,
    /// What it weighs; nothing where the file does not say.
    pub inertial: Inertial,
    /// Whether the file says what it weighs.
    pub has_inertial: bool,
    /// Shapes, each with its place in the link.
    pub collisions: Vec<(Origin, Geometry)>,
}

/// What a link weighs; nothing where the file does not say.
#[derive(Debug, Default)]
pub struct Inertial {
    /// Place of the centre of mass, and the axes of `inertia`.
    pub origin: Origin,
    /// kg.
    pub mass_kg: f64,
    /// ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, kg·m².
    pub inertia: [f64; 6],
}

/// A shape; lengths in m, along z.
#[derive(Clone, Copy, Debug)]
pub enum Geometry {
    /// About the origin.
    Sphere {
        /// m.
        radius: f64,
    },
    /// About the origin.
    Cylinder {
        /// m.
        radius: f64,
        /// m.
        length: f64,
    },
    /// A cylinder with half spheres at its ends.
    Capsule {
        /// m.
        radius: f64,
        /// Of the cylinder, m.
        length: f64,
    },
    /// A box or a mesh.
    Other,
}

/// What joins two links.
#[derive(Debug)]
pub struct Joint {
    /// As in the file.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Its place in the parent at position 0.
    pub origin: Origin,
    /// Name of the link that carries it.
    pub parent: String,
    /// Name of the link that it carries.
    pub child: String,
    /// Axis in its own frame; as in the file, so not always of length 1.
    pub axis: [f64; 3],
    /// What it can do.
    pub limit: Limit,
    /// Its friction.
    pub dynamics: Dynamics,
    /// The joint that it follows.
    pub mimic: Option<Mimic>,
}

/// Friction of a joint; 0 where the file does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dynamics {
    /// N·m·s/rad or N·s/m.
    pub damping: f64,
    /// N·m or N.
    pub friction: f64,
}

/// A joint that follows another: position = multiplier · other + offset.
#[derive(Clone, Debug)]
pub struct Mimic {
    /// Name of the other.
    pub joint: String,
    /// Without unit, or m/rad.
    pub multiplier: f64,
    /// rad or m.
    pub offset: f64,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// About an axis, within limits.
    Revolute,
    /// About an axis, without limits.
    Continuous,
    /// Along an axis.
    Prismatic,
    /// Not at all.
    Fixed,
    /// In all six directions.
    Floating,
    /// In a plane.
    Planar,
    /// About a point.
    Spherical,
}

impl JointKind {
    const ALL: [(&str, Self); 7] = [
        ("revolute", Self::Revolute),
        ("continuous", Self::Continuous),
        ("prismatic", Self::Prismatic),
        ("fixed", Self::Fixed),
        ("floating", Self::Floating),
        ("planar", Self::Planar),
        ("spherical", Self::Spherical),
    ];

    /// As in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

/// What a joint can do: rad or m, and per second, N·m or N.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// rad or m.
    pub lower: f64,
    /// rad or m.
    pub upper: f64,
    /// N·m or N; infinite where the file does not say, as of many.
    pub effort: f64,
    /// rad/s or m/s; infinite where the file does not say.
    pub velocity: f64,
}

/// Reads the text of the file at `path`, whose outermost element is `<robot>`.
pub(crate) fn read(path: &Path, text: &str) -> Result<Urdf, UrdfError> {
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let reason = match error {
            roxmltree::Error::DtdDetected => "expected no <!DOCTYPE …>: take it out".into(),
            error => whole_file::one_line(
                &format!("expected well-formed XML: {}", whole_file::plain(&error.to_string())),
                300,
            ),
        };
        UrdfError::Parse { path: path.into(), reason }
    })?;
    let root = document.root_element();
    let name = |node: &Node| node.attribute("name").unwrap_or("without a name").to_owned();
    let links =
        children(&root, "link").map(|node| link(&node).map_err(|reason| link_error(path, &name(&node), &reason)));
    let links = links.collect::<Result<_, _>>()?;
    let joints =
        children(&root, "joint").map(|node| joint(&node).map_err(|reason| joint_error(path, &name(&node), &reason)));
    Ok(Urdf { links, joints: joints.collect::<Result<_, _>>()? })
}

fn children<'a>(node: &Node<'a, 'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> + use<'a> {
    node.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// The only child of a name; two would contradict each other.
fn child<'a>(node: &Node<'a, 'a>, name: &'a str) -> Result<Option<Node<'a, 'a>>, String> {
    let mut all = children(node, name);
    match (all.next(), all.next()) {
        (found, None) => Ok(found),
        _ => Err(format!("<{}> has two <{name}>, expected one", node.tag_name().name())),
    }
}

fn text(node: &Node, key: &str) -> Result<String, String> {
    let value = node.attribute(key).map(ToString::to_string);
    value.ok_or_else(|| format!("<{}> has no attribute `{key}`", node.tag_name().name()))
}

fn number(node: &Node, key: &str) -> Result<f64, String> {
    let value = text(node, key)?;
    let found = || format!("<{} {key}={value:?}>: expected a number", node.tag_name().name());
    value.trim().parse().map_err(|_| found())
}

/// Three numbers; `default` without the attribute.
fn three(node: &Node, key: &str, default: [f64; 3]) -> Result<[f64; 3], String> {
    let Some(value) = node.attribute(key) else { return Ok(default) };
    let numbers: Result<Vec<f64>, _> = value.split_whitespace().map(str::parse).collect();
    let three = numbers.ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    three.ok_or_else(|| format!("<{} {key}={value:?}>: expected three numbers", node.tag_name().name()))
}

fn origin(node: &Node) -> Result<Origin, String> {
    let Some(origin) = child(node, "origin")? else { return Ok(Origin::default()) };
    let xyz = three(&origin, "xyz", [0.0; 3])?;
    // Of version 1.1 on.
    let Some(quaternion) = origin.attribute("quat_xyzw") else {
        return Ok(Origin { xyz, rpy: three(&origin, "rpy", [0.0; 3])? });
    };
    let numbers: Result<Vec<f64>, _> = quaternion.split_whitespace().map(str::parse).collect();
    let four = numbers.ok().and_then(|numbers| <[f64; 4]>::try_from(numbers).ok());
    let turn = four.and_then(|[x, y, z, w]| UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6));
    let turn = turn.ok_or_else(|| format!("<origin quat_xyzw={quaternion:?}>: expected a quaternion"))?;
    let (roll, pitch, yaw) = turn.euler_angles();
    Ok(Origin { xyz, rpy: [roll, pitch, yaw] })
}

fn link(node: &Node) -> Result<Link, String> {
    let inertial = child(node, "inertial")?.map(|inertial| self::inertial(&inertial)).transpose()?;
    let collisions = children(node, "collision").map(|collision| Ok((origin(&collision)?, geometry(&collision)?)));
    Ok(Link {
        name: text(node, "name")?,
        has_inertial: inertial.is_some(),
        inertial: inertial.unwrap_or_default(),
        collisions: collisions.collect::<Result<_, String>>()?,
    })
}

fn inertial(node: &Node) -> Result<Inertial, String> {
    let part = |name| child(node, name)?.ok_or_else(|| format!("<inertial> has no <{name}>, expected one"));
    let (mass, inertia) = (part("mass")?, part("inertia")?);
    let mut values = [0.0; 6];
    for (value, key) in values.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
        *value = number(&inertia, key)?;
    }
    Ok(Inertial { origin: origin(node)?, mass_kg: number(&mass, "value")?, inertia: values })
}

fn geometry(collision: &Node) -> Result<Geometry, String> {
    let shape = child(collision, "geometry")?.and_then(|node| node.children().find(Node::is_element));
    let Some(shape) = shape else { return Err("<collision> has no <geometry> with a shape".into()) };
    let [radius, length] = ["radius", "length"].map(|key| number(&shape, key));
    Ok(match shape.tag_name().name() {
        "sphere" => Geometry::Sphere { radius: radius? },
        "cylinder" => Geometry::Cylinder { radius: radius?, length: length? },
        "capsule" => Geometry::Capsule { radius: radius?, length: length? },
        _ => Geometry::Other,
    })
}

fn joint(node: &Node) -> Result<Joint, String> {
    let end = |name| {
        let end = child(node, name)?.ok_or_else(|| format!("<{name}> is missing, expected <{name} link=\"…\"/>"))?;
        text(&end, "link")
    };
    let kind = text(node, "type")?;
    let known = JointKind::ALL.iter().find(|(name, _)| *name == kind).map(|(_, kind)| *kind);
    let kind = known.ok_or_else(|| {
        let names: Vec<&str> = JointKind::ALL.iter().map(|(name, _)| *name).collect();
        format!("is of type {kind:?}, expected one of {}", names.join(", "))
    })?;
    let axis = child(node, "axis")?.map_or(Ok([1.0, 0.0, 0.0]), |axis| three(&axis, "xyz", [1.0, 0.0, 0.0]))?;
    let limit = child(node, "limit")?.map(|limit| self::limit(&limit)).transpose()?;
    Ok(Joint {
        name: text(node, "name")?,
        kind,
        origin: origin(node)?,
        parent: end("parent")?,
        child: end("child")?,
        axis,
        limit: limit.unwrap_or(Limit { lower: 0.0, upper: 0.0, effort: f64::INFINITY, velocity: f64::INFINITY }),
        dynamics: child(node, "dynamics")?.map_or(Ok(Dynamics::default()), |node| dynamics(&node))?,
        mimic: child(node, "mimic")?.map(|mimic| self::mimic(&mimic)).transpose()?,
    })
}

fn number_or(node: &Node, key: &str, default: f64) -> Result<f64, String> {
    if node.has_attribute(key) { number(node, key) } else { Ok(default) }
}

fn dynamics(node: &Node) -> Result<Dynamics, String> {
    Ok(Dynamics { damping: number_or(node, "damping", 0.0)?, friction: number_or(node, "friction", 0.0)? })
}

fn mimic(node: &Node) -> Result<Mimic, String> {
    let (multiplier, offset) = (number_or(node, "multiplier", 1.0)?, number_or(node, "offset", 0.0)?);
    Ok(Mimic { joint: text(node, "joint")?, multiplier, offset })
}

fn limit(node: &Node) -> Result<Limit, String> {
    // Version 1.2 has no limit where none is given, earlier ones have 0.
    let version = node.document().root_element().attribute("version").and_then(|text| text.trim().parse().ok());
    let free = if version.unwrap_or(1.0_f64) > 1.15 { f64::INFINITY } else { 0.0 };
    Ok(Limit {
        lower: number_or(node, "lower", -free)?,
        upper: number_or(node, "upper", free)?,
        effort: number_or(node, "effort", f64::INFINITY)?,
        velocity: number_or(node, "velocity", f64::INFINITY)?,
    })
}
