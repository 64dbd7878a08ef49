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
        // By the log's own stamps: a period that is stated wrongly is not rare.
        let period = log.median_step();
        let rows = (TICK_SECS / period + 1e-6).floor().max(1.0) as usize;
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
            groups.iter().flatten().map(|range| mean(&values[range.clone()])).collect()
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

/// Of what is there; NaN where nothing is.
fn mean(values: &[f64]) -> f64 {
    let there = values.iter().filter(|value| value.is_finite());
    there.clone().sum::<f64>() / there.count() as f64
}
