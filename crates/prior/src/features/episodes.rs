//! Recorded episodes as what a network is trained on.

use dataset::{Episode, Schema};

use physics_model::Theta;
use physics_model::state::{BODY_LEN, MAX_JOINTS};
use physics_model::theta::{CLASS_TARGETS, NO_OBSTACLE, THETA_LEN, THETA_NAMES};
use pomdp::{Purpose, Seed};
use push_task::action::ACTION_COUNT;
use push_task::state::State;
use rand::RngExt as _;
use rand_distr::StandardNormal;

use super::{ActionInput, from_names, theta_row};
use crate::{Error, Layout, Sequence};

/// Resolutions of a joint (rad) and of a body's position (m), quaternion, velocity (m/s) and angular velocity (rad/s): below what sensors
/// measure and what a push depends on.
const JOINT_RAD: f64 = 0.0005;
const BODY: [(usize, f64); 4] = [(3, 0.001), (4, 0.005), (3, 0.005), (3, 0.05)];

/// What a prior trained on a dataset of this schema takes in and gives out.
///
/// # Errors
///
/// [`Error::Schema`] where the dataset is not one of this task: another Θ, other classes, another state or number of actions.
pub fn layout_of_dataset(schema: &Schema, input: ActionInput) -> Result<Layout, Error> {
    let joints = schema.state.len().checked_sub(2 * BODY_LEN).filter(|joints| (1..=MAX_JOINTS).contains(joints));
    let state = joints.map(State::names).unwrap_or_default();
    let names = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let expected = [
        ("state", &schema.state, state),
        ("theta", &schema.theta, names(&THETA_NAMES)),
        ("classes", &schema.classes, names(&CLASS_TARGETS.map(|(name, _)| name))),
    ];
    for (key, found, expected) in expected {
        if found.is_empty() || *found != expected {
            return Err(Error::Schema { key, found: found.join(", "), expected: expected.join(", ") });
        }
    }
    if schema.action_count != ACTION_COUNT {
        let (found, expected) = (schema.action_count.to_string(), ACTION_COUNT.to_string());
        return Err(Error::Schema { key: "action_count", found, expected });
    }
    Ok(from_names(&schema.robot, schema.observation.clone(), schema.state.clone(), schema.theta.clone(), input))
}

/// A recorded episode as a training sequence. The noise of the resolution depends on the episode's number alone.
///
/// # Errors
///
/// [`Error::Class`] for a shape that does not exist.
///
/// # Panics
///
/// If the episode's columns differ from [`layout_of_dataset`].
pub fn sequence(layout: &Layout, episode: &Episode) -> Result<Sequence, Error> {
    for (target, &found) in layout.classes.iter().zip(&episode.classes) {
        if usize::from(found) >= target.labels.len() {
            let name = target.name.clone();
            return Err(Error::Class { episode: episode.episode, name, found, labels: target.labels.len() });
        }
    }
    let action_input = ActionInput::of(layout);
    let mut rng = Seed(0).stream(Purpose::Resolution, episode.episode);
    let steps = episode.rows();
    let theta: [f64; THETA_LEN] = episode.theta.as_slice().try_into().expect("theta has 12 values");
    let classes = [usize::from(episode.classes[0]), usize::from(episode.classes[1])];
    let (theta, applies) = theta_row(&Theta::from_parts(&theta, classes));
    let mut sequence =
        Sequence { observations: Vec::new(), targets: Vec::new(), mask: Vec::new(), classes: Vec::new(), steps };
    for row in 0..steps {
        let mut state = episode.state(row).to_vec();
        let joints = state.len() - 2 * BODY_LEN;
        for body in 0..2 {
            let at = joints + body * BODY_LEN + 3;
            positive_scalar(&mut state[at..at + 4]);
        }
        for (value, resolution) in state.iter_mut().zip(resolutions(joints)) {
            *value += resolution * rng.sample::<f64, _>(StandardNormal);
        }
        let has_obstacle = classes[1] != NO_OBSTACLE;
        let state_mask = (0..state.len()).map(|i| has_obstacle || i < joints + BODY_LEN);
        let observation: Vec<f64> = episode.observation(row).iter().map(|v| f64::from(*v)).collect();
        let values = state.iter().chain(&theta).zip(&layout.transforms);
        for ((value, transform), applies) in values.zip(state_mask.chain(applies)) {
            let written = if applies { transform.apply(*value, &observation) } else { 0.0 };
            sequence.targets.push(written as f32);
            sequence.mask.push(if applies { 1.0 } else { 0.0 });
        }
        let action = usize::try_from(episode.action[row]).ok();
        sequence.observations.extend(episode.observation(row));
        sequence.observations.extend(action_input.columns(action).map(|v| v as f32));
        sequence.classes.extend(&episode.classes);
    }
    Ok(sequence)
}

/// Resolution of every value of a state.
fn resolutions(joints: usize) -> impl Iterator<Item = f64> {
    let body = || BODY.into_iter().flat_map(|(count, resolution)| std::iter::repeat_n(resolution, count));
    std::iter::repeat_n(JOINT_RAD, joints).chain(body()).chain(body())
}

/// First row of an episode in whose action `event` happened; none where it never did or the dataset does not tell.
#[must_use]
pub fn first_event(schema: &Schema, episode: &Episode, event: &str) -> Option<usize> {
    let column = schema.events.iter().position(|name| name == event)?;
    let mut happened = episode.events.iter().skip(column).step_by(schema.events.len());
    happened.position(|happened| *happened == 1)
}

/// Of a rotation's two quaternions (x, y, z, w) the one with w ≥ 0, as sensors report it.
fn positive_scalar(quaternion: &mut [f64]) {
    if quaternion[3] < 0.0 {
        for value in quaternion {
            *value = -*value;
        }
    }
}
