//! A policy that knows the task: bring the tool behind the object, then push it towards the goal, round an obstacle in the way.

use nalgebra::Vector2;
use physics_model::robot::ToolShape;
use pomdp::{ActionPrior, Policy, Rng};

use crate::action::Action;
use crate::model::{Particle, PushModel};

/// Of the object's radius, how far the tool may be off the line through the object and the goal and still push.
const PUSHING_SHARE: f64 = 0.4;
/// Pull back to that line while pushing, in moves along the line per radius off it.
const STEERING: f64 = 2.0;
/// Nearer to the line behind the object than this (cosine of the angle at the object) the tool goes straight there.
const STRAIGHT_COSINE: f64 = 0.7;
/// Simulations that the policy's own action counts for at a new node, and how much less the others are worth than it.
const OWN_VISITS: u32 = 3;
const OTHERS_COST: f64 = 5.0;
/// Room, m, that is left between the object and an obstacle that it passes.
const ROOM_M: f64 = 0.01;

/// Goes round the object to the side away from the goal and pushes along the line to the goal, steering back to it; past an obstacle on
/// that line by a point beside it. It sees the whole state, so it is a rollout policy and a demonstration, not a plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct GoalPolicy;

impl GoalPolicy {
    /// Where the object should go next: the goal, or a point beside the obstacle that is in the way.
    fn target(model: &PushModel, particle: &Particle) -> Vector2<f64> {
        let goal = Vector2::new(model.config().task.goal.x_m, model.config().task.goal.y_m);
        let (Some(theta), Some(body)) = (&particle.theta.obstacle, &particle.state.obstacle) else { return goal };
        let object = plane(particle.state.object.position_m);
        let obstacle = plane(body.position_m);
        let shape = &particle.theta.object;
        let clearance_m =
            shape.shape.footprint_radius_m(shape.size_m) + theta.shape.footprint_radius_m(theta.size_m) + ROOM_M;
        let Some(along) = (goal - object).try_normalize(1e-9) else { return goal };
        let ahead_m = (obstacle - object).dot(&along);
        let aside = object + along * ahead_m - obstacle;
        // Behind the object, behind the goal or out of the way.
        let length_m = (goal - object).norm();
        if ahead_m <= 0.0 || ahead_m > length_m + clearance_m || aside.norm() >= clearance_m {
            return goal;
        }
        let across = Vector2::new(-along.y, along.x);
        let side = if aside.dot(&across) < 0.0 { -across } else { across };
        obstacle + side * clearance_m
    }

    /// Direction in which the tool should go, base frame; not of unit length.
    fn direction(model: &PushModel, particle: &Particle) -> Option<Vector2<f64>> {
        let object = plane(particle.state.object.position_m);
        let along = (Self::target(model, particle) - object).try_normalize(1e-9)?;
        let across = Vector2::new(-along.y, along.x);
        let theta = &particle.theta.object;
        let radius_m = theta.shape.footprint_radius_m(theta.size_m);
        let tool = model.tool_position_m(&particle.state.joints_rad);
        let offset = plane(tool) - object;
        let (ahead_m, aside_m) = (offset.dot(&along), offset.dot(&across));
        // What is wider than the object holds it between its ends: it goes where the tool goes. A narrow tool turns it round the contact.
        let half_width_m = tool_extent_m(model, across).min(tool_extent_m(model, -across));
        let (tolerance_m, steering) =
            if half_width_m > radius_m { (half_width_m, 0.0) } else { (PUSHING_SHARE * radius_m, STEERING) };
        if ahead_m < 0.0 && aside_m.abs() < tolerance_m {
            return Some(along - across * (steering * aside_m / radius_m));
        }
        // To the place behind the object: straight where nothing is in between, else round the object.
        let behind = -along * (radius_m + tool_extent_m(model, along) + ROOM_M);
        let away = offset.try_normalize(1e-9)?;
        if away.dot(&-along) > STRAIGHT_COSINE {
            return Some(behind - offset);
        }
        let round = Vector2::new(-away.y, away.x);
        let round = if round.dot(&along) > 0.0 { -round } else { round };
        let clear_m = radius_m + tool_extent_m(model, -away) + ROOM_M;
        Some(round + away * ((clear_m - offset.norm()) / model.config().task.step_m).clamp(-1.0, 1.0))
    }

    /// The reachable move in the plane that is nearest to the wanted direction; among equals the first.
    fn own_action(self, model: &PushModel, particle: &Particle) -> Action {
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

impl Policy<PushModel> for GoalPolicy {
    fn action(&self, model: &PushModel, particle: &Particle, _rng: &mut Rng) -> Action {
        self.own_action(model, particle)
    }

    /// The policy's own action counts as tried a few times with the leaf value, every other as tried once and a little worse: a tree of some
    /// hundred simulations then need not try all ten actions at every node before it goes deeper.
    fn priors(&self, model: &PushModel, particle: &Particle, priors: &mut [ActionPrior]) {
        let value = self.leaf_value(model, particle, model.config().task.horizon);
        let own = self.own_action(model, particle).index();
        for (index, prior) in priors.iter_mut().enumerate() {
            let (visits, value) = if index == own { (OWN_VISITS, value) } else { (1, value - OTHERS_COST) };
            *prior = ActionPrior { visits, value, ..ActionPrior::default() };
        }
    }

    /// As if tool and object went straight, step by step: first the tool to the place behind the object, then both to the goal region.
    fn leaf_value(&self, model: &PushModel, particle: &Particle, actions_left: usize) -> f64 {
        let task = &model.config().task;
        let object = plane(particle.state.object.position_m);
        let tool = model.tool_position_m(&particle.state.joints_rad);
        let target = Self::target(model, particle);
        let goal = Vector2::new(task.goal.x_m, task.goal.y_m);
        let along = (target - object).try_normalize(1e-9).unwrap_or_default();
        let theta = &particle.theta.object;
        let behind = theta.shape.footprint_radius_m(theta.size_m) + tool_extent_m(model, along);
        let place = object - along * behind;
        let to_place_m = (place - plane(tool)).norm();
        let by_way_m = if target == goal { 0.0 } else { (goal - target).norm() };
        let to_goal_m = ((target - object).norm() + by_way_m - task.goal.radius_m).max(0.0);
        let steps = ((to_place_m + to_goal_m) / task.step_m).ceil().max(1.0) as usize;
        let cost = |count: usize| (0..count).map(|t| task.reward.step * task.discount.powi(t as i32)).sum::<f64>();
        // An object that the tool cannot get behind is lost: it stands or has rolled where it can only be pushed farther away.
        if steps > actions_left || !task.reach.contains([place.x, place.y, tool[2]]) {
            return cost(actions_left);
        }
        cost(steps) + task.reward.goal * task.discount.powi(steps as i32 - 1)
    }
}

fn plane(position_m: [f64; 3]) -> Vector2<f64> {
    Vector2::new(position_m[0], position_m[1])
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
