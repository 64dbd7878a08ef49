//! Logs whose numbers cannot mean what they say: other units cost hours of simulation and a report about nothing.

use measured_log::{Axis, Channel, Component, Episode, Log, Number};

use crate::error::Error;
use crate::noise::NoiseLevels;
use crate::nominal::Nominal;
use crate::trial::Kind;
use crate::units::Units;

/// Ticks a row, or rows a tick, at most: logs may be thinned, and lack rows.
const TICKS_A_ROW: f64 = 100.0;
/// Ticks of an episode that need no rows.
const SHORT: f64 = 1000.0;
/// Ticks of a log, at most.
const MOST_TICKS: f64 = 5e6;
/// By how much more than its noise, in standard deviations, a position changes that moves.
const MOVES: f64 = 10.0;
/// A command that changes by less, m, does not move the tool.
const COMMAND_M: f64 = 1e-4;

/// Refuses a log whose times are no times of its ticks, whose object is nowhere near the table it is pushed over, or in which fewer than `least` episodes
/// show any motion. Lengths are in `units`; what is said of them is not.
///
/// # Errors
///
/// [`Error::Unfit`] with what was expected and found.
pub(crate) fn check(
    log: &Log,
    name: &str,
    nominal: &Nominal,
    (noise, units): (&NoiseLevels, &Units),
    least: usize,
) -> Result<(), Error> {
    let refuse = |reason: String| Err(Error::Unfit { log: name.into(), reason });
    let period_secs = log.header.period_secs;
    let mut all = 0.0;
    for episode in &log.episodes {
        let (rows, duration_secs) = (episode.rows() as f64, duration_secs(episode));
        let ticks = duration_secs / period_secs;
        all += ticks;
        if ticks > (TICKS_A_ROW * rows).max(SHORT) || rows > TICKS_A_ROW * (ticks + 1.0) {
            return refuse(format!(
                "episode {}: expected about as many rows as `time_secs` has ticks of period_secs = {period_secs} s (within {TICKS_A_ROW} times), found {rows} rows in \
                 {duration_secs} s",
                episode.id
            ));
        }
    }
    if all > MOST_TICKS {
        return refuse(format!("expected at most {MOST_TICKS} ticks of period_secs = {period_secs} s, found {all:.0}"));
    }
    if nominal.has_tool() {
        let (table_m, size_m) =
            (log.header.table.height_m.mean(), 2.0 * log.header.object.shape.reach_m().into_iter().fold(0.0, f64::max));
        let unsure_m = match log.header.table.height_m {
            Number::Uncertain { stddev, .. } => 3.0 * stddev,
            Number::Fixed(_) => 0.0,
        };
        for episode in &log.episodes {
            let place = (0..episode.rows()).find_map(|row| episode.vector(Channel::ObjectPosition, row));
            let Some([_, _, z]) = place else { continue };
            let height_m = z - table_m;
            if height_m.abs() > 2.0 * size_m + 0.05 + unsure_m {
                let [size_m, table_m, height_m] = [size_m, table_m, height_m].map(|length| units.factor("m") * length);
                return refuse(format!(
                    "episode {}: expected an object of {size_m:.4} m that begins on the table at table.height_m = {table_m}, found its centre {height_m:.3} m above it: are \
                     positions in m, and in the same frame?",
                    episode.id
                ));
            }
        }
    }
    let moving = log.episodes.iter().filter(|episode| moves(episode, nominal.has_tool(), noise)).count();
    if moving < least {
        return refuse(format!("expected at least {least} episodes in which something moves, found {moving}"));
    }
    Ok(())
}

fn duration_secs(episode: &Episode) -> f64 {
    episode.time_secs.last().zip(episode.time_secs.first()).map_or(0.0, |(last, first)| last - first)
}

/// Whether the object, or what pushes it, goes farther than its sensor's noise.
fn moves(episode: &Episode, has_tool: bool, noise: &NoiseLevels) -> bool {
    let beyond = |channel: fn(Axis) -> Channel, least_m: f64| {
        Axis::ALL.iter().any(|axis| {
            let read = (0..episode.rows()).filter_map(|row| episode.get(channel(*axis), row));
            let (low, high) = read.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            high - low > least_m
        })
    };
    let of = |kind: Kind| MOVES * noise.of(kind).unwrap_or(0.0);
    let turns = Component::ALL.iter().any(|component| {
        let read = (0..episode.rows()).filter_map(|row| episode.get(Channel::ObjectOrientation(*component), row));
        let (low, high) = read.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        high - low > of(Kind::ObjectOrientation)
    });
    turns
        || beyond(Channel::ObjectPosition, of(Kind::ObjectPosition))
        || (has_tool
            && (beyond(Channel::Command, COMMAND_M) || beyond(Channel::Tool, of(Kind::ToolPosition).max(COMMAND_M))))
}
