//! Whether rows were read when their stamps say, or at a steady rate.
//!
//! A logger that writes whole milliseconds, or stamps rows a little late, reads them more evenly than it says. One that waits for its turn reads them
//! when it says. Positions tell which: their motion is smooth in the time that is right.

use rayon::prelude::*;

use crate::log::{Log, median};
use crate::smooth::Readings;
use crate::ticks::Ticks;

/// Stamps whose distance from even ones is at most this share of a period are even.
const EVEN: f64 = 1e-3;
/// By how much ln of the density has to be larger for even stamps: what is written down is right unless something speaks against it.
const MARGIN: f64 = 10.0;

impl Log {
    /// Takes rows as read at a steady rate where the motion of the joints is smoother so.
    pub(crate) fn settle_stamps(&mut self) {
        // As many rows in a tick for all: densities of other numbers of readings cannot be compared.
        let rows = Ticks::rows_in(self);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for even in self.even_stamps() {
            let given = std::mem::replace(&mut self.time_secs, even);
            let log_likelihood = self.log_likelihood(rows);
            let even = std::mem::replace(&mut self.time_secs, given);
            if best.as_ref().is_none_or(|(most, _)| log_likelihood > *most) {
                best = Some((log_likelihood, even));
            }
        }
        let Some((most, even)) = best else { return };
        if most > self.log_likelihood(rows) + MARGIN {
            self.time_secs = even;
            self.notes.push(
                "rows are taken as read at a steady rate: the motion is smoother so than by the stamps of time_secs"
                    .into(),
            );
        }
    }

    /// ln of the density of all positions and velocities under the smooth motion that fits best.
    fn log_likelihood(&self, rows: usize) -> f64 {
        let ticks = Ticks::of_rows(self, rows);
        let spans: Vec<_> = ticks.spans().filter(|span| !span.is_empty()).collect();
        let of_joint = |joint: usize| {
            let velocity = ticks.velocity.get(joint).map_or(&[][..], Vec::as_slice);
            let position = &ticks.position[joint];
            Readings { spans: &spans, time_secs: &ticks.time_secs, position, velocity }
                .smooth(None, None)
                .log_likelihood
        };
        (0..self.joints()).into_par_iter().map(of_joint).collect::<Vec<_>>().into_iter().sum()
    }

    /// Stamps of the same rows at a steady rate: with those that are missing left out, and as if none were missing. None that are as good as given.
    fn even_stamps(&self) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = Vec::new();
        for in_turn in [false, true] {
            let of_span = |span: std::ops::Range<usize>| {
                let stamps = &self.time_secs[span];
                if stamps.len() < 3 {
                    return Some((stamps.to_vec(), 0.0));
                }
                let rows = || (0..stamps.len()).map(|row| row as f64).collect();
                let numbers = if in_turn { rows() } else { numbered(stamps, self.header.period_secs)? };
                let line = Line::through(&numbers, stamps);
                Some((line.even.clone(), line.farthest / line.period))
            };
            let Some(spans) = self.rows().map(of_span).collect::<Option<Vec<_>>>() else { continue };
            let farthest = spans.iter().map(|(_, off)| *off).fold(0.0, f64::max);
            let even: Vec<f64> = spans.into_iter().flat_map(|(even, _)| even).collect();
            if farthest > EVEN && !all.contains(&even) {
                all.push(even);
            }
        }
        all
    }
}

/// A line through the stamps of numbered rows.
struct Line {
    /// The stamps on it, s.
    even: Vec<f64>,
    /// From one number to the next, s.
    period: f64,
    /// Of the first number, s.
    first: f64,
    /// How far the farthest stamp is from it, s.
    farthest: f64,
}

impl Line {
    fn through(numbers: &[f64], stamps: &[f64]) -> Self {
        let count = stamps.len() as f64;
        let (x, y) = (numbers.iter().sum::<f64>() / count, stamps.iter().sum::<f64>() / count);
        let product: f64 = numbers.iter().zip(stamps).map(|(number, stamp)| (number - x) * (stamp - y)).sum();
        let period = product / numbers.iter().map(|number| (number - x).powi(2)).sum::<f64>();
        let even: Vec<f64> = numbers.iter().map(|number| y + period * (number - x)).collect();
        let farthest = even.iter().zip(stamps).map(|(even, stamp)| (even - stamp).abs()).fold(0.0, f64::max);
        Self { even, period, first: y - period * x, farthest }
    }
}

/// Numbers of rows of a steady rate of which some may be missing: of all rates that leave no stamp half a period off, the one that misses the fewest.
fn numbered(stamps: &[f64], stated: f64) -> Option<Vec<f64>> {
    let steps: Vec<f64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    // Rows that are missing make the mean too long, and rounding the median wrong.
    let found = [stated, mean, median(steps)].into_iter().filter_map(|period| numbered_at(stamps, period));
    found.min_by(|a, b| a[a.len() - 1].total_cmp(&b[b.len() - 1]))
}

/// Numbers of rows that are about `period` apart, s; `None` where one is half a period off, and could be the one beside it.
fn numbered_at(stamps: &[f64], period: f64) -> Option<Vec<f64>> {
    /// Share of an error by which what is expected follows stamps: they jitter, and the period is not exact.
    const FOLLOW: f64 = 0.1;
    /// Counts along the line of the count before.
    const TIMES: usize = 4;
    let (mut number, mut expected) = (0.0, stamps[0]);
    let mut numbers: Vec<f64> = Vec::with_capacity(stamps.len());
    for stamp in stamps {
        if !numbers.is_empty() {
            let passed = ((stamp - expected) / period).round().max(1.0);
            number += passed;
            expected += passed * period;
            expected += FOLLOW * (stamp - expected);
        }
        numbers.push(number);
    }
    for _ in 0..TIMES {
        let line = Line::through(&numbers, stamps);
        numbers = stamps.iter().map(|stamp| ((stamp - line.first) / line.period).round()).collect();
        let first = numbers[0];
        numbers.iter_mut().for_each(|number| *number -= first);
    }
    let line = Line::through(&numbers, stamps);
    let grows = numbers.windows(2).all(|pair| pair[1] > pair[0]);
    (grows && line.farthest < 0.5 * line.period).then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::{Line, numbered};
    use crate::smooth::Readings;

    /// Between −1 and 1, without a generator of its own.
    fn jitter(row: usize) -> f64 {
        let x = (row as f64 * 12.9898).sin() * 43_758.545_3;
        2.0 * (x - x.floor()) - 1.0
    }

    #[test]
    fn positions_tell_whether_rows_or_stamps_are_uneven() {
        for period in [0.01, 0.004] {
            let even: Vec<f64> = (0..1500).map(|i| period * f64::from(i)).collect();
            let uneven: Vec<f64> = even.iter().enumerate().map(|(i, t)| t + 0.2 * period * jitter(i)).collect();
            for (read, other) in [(&even, &uneven), (&uneven, &even)] {
                let position: Vec<f64> =
                    read.iter().enumerate().map(|(i, t)| (2.0 * t).sin() + 1e-5 * jitter(7 * i + 3)).collect();
                let likely = |time_secs: &[f64]| {
                    let spans = std::slice::from_ref(&(0..1500));
                    Readings { spans, time_secs, position: &position, velocity: &[] }.smooth(None, None).log_likelihood
                };
                assert!(likely(read) > likely(other) + 100.0);
            }
        }
    }

    #[test]
    fn rows_are_numbered_rightly_where_stamps_jitter_and_some_are_missing() {
        for (rate, share, whole) in [(240.0, 0.0, true), (240.0, 0.2, true), (100.0, 0.3, false), (1000.0, 0.3, false)]
        {
            let there: Vec<usize> = (0..4000).filter(|i| i % 97 != 5 && !(1000..1100).contains(i)).collect();
            let stamp = |i: &usize| {
                let secs = (*i as f64 + share * jitter(*i)) / rate;
                if whole { (1e3 * secs).round() * 1e-3 } else { secs }
            };
            let stamps: Vec<f64> = there.iter().map(stamp).collect();
            let numbers = numbered(&stamps, 1.001 / rate).expect("rows of a steady rate");
            assert!(numbers.iter().zip(&there).all(|(number, i)| *number == *i as f64), "{rate} {share}");
            assert!((Line::through(&numbers, &stamps).period * rate - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn stamps_that_alternate_are_of_rows_of_which_none_is_missing() {
        let stamps: Vec<f64> =
            (0..500).map(|i| 0.01 * f64::from(i) + if i % 2 == 0 { 0.002 } else { -0.002 }).collect();
        assert_eq!(numbered(&stamps, 0.01).map(|numbers| numbers[499]), Some(499.0));
    }

    #[test]
    fn rows_that_come_at_any_time_have_no_numbers() {
        let stamps: Vec<f64> = (0..500).map(|i| 0.01 * i as f64 + 0.0075 * jitter(i)).collect();
        assert!(numbered(&stamps, 0.01).is_none());
    }
}
