//! Where episodes begin and end.

use std::ops::Range;

use crate::Error;
use crate::mapping::{Mapping, Moving, RawEpisodes};
use crate::plan::{Plan, Quantity};
use crate::store::Store;

/// Readings of one episode: those from `from` to before `to`, and their rows where rows are kept.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) label: Option<f64>,
    pub(crate) from_secs: f64,
    pub(crate) to_secs: f64,
    pub(crate) rows: Range<usize>,
}

/// Cuts what was read; `rows` says that the readings of all tracks are those of the same rows, in their order.
pub(crate) fn cut(mapping: &Mapping, plan: &Plan, store: &Store, rows: bool) -> Result<Vec<Piece>, Error> {
    let read: Vec<usize> = (0..plan.tracks.len())
        .filter(|index| plan.tracks[*index].quantity != Quantity::Label && !store.streams[*index].times.is_empty())
        .collect();
    let positive = |key: &str, value: f64| {
        if value > 0.0 && value.is_finite() {
            return Ok(value);
        }
        Err(mapping.wrong(format!("episodes.{key}"), format!("expected more than 0, found {value}")))
    };
    match &mapping.raw.episodes {
        RawEpisodes::Source => {
            let count = read.first().map_or(0, |index| store.streams[*index].times.len());
            Ok(vec![Piece { label: None, from_secs: f64::NEG_INFINITY, to_secs: f64::INFINITY, rows: 0..count }])
        }
        RawEpisodes::Change(change) => {
            let Some(index) = plan.index(Quantity::Label) else { return Ok(Vec::new()) };
            let stream = &store.streams[index];
            let skip: Vec<f64> = change.skip.iter().map(|label| store.known_label(&label.0)).collect();
            let mut pieces = Vec::new();
            for run in runs(&stream.values) {
                let label = stream.values[run.start];
                if label.is_nan() || skip.contains(&label) {
                    continue;
                }
                let to_secs = stream.times.get(run.end).copied().unwrap_or(f64::INFINITY);
                pieces.push(Piece { label: Some(label), from_secs: stream.times[run.start], to_secs, rows: run });
            }
            Ok(pieces)
        }
        RawEpisodes::Gap(gap) => {
            let longest = positive("gap.longer_than_secs", gap.longer_than_secs)?;
            let mut times: Vec<f64> = if rows {
                read.first().map_or_else(Vec::new, |index| store.streams[*index].times.clone())
            } else {
                read.iter().flat_map(|index| store.streams[*index].times.iter().copied()).collect()
            };
            if !rows {
                times.sort_by(f64::total_cmp);
            }
            Ok(pieces(&times, gaps(&times, longest)))
        }
        RawEpisodes::Still(still) => {
            let longest = positive("still.longer_than_secs", still.longer_than_secs)?;
            let within = positive("still.within_m", still.within_m)?;
            let quantity = match still.of {
                Moving::Command => Quantity::Command,
                Moving::Tool => Quantity::Tool,
                Moving::Object => Quantity::Object,
            };
            let index =
                plan.index(quantity).filter(|index| plan.tracks[*index].fixed().is_none()).ok_or_else(|| {
                    let reason = format!("expected a quantity of this mapping, found {}", quantity.key());
                    mapping.wrong("episodes.still.of", reason)
                })?;
            let stream = &store.streams[index];
            let position = |i: usize| [stream.get(i)[0], stream.get(i)[1], stream.get(i)[2]];
            Ok(pieces(&stream.times, moving(&stream.times, &position, within, longest)))
        }
    }
}

fn pieces(times: &[f64], ranges: Vec<Range<usize>>) -> Vec<Piece> {
    let piece = |rows: Range<usize>| Piece {
        label: None,
        from_secs: times[rows.start],
        to_secs: times[rows.end - 1].next_up(),
        rows,
    };
    ranges.into_iter().map(piece).collect()
}

/// Runs of equal values.
fn runs(values: &[f64]) -> Vec<Range<usize>> {
    let mut start = 0;
    let same = |a: &f64, b: &f64| a == b || (a.is_nan() && b.is_nan());
    let run = |run: &[f64]| {
        let range = start..start + run.len();
        start = range.end;
        range
    };
    values.chunk_by(same).map(run).collect()
}

/// What lies between gaps, and between steps backwards.
fn gaps(times: &[f64], longest: f64) -> Vec<Range<usize>> {
    let mut start = 0;
    times
        .chunk_by(|a, b| b - a <= longest && b >= a)
        .map(|run| {
            let range = start..start + run.len();
            start = range.end;
            range
        })
        .collect()
}

/// What lies between phases of more than `longest` seconds within a ball of `within`; half of that time stays at both ends.
fn moving(times: &[f64], position: &dyn Fn(usize) -> [f64; 3], within: f64, longest: f64) -> Vec<Range<usize>> {
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>() <= within * within;
    let mut phases: Vec<Range<usize>> = Vec::new();
    let mut first = 0;
    while first < times.len() {
        let centre = position(first);
        let mut end = first + 1;
        while end < times.len() && near(centre, position(end)) {
            end += 1;
        }
        let still = times[end - 1] - times[first] >= longest;
        match phases.last_mut() {
            // A slow creep of the readings' zero makes one phase of many.
            Some(last) if still && last.end >= first => last.end = end,
            _ if still => phases.push(first..end),
            _ => {}
        }
        first = if still { end } else { first + 1 };
    }
    let mut ranges = Vec::new();
    let mut start = 0;
    let after = |time: f64| times.partition_point(|t| *t < time);
    for phase in phases.into_iter().chain(std::iter::once(times.len()..times.len())) {
        let stop = if phase.is_empty() { times.len() } else { after(times[phase.start] + 0.5 * longest) };
        // What is still from its first reading to its last is no episode.
        let moves = (start..stop).any(|i| !near(position(start), position(i)));
        if moves {
            ranges.push(start..stop);
        }
        start = if phase.is_empty() { stop } else { after(times[phase.end - 1] - 0.5 * longest) };
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_labels_include_those_without_one() {
        assert_eq!(runs(&[1.0, 1.0, f64::NAN, f64::NAN, 2.0]), [0..2, 2..4, 4..5]);
        assert_eq!(runs(&[]), []);
    }

    #[test]
    fn gaps_and_clocks_that_start_anew_cut() {
        assert_eq!(gaps(&[0.0, 0.1, 1.5, 1.6, 0.0, 0.1], 1.0), [0..2, 2..4, 4..6]);
    }

    #[test]
    fn still_phases_cut_and_leave_rest_at_both_ends() {
        // Still for 2 s, moves for 1 s, still for 2 s, moves for 1 s to the end.
        let times: Vec<f64> = (0..60).map(|i| f64::from(i) * 0.1).collect();
        let x: Vec<f64> = times.iter().map(|t| (t - 2.0).clamp(0.0, 1.0) + (t - 5.0).clamp(0.0, 1.0)).collect();
        let found = moving(&times, &|i| [x[i], 0.0, 0.0], 0.01, 1.0);
        assert_eq!(found.len(), 2, "{found:?}");
        let ends: Vec<(f64, f64)> = found.iter().map(|r| (times[r.start], times[r.end - 1])).collect();
        for ((start, end), (expected_start, expected_end)) in ends.into_iter().zip([(1.5, 3.4), (4.5, 5.9)]) {
            assert!((start - expected_start).abs() < 0.11 && (end - expected_end).abs() < 0.11, "{start} {end}");
        }
    }
}
