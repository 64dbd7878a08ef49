//! Which hypotheses can be worlds at all, and in which worlds nothing will happen: checks that need no simulation.

use rapier3d::parry::bounding_volume::Aabb;
use rapier3d::prelude::{Pose, SharedShape, Vector};

use crate::bodies::{shape_axis_angle, shared_shape};
use crate::config::{ObstacleMobility, WorldConfig};
use crate::error::Impossible;
use crate::robot::ToolShape;
use crate::state::BodyState;
use crate::theta::{ObjectShape, Theta};
use crate::world::{ToolPose, pose, vector};

/// Deepest overlap, m, at which two bodies may be restored: what soft contacts reach in a hard push, and no more.
pub const OVERLAP_LIMIT_M: f64 = 0.006;
/// Slower than this a body is at rest: friction stops it within a micrometre.
const RESTING_SPEED_MPS: f64 = 0.002;
const RESTING_SPIN_RPS: f64 = 0.02;
/// Overlap of two resting bodies, m.
const RESTING_OVERLAP_M: f64 = 0.0002;
/// Height over the resting height, m, and squared x–y part of the quaternion (2° of tilt) of a body that stands on the table.
const RESTING_HEIGHT_M: f64 = 0.001;
const RESTING_TILT_SQUARED: f64 = 3e-4;
/// Horizontal distance, m, of a resting sphere's centre of mass from its centre: what rolling resistance holds.
const RESTING_COM_M: f64 = 0.002;
/// Distance, m, at which the tool passes clear of a body.
const CLEARANCE_M: f32 = 0.002;
/// How far, m, a body at rest may get in an action towards a part of the tool that does not push it: a move is 2 cm.
const BODY_REACH_M: f32 = 0.04;

/// Whether nothing can happen while the tool moves in a straight line from `tool` to `target_m`: every body stands upright at rest and the
/// tool passes clear of all of them. Then a simulated world would return the state it was given, up to the settling of its
/// contacts by some 0.1 mm, and need not be simulated. Only meant for vertical gravity: a tilt can set a resting body in motion.
#[must_use]
pub fn nothing_happens(
    config: &WorldConfig,
    theta: &Theta,
    object: &BodyState,
    obstacle: Option<&BodyState>,
    tool: &ToolPose,
    target_m: [f64; 3],
    tool_shapes: &[ToolShape],
) -> bool {
    let clear = |shape: ObjectShape, size_m: [f64; 3], body: &BodyState| {
        let bounds = body_bounds(shape, size_m, body);
        tool_shapes.iter().all(|part| apart(&swept_bounds(part, tool, target_m), &bounds, CLEARANCE_M))
    };
    let obstacle_quiet = match (&theta.obstacle, obstacle) {
        (Some(o), Some(body)) => {
            let moves = config.obstacle_mobility == ObstacleMobility::Movable;
            (!moves || rests(config, o.shape, o.size_m, [0.0; 3], body)) && clear(o.shape, o.size_m, body)
        }
        _ => true,
    };
    let o = &theta.object;
    obstacle_quiet
        && rests(config, o.shape, o.size_m, o.com_m, object)
        && clear(o.shape, o.size_m, object)
        && !squeezed(theta, object, obstacle)
}

/// Whether object and obstacle overlap so much that they will push each other apart.
fn squeezed(theta: &Theta, object: &BodyState, obstacle: Option<&BodyState>) -> bool {
    let Some((o, body)) = theta.obstacle.as_ref().zip(obstacle) else { return false };
    let first = placed(theta.object.shape, theta.object.size_m, object);
    let second = placed(o.shape, o.size_m, body);
    overlap_m(&first, &second) > RESTING_OVERLAP_M
}

/// Whether a body stands upright on the table, at rest.
fn rests(config: &WorldConfig, shape: ObjectShape, size_m: [f64; 3], com_m: [f64; 3], body: &BodyState) -> bool {
    let speed = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [x, y, _, _] = body.orientation;
    let upright = if shape == ObjectShape::Sphere {
        let com = pose([0.0; 3], body.orientation).transform_vector(vector(com_m));
        com.x.hypot(com.y) < RESTING_COM_M as f32
    } else {
        x * x + y * y < RESTING_TILT_SQUARED
    };
    let height_m = body.position_m[2] - config.table_height_m - shape.half_height_m(size_m);
    speed(body.linear_mps) < RESTING_SPEED_MPS
        && speed(body.angular_rps) < RESTING_SPIN_RPS
        && upright
        && height_m.abs() < RESTING_HEIGHT_M
}

/// The parts of the tool that can touch anything while it moves in a straight line to `target_m`: those that come near a body, or the
/// table. The others need not be simulated.
#[must_use]
pub fn parts_in_reach(
    config: &WorldConfig,
    theta: &Theta,
    object: &BodyState,
    obstacle: Option<&BodyState>,
    tool: &ToolPose,
    target_m: [f64; 3],
    tool_shapes: &[ToolShape],
) -> Vec<ToolShape> {
    // A body that moves or tips may come from anywhere: a loaded sphere gains speed as it rolls.
    let moves = config.obstacle_mobility == ObstacleMobility::Movable;
    let obstacle_rests = theta
        .obstacle
        .as_ref()
        .zip(obstacle)
        .is_none_or(|(o, body)| !moves || rests(config, o.shape, o.size_m, [0.0; 3], body));
    let o = &theta.object;
    if !(obstacle_rests && rests(config, o.shape, o.size_m, o.com_m, object)) {
        return tool_shapes.to_vec();
    }
    let object = body_bounds(theta.object.shape, theta.object.size_m, object);
    let obstacle = theta.obstacle.as_ref().zip(obstacle).map(|(o, body)| body_bounds(o.shape, o.size_m, body));
    let table_m = config.table_height_m as f32 + CLEARANCE_M;
    tool_shapes
        .iter()
        .filter(|part| {
            let swept = swept_bounds(part, tool, target_m);
            swept.mins.z < table_m
                || !apart(&swept, &object, BODY_REACH_M)
                || obstacle.is_some_and(|obstacle| !apart(&swept, &obstacle, BODY_REACH_M))
        })
        .copied()
        .collect()
}

fn body_bounds(shape: ObjectShape, size_m: [f64; 3], body: &BodyState) -> Aabb {
    let (at, shape) = placed(shape, size_m, body);
    shape.compute_aabb(&at)
}

/// Box around a part of the tool on its way.
fn swept_bounds(part: &ToolShape, tool: &ToolPose, target_m: [f64; 3]) -> Aabb {
    let (a, b, radius) = match part {
        ToolShape::Ball { center_m, radius_m } => (vector(*center_m), vector(*center_m), *radius_m as f32),
        ToolShape::Capsule { a_m, b_m, radius_m } => (vector(*a_m), vector(*b_m), *radius_m as f32),
    };
    let from = pose(tool.position_m, tool.orientation);
    let to = pose(target_m, tool.orientation);
    let ends = [from.transform_point(a), from.transform_point(b), to.transform_point(a), to.transform_point(b)];
    let low = ends.iter().fold(Vector::splat(f32::MAX), |m, p| m.min(*p)) - Vector::splat(radius);
    let high = ends.iter().fold(Vector::splat(f32::MIN), |m, p| m.max(*p)) + Vector::splat(radius);
    Aabb::new(low, high)
}

/// Whether two boxes are further apart than `margin_m` along an axis.
fn apart(a: &Aabb, b: &Aabb, margin_m: f32) -> bool {
    let margin = Vector::splat(margin_m);
    (a.mins - margin).cmpgt(b.maxs).any() || (a.maxs + margin).cmplt(b.mins).any()
}

/// Checks the values of Θ against their physical range: finite, positive masses and sizes, friction in [0, 1], centre of mass
/// within the shape's largest size.
///
/// # Errors
///
/// [`Impossible`], naming the value and its range.
pub fn check_theta(theta: &Theta) -> Result<(), Impossible> {
    let range = |what, value: f64, low: f64, high: f64| {
        if !value.is_finite() {
            Err(Impossible::NotFinite { what })
        } else if value < low || value > high {
            Err(Impossible::OutOfRange { what, value, low, high })
        } else {
            Ok(())
        }
    };
    let object = &theta.object;
    range("object mass (kg)", object.mass_kg, 0.005, 100.0)?;
    range("object friction", object.friction, 0.0, 1.0)?;
    for size in &object.size_m[..object.shape.size_count()] {
        range("object size (m)", *size, 0.005, 1.0)?;
    }
    for (com, half) in object.com_m.iter().zip(object.shape.half_extents_m(object.size_m)) {
        range("object centre of mass (m)", *com, -half, half)?;
    }
    if object.shape == ObjectShape::Cylinder {
        let [x, y, _] = object.com_m;
        range("distance of the centre of mass from the cylinder's axis (m)", x.hypot(y), 0.0, object.size_m[0])?;
    }
    if let Some(obstacle) = &theta.obstacle {
        range("obstacle mass (kg)", obstacle.mass_kg, 0.005, 1000.0)?;
        for size in &obstacle.size_m[..obstacle.shape.size_count()] {
            range("obstacle size (m)", *size, 0.005, 1.0)?;
        }
    }
    for effect in &theta.effects {
        let [low, high] = effect.parameter.parameter().limits;
        range(effect.parameter.parameter().name, effect.value, low, high)?;
    }
    Ok(())
}

/// Checks that the bodies of a hypothesis do not overlap more than soft contacts do, and that none has sunk into the table.
///
/// # Errors
///
/// [`Impossible`], naming the bodies or values.
pub fn check_overlaps(
    config: &WorldConfig,
    theta: &Theta,
    object: &BodyState,
    obstacle: Option<&BodyState>,
    tool: &ToolPose,
    tool_shapes: &[ToolShape],
) -> Result<(), Impossible> {
    let mut bodies = vec![("object", placed(theta.object.shape, theta.object.size_m, object))];
    if let (Some(parameters), Some(state)) = (&theta.obstacle, obstacle) {
        bodies.push(("obstacle", placed(parameters.shape, parameters.size_m, state)));
    }
    for (what, (at, shape)) in &bodies {
        if !at.is_finite() {
            return Err(Impossible::NotFinite { what });
        }
        let lowest = f64::from(shape.compute_aabb(at).mins.z) - config.table_height_m;
        if lowest < -OVERLAP_LIMIT_M {
            return Err(Impossible::Overlap {
                first: what,
                second: "table",
                depth_m: -lowest,
                limit_m: OVERLAP_LIMIT_M,
            });
        }
    }
    let base_from_tool = pose(tool.position_m, tool.orientation);
    let tool_parts = tool_shapes.iter().map(|shape| match shape {
        ToolShape::Ball { center_m, radius_m } => {
            (base_from_tool * Pose::from_translation(vector(*center_m)), SharedShape::ball(*radius_m as f32))
        }
        ToolShape::Capsule { a_m, b_m, radius_m } => {
            (base_from_tool, SharedShape::capsule(vector(*a_m), vector(*b_m), *radius_m as f32))
        }
    });
    let mut pairs = Vec::new();
    for part in tool_parts {
        for (name, other) in &bodies {
            pairs.push(("tool", part.clone(), *name, other.clone()));
        }
    }
    if let [(first, a), (second, b)] = bodies.as_slice() {
        pairs.push((first, a.clone(), second, b.clone()));
    }
    for (first, a, second, b) in pairs {
        let depth_m = overlap_m(&a, &b);
        if depth_m > OVERLAP_LIMIT_M {
            return Err(Impossible::Overlap { first, second, depth_m, limit_m: OVERLAP_LIMIT_M });
        }
    }
    Ok(())
}

/// A shape and where it is.
type Placed = (Pose, SharedShape);

fn placed(shape: ObjectShape, size_m: [f64; 3], body: &BodyState) -> Placed {
    let local = Pose::rotation(shape_axis_angle(shape));
    (pose(body.position_m, body.orientation) * local, shared_shape(shape, size_m))
}

/// Depth, m, to which two shapes overlap; 0 where they do not.
fn overlap_m((at_a, a): &Placed, (at_b, b): &Placed) -> f64 {
    // The boxes around them say no in most cases, at a fraction of the time.
    if apart(&a.compute_aabb(at_a), &b.compute_aabb(at_b), 0.0) {
        return 0.0;
    }
    let contact = rapier3d::parry::query::contact(at_a, &**a, at_b, &**b, 0.0).ok().flatten();
    contact.map_or(0.0, |contact| (-f64::from(contact.dist)).max(0.0))
}
