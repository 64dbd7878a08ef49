//! Whether joints and tool fit together.

use measured_log::{Axis, Channel, Episode, Log};
use nalgebra::Vector3;
use physics_model::robot::Robot;

use crate::Reading;
use crate::suspicion::{Kind, Suspicion, capital};

/// Rows that are looked at, spread over the log.
const ROWS: usize = 400;
/// How far the tool may be from where the joints say, m: bases and flanges are measured to that.
const TOLERANCE_M: f64 = 0.01;
/// A reading has to leave this share of the distance at most.
const LEFT_SHARE: f64 = 0.3;

/// Joints of a row, rad.
pub(crate) fn joints(episode: &Episode, count: u8, row: usize) -> Option<Vec<f64>> {
    (0..count).map(|joint| episode.get(Channel::Joint(joint), row)).collect()
}

/// Where the tool centre is in a row: as measured, else by the joints, else as commanded.
pub(crate) fn tool_m(log: &Log, arm: Option<&Robot>, episode: &Episode, row: usize) -> Option<[f64; 3]> {
    if log.has(Channel::Tool(Axis::X)) {
        return episode.vector(Channel::Tool, row);
    }
    if let Some(arm) = arm
        && log.has(Channel::Joint(0))
    {
        let q = joints(episode, log.header.robot.joints(), row)?;
        return Some(arm.base_from_tool(&q).translation.vector.into());
    }
    episode.vector(Channel::Command, row)
}

/// Joints beside measured, else commanded, places of the tool.
pub(crate) fn suspicion(log: &Log, arm: &Robot) -> Option<Suspicion> {
    let count = log.header.robot.joints();
    let place: fn(Axis) -> Channel = if log.has(Channel::Tool(Axis::X)) { Channel::Tool } else { Channel::Command };
    let all: Vec<(Vec<f64>, Vector3<f64>)> = log
        .episodes
        .iter()
        .flat_map(|episode| {
            (0..episode.rows())
                .filter_map(|row| Some((joints(episode, count, row)?, Vector3::from(episode.vector(place, row)?))))
        })
        .collect();
    let rows: Vec<&(Vec<f64>, Vector3<f64>)> = all.iter().step_by(all.len().div_ceil(ROWS).max(1)).collect();
    let distance = |reading: Option<&Reading>| -> Option<f64> {
        let off = rows.iter().map(|(q, tool)| {
            let mut q = q.clone();
            if let Some(reading) = reading {
                reading.joints(&mut q);
            }
            (arm.base_from_tool(&q).translation.vector - tool).norm()
        });
        statistics::nearest_rank(off, 0.5)
    };
    let own = distance(None).filter(|own| *own > TOLERANCE_M)?;
    let mut readings: Vec<(f64, Reading)> = candidates(count, &rows, arm)
        .into_iter()
        .filter_map(|reading| Some((distance(Some(&reading))?, reading)))
        .filter(|(left, _)| *left < (LEFT_SHARE * own).min(2.0 * TOLERANCE_M))
        .collect();
    readings.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found =
        format!("The joints put the tool {:.0} mm from where it was measured or sent, in the median.", 1e3 * own);
    let mend = match readings.first() {
        Some((left, reading)) => format!("{} it is {:.0} mm.", capital(&reading.words()), 1e3 * left),
        None => "Check joint order, units, zero positions and the tool's frame.".into(),
    };
    let mut suspicion = Suspicion::new(Kind::Joints, found, &mend);
    suspicion.readings = readings.into_iter().take(1).map(|(_, reading)| reading).collect();
    Some(suspicion)
}

fn candidates(count: u8, rows: &[&(Vec<f64>, Vector3<f64>)], arm: &Robot) -> Vec<Reading> {
    let mut all = vec![Reading::JointsInDegrees];
    for a in 0..count {
        all.extend((a + 1..count).map(|b| Reading::JointsSwapped(a, b)));
        all.push(Reading::JointReversed(a));
        all.extend(offset(a, rows, arm).map(|offset| Reading::JointOffset(a, offset)));
    }
    all
}

/// What has to be added to a joint so that the tool is where it was measured: the best of all angles, by steps and then by golden section.
fn offset(joint: u8, rows: &[&(Vec<f64>, Vector3<f64>)], arm: &Robot) -> Option<f64> {
    let few: Vec<_> = rows.iter().step_by(rows.len().div_ceil(20).max(1)).collect();
    let off = |offset: f64| -> f64 {
        few.iter()
            .map(|(q, tool)| {
                let mut q = q.clone();
                q[usize::from(joint)] += offset;
                (arm.base_from_tool(&q).translation.vector - tool).norm_squared()
            })
            .sum()
    };
    const STEPS: i32 = 36;
    let step = std::f64::consts::TAU / f64::from(STEPS);
    let best =
        (0..STEPS).map(|i| step * f64::from(i) - std::f64::consts::PI).min_by(|a, b| off(*a).total_cmp(&off(*b)))?;
    let (mut low, mut high) = (best - step, best + step);
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if off(a) < off(b) { high = b } else { low = a }
    }
    Some(0.5 * (low + high))
}
