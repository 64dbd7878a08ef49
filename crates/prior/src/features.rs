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

mod episodes;

use physics_model::state::BODY_LEN;
use physics_model::theta::{CLASS_TARGETS, THETA_LEN, THETA_NAMES};
use physics_model::{BodyState, ObjectShape, Theta};
use push_task::action::ACTION_COUNT;
use push_task::sensor::observation_names;
use push_task::state::State;
use push_task::{Action, Particle, PushModel};

use crate::mixture::Draw;
use crate::{ClassTarget, Layout, Transform};

pub use episodes::{first_event, layout_of_dataset, sequence};

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

    fn columns(self, action: Option<usize>) -> impl Iterator<Item = f64> {
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
pub(crate) fn theta_row(theta: &Theta) -> ([f64; THETA_LEN], [bool; THETA_LEN]) {
    let (mut values, mut applies) = (theta.continuous(), theta.applies());
    let obstacle = theta.obstacle.as_ref().map(|o| (9, o.shape, o.size_m));
    for (at, shape, size) in [Some((5, theta.object.shape, theta.object.size_m)), obstacle].into_iter().flatten() {
        let (extents, apply) = extents(shape, size);
        values[at..at + 3].copy_from_slice(&extents);
        applies[at..at + 3].copy_from_slice(&apply);
    }
    (values, applies)
}

fn from_names(
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

    use dataset::{Episode, Schema};

    use super::*;

    fn episode(classes: [u8; 2]) -> Episode {
        let object = BodyState::at_rest([0.5, 0.1, -0.055], 0.4).to_array();
        let mut turned = object;
        turned[3..7].iter_mut().for_each(|q| *q = -*q);
        let state = [vec![0.1; 7], object.to_vec(), turned.to_vec()].concat();
        Episode {
            episode: 0,
            outcome: 1,
            action: vec![-1, 2],
            reward: vec![0.0, -1.0],
            observation: vec![0.5; 40],
            state: [state.clone(), state].concat(),
            theta: vec![0.5, 0.01, 0.0, 0.0, 0.3, 0.08, 0.07, 0.09, 1.0, 0.04, 0.1, 0.0],
            classes: classes.to_vec(),
            events: vec![],
        }
    }

    fn layout(input: ActionInput) -> Layout {
        let names = observation_names(ForceSensing::Wrist, 7);
        from_names("sawyer", names, State::names(7), THETA_NAMES.map(String::from).to_vec(), input)
    }

    #[test]
    fn what_does_not_apply_is_masked() {
        let layout = layout(ActionInput::Off);
        let count = |classes| sequence(&layout, &episode(classes)).unwrap().mask.iter().sum::<f32>() / 2.0;
        // 7 joints, 13 object, 5 + 3 of a box, 13 obstacle, 1 + 2 of a cylinder.
        assert_eq!(count([0, 1]), 7.0 + 13.0 + 8.0 + 13.0 + 3.0);
        // Sphere without obstacle: mass, depth of the centre of mass, friction, radius.
        assert_eq!(count([2, 3]), 7.0 + 13.0 + 4.0);
    }

    #[test]
    fn a_target_comes_back_as_the_particle_it_was_made_from() {
        let (layout, episode) = (layout(ActionInput::Off), episode([0, 1]));
        let sequence = sequence(&layout, &episode).unwrap();
        assert!((f64::from(sequence.targets[33]) - 0.5_f64.ln()).abs() < 1e-6, "a mass is learnt as its logarithm");
        let values: Vec<f64> = sequence.targets[..45].iter().map(|v| f64::from(*v)).collect();
        let draw = Draw { values, classes: vec![0, 1], component: 0 };
        let observation: Vec<f64> = episode.observation(0).iter().map(|v| f64::from(*v)).collect();
        let particle = particle(&layout, &draw, &observation, 7, -0.1);
        assert_eq!(particle.theta.classes(), [0, 1]);
        assert!(
            (particle.theta.object.mass_kg - 0.5).abs() < 1e-6
                && (particle.theta.obstacle.as_ref().unwrap().mass_kg - 1.0).abs() < 1e-6
        );
        assert!((particle.theta.object.size_m[1] - 0.07).abs() < 1e-6);
        // A cylinder of radius 4 cm and height 10 cm.
        let obstacle = particle.theta.obstacle.as_ref().unwrap();
        assert!((obstacle.size_m[0] - 0.04).abs() < 1e-6 && (obstacle.size_m[1] - 0.1).abs() < 1e-6, "{obstacle:?}");
        assert!((particle.state.object.position_m[2] - (-0.055)).abs() < 1e-7, "rests at half its height");
        // Up to five times the resolution.
        assert!((particle.state.object.position_m[0] - 0.5).abs() < 0.005);
        assert!((particle.state.object.yaw_rad() - 0.4).abs() < 0.06);
        // The obstacle's quaternion was given with the other sign.
        assert!((particle.state.obstacle.unwrap().yaw_rad() - 0.4).abs() < 0.06);
    }

    #[test]
    fn measured_targets_are_differences_with_the_noise_of_the_resolution() {
        let layout = layout(ActionInput::Off);
        let measured = layout.transforms.iter().filter(|t| matches!(t, Transform::MinusObservation(_))).count();
        assert_eq!(measured, 14, "7 joints and the object's pose");
        // Null: noise of 1 mm about 0.5 − 0.5 = 0. n = 2 × 400 rows, standard error of the spread 2.5 %; tolerance 4 of them.
        let mut squares = 0.0;
        for number in 0..400 {
            let mut episode = Episode { episode: number, ..episode([0, 1]) };
            for row in 0..2 {
                episode.observation[row * 20 + 13] = 0.5;
            }
            let sequence = sequence(&layout, &episode).unwrap();
            squares += sequence.targets.iter().skip(7).step_by(45).map(|v| f64::from(*v).powi(2)).sum::<f64>();
        }
        assert!(((squares / 800.0).sqrt() / 0.001 - 1.0).abs() < 0.1, "{squares}");
    }

    #[test]
    fn actions_are_one_hot_columns_behind_the_observation() {
        let layout = layout(ActionInput::OneHot);
        let sequence = sequence(&layout, &episode([0, 1])).unwrap();
        assert_eq!(sequence.observations.len(), 2 * 30);
        assert!(sequence.observations[20..30].iter().all(|v| *v == 0.0), "no action has led to the first row");
        let second: Vec<f64> = sequence.observations[30..].iter().map(|v| f64::from(*v)).collect();
        assert_eq!(second[20..], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(input(&layout, Some(Action::ALL[2]), &second[..20]), second);
        assert_eq!(input(&self::layout(ActionInput::Off), Some(Action::ALL[2]), &second[..20]), second[..20]);
    }

    #[test]
    fn a_dataset_of_another_task_is_refused_by_its_key() {
        let names = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        let good = Schema {
            robot: "sawyer".into(),
            observation: observation_names(ForceSensing::Wrist, 7),
            action_count: ACTION_COUNT,
            state: State::names(7),
            theta: names(&THETA_NAMES),
            classes: names(&["object_shape", "obstacle_shape"]),
            events: vec![],
        };
        assert_eq!(layout_of_dataset(&good, ActionInput::Off).unwrap(), layout(ActionInput::Off));
        type Case = (&'static str, fn(&mut Schema));
        let bad: [Case; 5] = [
            ("state", |s| s.state.truncate(20)),
            ("state", |s| s.state.swap(0, 1)),
            ("theta", |s| s.theta.truncate(11)),
            ("classes", |s| s.classes.clear()),
            ("action_count", |s| s.action_count = 4),
        ];
        for (key, change) in bad {
            let mut schema = good.clone();
            change(&mut schema);
            let message = layout_of_dataset(&schema, ActionInput::Off).unwrap_err().to_string();
            assert!(message.starts_with(&format!("dataset: schema.{key} is ")), "{message}");
        }
        let message = sequence(&layout(ActionInput::Off), &episode([0, 4])).unwrap_err().to_string();
        assert_eq!(message, "dataset: obstacle_shape of episode 0 is class 4, expected one of 0 to 3");
    }

    #[test]
    fn wild_draws_become_physical() {
        let mut values = vec![0.0; 45];
        values[33] = -2.0;
        values[34] = 9.0;
        values[37] = 1.7;
        values[38..41].copy_from_slice(&[-0.1, 0.05, 0.05]);
        let draw = Draw { values, classes: vec![0, 3], component: 0 };
        let particle = particle(&layout(ActionInput::Off), &draw, &[0.0; 20], 7, 0.0);
        assert!(physics_model::feasible::check_theta(&particle.theta).is_ok(), "{:?}", particle.theta);
        assert!(particle.state.obstacle.is_none());
    }
}
