//! What an episode starts from and is driven by.

use std::borrow::Cow;

use measured_log::{Axis, Channel, Episode};
use nalgebra::{UnitQuaternion, Vector3};
use physics_model::BodyState;
use physics_model::robot::JointVector;

use super::{Kind, rotation};
use crate::noise::NoiseLevels;

/// Most rows at rest that the start is averaged over.
const REST_ROWS: usize = 50;
/// Rows at rest that a posture is averaged over, at least.
const LEAST_REST_ROWS: usize = 10;
/// How far, in standard deviations of the sensor, a reading at rest may be from the first ones.
const REST_SIGMAS: f64 = 5.0;
/// How far, in standard deviations, a resting tool is read from where it was sent.
const TOOL_SIGMAS: f64 = 4.0;
/// Rows that a velocity at the start is fitted to where it is not measured.
const VELOCITY_ROWS: usize = 8;

/// An episode from its first row with a pose of the object on; `None` where it has none, or where the tool is under way by then: what that has stirred nobody
/// has seen.
pub(super) fn from_first_pose(episode: &Episode) -> Option<Cow<'_, Episode>> {
    let turns = (0..episode.rows()).any(|row| episode.orientation(row).is_some());
    let whole = |row: &usize| {
        episode.vector(Channel::ObjectPosition, *row).is_some() && (!turns || episode.orientation(*row).is_some())
    };
    let first = (0..episode.rows()).find(whole)?;
    let sent = |row: usize| episode.vector(Channel::Command, row);
    if (1..=first).any(|row| sent(row).is_some() && sent(row) != sent(0)) {
        return None;
    }
    Some(if first == 0 { Cow::Borrowed(episode) } else { Cow::Owned(episode.part(first..episode.rows())) })
}

/// The posture in which an arm rests before its tool first moves: the mean of what its joints were read to be; `None` where they were not, or where it begins in
/// motion, in which a reading is as far off as a sensor is.
pub(super) fn posture(episode: &Episode, joints: u8) -> Option<JointVector> {
    let sent = episode.vector(Channel::Command, 0)?;
    let resting = |row: &usize| episode.vector(Channel::Command, *row) == Some(sent);
    let rows: Vec<usize> = (0..episode.rows().min(REST_ROWS)).take_while(resting).collect();
    let mut posture = JointVector::zeros();
    for joint in 0..joints {
        let read: Vec<f64> = rows.iter().filter_map(|row| episode.get(Channel::Joint(joint), *row)).collect();
        if read.len() < LEAST_REST_ROWS {
            return None;
        }
        posture[usize::from(joint)] = read.iter().sum::<f64>() / read.len() as f64;
    }
    (joints > 0).then_some(posture)
}

/// The command at the end of each tick, m, from the command columns, else from where the tool was measured.
pub(super) fn commands(episode: &Episode, begin_secs: f64, period_secs: f64, ticks: usize) -> Option<Vec<[f64; 3]>> {
    let given = |make: fn(Axis) -> Channel| {
        let points: Vec<(f64, [f64; 3])> = (0..episode.rows())
            .filter_map(|row| Some((episode.time_secs[row] - begin_secs, episode.vector(make, row)?)))
            .collect();
        (!points.is_empty()).then_some(points)
    };
    let points = given(Channel::Command).or_else(|| given(Channel::Tool))?;
    let mut next = 0;
    Some(
        (1..=ticks)
            .map(|tick| {
                let time = tick as f64 * period_secs;
                while next < points.len() && points[next].0 < time - 1e-9 {
                    next += 1;
                }
                match (next.checked_sub(1).map(|i| points[i]), points.get(next)) {
                    (_, Some((t, point))) if (t - time).abs() < 0.02 * period_secs => *point,
                    (Some((t0, a)), Some((t1, b))) => {
                        let share = (time - t0) / (t1 - t0);
                        std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
                    }
                    (Some((_, point)), None) => point,
                    (None, Some((_, point))) => *point,
                    (None, None) => unreachable!("there is a point"),
                }
            })
            .collect(),
    )
}

/// Where the tool rests before it first moves: where it is sent, if that is where it is read to be, else the mean of the readings.
pub(super) fn tool(episode: &Episode, noise: &NoiseLevels) -> Option<[f64; 3]> {
    let first = |make| (0..episode.rows()).find_map(|row| episode.vector(make, row));
    let Some(sent) = first(Channel::Command) else { return first(Channel::Tool) };
    let resting = |row: &usize| episode.vector(Channel::Command, *row).is_none_or(|command| command == sent);
    let read: Vec<Vector3<f64>> = (0..episode.rows().min(REST_ROWS))
        .take_while(resting)
        .filter_map(|row| episode.vector(Channel::Tool, row).map(Vector3::from))
        .collect();
    if read.is_empty() {
        return Some(first(Channel::Tool).unwrap_or(sent));
    }
    let n = read.len() as f64;
    let mean = read.iter().sum::<Vector3<f64>>() / n;
    let tolerance_m = noise.of(Kind::ToolPosition).unwrap_or(0.0) * TOOL_SIGMAS / n.sqrt();
    let there = (mean - Vector3::from(sent)).amax() < tolerance_m;
    Some(if there { sent } else { mean.into() })
}

/// The object at the start, and the standard deviations of its position, orientation, velocity and angular velocity.
pub(super) fn start(episode: &Episode, noise: &NoiseLevels) -> Option<(BodyState, [f64; 4])> {
    let here = Vector3::from(episode.vector(Channel::ObjectPosition, 0)?);
    let attitude = first_attitude(episode);
    let (sigma_m, sigma_rad) = (noise.of(Kind::ObjectPosition)?, noise.of(Kind::ObjectOrientation).unwrap_or(0.0));
    let state = |place, turn, linear, angular| state(attitude, place, turn, linear, angular);
    if let (Some(linear), Some(angular)) =
        (episode.vector(Channel::ObjectVelocity, 0), episode.vector(Channel::ObjectSpin, 0))
    {
        let moving = Vector3::from(linear).norm() > 0.0 || Vector3::from(angular).norm() > 0.0;
        if moving {
            let speed = noise.of(Kind::ObjectVelocity).unwrap_or(0.0);
            let spin = noise.of(Kind::ObjectSpin).unwrap_or(0.0);
            return Some((state(here, Vector3::zeros(), linear, angular), [sigma_m, sigma_rad, speed, spin]));
        }
    }
    // At rest: the mean of what was read before anything moved.
    let poses = poses(episode, REST_ROWS);
    let resting = poses.iter().take_while(|(_, place, _)| (place - here).amax() < REST_SIGMAS * sigma_m).count();
    if resting > VELOCITY_ROWS / 2 {
        // The later half may already be moving by less than what shows.
        let kept = if resting == poses.len() { resting } else { (resting / 2).max(1) };
        let n = kept as f64;
        let place = poses[..kept].iter().map(|pose| pose.1).sum::<Vector3<f64>>() / n;
        let turn = poses[..kept].iter().map(|pose| pose.2).sum::<Vector3<f64>>() / n;
        let start = state(place, turn, [0.0; 3], [0.0; 3]);
        return Some((start, [sigma_m / n.sqrt(), sigma_rad / n.sqrt(), 0.0, 0.0]));
    }
    let found = moving(episode, noise).map(|(start, stddev, _)| (start, stddev));
    Some(found.unwrap_or_else(|| (state(here, Vector3::zeros(), [0.0; 3], [0.0; 3]), [sigma_m, sigma_rad, 0.0, 0.0])))
}

/// The orientation in the first row.
fn first_attitude(episode: &Episode) -> UnitQuaternion<f64> {
    rotation(episode.orientation(0).unwrap_or([0.0, 0.0, 0.0, 1.0]))
}

fn state(
    attitude: UnitQuaternion<f64>,
    place: Vector3<f64>,
    turn: Vector3<f64>,
    linear_mps: [f64; 3],
    angular_rps: [f64; 3],
) -> BodyState {
    let q = UnitQuaternion::from_scaled_axis(turn) * attitude;
    BodyState { position_m: place.into(), orientation: [q.i, q.j, q.k, q.w], linear_mps, angular_rps }
}

/// Time, place and turn since the first row, of the first rows, as far as all have a place.
fn poses(episode: &Episode, rows: usize) -> Vec<(f64, Vector3<f64>, Vector3<f64>)> {
    let back = first_attitude(episode).inverse();
    (0..episode.rows().min(rows))
        .map_while(|row| {
            let place = Vector3::from(episode.vector(Channel::ObjectPosition, row)?);
            let turn = episode.orientation(row).map_or_else(Vector3::zeros, |q| (rotation(q) * back).scaled_axis());
            Some((episode.time_secs[row] - episode.time_secs[0], place, turn))
        })
        .collect()
}

/// The same in motion: a parabola through the first poses, its constant and its slope. Last, the mean square of what it leaves, in variances of
/// the sensor.
pub(super) fn moving(episode: &Episode, noise: &NoiseLevels) -> Option<(BodyState, [f64; 4], f64)> {
    let (sigma_m, sigma_rad) = (noise.of(Kind::ObjectPosition)?, noise.of(Kind::ObjectOrientation).unwrap_or(0.0));
    let rows = poses(episode, VELOCITY_ROWS);
    if rows.len() < 4 {
        return None;
    }
    let design = nalgebra::DMatrix::from_fn(rows.len(), 3, |i, j| rows[i].0.powi(j as i32));
    let inverse = (design.transpose() * &design).try_inverse()?;
    let fit = |pick: &dyn Fn(usize) -> f64| {
        let values = nalgebra::DVector::from_fn(rows.len(), |i, _| pick(i));
        let solution = &inverse * design.transpose() * &values;
        let left = (values - &design * &solution).norm_squared();
        (solution[0], solution[1], left)
    };
    let place: [(f64, f64, f64); 3] = std::array::from_fn(|axis| fit(&|i| rows[i].1[axis]));
    let turn: [(f64, f64, f64); 3] = std::array::from_fn(|axis| fit(&|i| rows[i].2[axis]));
    let left = place.iter().map(|fit| fit.2 / sigma_m.powi(2)).sum::<f64>()
        + turn.iter().filter(|_| sigma_rad > 0.0).map(|fit| fit.2 / sigma_rad.powi(2)).sum::<f64>();
    let (constant, slope) = (inverse[(0, 0)].sqrt(), inverse[(1, 1)].sqrt());
    let start = state(
        first_attitude(episode),
        Vector3::from(place.map(|fit| fit.0)),
        Vector3::from(turn.map(|fit| fit.0)),
        place.map(|fit| fit.1),
        turn.map(|fit| fit.1),
    );
    let stddev = [sigma_m * constant, sigma_rad * constant, sigma_m * slope, sigma_rad * slope];
    let freedoms = (rows.len() - 3) * if sigma_rad > 0.0 { 6 } else { 3 };
    Some((start, stddev, left / freedoms.max(1) as f64))
}
