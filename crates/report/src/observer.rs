//! Looks on at an episode and keeps what a person would want to see.

use agent::{StepView, Watcher};
use belief::Particles;
use nalgebra::Isometry3;
use physics_model::robot::{Robot, ToolShape};
use physics_model::{BodyState, ObjectShape};
use push_task::{Particle, PushModel};
use recording::{
    Body, BodyShape, Ghost, Moment, Pose, RootAction, Scene, SeenBelief, SeenParameter, SeenSearch, ToolPart,
};

/// Particles that are kept of each belief: enough for a picture, a hundredth of what there are.
const GHOSTS: usize = 100;

/// Keeps moments.
pub struct Observer<'a> {
    model: &'a PushModel,
    moments: Vec<Moment>,
    /// Called with each moment as it comes.
    tell: &'a mut dyn FnMut(&Moment),
}

impl<'a> Observer<'a> {
    /// Of an episode of this model; `tell` is called with each moment as it comes.
    pub fn new(model: &'a PushModel, tell: &'a mut dyn FnMut(&Moment)) -> Self {
        Self { model, moments: Vec::new(), tell }
    }

    /// What was seen.
    #[must_use]
    pub fn into_moments(self) -> Vec<Moment> {
        self.moments
    }
}

impl Watcher for Observer<'_> {
    fn see(&mut self, view: &StepView<'_>) {
        let robot = self.model.robot();
        let step = view.step;
        let mut events = Vec::new();
        for (happened, words) in [
            (step.is_some_and(|s| s.obstacle_touched), "the obstacle was touched"),
            (step.is_some_and(|s| s.large_force), "a force above the limit"),
            (step.is_some_and(|s| s.out_of_reach), "out of reach, not made"),
        ] {
            if happened {
                events.push(words.to_owned());
            }
        }
        let moment = Moment {
            action: step.map(|s| s.action.into()),
            reward: step.map(|s| s.reward),
            events,
            joints: robot.base_from_joints(view.joints_rad).iter().map(pose).collect(),
            tool: pose(&robot.base_from_tool(view.joints_rad)),
            truth: view.truth.map(scene),
            belief: view.belief.map(|belief| seen(belief, view.truth)),
            search: view.search.map(|report| SeenSearch {
                simulations: report.simulations,
                transitions: report.transitions,
                depth: report.depth,
                nodes: report.nodes,
                actions: report.actions.iter().map(|a| RootAction { visits: a.visits, value: a.value }).collect(),
            }),
            // A step counts those of its search as well.
            update_transitions: step
                .map(|s| s.transitions.saturating_sub(view.search.map_or(0, |search| search.transitions))),
        };
        (self.tell)(&moment);
        self.moments.push(moment);
    }
}

/// Parts of the arm's tool.
#[must_use]
pub fn tool_parts(robot: &Robot) -> Vec<ToolPart> {
    let part = |shape: &ToolShape| match *shape {
        ToolShape::Ball { center_m, radius_m } => ToolPart { from_m: center_m, to_m: center_m, radius_m },
        ToolShape::Capsule { a_m, b_m, radius_m } => ToolPart { from_m: a_m, to_m: b_m, radius_m },
    };
    robot.tool_shapes().iter().map(part).collect()
}

fn pose(isometry: &Isometry3<f64>) -> Pose {
    let (t, q) = (isometry.translation.vector, isometry.rotation);
    Pose { position_m: [t.x, t.y, t.z], orientation: [q.i, q.j, q.k, q.w] }
}

fn body(shape: ObjectShape, size_m: [f64; 3], state: &BodyState) -> Body {
    let shape_seen = match shape {
        ObjectShape::Box => BodyShape::Box,
        ObjectShape::Cylinder => BodyShape::Cylinder,
        ObjectShape::Sphere => BodyShape::Sphere,
    };
    let pose = Pose { position_m: state.position_m, orientation: state.orientation };
    Body { shape: shape_seen, half_m: shape.half_extents_m(size_m), pose }
}

fn scene(particle: &Particle) -> Scene {
    let (theta, state) = (&particle.theta, &particle.state);
    let obstacle = theta.obstacle.as_ref().zip(state.obstacle.as_ref());
    Scene {
        object: body(theta.object.shape, theta.object.size_m, &state.object),
        obstacle: obstacle.map(|(theta, state)| body(theta.shape, theta.size_m, state)),
    }
}

/// A parameter: name, unit, value in a particle.
type Parameter = (&'static str, &'static str, fn(&Particle) -> f64);

const PARAMETERS: [Parameter; 5] = [
    ("friction", "", |p| p.theta.object.friction),
    ("mass", "kg", |p| p.theta.object.mass_kg),
    ("length along x", "m", |p| length_m(p, 0)),
    ("length along y", "m", |p| length_m(p, 1)),
    ("height", "m", |p| length_m(p, 2)),
];

/// Full length along an axis of the object, which all shapes have.
fn length_m(particle: &Particle, axis: usize) -> f64 {
    2.0 * particle.theta.object.shape.half_extents_m(particle.theta.object.size_m)[axis]
}

fn seen(belief: &Particles<Particle>, truth: Option<&Particle>) -> SeenBelief {
    let share = |holds: &dyn Fn(&Particle) -> bool| {
        let weights = belief.iter().filter(|(p, _)| holds(p)).map(|(_, weight)| weight);
        // Sums of weights are 1 up to rounding, and an empty one is −0.
        weights.sum::<f64>().clamp(0.0, 1.0).abs()
    };
    let ghost = |p: &Particle| {
        let object = &p.theta.object;
        Ghost { scene: scene(p), friction: object.friction, mass_kg: object.mass_kg }
    };
    SeenBelief {
        particles: belief.count(),
        effective_sample_size: belief.effective_sample_size(),
        shape_probability: ObjectShape::ALL.map(|shape| share(&|p| p.theta.object.shape == shape)),
        obstacle_probability: share(&|p| p.state.obstacle.is_some()),
        parameters: PARAMETERS.iter().map(|parameter| parameter_of(parameter, belief, truth)).collect(),
        ghosts: drawn(belief).into_iter().map(ghost).collect(),
    }
}

fn parameter_of(
    &(name, unit, value): &Parameter,
    belief: &Particles<Particle>,
    truth: Option<&Particle>,
) -> SeenParameter {
    let mut values: Vec<(f64, f64)> = belief.iter().map(|(p, weight)| (value(p), weight)).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let quantile = |level| statistics::weighted_quantile(&values, level).unwrap_or(f64::NAN);
    SeenParameter {
        name: name.into(),
        unit: unit.into(),
        low: quantile(0.05),
        median: quantile(0.5),
        high: quantile(0.95),
        truth: truth.map(value),
    }
}

/// Particles at equal steps of the cumulative weight: without chance, so that equal beliefs look equal.
fn drawn(belief: &Particles<Particle>) -> Vec<&Particle> {
    let mut particles = belief.iter();
    let (mut current, mut sum) = (None, 0.0);
    let mut drawn = Vec::with_capacity(GHOSTS);
    for place in 0..GHOSTS {
        let target = (place as f64 + 0.5) / GHOSTS as f64;
        while sum < target {
            let Some((particle, weight)) = particles.next() else { break };
            sum += weight;
            current = Some(particle);
        }
        drawn.extend(current);
    }
    drawn
}
