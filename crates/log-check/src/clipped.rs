//! Sensors that read no more than their limit, and axes of a sensor that read nothing.

use measured_log::{Axis, Channel, Log};

use crate::sensors::{self, DEAD_ROWS};
use crate::suspicion::{Kind, Suspicion};

/// Readings that stay exactly at the limit for so many rows make a run; so many rows in runs are no chance.
const RUN: usize = 3;
const ROWS: usize = 10;
/// Neighbours that are exactly equal elsewhere, as a share: readings that change from row to row do not stay anywhere by themselves.
const EQUAL: f64 = 0.1;
/// Share of different readings among those that are not at the limit from which repeats are no chance, and how many repeats then suffice.
const DISTINCT: f64 = 0.5;
const FINE_ROWS: usize = 5;
/// Resolution, as a share of an axis's range, with which an axis that is hardly loaded changes too.
const FINE: f64 = 0.005;

/// Forces and torques, whose sensors have a limit.
fn limited(log: &Log) -> Vec<Channel> {
    let vectors: [fn(Axis) -> Channel; 2] = [Channel::WristForce, Channel::WristTorque];
    let joints = (0..log.header.robot.joints()).map(Channel::JointTorque);
    let all = vectors.into_iter().flat_map(|make| Axis::ALL.map(make)).chain(joints);
    all.filter(|channel| log.has(*channel)).collect()
}

/// Rows and readings of a column, by episode.
type Column = Vec<Vec<(usize, f64)>>;

/// Readings that follow each other.
fn readings(log: &Log, channel: Channel) -> Column {
    log.episodes.iter().map(|episode| sensors::readings(episode, channel).collect()).collect()
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
    // Most episodes begin with what a sensor reads at rest, whatever its zero is.
    let begins = read.iter().filter(|values| values.first().is_some_and(|(_, value)| *value == limit)).count();
    if 2 * begins > read.len() {
        return None;
    }
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

/// Axes of forces and torques that read the same in all rows, where other axes of the sensor change, and by less than it can tell apart.
pub(crate) fn dead_axes(log: &Log) -> Option<Suspicion> {
    let sensors: [fn(Axis) -> Channel; 2] = [Channel::WristForce, Channel::WristTorque];
    let found = sensors.into_iter().flat_map(|make| dead_of(log, &Axis::ALL.map(make)));
    let names: Vec<String> = found.map(|(channel, value)| format!("{} (always {value})", channel.name())).collect();
    (!names.is_empty()).then(|| {
        let found = format!(
            "{} never changes, while another axis of the sensor does: it is dead or was not measured.",
            names.join(", ")
        );
        Suspicion::new(Kind::DeadSensor, found, "A constant is taken for a measurement. Leave such a column out.")
    })
}

/// The dead ones of the axes of a sensor, with what they read.
fn dead_of(log: &Log, axes: &[Channel]) -> Vec<(Channel, f64)> {
    let read: Vec<(Channel, Column)> =
        axes.iter().filter(|axis| log.has(**axis)).map(|axis| (*axis, readings(log, *axis))).collect();
    let values = |read: &Column| read.iter().flatten().map(|(_, value)| *value).collect::<Vec<f64>>();
    let (mut dead, mut fine) = (Vec::new(), false);
    for (channel, read) in &read {
        let all = values(read);
        if all.len() < DEAD_ROWS {
            continue;
        }
        let [low, high] =
            [all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().copied().fold(f64::NEG_INFINITY, f64::max)];
        if low == high {
            dead.push((*channel, low));
            continue;
        }
        let steps = read.iter().flat_map(|episode| episode.windows(2)).map(|pair| (pair[1].1 - pair[0].1).abs());
        let step = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
        fine |= step <= FINE * (high - low);
    }
    // All of them are a dead sensor. An axis of a coarse one may read zero although it is not.
    if fine { dead } else { Vec::new() }
}
