//! What the world exerts on the tool.
//!
//! Most of it are the impulses of the solver. A kinematic tool is moved whatever it meets, though: between it and a fixed body the
//! solver has nothing to solve, and an object squeezed between the two is resolved over many steps only. An arm is not rigid: it gives way
//! and pushes back with its stiffness. So where the tool overlaps a body by more than soft contacts do in a free push, the arm feels at least
//! stiffness times overlap along the normal of the deepest contact. It does not act on the body: it says what the arm feels, and makes it
//! stop.
//!
//! The solver's share of a squeeze rises with the mass of what is squeezed, for rapier's contact springs are tuned by frequency and not by
//! stiffness: 0.5 mm of travel against a blocked object of 5 kg is felt as some 50 N, of 0.05 kg as 1 N. From 2 mm on the arm's
//! stiffness is the larger of the two for the usual masses.

use rapier3d::geometry::{ColliderHandle, ColliderSet, ContactData, ContactPair, NarrowPhase};
use rapier3d::prelude::Vector;

use crate::config::WorldConfig;
use crate::robot::ToolShape;
use crate::world::{ToolPose, Wrench, array, pose, vector};

/// Overlap, m, that soft contacts reach where nothing blocks the push.
const FREE_OVERLAP_M: f32 = 0.002;
/// Most bodies that a tool can be told to touch: object, obstacle and two that only effects know of. The table is no collider to it (see
/// [`table_wrench`]).
const BODIES: usize = 4;

/// What the tool's contacts with one body amount to.
#[derive(Clone, Copy)]
struct Touch {
    body: ColliderHandle,
    /// Force of all contacts along their normals, N.
    normal: Vector,
    /// Deepest overlap, m, the direction in which it pushes the tool, and where.
    deepest: f32,
    away: Vector,
    at: Vector,
}

/// Mean wrench on the tool during the last step, about `center_m` (base frame), and its part along the contact normals, N: over the step's
/// duration, the normal and friction impulses of all contacts, which total the substeps, or the resistance of an arm of the given
/// stiffness where that is larger.
pub(crate) fn tool_wrench(
    narrow_phase: &NarrowPhase,
    colliders: &ColliderSet,
    tool: &[ColliderHandle],
    center_m: [f64; 3],
    period_secs: f64,
    stiffness_npm: f64,
) -> (Wrench, [f64; 3]) {
    let center = vector(center_m);
    let (period, stiffness) = (period_secs as f32, stiffness_npm as f32);
    let (mut force, mut torque, mut normal) = (Vector::ZERO, Vector::ZERO, Vector::ZERO);
    let mut touches: [Option<Touch>; BODIES] = [None; BODIES];
    for collider in tool {
        for pair in narrow_phase.contact_pairs_with(*collider) {
            let tool_is_first = pair.collider1 == *collider;
            let body = if tool_is_first { pair.collider2 } else { pair.collider1 };
            for manifold in pair.solver_manifolds() {
                // The solver pushes the first body along −normal.
                let away = -manifold.data.normal;
                for point in manifold.contacts() {
                    let data = &point.data;
                    let sign = if tool_is_first { 1.0 } else { -1.0 };
                    let local = if tool_is_first { point.local_p1 } else { point.local_p2 };
                    let at = colliders[*collider].position().transform_point(local);
                    let along = away * (sign * data.impulse / period);
                    let push = along + tangential_impulse(data, away) * (sign / period);
                    force += push;
                    torque += (at - center).cross(push);
                    let free = touches.iter().position(|t| t.is_none_or(|t| t.body == body));
                    let Some(slot) = free else { continue };
                    let none = Touch { body, normal: Vector::ZERO, deepest: 0.0, away: Vector::ZERO, at: Vector::ZERO };
                    let touch = touches[slot].get_or_insert(none);
                    touch.normal += along;
                    if -point.dist > touch.deepest {
                        (touch.deepest, touch.away, touch.at) = (-point.dist, away * sign, at);
                    }
                }
            }
        }
    }
    for touch in touches.into_iter().flatten() {
        let resistance = stiffness * (touch.deepest - FREE_OVERLAP_M).max(0.0);
        let missing = touch.away * (resistance - touch.normal.dot(touch.away)).max(0.0);
        normal += touch.normal;
        if resistance > 0.0 {
            force += missing;
            normal += missing;
            torque += (touch.at - center).cross(missing);
        }
    }
    (Wrench { force_n: array(force), torque_nm: array(torque) }, array(normal))
}

/// Lowest point of the tool from its centre, m, base axes.
pub(crate) fn lowest_point(tool: &ToolPose, shapes: &[ToolShape]) -> Vector {
    let turn = pose([0.0; 3], tool.orientation);
    let mut lowest = Vector::new(0.0, 0.0, f32::INFINITY);
    for shape in shapes {
        let (ends, radius_m) = match shape {
            ToolShape::Ball { center_m, radius_m } => ([*center_m; 2], radius_m),
            ToolShape::Capsule { a_m, b_m, radius_m } => ([*a_m, *b_m], radius_m),
        };
        for end in ends {
            let point = turn.transform_point(vector(end)) - Vector::Z * (*radius_m as f32);
            if point.z < lowest.z {
                lowest = point;
            }
        }
    }
    lowest
}

/// The table's push on a tool at `center_m` whose lowest point, from there, is `lowest`: the arm's resistance as for other fixed bodies. The two
/// get no contact in the engine, because they meet only where a scenario lets the tool move into the table.
pub(crate) fn table_wrench(config: &WorldConfig, center_m: [f64; 3], lowest: Vector) -> Wrench {
    let overlap = (config.table_height_m - center_m[2]) as f32 - lowest.z - FREE_OVERLAP_M;
    if overlap <= 0.0 {
        return Wrench::default();
    }
    let push = Vector::Z * (overlap * config.arm_stiffness_npm as f32);
    Wrench { force_n: array(push), torque_nm: array(lowest.cross(push)) }
}

/// Whether two bodies touch: they push each other, or overlap where the solver has nothing to solve.
pub(crate) fn touches(pair: &ContactPair) -> bool {
    pair.total_impulse_magnitude() > 0.0
        || pair.solver_manifolds().iter().any(|manifold| manifold.contacts().iter().any(|point| point.dist < 0.0))
}

/// Friction impulse of a contact in world axes, on the first body.
///
/// rapier gives the total in the solver's tangent basis, which it does not expose; the last substep's impulse is given both in
/// that basis and in world axes, which reveals the basis.
fn tangential_impulse(data: &ContactData, away: Vector) -> Vector {
    let last = data.warmstart_tangent_impulse;
    let squared = last.x * last.x + last.y * last.y;
    if squared < 1e-20 {
        return Vector::ZERO;
    }
    let world = data.warmstart_tangent_world;
    let first = (world * last.x - away.cross(world) * last.y) / squared;
    first * data.tangent_impulse.x + away.cross(first) * data.tangent_impulse.y
}
