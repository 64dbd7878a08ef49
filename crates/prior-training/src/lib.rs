//! Recorded episodes as what the prior is trained on.
//!
//! Apart from [`prior`], which suggests and learns without files of episodes: programs that only play need neither Parquet nor Arrow, most of a first
//! build. The programs `train` and `calibrate` are here.

pub mod starts;

use dataset::{Episode, Schema};

use physics_model::Theta;
use physics_model::state::{BODY_LEN, MAX_JOINTS};
use physics_model::theta::{CLASS_TARGETS, NO_OBSTACLE, THETA_LEN, THETA_NAMES};
use pomdp::{Purpose, Seed};
use push_task::action::ACTION_COUNT;
use push_task::state::State;
use rand::RngExt as _;
use rand_distr::StandardNormal;

use prior::features::{ActionInput, from_names, theta_row};
use prior::{Error, Layout, Sequence};

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

#[cfg(test)]
mod tests {
    use push_task::config::ForceSensing;

    use physics_model::BodyState;
    use prior::features::{input, particle};
    use prior::{Draw, Transform};
    use push_task::Action;
    use push_task::sensor::observation_names;

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
}
