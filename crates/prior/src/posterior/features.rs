//! What the posterior network is told of a step. `training/posterior.py` has the same in PyTorch, and a test compares them.

use nalgebra::Vector3;
use push_task::action::ACTION_COUNT;
use push_task::{Action, Observation, PushModel};

/// Values of a step in files for training: action (−1 for none), tool (3, m), force without that of an arm at rest (6), pose (7).
pub const STEP_VALUES: usize = 17;
/// Length of an input row.
pub(super) const INPUTS: usize = ACTION_COUNT + 33;
/// Largest input.
const LIMIT: f64 = 20.0;

/// What is seen of a step, before it is scaled.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    tool_m: [f64; 3],
    force: [f64; 6],
    position_m: [f64; 3],
    orientation: [f64; 4],
    yaw_rad: f64,
}

impl Seen {
    pub(super) fn new(model: &PushModel, observation: &Observation, joints_rad: &[f64]) -> Self {
        let rest = model.resting_force(joints_rad);
        let measured = model.measured_force(observation);
        let (position_m, orientation) = observation.object_pose();
        Self {
            tool_m: model.tool_position_m(joints_rad),
            force: std::array::from_fn(|i| measured[i] - rest[i]),
            position_m,
            orientation,
            yaw_rad: twist(orientation),
        }
    }
}

#[cfg(test)]
impl Seen {
    /// From the values of a file.
    pub(super) fn of_values(values: &[f64]) -> (Option<Action>, Self) {
        let part = |from: usize| std::array::from_fn(|i| values[from + i]);
        let orientation: [f64; 4] = std::array::from_fn(|i| values[13 + i]);
        let seen = Self {
            tool_m: part(1),
            force: std::array::from_fn(|i| values[4 + i]),
            position_m: part(10),
            orientation,
            yaw_rad: twist(orientation),
        };
        (Action::ALL.into_iter().find(|action| action.index() as f64 == values[0]), seen)
    }
}

/// Rotation about the vertical, rad: that of a sphere that has rolled is defined, too.
fn twist([_, _, z, w]: [f64; 4]) -> f64 {
    2.0 * z.atan2(w)
}

/// The values of a step for a file of training data.
#[must_use]
pub fn step_values(
    model: &PushModel,
    action: Option<Action>,
    observation: &Observation,
    joints_rad: &[f64],
) -> [f32; STEP_VALUES] {
    let seen = Seen::new(model, observation, joints_rad);
    let action = action.map_or(-1.0, |action| action.index() as f64);
    let values = [&[action], &seen.tool_m[..], &seen.force, &seen.position_m, &seen.orientation].concat();
    std::array::from_fn(|i| values[i] as f32)
}

/// Turns steps into input rows.
#[derive(Debug)]
pub(super) struct Features {
    /// Standard deviation of each force sensor's noise.
    pub(super) force_scale: [f64; 6],
    /// Mean and standard deviation of each input in the training data.
    pub(super) normalisation: Vec<(f32, f32)>,
}

impl Features {
    /// The input of a step.
    pub(super) fn row(&self, action: Option<Action>, now: &Seen, before: &Seen, first: &Seen) -> Vec<f32> {
        let difference = |a: &[f64; 3], b: &[f64; 3], scale: f64| (Vector3::from(*a) - Vector3::from(*b)) / scale;
        let wrap = |angle: f64| (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        let mut row: Vec<f64> = (0..ACTION_COUNT).map(|a| f64::from(action.is_some_and(|x| x.index() == a))).collect();
        row.extend(&difference(&now.tool_m, &[0.6, 0.0, 0.0], 0.1));
        row.extend(&difference(&now.position_m, &now.tool_m, 0.05));
        row.extend(&difference(&now.position_m, &before.position_m, 0.01));
        row.extend(&difference(&now.position_m, &first.position_m, 0.05));
        row.extend(&difference(&now.tool_m, &before.tool_m, 0.02));
        row.extend(now.orientation[..2].iter().map(|q| q / 0.02));
        row.push(wrap(now.yaw_rad - before.yaw_rad) / 0.05);
        row.push(wrap(now.yaw_rad - first.yaw_rad) / 0.3);
        row.extend([now.yaw_rad.sin(), now.yaw_rad.cos()]);
        let forces = || now.force.iter().zip(&self.force_scale).map(|(force, scale)| force / scale);
        row.extend(forces().map(|force| (force / 2.0).asinh() / 2.0));
        row.extend(forces().map(|force| force / 50.0));
        let scaled = row.iter().zip(&self.normalisation);
        scaled.map(|(value, (mean, stddev))| (value.clamp(-LIMIT, LIMIT) as f32 - mean) / stddev).collect()
    }
}
