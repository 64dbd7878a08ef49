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

/// Places of a vector by the time since the start, s; `None` where there are none.
fn given(episode: &Episode, make: fn(Axis) -> Channel, begin_secs: f64) -> Option<Vec<(f64, [f64; 3])>> {
    let points: Vec<(f64, [f64; 3])> = (0..episode.rows())
        .filter_map(|row| Some((episode.time_secs[row] - begin_secs, episode.vector(make, row)?)))
        .collect();
    (!points.is_empty()).then_some(points)
}

/// Half widths, in rows, over which places of the tool are smoothed, the widest first.
const HALF_WIDTHS: [usize; 4] = [8, 5, 3, 2];
/// A parabola that leaves more than this, as a mean square in variances of the sensor, is not the tool's way.
const NOT_ITS_WAY: f64 = 1.5;

/// The way of a tool that was read with noise of `sigma_m`: of each place the parabola through as many of its neighbours as lie on one. A kinematic tool that
/// went where noise has it would shake what it pushes.
fn smoothed(points: &[(f64, [f64; 3])], sigma_m: f64) -> Vec<(f64, [f64; 3])> {
    let smooth = |index: usize, half: usize| -> Option<[f64; 3]> {
        let near = &points[index.saturating_sub(half)..points.len().min(index + half + 1)];
        if near.len() < 5 {
            return None;
        }
        let span = near[near.len() - 1].0 - near[0].0;
        let design =
            nalgebra::DMatrix::from_fn(near.len(), 3, |i, j| ((near[i].0 - points[index].0) / span).powi(j as i32));
        let inverse = (design.transpose() * &design).try_inverse()?;
        let mut place = [0.0; 3];
        for (axis, place) in place.iter_mut().enumerate() {
            let read = nalgebra::DVector::from_fn(near.len(), |i, _| near[i].1[axis]);
            let solution = &inverse * design.transpose() * &read;
            let left = (&read - &design * &solution).norm_squared() / (near.len() - 3) as f64;
            *place = (left < NOT_ITS_WAY * sigma_m * sigma_m).then_some(solution[0])?;
        }
        Some(place)
    };
    let one = |(index, point): (usize, &(f64, [f64; 3]))| {
        (point.0, HALF_WIDTHS.into_iter().find_map(|half| smooth(index, half)).unwrap_or(point.1))
    };
    points.iter().enumerate().map(one).collect()
}

/// The command at the end of each tick, m, from the command columns, else from where the tool was measured.
pub(super) fn commands(
    episode: &Episode,
    noise: &NoiseLevels,
    begin_secs: f64,
    period_secs: f64,
    ticks: usize,
) -> Option<Vec<[f64; 3]>> {
    let sigma_m = noise.of(Kind::ToolPosition).unwrap_or(0.0);
    let read = || given(episode, Channel::Tool, begin_secs).map(|points| smoothed(&points, sigma_m));
    let points = given(episode, Channel::Command, begin_secs).or_else(read)?;
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
    let Some(sent) = first(Channel::Command) else {
        return given(episode, Channel::Tool, 0.0).and_then(|points| {
            smoothed(&points, noise.of(Kind::ToolPosition).unwrap_or(0.0)).first().map(|point| point.1)
        });
    };
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
    let poses = poses(episode, REST_ROWS, None);
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
    let found = moving(episode, noise, None).map(|(start, stddev, _)| (start, stddev));
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

/// Time, place and turn since the first row, of the first rows, as far as all have a place. `spin`: in the first row, rad/s, base axes, where it is known.
fn poses(episode: &Episode, rows: usize, spin: Option<[f64; 3]>) -> Vec<(f64, Vector3<f64>, Vector3<f64>)> {
    let back = first_attitude(episode).inverse();
    let (mut last, mut rate) = ((0.0, Vector3::zeros()), spin.map_or_else(Vector3::zeros, Vector3::from));
    (0..episode.rows().min(rows))
        .map_while(|row| {
            let place = Vector3::from(episode.vector(Channel::ObjectPosition, row)?);
            let time = episode.time_secs[row] - episode.time_secs[0];
            let turn = episode.orientation(row).map_or_else(Vector3::zeros, |q| (rotation(q) * back).scaled_axis());
            let turn = nearest_turn(turn, last.1 + rate * (time - last.0));
            if time > last.0 {
                rate = (turn - last.1) / (time - last.0);
                last = (time, turn);
            }
            Some((time, place, turn))
        })
        .collect()
}

/// Of the rotation vectors of a turn, which differ by whole turns, the one that is nearest to what is expected.
fn nearest_turn(turn: Vector3<f64>, expected: Vector3<f64>) -> Vector3<f64> {
    let axis = turn.try_normalize(1e-9).or_else(|| expected.try_normalize(1e-9));
    let Some(axis) = axis else { return turn };
    let whole = ((expected - turn).dot(&axis) / std::f64::consts::TAU).round();
    turn + axis * (whole * std::f64::consts::TAU)
}

/// The same in motion: a parabola through the first poses, its constant and its slope. Last, the mean square of what it leaves, in variances of
/// the sensor. `spin`: as measured in the first row, rad/s.
pub(super) fn moving(
    episode: &Episode,
    noise: &NoiseLevels,
    spin: Option<[f64; 3]>,
) -> Option<(BodyState, [f64; 4], f64)> {
    let (sigma_m, sigma_rad) = (noise.of(Kind::ObjectPosition)?, noise.of(Kind::ObjectOrientation).unwrap_or(0.0));
    let rows = poses(episode, VELOCITY_ROWS, spin);
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

#[cfg(test)]
mod tests {
    use measured_log::{Component, Readings};
    use pomdp::{Purpose, Seed};
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    /// An object that spins about the vertical, read every `period_secs`.
    fn spinning(rate_rps: f64, period_secs: f64) -> Episode {
        let time_secs: Vec<f64> = (0..8).map(|row| period_secs * f64::from(row)).collect();
        let mut episode = Episode { time_secs: time_secs.clone(), ..Episode::default() };
        for axis in Axis::ALL {
            episode.channels.insert(Channel::ObjectPosition(axis), time_secs.iter().map(|_| 0.0).collect());
        }
        for (i, component) in Component::ALL.into_iter().enumerate() {
            let part = |time: &f64| {
                let (sin, cos) = (0.5 * rate_rps * time).sin_cos();
                [0.0, 0.0, sin, cos][i]
            };
            let cells: Readings = time_secs.iter().map(part).collect();
            episode.channels.insert(Channel::ObjectOrientation(component), cells);
        }
        episode
    }

    #[test]
    fn a_spin_of_many_turns_is_followed_and_a_measured_one_beyond_half_a_turn_a_row() {
        let turned = |rate_rps: f64, spin| poses(&spinning(rate_rps, 0.02), 8, spin)[7].2[2];
        // 0.57 turns a row look like 0.43 the other way.
        assert!((turned(180.0, Some([0.0, 0.0, 175.0])) - 180.0 * 0.14).abs() < 1e-9);
        assert!((turned(100.0, None) - 14.0).abs() < 1e-9);
        assert!((turned(-3.0, None) + 0.42).abs() < 1e-9);
    }

    #[test]
    fn a_tool_that_was_read_with_noise_goes_its_way() {
        let mut rng = Seed(2).stream(Purpose::Test, 0);
        // At rest, then at 5 cm/s.
        let way = |time: f64| 0.05 * (time - 1.0).max(0.0);
        let points: Vec<(f64, [f64; 3])> = (0..100)
            .map(|row| {
                let time = 0.02 * f64::from(row);
                let noise: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                (time, [way(time) + 1e-4 * noise[0], 1e-4 * noise[1], 1e-4 * noise[2]])
            })
            .collect();
        let error = |points: &[(f64, [f64; 3])]| {
            (points.iter().map(|(time, place)| (place[0] - way(*time)).powi(2)).sum::<f64>() / 100.0).sqrt()
        };
        let found = smoothed(&points, 1e-4);
        assert!(error(&found) < 0.6 * error(&points), "{} of {}", error(&found), error(&points));
        // What is exact stays.
        let exact: Vec<(f64, [f64; 3])> = points.iter().map(|(time, _)| (*time, [way(*time), 0.0, 0.0])).collect();
        assert!(smoothed(&exact, 1e-6).iter().zip(&exact).all(|(a, b)| (a.1[0] - b.1[0]).abs() < 1.3e-6));
    }
}
