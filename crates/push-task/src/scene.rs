//! The task in the plane, and the shortest plan for it.

use nalgebra::Vector2;

use crate::footprint::Footprint;
use crate::model::{Particle, PushModel};
use crate::route::{Route, routes};
use crate::way::{Circle, Ground, ROOM_M};

// All numbers of this file were chosen on 1,000 worlds each of D4, D5 and the Jaco's `obstacle` (seed 1004; `bench policy`, once with the obstacle known
// and once known only after a touch).

/// Of the object's radius, how far the tool may be off the line through the object and the goal and still push.
const PUSHING_SHARE: f64 = 0.4;
/// Pull back to that line while pushing, in moves along the line per radius off it.
const STEERING: f64 = 2.0;
/// How far beside the goal's centre the object may be aimed, of the goal's radius, and what that counts for, m: far off it may miss.
const AIMS: [(f64, f64); 7] = [(0.0, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.6, 0.05), (-0.6, 0.05), (0.9, 0.1), (-0.9, 0.1)];
/// How far the place behind the object may lie beyond the reach, m: the tool pushes from a little nearer, too.
const SHORT_M: f64 = 0.02;
/// Room, m, between object and obstacle on the object's way.
const CLEAR_M: f64 = 0.005;
/// Between the largest circle in a box and the one around it, how much of its corners counts where object and obstacle pass each other.
const OBJECT_CORNERS: f64 = 0.4;
const OBSTACLE_CORNERS: f64 = 0.7;
/// A thing that is nearer to the tool than this, m, is pressed against it.
const TOUCH_M: f64 = 0.002;
/// An object that touches the obstacle is pressed against it by pushes nearer to its direction than this, as the cosine of the angle.
const PINNED_COSINE: f64 = 0.7;
/// The tool does not move towards a thing that is nearer than this, m, but beside it.
const BESIDE_M: f64 = 0.01;

/// What is left to do, and what comes first.
pub(crate) struct Plan {
    /// Of the tool to the place behind the object, and of the object to the goal region.
    pub(crate) length_m: f64,
    pub(crate) next: Move,
    /// Whether the object has to go round the obstacle.
    pub(crate) bent: bool,
}

impl Plan {
    pub(crate) fn steps(&self, model: &PushModel) -> f64 {
        (self.length_m / model.config().task.step_m).max(1.0)
    }
}

pub(crate) enum Move {
    /// In the plane; not of unit length.
    Along(Vector2<f64>),
    Up,
    Down,
}

/// Between a thing and the tool.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// From the thing to the tool, unit.
    outward: Vector2<f64>,
    length_m: f64,
}

/// The task in the plane.
pub(crate) struct Scene<'a> {
    ground: Ground<'a>,
    goal: Vector2<f64>,
    goal_radius_m: f64,
    step_m: f64,
    tool: Vector2<f64>,
    /// How far the tool is above the height at which it pushes, and how far it can go up from there.
    raised_m: f64,
    top_m: f64,
    /// Whether it can go up by a step.
    rises: bool,
    object: Circle,
    obstacle: Option<Circle>,
    /// The radii, m, that object and obstacle have where they pass each other.
    passing_m: f64,
    obstacle_passing_m: f64,
    /// From object and obstacle to the tool.
    off: [Option<Gap>; 2],
}

impl<'a> Scene<'a> {
    pub(crate) fn new(model: &'a PushModel, particle: &Particle) -> Self {
        let task = &model.config().task;
        let tool = model.tool_position_m(&particle.state.joints_rad);
        let object = &particle.theta.object;
        let obstacle = particle.theta.obstacle.as_ref().zip(particle.state.obstacle.as_ref());
        let obstacle = obstacle.map(|(theta, body)| Footprint::new(theta.shape, theta.size_m, body));
        let object = Footprint::new(object.shape, object.size_m, &particle.state.object);
        let ground = Ground { robot: model.robot(), reach: &task.reach, height_m: tool[2] };
        let off = [Some(object), obstacle].map(|thing| {
            let gap = thing?.gap(plane(tool));
            let outward = gap.try_normalize(1e-9)?;
            Some(Gap { outward, length_m: gap.norm() - ground.extent_m(-outward) })
        });
        let rises = task.reach.contains([tool[0], tool[1], tool[2] + task.step_m]);
        Self {
            ground,
            goal: Vector2::new(task.goal.x_m, task.goal.y_m),
            goal_radius_m: task.goal.radius_m,
            step_m: task.step_m,
            tool: plane(tool),
            raised_m: tool[2] - task.tool_start_m[2],
            top_m: task.reach.z_m[1] - task.tool_start_m[2],
            rises,
            object: object.circle,
            obstacle: obstacle.map(|thing| thing.circle),
            off,
            passing_m: passing_m(&object, OBJECT_CORNERS),
            obstacle_passing_m: obstacle.map_or(0.0, |thing| passing_m(&thing, OBSTACLE_CORNERS)),
        }
    }

    /// The shortest of the plans that push to some point of the goal region, on either side of an obstacle. `None` where the tool cannot get
    /// behind the object: it stands or has rolled where it can only be pushed farther away.
    pub(crate) fn plan(&self) -> Option<Plan> {
        let object = self.object.center;
        let along = (self.goal - object).try_normalize(1e-9)?;
        let across = Vector2::new(-along.y, along.x) * self.goal_radius_m;
        AIMS.into_iter()
            .flat_map(|(share, extra_m)| {
                let ways = routes(object, self.goal + across * share, self.passes());
                ways.into_iter().map(move |route| (route, extra_m))
            })
            .filter(|(route, _)| self.ground.reaches(self.place(route.heading) + route.heading * SHORT_M))
            .map(|(route, extra_m)| {
                let plan = self.plan_along(&route);
                Plan { length_m: plan.length_m + extra_m, ..plan }
            })
            .min_by(|a, b| a.length_m.total_cmp(&b.length_m))
    }

    /// What the object's centre has to keep out of.
    fn passes(&self) -> Option<Circle> {
        // A tool that is wider than the object has to pass, too.
        let across = (self.goal - self.object.center).try_normalize(1e-9).map(|along| Vector2::new(-along.y, along.x));
        let half_width_m = across.map_or(0.0, |across| self.half_width_m(across));
        let passing_m = self.passing_m.max(half_width_m);
        let clear = |obstacle: Circle| Circle { radius_m: passing_m + self.obstacle_passing_m + CLEAR_M, ..obstacle };
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
        if ahead_m < 0.0 && aside_m.abs() < tolerance_m && !raised && !self.pins() {
            let direction = along - across * (steering * aside_m / radius_m);
            // A wide tool meets the obstacle beside the object that it pushes.
            let direction = Self::clear_of([None, self.off[1]], direction);
            let way_m = (place - self.tool).dot(&along).max(0.0);
            return Plan { length_m: way_m + push_m, next: Move::Along(direction), bent: route.bent };
        }
        let (way_m, next) = self.way_to(place, raised);
        Plan { length_m: way_m + push_m, next, bent: route.bent }
    }

    /// Whether a push from here presses the object against the obstacle.
    fn pins(&self) -> bool {
        let (Some(obstacle), Some(gap)) = (self.obstacle, self.off[0]) else { return false };
        let beyond = obstacle.center - self.object.center;
        let touches = beyond.norm() < self.passing_m + self.obstacle_passing_m + CLEAR_M;
        touches && -gap.outward.dot(&beyond) > PINNED_COSINE * beyond.norm()
    }

    /// `direction`, turned away from the nearest of `things` where the tool is at it.
    fn clear_of(things: [Option<Gap>; 2], direction: Vector2<f64>) -> Vector2<f64> {
        let nearest = things.into_iter().flatten().min_by(|a, b| a.length_m.total_cmp(&b.length_m));
        let Some(Gap { outward, length_m }) = nearest else { return direction };
        if length_m > BESIDE_M || direction.dot(&outward) >= 0.0 {
            return direction;
        }
        let beside = (direction - outward * direction.dot(&outward)).try_normalize(1e-9).unwrap_or_else(Vector2::zeros);
        // What is pressed against a thing does not slide along it, or takes it along: first away, then round.
        if length_m < TOUCH_M { beside + outward } else { beside }
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
            return (way.length_m, Move::Along(Self::clear_of(self.off, way.first - self.tool)));
        }
        let up_m = (self.top_m - self.raised_m).max(0.0);
        let next = if self.rises { Move::Up } else { Move::Along(place - self.tool) };
        (up_m + straight_m + self.top_m, next)
    }
}

fn passing_m(thing: &Footprint, corners: f64) -> f64 {
    let inner_m = thing.inner_radius_m();
    inner_m + corners * (thing.circle.radius_m - inner_m)
}

fn plane(position_m: [f64; 3]) -> Vector2<f64> {
    Vector2::new(position_m[0], position_m[1])
}
