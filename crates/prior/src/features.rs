//! Between the network's vectors and the pushing task: observations and targets in, particles out.
//!
//! Continuous targets: joint positions, object and obstacle (pose and velocity), then the 12 continuous values of Θ. Class targets: shape
//! of the object, shape of the obstacle or none. Values that do not apply (sizes of a sphere beyond its radius, anything of an absent
//! obstacle) are masked out of the loss.
//!
//! The published network uses these targets as they are. Here a measured target is learnt as its difference from the
//! measurement, and a mass as its logarithm. Sizes are extents (width, depth, height), which mean nearly the same for
//! every shape: no component is spent on telling a radius from a side. Values of the state have a resolution. A body at
//! rest has velocity exactly 0, and without a resolution the density could grow there without bound. Noise of the size
//! of the resolution is added to the targets, so a calibrated network states at least that spread.

use physics_model::state::BODY_LEN;
use physics_model::theta::{CLASS_TARGETS, THETA_LEN, THETA_NAMES};
use physics_model::{BodyState, ObjectShape, Theta};
use push_task::action::ACTION_COUNT;
use push_task::sensor::observation_names;
use push_task::state::State;
use push_task::{Action, Particle, PushModel};

use crate::mixture::Draw;
use crate::{ClassTarget, Layout, Transform};

/// A suggested body that leans less than this stands upright, rad.
const UPRIGHT_TOLERANCE_RAD: f64 = 0.3;
/// A suggested body within this height of resting on the table rests on it, m.
const RESTING_TOLERANCE_M: f64 = 0.015;
/// Suggestions are clamped to at least this size and mass.
const SMALLEST_SIZE_M: f64 = 0.01;
const SMALLEST_MASS_KG: f64 = 0.02;
/// And at most this mass.
const LARGEST_MASS_KG: f64 = 100.0;
/// Places of the sizes in Θ and the names of their targets.
const SIZES: [(usize, &str); 6] = [
    (5, "object_width_m"),
    (6, "object_depth_m"),
    (7, "object_height_m"),
    (9, "obstacle_width_m"),
    (10, "obstacle_depth_m"),
    (11, "obstacle_height_m"),
];
/// Whether the network is also told the action that led to an observation; the published one is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActionInput {
    /// Observations alone.
    Off,
    /// One column an action: 1 for the one taken, else 0; all 0 at the start of an episode.
    OneHot,
}

impl ActionInput {
    /// What a prior of this layout takes in.
    #[must_use]
    pub fn of(layout: &Layout) -> Self {
        if layout.observation.ends_with(&action_names()) { Self::OneHot } else { Self::Off }
    }

    /// The columns of an action, or of none.
    pub fn columns(self, action: Option<usize>) -> impl Iterator<Item = f64> {
        let columns = if self == Self::OneHot { ACTION_COUNT } else { 0 };
        (0..columns).map(move |column| if action == Some(column) { 1.0 } else { 0.0 })
    }
}

fn action_names() -> Vec<String> {
    (0..ACTION_COUNT).map(|action| format!("action_{action}")).collect()
}

/// What a prior for this arm takes in and gives out.
#[must_use]
pub fn layout(robot: &str, model: &PushModel, input: ActionInput) -> Layout {
    let joints = model.joint_count();
    let observation = observation_names(model.config().sensor.force, joints);
    from_names(robot, observation, State::names(joints), THETA_NAMES.map(String::from).to_vec(), input)
}

/// The continuous targets that stay the same in an episode: Θ.
#[must_use]
pub fn static_columns(layout: &Layout) -> std::ops::Range<usize> {
    layout.continuous.len() - THETA_LEN..layout.continuous.len()
}

/// The network's input after `action`.
#[must_use]
pub fn input(layout: &Layout, action: Option<Action>, observation: &[f64]) -> Vec<f64> {
    let columns = ActionInput::of(layout).columns(action.map(Action::index));
    observation.iter().copied().chain(columns).collect()
}

/// Names of the targets of Θ for a dataset's names of Θ.
fn theta_targets(theta: Vec<String>) -> Vec<String> {
    let rename = |name: String| match SIZES.iter().find(|(at, _)| THETA_NAMES[*at] == name) {
        Some((_, target)) => (*target).to_string(),
        None => name,
    };
    theta.into_iter().map(rename).collect()
}

/// Width, depth and height, m, of a shape of `size`: what a value stands for that does not apply is kept out by the mask.
pub(crate) fn extents(shape: ObjectShape, size: [f64; 3]) -> ([f64; 3], [bool; 3]) {
    match shape {
        ObjectShape::Box => (size, [true; 3]),
        ObjectShape::Cylinder => ([2.0 * size[0], 0.0, size[1]], [true, false, true]),
        ObjectShape::Sphere => ([2.0 * size[0], 0.0, 0.0], [true, false, false]),
    }
}

/// Inverse of [`extents`].
fn sizes(shape: ObjectShape, [width, depth, height]: [f64; 3]) -> [f64; 3] {
    match shape {
        ObjectShape::Box => [width, depth, height],
        ObjectShape::Cylinder => [width / 2.0, height, 0.0],
        ObjectShape::Sphere => [width / 2.0, 0.0, 0.0],
    }
}

/// Θ from its targets without their transforms; values that do not apply to the classes are left out.
pub(crate) fn theta_of_targets(targets: &[f64], classes: &[usize]) -> Theta {
    let mut values = [0.0; THETA_LEN];
    values.copy_from_slice(targets);
    for (at, class) in [(5, classes[0]), (9, classes[1])] {
        if let Some(shape) = ObjectShape::ALL.get(class) {
            let extents = [values[at], values[at + 1], values[at + 2]];
            values[at..at + 3].copy_from_slice(&sizes(*shape, extents));
        }
    }
    Theta::from_parts(&values, [classes[0], classes[1]])
}

/// Θ as its targets are given, and which of them apply.
#[must_use]
pub fn theta_row(theta: &Theta) -> ([f64; THETA_LEN], [bool; THETA_LEN]) {
    let (mut values, mut applies) = (theta.continuous(), theta.applies());
    let obstacle = theta.obstacle.as_ref().map(|o| (9, o.shape, o.size_m));
    for (at, shape, size) in [Some((5, theta.object.shape, theta.object.size_m)), obstacle].into_iter().flatten() {
        let (extents, apply) = extents(shape, size);
        values[at..at + 3].copy_from_slice(&extents);
        applies[at..at + 3].copy_from_slice(&apply);
    }
    (values, applies)
}

/// What a prior takes in and gives out whose columns have these names.
#[must_use]
pub fn from_names(
    robot: &str,
    mut observation: Vec<String>,
    state: Vec<String>,
    theta: Vec<String>,
    input: ActionInput,
) -> Layout {
    let continuous = [state, theta_targets(theta)].concat();
    let transform = |name: &String| match observation.iter().position(|measured| measured == name) {
        Some(column) => Transform::MinusObservation(column),
        None if name.ends_with("_mass_kg") => Transform::Log,
        None => Transform::Identity,
    };
    let transforms = continuous.iter().map(transform).collect();
    if input == ActionInput::OneHot {
        observation.extend(action_names());
    }
    let classes = CLASS_TARGETS.iter().map(|(name, labels)| ClassTarget {
        name: (*name).into(),
        labels: labels.iter().map(ToString::to_string).collect(),
    });
    Layout { robot: robot.into(), observation, continuous, transforms, classes: classes.collect() }
}

/// A draw made after `observation`, as a particle on the table at `table_height_m`. It is moved into the physical
/// ranges: friction in [0, 1], positive masses and sizes, centre of mass inside the shape. A body drawn nearly upright
/// and nearly resting is put upright and at rest height, because the mixture's components are diagonal and cannot hold
/// height and size together.
#[must_use]
pub fn particle(layout: &Layout, draw: &Draw, observation: &[f64], joints: usize, table_height_m: f64) -> Particle {
    let plain = layout.invert(&draw.values, observation);
    let (state, theta) = plain.split_at(joints + 2 * BODY_LEN);
    let mut values = [0.0; THETA_LEN];
    values.copy_from_slice(theta);
    values[0] = values[0].clamp(SMALLEST_MASS_KG, LARGEST_MASS_KG);
    values[8] = values[8].clamp(SMALLEST_MASS_KG, LARGEST_MASS_KG);
    values[4] = values[4].clamp(0.0, 1.0);
    for (at, _) in SIZES {
        values[at] = values[at].max(SMALLEST_SIZE_M);
    }
    let mut theta = theta_of_targets(&values, &draw.classes);
    let object = &mut theta.object;
    let half = object.shape.half_extents_m(object.size_m);
    for (com, half) in object.com_m.iter_mut().zip(half) {
        *com = com.clamp(-0.9 * half, 0.9 * half);
    }
    let mut state = State::from_slice(state, joints, theta.obstacle.is_some());
    settle(&mut state.object, theta.object.shape, theta.object.size_m, table_height_m);
    if let (Some(body), Some(obstacle)) = (&mut state.obstacle, &theta.obstacle) {
        settle(body, obstacle.shape, obstacle.size_m, table_height_m);
    }
    Particle::new(state, theta)
}

fn settle(body: &mut BodyState, shape: ObjectShape, size_m: [f64; 3], table_height_m: f64) {
    let [x, y, _, _] = body.orientation;
    // Tilt of the body's z axis: cos = 1 − 2 (x² + y²).
    let tilt_rad = (1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0).acos();
    let rest_m = table_height_m + shape.half_height_m(size_m);
    let near = (body.position_m[2] - rest_m).abs() < RESTING_TOLERANCE_M;
    if near && (shape == ObjectShape::Sphere || tilt_rad < UPRIGHT_TOLERANCE_RAD) {
        if shape != ObjectShape::Sphere {
            body.orientation = BodyState::at_rest([0.0; 3], body.yaw_rad()).orientation;
            body.angular_rps = [0.0, 0.0, body.angular_rps[2]];
        }
        body.position_m[2] = rest_m;
        body.linear_mps[2] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use push_task::config::ForceSensing;

    use super::*;

    #[test]
    fn wild_draws_become_physical() {
        let mut values = vec![0.0; 45];
        values[33] = -2.0;
        values[34] = 9.0;
        values[37] = 1.7;
        values[38..41].copy_from_slice(&[-0.1, 0.05, 0.05]);
        let draw = Draw { values, classes: vec![0, 3], component: 0 };
        let names = observation_names(ForceSensing::Wrist, 7);
        let layout =
            from_names("sawyer", names, State::names(7), THETA_NAMES.map(String::from).to_vec(), ActionInput::Off);
        let particle = particle(&layout, &draw, &[0.0; 20], 7, 0.0);
        assert!(physics_model::feasible::check_theta(&particle.theta).is_ok(), "{:?}", particle.theta);
        assert!(particle.state.obstacle.is_none());
    }
}
