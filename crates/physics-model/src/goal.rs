//! A policy that knows the task: bring the tool behind the object, then push it towards the goal.

use nalgebra::Vector2;
use pomdp::{Policy, Rng};

use crate::action::Action;
use crate::model::{Particle, PushModel};
use crate::robot::ToolShape;

/// Of the object's radius, how far the tool may be off the line through the object and the goal and still push.
const PUSHING_SHARE: f64 = 0.4;
/// Pull back to that line while pushing, in moves along the line per radius off it.
const STEERING: f64 = 2.0;

/// Goes round the object to the side away from the goal and pushes along the line to the goal, steering back to it. It sees no obstacle
/// and turns no object: a demonstration, not a plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct GoalPolicy;

impl GoalPolicy {
    /// Direction in which the tool should go, base frame; not of unit length.
    fn direction(model: &PushModel, particle: &Particle) -> Option<Vector2<f64>> {
        let task = &model.config().task;
        let plane = |v: [f64; 3]| Vector2::new(v[0], v[1]);
        let object = plane(particle.state.object.position_m);
        let along = (Vector2::new(task.goal.x_m, task.goal.y_m) - object).try_normalize(1e-9)?;
        let across = Vector2::new(-along.y, along.x);
        let theta = &particle.theta.object;
        let radius_m = theta.shape.footprint_radius_m(theta.size_m);
        let offset = plane(model.tool_position_m(&particle.state.joints_rad)) - object;
        let (ahead_m, aside_m) = (offset.dot(&along), offset.dot(&across));
        let side = if aside_m < 0.0 { -across } else { across };
        let behind_m = radius_m + tool_extent_m(model, along);
        let beside_m = radius_m + tool_extent_m(model, -side) + task.step_m / 2.0;
        // What is wider than the object holds it between its ends: it goes where the tool goes. A narrow tool turns it round the contact.
        let half_width_m = tool_extent_m(model, across).min(tool_extent_m(model, -across));
        let (tolerance_m, steering) =
            if half_width_m > radius_m { (half_width_m, 0.0) } else { (PUSHING_SHARE * radius_m, STEERING) };
        let direction = if ahead_m < 0.0 && aside_m.abs() < tolerance_m {
            along - across * (steering * aside_m / radius_m)
        } else if ahead_m < -behind_m {
            // Far enough back to slide to the line.
            -side
        } else if aside_m.abs() < beside_m {
            // In the way: out to the side before going back.
            side - along * 0.5
        } else {
            -along
        };
        Some(direction)
    }
}

impl Policy<PushModel> for GoalPolicy {
    /// The reachable move in the plane that is nearest to the wanted direction; among equals the first.
    fn action(&self, model: &PushModel, particle: &Particle, _rng: &mut Rng) -> Action {
        let task = &model.config().task;
        let tool = model.tool_position_m(&particle.state.joints_rad);
        if tool[2] > task.tool_start_m[2] + task.step_m / 2.0 {
            return Action::DOWN;
        }
        let wanted = Self::direction(model, particle).unwrap_or_default();
        let mut best = (f64::NEG_INFINITY, Action::ALL[0]);
        for action in Action::ALL {
            let direction = action.direction();
            let target: [f64; 3] = std::array::from_fn(|i| tool[i] + task.step_m * direction[i]);
            let progress = wanted.x * direction[0] + wanted.y * direction[1];
            if direction[2] == 0.0 && task.reach.contains(target) && progress > best.0 {
                best = (progress, action);
            }
        }
        best.1
    }
}

/// How far the tool reaches from its centre in the horizontal unit `direction`, m.
fn tool_extent_m(model: &PushModel, direction: Vector2<f64>) -> f64 {
    // The tool never turns with respect to the base, so its commanded attitude will do.
    let [x, y, _] = model.robot().tool_rotation();
    let reach = |point: &[f64; 3]| {
        let row = |r: [f64; 3]| r[0] * point[0] + r[1] * point[1] + r[2] * point[2];
        row(x) * direction.x + row(y) * direction.y
    };
    let extents = model.robot().tool_shapes().iter().map(|shape| match shape {
        ToolShape::Ball { center_m, radius_m } => reach(center_m) + radius_m,
        ToolShape::Capsule { a_m, b_m, radius_m } => reach(a_m).max(reach(b_m)) + radius_m,
    });
    extents.fold(0.0, f64::max)
}
