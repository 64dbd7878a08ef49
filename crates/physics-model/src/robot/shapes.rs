//! Collision primitives of the tool: what of the hand can touch objects.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::chain::Frame;
use urdf_file::{Geometry, Link};

/// A collision primitive, fixed in the frame of `tool_link`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ToolShape {
    /// Ball.
    Ball {
        /// Centre, m, tool frame.
        center_m: [f64; 3],
        /// Radius, m.
        radius_m: f64,
    },
    /// All points within a radius of a segment.
    Capsule {
        /// One end of the segment, m, tool frame.
        a_m: [f64; 3],
        /// Other end of the segment, m, tool frame.
        b_m: [f64; 3],
        /// Radius, m.
        radius_m: f64,
    },
}

/// A sphere counts as the cap of a cylinder's end if its centre is this near, m: the lengths of our capsules are rounded.
const CAP_TOLERANCE_M: f64 = 2e-4;

/// What is longer, or further away, is no tool, m.
const LONGEST_M: f64 = 10.0;

struct Ball {
    center: Vector3<f64>,
    radius: f64,
    absorbed: bool,
}

/// Balls and capsules of one link, m, in the frame that `target_from_link` leads to. URDF has no capsule, so:
///
/// - a cylinder whose ends are capped by spheres is the capsule between the caps (spheres of the same radius go into it);
/// - an end without a cap is rounded inside the cylinder, so that the tip stays where it is;
/// - a cylinder without caps and not longer than its diameter is a flange, no tool, and is left out.
///
/// # Errors
///
/// A sentence, if a shape is a box or a mesh or has a radius that is not positive.
pub(super) fn link_shapes(link: &Link, target_from_link: &Frame) -> Result<Vec<ToolShape>, String> {
    let mut balls = Vec::new();
    let mut cylinders = Vec::new();
    let mut shapes = Vec::new();
    for (origin, geometry) in &link.collisions {
        let origin = Frame::from_xyz_rpy(origin.xyz, origin.rpy);
        let target_from_shape = target_from_link.then(&origin);
        let (radius, length) = match geometry {
            Geometry::Sphere { radius } => (*radius, 0.0),
            Geometry::Cylinder { radius, length } | Geometry::Capsule { radius, length } => (*radius, *length),
            Geometry::Other => {
                return Err("collision is a box or a mesh, expected sphere, cylinder or capsule on the tool".into());
            }
        };
        let placed = target_from_shape.position.iter().all(|v| v.abs() <= LONGEST_M)
            && target_from_shape.rotation.iter().all(|v| v.is_finite());
        if !(radius > 0.0 && radius <= LONGEST_M && (0.0..=LONGEST_M).contains(&length) && placed) {
            return Err(format!(
                "collision has radius {radius} and length {length}, expected positive numbers within {LONGEST_M} m of the tool"
            ));
        }
        let end = |side: f64| target_from_shape.point(&Vector3::new(0.0, 0.0, side * length / 2.0));
        match geometry {
            Geometry::Sphere { .. } => balls.push(Ball { center: end(0.0), radius, absorbed: false }),
            Geometry::Capsule { .. } => shapes.push(capsule(end(-1.0), end(1.0), radius)),
            _ => cylinders.push((end(-1.0), end(1.0), radius)),
        }
    }
    for (a, b, radius) in cylinders {
        let ends = [(a, b), (b, a)].map(|(end, other)| cap(&mut balls, end, radius).ok_or((end, other)));
        if ends.iter().all(Result::is_err) && (b - a).norm() <= 2.0 * radius {
            tracing::debug!(link = link.name, radius, "flat cylinder is not a tool shape");
            continue;
        }
        let [a, b] = ends.map(|end| {
            end.unwrap_or_else(|(end, other)| {
                let length = (other - end).norm();
                end + (other - end) * (radius.min(length) / length)
            })
        });
        shapes.push(capsule(a, b, radius));
    }
    let alone = balls.iter().filter(|ball| !ball.absorbed);
    shapes.extend(alone.map(|ball| ToolShape::Ball { center_m: ball.center.into(), radius_m: ball.radius }));
    Ok(shapes)
}

fn capsule(a: Vector3<f64>, b: Vector3<f64>, radius_m: f64) -> ToolShape {
    ToolShape::Capsule { a_m: a.into(), b_m: b.into(), radius_m }
}

/// Centre of the sphere that caps a cylinder's end; one of the same radius becomes part of the capsule.
fn cap(balls: &mut [Ball], end: Vector3<f64>, radius: f64) -> Option<Vector3<f64>> {
    let ball = balls.iter_mut().find(|b| b.radius >= radius && (b.center - end).norm() < CAP_TOLERANCE_M)?;
    ball.absorbed |= ball.radius == radius;
    Some(ball.center)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes(collisions: &[(&str, &str)]) -> Result<Vec<ToolShape>, String> {
        let body: String = collisions
            .iter()
            .map(|(xyz, g)| format!("<collision><origin xyz=\"{xyz}\"/><geometry><{g}/></geometry></collision>"))
            .collect();
        let text = format!("<robot name=\"r\"><link name=\"hand\">{body}</link></robot>");
        let urdf = urdf_file::parse(std::path::Path::new("hand.urdf"), &text).expect("URDF");
        link_shapes(&urdf.links[0], &Frame::identity())
    }

    #[test]
    fn cylinder_between_equal_spheres_is_one_capsule() {
        let found = shapes(&[
            ("0 0 0.1", "cylinder radius=\"0.02\" length=\"0.2\""),
            ("0 0 0", "sphere radius=\"0.02\""),
            ("0 0 0.2", "sphere radius=\"0.02\""),
        ]);
        assert_eq!(found, Ok(vec![ToolShape::Capsule { a_m: [0.0; 3], b_m: [0.0, 0.0, 0.2], radius_m: 0.02 }]));
    }

    #[test]
    fn bare_cylinder_keeps_its_tip_and_a_flat_one_is_no_tool() {
        let found = shapes(&[
            ("0 0 0.05", "cylinder radius=\"0.01\" length=\"0.1\""),
            ("0 0 0", "cylinder radius=\"0.03\" length=\"0.05\""),
        ]);
        let Ok([ToolShape::Capsule { a_m, b_m, radius_m }]) = found.as_deref() else { panic!("{found:?}") };
        assert!((a_m[2] - 0.01).abs() < 1e-15 && (b_m[2] - 0.09).abs() < 1e-15 && *radius_m == 0.01, "{a_m:?} {b_m:?}");
    }

    #[test]
    fn box_on_the_tool_is_an_error() {
        assert!(shapes(&[("0 0 0", "box size=\"1 1 1\"")]).unwrap_err().contains("expected sphere"));
    }
}
