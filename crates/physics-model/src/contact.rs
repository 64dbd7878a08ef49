//! What the world exerts on the tool.
//!
//! Most of it are the impulses of the solver. A kinematic tool is moved whatever it meets, though: between it and a fixed body the
//! solver has nothing to solve, and an object squeezed between the two is resolved over many steps only. An arm is not rigid: it gives way
//! and pushes back with its stiffness. So an overlap of the tool beyond what soft contacts reach in a free push exerts
//! stiffness times overlap. It does not act on the body: it says what the arm feels, and makes it stop.

use rapier3d::geometry::{ColliderHandle, ColliderSet, ContactData, ContactPair, NarrowPhase};
use rapier3d::prelude::Vector;

use crate::config::WorldConfig;
use crate::robot::ToolShape;
use crate::world::{ToolPose, Wrench, array, pose, vector};

/// Overlap, m, that soft contacts reach where nothing blocks the push.
const FREE_OVERLAP_M: f32 = 0.002;

/// Mean wrench on the tool during the last step, about `center_m` (base frame): over the step's duration, the normal and friction impulses of
/// all its contacts, which total the substeps, and the resistance of an arm of the given stiffness.
pub(crate) fn tool_wrench(
    narrow_phase: &NarrowPhase,
    colliders: &ColliderSet,
    tool: &[ColliderHandle],
    center_m: [f64; 3],
    period_secs: f64,
    stiffness_npm: f64,
) -> Wrench {
    let center = vector(center_m);
    let (period, stiffness) = (period_secs as f32, stiffness_npm as f32);
    let (mut force, mut torque) = (Vector::ZERO, Vector::ZERO);
    for collider in tool {
        for pair in narrow_phase.contact_pairs_with(*collider) {
            let tool_is_first = pair.collider1 == *collider;
            for manifold in pair.solver_manifolds() {
                // The solver pushes the first body along −normal.
                let away = -manifold.data.normal;
                for point in manifold.contacts() {
                    let data = &point.data;
                    let blocked = (-point.dist - FREE_OVERLAP_M).max(0.0) * stiffness;
                    let push = away * (data.impulse / period + blocked) + tangential_impulse(data, away) / period;
                    let (push, local) = if tool_is_first { (push, point.local_p1) } else { (-push, point.local_p2) };
                    let at = colliders[*collider].position().transform_point(local);
                    force += push;
                    torque += (at - center).cross(push);
                }
            }
        }
    }
    Wrench { force_n: array(force), torque_nm: array(torque) }
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
