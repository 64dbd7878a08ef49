//! Links and joints as a URDF file says them, by the specification at <https://wiki.ros.org/urdf/XML>: what the chain of an arm needs, and nothing else.
//!
//! Visuals, meshes, transmissions and extensions of simulators are passed over.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};
use roxmltree::{Document, Node, ParsingOptions};

use super::RobotError;
use super::error::{joint_error, link_error};

/// Elements, attributes and texts of a file, at most.
const MOST_NODES: u32 = 1_000_000;

/// A file.
#[derive(Debug)]
pub(super) struct Urdf {
    pub(super) links: Vec<Link>,
    pub(super) joints: Vec<Joint>,
}

/// Place of a frame in another.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Origin {
    /// m.
    pub(super) xyz: [f64; 3],
    /// Turns about fixed x, then y, then z, rad.
    pub(super) rpy: [f64; 3],
}

#[derive(Debug)]
pub(super) struct Link {
    pub(super) name: String,
    pub(super) inertial: Inertial,
    pub(super) collisions: Vec<(Origin, Geometry)>,
}

/// What a link weighs; nothing where the file does not say.
#[derive(Debug, Default)]
pub(super) struct Inertial {
    pub(super) origin: Origin,
    pub(super) mass_kg: f64,
    /// ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, kg·m².
    pub(super) inertia: [f64; 6],
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Geometry {
    Sphere {
        radius: f64,
    },
    Cylinder {
        radius: f64,
        length: f64,
    },
    Capsule {
        radius: f64,
        length: f64,
    },
    /// A box or a mesh.
    Other,
}

#[derive(Debug)]
pub(super) struct Joint {
    pub(super) name: String,
    pub(super) kind: JointKind,
    pub(super) origin: Origin,
    pub(super) parent: String,
    pub(super) child: String,
    pub(super) axis: [f64; 3],
    pub(super) limit: Limit,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JointKind {
    Revolute,
    Continuous,
    Prismatic,
    Fixed,
    Floating,
    Planar,
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
    pub(super) fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

/// rad or m, and per second, N·m or N.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) effort: f64,
    /// Like the effort infinite where the file does not say: many do not, and nothing here uses them.
    pub(super) velocity: f64,
}

/// Reads the text of the file at `path`, whose outermost element is `<robot>`.
pub(super) fn read(path: &Path, text: &str) -> Result<Urdf, RobotError> {
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let reason = match error {
            roxmltree::Error::DtdDetected => "expected no <!DOCTYPE …>: take it out".into(),
            error => whole_file::one_line(
                &format!("expected well-formed XML: {}", whole_file::plain(&error.to_string())),
                300,
            ),
        };
        RobotError::Parse { path: path.into(), reason }
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
        limit: limit.unwrap_or(Limit { lower: 0.0, upper: 0.0, effort: 0.0, velocity: f64::INFINITY }),
    })
}

fn limit(node: &Node) -> Result<Limit, String> {
    // Version 1.2 has no limit where none is given, earlier ones have 0.
    let version = node.document().root_element().attribute("version").and_then(|text| text.trim().parse().ok());
    let free = if version.unwrap_or(1.0_f64) > 1.15 { f64::INFINITY } else { 0.0 };
    let or = |key, value: f64| if node.has_attribute(key) { number(node, key) } else { Ok(value) };
    Ok(Limit {
        lower: or("lower", -free)?,
        upper: or("upper", free)?,
        effort: or("effort", f64::INFINITY)?,
        velocity: or("velocity", f64::INFINITY)?,
    })
}
