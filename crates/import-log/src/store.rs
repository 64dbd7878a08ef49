//! The values that a mapping asks for, on their way from a source.

use std::collections::BTreeMap;

use crate::mapping::Sampling;
use crate::plan::Plan;

/// Numbers that are kept at most: 128 MiB of them.
const MOST_KEPT: usize = 16 << 20;
/// The same where rows of a table are rows of the log, whose number is limited.
const MOST_KEPT_ROWS: usize = 48 << 20;
/// Readings further apart than this share of the period are kept whatever happens.
const THINNED: f64 = 0.25;
/// Between episodes whose clock starts anew.
const APART_SECS: f64 = 1000.0;

/// Readings of one track.
#[derive(Debug)]
pub(crate) struct Stream {
    pub(crate) width: usize,
    pub(crate) times: Vec<f64>,
    /// `width` numbers a reading; NaN is a missing one.
    pub(crate) values: Vec<f64>,
    /// Readings that another one of the same time has replaced.
    pub(crate) replaced: usize,
}

impl Stream {
    pub(crate) fn get(&self, index: usize) -> &[f64] {
        &self.values[index * self.width..(index + 1) * self.width]
    }

    /// Orders readings by time; of readings of one time the last counts.
    fn sort(&mut self) {
        if self.times.is_sorted_by(|a, b| a < b) {
            return;
        }
        let mut order: Vec<usize> = (0..self.times.len()).collect();
        order.sort_by(|a, b| self.times[*a].total_cmp(&self.times[*b]));
        let (times, values) = (std::mem::take(&mut self.times), std::mem::take(&mut self.values));
        for index in order {
            if self.times.last() == Some(&times[index]) {
                self.times.pop();
                self.replaced += 1;
                self.values.truncate(self.values.len() - self.width);
            }
            self.times.push(times[index]);
            self.values.extend_from_slice(&values[index * self.width..(index + 1) * self.width]);
        }
    }

    /// Leaves out readings that follow another one closely.
    fn thin(&mut self, least_secs: f64) {
        self.sort();
        let (mut kept, mut last) = (0, f64::NEG_INFINITY);
        for index in 0..self.times.len() {
            if self.times[index] - last < least_secs {
                continue;
            }
            last = self.times[index];
            self.times[kept] = last;
            self.values.copy_within(index * self.width..(index + 1) * self.width, kept * self.width);
            kept += 1;
        }
        self.times.truncate(kept);
        self.values.truncate(kept * self.width);
    }
}

/// A moment by a clock of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Moment {
    Nanos(i128),
    Secs(f64),
}

/// Readings of all tracks.
#[derive(Debug)]
pub(crate) struct Store {
    pub(crate) streams: Vec<Stream>,
    /// The first whole moment, from which others count: seconds since an epoch would lose nanoseconds.
    base: Option<i128>,
    kept: usize,
    most: usize,
    thin_secs: Option<f64>,
    labels: BTreeMap<String, usize>,
    /// The label and the time of the last row, and what is added to times since the clock started anew.
    last: (f64, f64),
    shift_secs: f64,
    /// When the clock last started anew, on the clock of the whole.
    restarted_secs: f64,
}

/// More was read than is kept.
#[derive(Debug)]
pub(crate) struct Full {
    pub(crate) limit: usize,
}

impl Store {
    pub(crate) fn new(plan: &Plan, period_secs: f64) -> Self {
        let stream = |width| Stream { width, times: Vec::new(), values: Vec::new(), replaced: 0 };
        let rows = plan.sample == Sampling::Rows;
        Self {
            streams: plan.tracks.iter().map(|track| stream(track.width())).collect(),
            base: None,
            kept: 0,
            most: if rows { MOST_KEPT_ROWS } else { MOST_KEPT },
            thin_secs: (!rows).then_some(THINNED * period_secs),
            labels: BTreeMap::new(),
            last: (f64::NAN, f64::NEG_INFINITY),
            shift_secs: 0.0,
            restarted_secs: f64::NEG_INFINITY,
        }
    }

    /// Seconds from the first whole moment.
    #[expect(clippy::cast_precision_loss, reason = "differences of a recording")]
    pub(crate) fn seconds(&mut self, moment: Moment) -> f64 {
        match moment {
            Moment::Nanos(nanos) => (nanos - *self.base.get_or_insert(nanos)) as f64 / 1e9,
            Moment::Secs(secs) => secs - self.base.map_or(0.0, |base| base as f64 / 1e9),
        }
    }

    pub(crate) fn push(&mut self, track: usize, time: f64, values: &[f64]) -> Result<(), Full> {
        let stream = &mut self.streams[track];
        debug_assert_eq!(values.len(), stream.width);
        stream.times.push(time);
        stream.values.extend_from_slice(values);
        self.kept += values.len() + 1;
        if self.kept <= self.most {
            return Ok(());
        }
        let full = Full { limit: self.most };
        let Some(secs) = self.thin_secs else { return Err(full) };
        for stream in &mut self.streams {
            stream.thin(secs);
        }
        self.kept = self.streams.iter().map(|stream| stream.times.len() + stream.values.len()).sum();
        // Otherwise it would be thinned again after few more.
        if self.kept > self.most / 4 * 3 { Err(full) } else { Ok(()) }
    }

    /// What is added to the times of a row, so that a clock that starts anew with each episode does not mix them.
    pub(crate) fn shift(&mut self, label: f64, time: f64) -> f64 {
        let (last_label, last_time) = self.last;
        if label.total_cmp(&last_label).is_ne() && time + self.shift_secs <= last_time {
            self.shift_secs = last_time - time + APART_SECS;
            self.restarted_secs = time + self.shift_secs;
        }
        self.last = (label, time + self.shift_secs);
        self.shift_secs
    }

    /// When the clock last started anew, s, as shifted; −∞ where it never did.
    pub(crate) fn restarted_secs(&self) -> f64 {
        self.restarted_secs
    }

    /// A number that stands for a name of an episode: the name itself where it is one, else one beyond all numbers.
    #[expect(clippy::cast_precision_loss, reason = "a count of names")]
    pub(crate) fn label(&mut self, words: &str) -> f64 {
        let number: Option<f64> = words.trim().parse().ok();
        if let Some(number) = number.filter(|number| number.is_finite()) {
            return number;
        }
        let count = self.labels.len();
        -1e300 + 1e290 * (*self.labels.entry(words.to_string()).or_insert(count) as f64)
    }

    /// The number of a name that was read; NaN if none was.
    #[expect(clippy::cast_precision_loss, reason = "a count of names")]
    pub(crate) fn known_label(&self, words: &str) -> f64 {
        let number: Option<f64> = words.trim().parse().ok();
        let named = || self.labels.get(words).map(|count| -1e300 + 1e290 * (*count as f64));
        number.filter(|number| number.is_finite()).or_else(named).unwrap_or(f64::NAN)
    }

    /// Orders all readings by time.
    pub(crate) fn sort(&mut self) {
        for stream in &mut self.streams {
            stream.sort();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_reading_of_a_moment_counts() {
        let mut stream =
            Stream { width: 1, times: vec![1.0, 0.0, 1.0, 0.5], values: vec![10.0, 0.0, 11.0, 5.0], replaced: 0 };
        stream.sort();
        assert_eq!((stream.times, stream.values), (vec![0.0, 0.5, 1.0], vec![0.0, 5.0, 11.0]));
    }

    #[test]
    fn thinning_keeps_the_first_of_each_gap() {
        let mut stream =
            Stream { width: 1, times: vec![0.0, 0.1, 0.2, 0.3], values: vec![0.0, 1.0, 2.0, 3.0], replaced: 0 };
        stream.thin(0.15);
        assert_eq!((stream.times, stream.values), (vec![0.0, 0.2], vec![0.0, 2.0]));
    }
}
