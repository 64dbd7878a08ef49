//! Rows taken together to ticks of some milliseconds: motions of an arm are slower than that, and noise averages out.

use crate::log::{Log, Readings};

/// Shortest tick, s: arms move by less than their noise within it.
const TICK_SECS: f64 = 0.004;

/// Means over ticks.
#[derive(Debug)]
pub(crate) struct Ticks {
    /// First tick of each episode, and the number of ticks.
    pub(crate) episodes: Vec<usize>,
    /// s from the start of the episode.
    pub(crate) time_secs: Vec<f64>,
    pub(crate) position: Readings,
    pub(crate) velocity: Readings,
    pub(crate) torque: Readings,
    pub(crate) command: Readings,
    /// Rows in a tick.
    pub(crate) rows: usize,
}

impl Ticks {
    pub(crate) fn new(log: &Log) -> Self {
        Self::of_rows(log, Self::rows_in(log))
    }

    /// Rows in a tick, by the log's own stamps: a period that is stated wrongly is not rare. One that is off by a percent is the same.
    pub(crate) fn rows_in(log: &Log) -> usize {
        (TICK_SECS / log.median_step() * 1.01).floor().max(1.0) as usize
    }

    /// Ticks of so many rows.
    pub(crate) fn of_rows(log: &Log, rows: usize) -> Self {
        let groups: Vec<Vec<std::ops::Range<usize>>> = log
            .rows()
            .map(|episode| {
                let ticks = episode.len() / rows;
                (0..ticks).map(|tick| episode.start + tick * rows..episode.start + (tick + 1) * rows).collect()
            })
            .collect();
        let mut episodes = vec![0];
        for group in &groups {
            episodes.push(episodes[episodes.len() - 1] + group.len());
        }
        let mean = |values: &Vec<f64>| -> Vec<f64> {
            let filled = filled(log, values);
            groups.iter().flatten().map(|range| mean(&values[range.clone()], &filled[range.clone()])).collect()
        };
        let all = |readings: &Readings| readings.iter().map(&mean).collect();
        Self {
            episodes,
            time_secs: mean(&log.time_secs),
            position: all(&log.position),
            velocity: all(&log.velocity),
            torque: all(&log.torque),
            command: all(&log.command),
            rows,
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.time_secs.len()
    }

    pub(crate) fn spans(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.episodes.windows(2).map(|pair| pair[0]..pair[1])
    }
}

/// Of a tick's readings; NaN where none is there. Where some are missing, the mean of those that are there would be that of another instant: what stands on the
/// line between their neighbours stands in, but at the ends of an episode.
fn mean(values: &[f64], filled: &[f64]) -> f64 {
    let there = values.iter().filter(|value| value.is_finite());
    let count = there.clone().count();
    match filled.iter().sum::<f64>() / filled.len() as f64 {
        mean if count > 0 && mean.is_finite() => mean,
        _ => there.sum::<f64>() / count as f64,
    }
}

/// Readings with those that are missing on the line between their neighbours in the same episode; at its ends they stay missing.
fn filled(log: &Log, values: &[f64]) -> Vec<f64> {
    let mut all = values.to_vec();
    for span in log.rows() {
        let mut before: Option<usize> = None;
        for row in span {
            if values[row].is_nan() {
                continue;
            }
            if let Some(last) = before {
                let slope = (values[row] - values[last]) / (log.time_secs[row] - log.time_secs[last]);
                let missing = last + 1..row;
                for (value, time) in all[missing.clone()].iter_mut().zip(&log.time_secs[missing]) {
                    *value = values[last] + slope * (time - log.time_secs[last]);
                }
            }
            before = Some(row);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::mean;

    #[test]
    fn a_reading_that_is_missing_does_not_move_a_tick() {
        // A joint at 1 rad/s, rows of 1 ms; the last reading of the tick is missing.
        let (values, filled) = ([0.0, 0.001, 0.002, f64::NAN], [0.0, 0.001, 0.002, 0.003]);
        assert!((mean(&values, &filled) - 0.0015).abs() < 1e-15);
        assert_eq!(mean(&values, &values), 0.001);
        assert!(mean(&[f64::NAN; 4], &filled).is_nan());
    }
}
