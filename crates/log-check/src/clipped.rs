//! Sensors that read no more than their limit, and axes of a sensor that read nothing.

use measured_log::{Axis, Channel, Episode, Log};

use crate::suspicion::{Kind, Suspicion};

/// Readings that stay exactly at the limit for so many rows make a run; so many rows in runs are no chance.
const RUN: usize = 3;
const ROWS: usize = 10;
/// Neighbours that are exactly equal elsewhere, as a share: readings that change from row to row do not stay anywhere by themselves.
const EQUAL: f64 = 0.1;
/// Share of different readings among those that are not at the limit from which repeats are no chance, and how many repeats then suffice.
const DISTINCT: f64 = 0.5;
const FINE_ROWS: usize = 5;
/// Readings after which an axis that never changes is dead, if the others change.
const DEAD_ROWS: usize = 50;

/// Forces, torques and velocities whose sensors have a limit.
fn limited(log: &Log) -> Vec<Channel> {
    let vectors: [fn(Axis) -> Channel; 4] =
        [Channel::WristForce, Channel::WristTorque, Channel::ObjectVelocity, Channel::ObjectSpin];
    let joints = (0..log.header.robot.joints()).map(Channel::JointTorque);
    let all = vectors.into_iter().flat_map(|make| Axis::ALL.map(make)).chain(joints);
    all.filter(|channel| log.has(*channel)).collect()
}

/// Readings that follow each other, by episode.
fn readings(log: &Log, channel: Channel) -> Vec<Vec<(usize, f64)>> {
    let of = |episode: &Episode| {
        let cells = episode.channels.get(&channel);
        cells.into_iter().flat_map(|cells| cells.iter().enumerate()).filter_map(|(row, v)| Some((row, v?))).collect()
    };
    log.episodes.iter().map(of).collect()
}

/// Columns that stay at their largest or smallest reading, where they change from row to row elsewhere.
pub(crate) fn clipped(log: &Log) -> Option<Suspicion> {
    let mut all = limited(log).into_iter().flat_map(|channel| {
        let read = readings(log, channel);
        let values = || read.iter().flatten().map(|(_, value)| *value);
        let [low, high] = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
        // A limit on one side alone is not at rest.
        let limits = [high].into_iter().filter(|high| *high > 0.0).chain([low].into_iter().filter(|low| *low < 0.0));
        let found: Vec<(Channel, f64, usize, (usize, usize))> = limits
            .filter_map(|limit| at_limit(&read, limit).map(|(rows, first)| (channel, limit, rows, first)))
            .collect();
        found
    });
    let (channel, limit, rows, (episode, row)) = all.next()?;
    let others = match all.count() {
        0 => String::new(),
        many => format!(" So do {many} other limits."),
    };
    let found = format!(
        "{} is exactly {limit} in {rows} rows and never beyond, while other readings do not repeat: the sensor is at its limit.{others}",
        channel.name()
    );
    let mut suspicion = Suspicion::new(
        Kind::Clipped,
        found,
        "Leave such cells empty, or widen the sensor's range: what was larger is lost, and a diagnosis would name a saturated sensor.",
    );
    let episode = &log.episodes[episode];
    suspicion.shown_at = Some((episode.id, episode.time_secs[row]));
    Some(suspicion)
}

/// Rows at the limit and where the first is, if they are many. Readings that hardly ever repeat do not repeat their largest by chance. Those of a coarse
/// sensor do: there they have to stay in runs, and to change from row to row elsewhere.
fn at_limit(read: &[Vec<(usize, f64)>], limit: f64) -> Option<(usize, (usize, usize))> {
    let (mut rows, mut in_runs, mut longest, mut first) = (0, 0, 0, None);
    let (mut equal, mut elsewhere, mut others) = (0, 0, Vec::new());
    for (episode, values) in read.iter().enumerate() {
        for run in values.chunk_by(|a, b| a.1 == b.1) {
            if run[0].1 == limit {
                rows += run.len();
                first.get_or_insert((episode, run[0].0));
                if run.len() >= RUN {
                    (in_runs, longest) = (in_runs + run.len(), run.len().max(longest));
                }
            } else {
                (equal, elsewhere) = (equal + run.len() - 1, run.len().max(elsewhere));
                others.extend(run.iter().map(|(_, value)| value.to_bits()));
            }
        }
    }
    let count = others.len() as f64;
    others.sort_unstable();
    others.dedup();
    let fine = others.len() as f64 >= DISTINCT * count && rows >= FINE_ROWS;
    let coarse = equal as f64 <= EQUAL * count && in_runs >= ROWS && longest > elsewhere;
    (count > 0.0 && (fine || coarse)).then_some((rows, first?))
}

/// Axes of forces and torques that read the same in all rows, where another axis of the sensor changes.
pub(crate) fn dead_axes(log: &Log) -> Option<Suspicion> {
    let constant = |channel: Channel| {
        let read = readings(log, channel);
        let mut values = read.iter().flatten().map(|(_, value)| *value);
        let first = values.next()?;
        values.all(|value| value == first).then_some(first)
    };
    let sensors: [fn(Axis) -> Channel; 2] = [Channel::WristForce, Channel::WristTorque];
    for make in sensors {
        let axes = Axis::ALL.map(make);
        let count: usize = readings(log, axes[0]).iter().map(Vec::len).sum();
        if !log.has(axes[0]) || count < DEAD_ROWS {
            continue;
        }
        let values = axes.map(constant);
        // All three are a dead sensor.
        if values.iter().all(Option::is_some) {
            continue;
        }
        if let Some((axis, value)) = axes.into_iter().zip(values).find_map(|(axis, value)| Some((axis, value?))) {
            let found = format!(
                "{} reads exactly {value} in all rows, and the other axes change: it is dead or was not measured.",
                axis.name()
            );
            return Some(Suspicion::new(
                Kind::DeadSensor,
                found,
                "A constant is taken for a measurement. Take the sensor's columns out where an axis is dead.",
            ));
        }
    }
    None
}
