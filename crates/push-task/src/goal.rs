//! A policy that knows the task: bring the tool behind the object, then push it towards the goal, round an obstacle in the way.

use nalgebra::Vector2;
use pomdp::{ActionPrior, Policy, Rng};

use crate::action::Action;
use crate::model::{Particle, PushModel};
use crate::route::{Route, routes};
use crate::way::{Circle, Ground, ROOM_M};

/// Of the object's radius, how far the tool may be off the line through the object and the goal and still push.
const PUSHING_SHARE: f64 = 0.4;
/// Pull back to that line while pushing, in moves along the line per radius off it.
const STEERING: f64 = 2.0;
/// Of the goal's radius, how far beside its centre the object may be aimed. Of 0, 0.3, 0.6 and 0.9: with full knowledge of 300 worlds each of D4 and D5
/// (seed 1003) the policy alone earns most with 0.3.
const AIM_SHARE: f64 = 0.3;
/// Simulations that the policy's own action counts for at a new node, and how much less the others are worth than it.
const OWN_VISITS: u32 = 3;
const OTHERS_COST: f64 = 5.0;

/// Pushes the object the shortest way to the goal region, past an obstacle on either side, and steers back to that way. Before that it brings the tool
/// to the place behind the object, round whatever stands in between. It sees the whole state, so it is a rollout policy and a demonstration, not a plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct GoalPolicy;

/// What is left to do, and what comes first.
struct Plan {
    /// Of the tool to the place behind the object, and of the object to the goal region.
    length_m: f64,
    next: Move,
}

enum Move {
    /// In the plane; not of unit length.
    Along(Vector2<f64>),
    Up,
    Down,
}

/// The task in the plane.
struct Scene<'a> {
    ground: Ground<'a>,
    goal: Vector2<f64>,
    goal_radius_m: f64,
    step_m: f64,
    tool: Vector2<f64>,
    /// How far the tool is above the height at which it pushes, and how far it can go up from there.
    raised_m: f64,
    top_m: f64,
    object: Circle,
    obstacle: Option<Circle>,
}

impl<'a> Scene<'a> {
    fn new(model: &'a PushModel, particle: &Particle) -> Self {
        let task = &model.config().task;
        let tool = model.tool_position_m(&particle.state.joints_rad);
        let object = &particle.theta.object;
        let obstacle = particle.theta.obstacle.as_ref().zip(particle.state.obstacle.as_ref());
        Self {
            ground: Ground { robot: model.robot(), reach: &task.reach, height_m: tool[2] },
            goal: Vector2::new(task.goal.x_m, task.goal.y_m),
            goal_radius_m: task.goal.radius_m,
            step_m: task.step_m,
            tool: plane(tool),
            raised_m: tool[2] - task.tool_start_m[2],
            top_m: task.reach.z_m[1] - task.tool_start_m[2],
            object: Circle {
                center: plane(particle.state.object.position_m),
                radius_m: object.shape.footprint_radius_m(object.size_m),
            },
            obstacle: obstacle.map(|(theta, body)| Circle {
                center: plane(body.position_m),
                radius_m: theta.shape.footprint_radius_m(theta.size_m),
            }),
        }
    }

    /// The shortest of the plans that push to some point of the goal region, on either side of an obstacle. `None` where the tool cannot get
    /// behind the object: it stands or has rolled where it can only be pushed farther away.
    fn plan(&self) -> Option<Plan> {
        let object = self.object.center;
        let along = (self.goal - object).try_normalize(1e-9)?;
        let across = Vector2::new(-along.y, along.x) * (AIM_SHARE * self.goal_radius_m);
        [Vector2::zeros(), across, -across]
            .into_iter()
            .flat_map(|aside| routes(object, self.goal + aside, self.passes()))
            .filter(|route| self.ground.reaches(self.place(route.heading)))
            .map(|route| self.plan_along(&route))
            .min_by(|a, b| a.length_m.total_cmp(&b.length_m))
    }

    /// What the object's centre has to keep out of.
    fn passes(&self) -> Option<Circle> {
        // A tool that is wider than the object has to pass, too.
        let across = (self.goal - self.object.center).try_normalize(1e-9).map(|along| Vector2::new(-along.y, along.x));
        let half_width_m = across.map_or(0.0, |across| self.half_width_m(across));
        let passing_m = self.object.radius_m.max(half_width_m);
        let clear = |obstacle: Circle| Circle { radius_m: passing_m + obstacle.radius_m + ROOM_M, ..obstacle };
        self.obstacle.map(clear)
    }

    /// Where the tool stands to push the object in a direction.
    fn place(&self, heading: Vector2<f64>) -> Vector2<f64> {
        self.object.center - heading * (self.object.radius_m + self.ground.extent_m(heading) + ROOM_M)
    }

    fn half_width_m(&self, across: Vector2<f64>) -> f64 {
        self.ground.extent_m(across).min(self.ground.extent_m(-across))
    }

    fn plan_along(&self, route: &Route) -> Plan {
        let along = route.heading;
        let across = Vector2::new(-along.y, along.x);
        let push_m = (route.length_m - self.goal_radius_m).max(0.0);
        let offset = self.tool - self.object.center;
        let (ahead_m, aside_m) = (offset.dot(&along), offset.dot(&across));
        // What is wider than the object holds it between its ends: it goes where the tool goes. A narrow tool turns it round the contact.
        let half_width_m = self.half_width_m(across);
        let radius_m = self.object.radius_m;
        let (tolerance_m, steering) =
            if half_width_m > radius_m { (half_width_m, 0.0) } else { (PUSHING_SHARE * radius_m, STEERING) };
        let raised = self.raised_m > 0.5 * self.step_m;
        let place = self.place(along);
        if ahead_m < 0.0 && aside_m.abs() < tolerance_m && !raised {
            let direction = along - across * (steering * aside_m / radius_m);
            let way_m = (place - self.tool).dot(&along).max(0.0);
            return Plan { length_m: way_m + push_m, next: Move::Along(direction) };
        }
        let (way_m, next) = self.way_to(place, raised);
        Plan { length_m: way_m + push_m, next }
    }

    /// Length of the tool's way to the place behind the object, and its first move: round the things, or over them where no way leads round.
    fn way_to(&self, place: Vector2<f64>, raised: bool) -> (f64, Move) {
        let things = [Some(self.object), self.obstacle];
        let things: Vec<Circle> = things.into_iter().flatten().collect();
        let straight_m = (place - self.tool).norm();
        if raised && self.ground.free(&things, self.tool, place) {
            return (self.raised_m + straight_m, Move::Down);
        }
        if !raised && let Some(way) = self.ground.way(&things, self.tool, place) {
            return (way.length_m, Move::Along(way.first - self.tool));
        }
        let up_m = (self.top_m - self.raised_m).max(0.0);
        let next = if up_m > 0.5 * self.step_m { Move::Up } else { Move::Along(place - self.tool) };
        (up_m + straight_m + self.top_m, next)
    }
}

impl GoalPolicy {
    /// The first move of a plan; in the plane the reachable one that is nearest to the wanted direction, among equals the first.
    fn first(model: &PushModel, particle: &Particle, plan: Option<&Plan>) -> Action {
        let wanted = match plan.map(|plan| &plan.next) {
            Some(Move::Up) => return Action::UP,
            Some(Move::Down) => return Action::DOWN,
            Some(Move::Along(direction)) => *direction,
            None => Vector2::zeros(),
        };
        let task = &model.config().task;
        let tool = model.tool_position_m(&particle.state.joints_rad);
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

    /// As if tool and object went their ways step by step.
    fn value(model: &PushModel, plan: Option<&Plan>, actions_left: usize) -> f64 {
        let task = &model.config().task;
        let cost = |count: usize| (0..count).map(|t| task.reward.step * task.discount.powi(t as i32)).sum::<f64>();
        match plan.map(|plan| (plan.length_m / task.step_m).ceil().max(1.0) as usize) {
            Some(steps) if steps <= actions_left => {
                cost(steps) + task.reward.goal * task.discount.powi(steps as i32 - 1)
            }
            _ => cost(actions_left),
        }
    }
}

impl Policy<PushModel> for GoalPolicy {
    fn action(&self, model: &PushModel, particle: &Particle, _rng: &mut Rng) -> Action {
        Self::first(model, particle, Scene::new(model, particle).plan().as_ref())
    }

    /// The policy's own action counts as tried a few times with the leaf value, every other as tried once and a little worse: a tree of some
    /// hundred simulations then need not try all ten actions at every node before it goes deeper.
    fn priors(&self, model: &PushModel, particle: &Particle, priors: &mut [ActionPrior]) {
        let plan = Scene::new(model, particle).plan();
        let value = Self::value(model, plan.as_ref(), model.config().task.horizon);
        let own = Self::first(model, particle, plan.as_ref()).index();
        for (index, prior) in priors.iter_mut().enumerate() {
            let (visits, value) = if index == own { (OWN_VISITS, value) } else { (1, value - OTHERS_COST) };
            *prior = ActionPrior { visits, value, ..ActionPrior::default() };
        }
    }

    fn leaf_value(&self, model: &PushModel, particle: &Particle, actions_left: usize) -> f64 {
        Self::value(model, Scene::new(model, particle).plan().as_ref(), actions_left)
    }
}

fn plane(position_m: [f64; 3]) -> Vector2<f64> {
    Vector2::new(position_m[0], position_m[1])
}
