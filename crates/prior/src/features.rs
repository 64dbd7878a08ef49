//! Between the network's vectors and the pushing task: observations and targets in, particles out.
//!
//! Continuous targets: joint positions, object and obstacle (pose and velocity), then the 12 continuous values of Θ. Class targets: shape
//! of the object, shape of the obstacle or none. Values that do not apply (sizes of a sphere beyond its radius, anything of an absent
//! obstacle) are masked out of the loss.

use dataset::{Episode, Schema};
use physics_model::sensor::observation_names;
use physics_model::state::{BODY_LEN, State};
use physics_model::theta::{CLASS_TARGETS, NO_OBSTACLE, THETA_LEN, THETA_NAMES};
use physics_model::{BodyState, ObjectShape, Particle, PushModel, Theta};

use crate::mixture::Draw;
use crate::{ClassTarget, Layout, Sequence};

/// A suggested body that leans less than this stands upright, rad.
const UPRIGHT_TOLERANCE_RAD: f64 = 0.3;
/// A suggested body within this height of resting on the table rests on it, m.
const RESTING_TOLERANCE_M: f64 = 0.015;
/// Suggestions are clamped to at least this size and mass.
const SMALLEST_SIZE_M: f64 = 0.01;
const SMALLEST_MASS_KG: f64 = 0.02;

/// What a prior for this arm takes in and gives out.
#[must_use]
pub fn layout(robot: &str, model: &PushModel) -> Layout {
    let joints = model.joint_count();
    let observation = observation_names(model.config().sensor.force, joints);
    from_names(robot, observation, State::names(joints), THETA_NAMES.map(String::from).to_vec())
}

/// What a prior trained on a dataset of this schema takes in and gives out.
#[must_use]
pub fn layout_of_dataset(schema: &Schema) -> Layout {
    from_names(&schema.robot, schema.observation.clone(), schema.state.clone(), schema.theta.clone())
}

fn from_names(robot: &str, observation: Vec<String>, state: Vec<String>, theta: Vec<String>) -> Layout {
    let classes = CLASS_TARGETS.iter().map(|(name, labels)| ClassTarget {
        name: (*name).into(),
        labels: labels.iter().map(ToString::to_string).collect(),
    });
    Layout { robot: robot.into(), observation, continuous: [state, theta].concat(), classes: classes.collect() }
}

/// A recorded episode as a training sequence.
///
/// # Panics
///
/// If the episode's columns are not those of [`layout_of_dataset`].
#[must_use]
pub fn sequence(episode: &Episode) -> Sequence {
    let steps = episode.rows();
    let theta: [f64; THETA_LEN] = episode.theta.as_slice().try_into().expect("theta has 12 values");
    let classes = [usize::from(episode.classes[0]), usize::from(episode.classes[1])];
    let applies = Theta::from_parts(&theta, classes).applies();
    let mut sequence = Sequence {
        observations: episode.observation.clone(),
        targets: Vec::new(),
        mask: Vec::new(),
        classes: Vec::new(),
        steps,
    };
    for row in 0..steps {
        let mut state = episode.state(row).to_vec();
        let joints = state.len() - 2 * BODY_LEN;
        for body in 0..2 {
            let at = joints + body * BODY_LEN + 3;
            positive_scalar(&mut state[at..at + 4]);
        }
        let has_obstacle = classes[1] != NO_OBSTACLE;
        sequence.targets.extend(state.iter().chain(&theta).map(|v| *v as f32));
        let state_mask = (0..state.len()).map(|i| has_obstacle || i < joints + BODY_LEN);
        sequence.mask.extend(state_mask.chain(applies).map(|a| if a { 1.0 } else { 0.0 }));
        sequence.classes.extend(&episode.classes);
    }
    sequence
}

/// First row of an episode in which the object has left its first position by more than a millimetre: something has touched it.
#[must_use]
pub fn first_contact(episode: &Episode) -> Option<usize> {
    let joints = episode.state(0).len() - 2 * BODY_LEN;
    let position = |row: usize| &episode.state(row)[joints..joints + 3];
    (1..episode.rows()).find(|&row| {
        let squared: f64 = position(row).iter().zip(position(0)).map(|(a, b)| (a - b) * (a - b)).sum();
        squared.sqrt() > 0.001
    })
}

/// A draw as a hypothesis on the table at `table_height_m`, inside the physical ranges: friction in [0, 1], positive masses and sizes,
/// centre of mass inside the shape. A body drawn nearly upright and nearly resting is put upright and at rest height, because the mixture's
/// components are diagonal and cannot hold height and size together.
#[must_use]
pub fn particle(draw: &Draw, joints: usize, table_height_m: f64) -> Particle {
    let (state, theta) = draw.values.split_at(joints + 2 * BODY_LEN);
    let mut values = [0.0; THETA_LEN];
    values.copy_from_slice(theta);
    values[0] = values[0].max(SMALLEST_MASS_KG);
    values[8] = values[8].max(SMALLEST_MASS_KG);
    values[4] = values[4].clamp(0.0, 1.0);
    for index in [5, 6, 7, 9, 10, 11] {
        values[index] = values[index].max(SMALLEST_SIZE_M);
    }
    let mut theta = Theta::from_parts(&values, [draw.classes[0], draw.classes[1]]);
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
        }
    }

    #[test]
    fn what_does_not_apply_is_masked() {
        let count = |classes| sequence(&episode(classes)).mask.iter().sum::<f32>() / 2.0;
        // 7 joints, 13 object, 5 + 3 of a box, 13 obstacle, 1 + 2 of a cylinder.
        assert_eq!(count([0, 1]), 7.0 + 13.0 + 8.0 + 13.0 + 3.0);
        // Sphere without obstacle: mass, depth of the centre of mass, friction, radius.
        assert_eq!(count([2, 3]), 7.0 + 13.0 + 4.0);
    }

    #[test]
    fn a_target_comes_back_as_the_particle_it_was_made_from() {
        let sequence = sequence(&episode([0, 1]));
        let values: Vec<f64> = sequence.targets[..45].iter().map(|v| f64::from(*v)).collect();
        let draw = Draw { values, classes: vec![0, 1], component: 0 };
        let particle = particle(&draw, 7, -0.1);
        assert_eq!(particle.theta.classes(), [0, 1]);
        assert!((particle.theta.object.size_m[1] - 0.07).abs() < 1e-6);
        assert!((particle.state.object.position_m[2] - (-0.055)).abs() < 1e-7, "rests at half its height");
        assert!((particle.state.object.yaw_rad() - 0.4).abs() < 1e-6);
        // The obstacle's quaternion was given with the other sign.
        assert!((particle.state.obstacle.unwrap().yaw_rad() - 0.4).abs() < 1e-6);
    }

    #[test]
    fn wild_draws_become_physical() {
        let mut values = vec![0.0; 45];
        values[33] = -2.0;
        values[34] = 9.0;
        values[37] = 1.7;
        values[38..41].copy_from_slice(&[-0.1, 0.05, 0.05]);
        let particle = particle(&Draw { values, classes: vec![0, 3], component: 0 }, 7, 0.0);
        assert!(physics_model::feasible::check_theta(&particle.theta).is_ok(), "{:?}", particle.theta);
        assert!(particle.state.obstacle.is_none());
    }
}
