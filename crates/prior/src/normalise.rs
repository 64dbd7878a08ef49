//! Shift and scale of inputs and targets, fitted on the training data and stored with the weights.

use crate::{Layout, Sequence};
use serde::{Deserialize, Serialize};

/// Interquartile range of a Gaussian in standard deviations.
const QUARTILES: f64 = 1.349;

/// Below this fraction of (1 + |mean|) a column counts as constant and keeps its unit.
///
/// Some columns are constant, such as the angular velocity of a fixed obstacle. Dividing them by their rounding noise
/// would turn noise into a signal, and the density into an arbitrarily high spike.
const CONSTANT: f64 = 1e-6;

/// Centre and spread of a column.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// Mean over the rows that apply; of an observation the median.
    pub mean: f64,
    /// Standard deviation over the rows that apply; for observations from the quartiles. 1 for a column without spread.
    pub stddev: f64,
}

impl Scale {
    /// Whether values can be shifted and scaled by it.
    pub(crate) fn is_usable(&self) -> bool {
        self.mean.is_finite() && self.stddev.is_finite() && self.stddev > 0.0
    }

    /// Median and interquartile range, the latter as the standard deviation of the Gaussian that has it. This is the
    /// scale of usual values: a blocked push reads a hundred times the force of a free one. A column with three
    /// quarters of equal values falls back on [`Scale::fit`].
    #[must_use]
    pub fn robust(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values[((values.len() - 1) as f64 * share) as usize];
        if values.is_empty() {
            return Self::fit(std::iter::empty());
        }
        let (mean, stddev) = (at(0.5), (at(0.75) - at(0.25)) / QUARTILES);
        let constant = stddev < CONSTANT * (1.0 + f64::abs(mean));
        if constant { Self::fit(values.into_iter()) } else { Self { mean, stddev } }
    }

    /// Scale of the values that `values` yields.
    #[must_use]
    pub fn fit(values: impl Iterator<Item = f64>) -> Self {
        // Welford's recurrence: no cancellation for a small spread around a large mean.
        let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
        for value in values {
            count += 1.0;
            let delta = value - mean;
            mean += delta / count;
            squares += delta * (value - mean);
        }
        let stddev = if count > 0.0 { f64::sqrt(squares / count) } else { 0.0 };
        let constant = stddev < CONSTANT * (1.0 + f64::abs(mean));
        Self { mean, stddev: if constant { 1.0 } else { stddev } }
    }
}

/// Scales of all columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normalisation {
    /// One per observation column.
    pub observation: Vec<Scale>,
    /// One per continuous target.
    pub continuous: Vec<Scale>,
}

impl Normalisation {
    /// Fits every column on `sequences`; targets count only where their mask is 1.
    #[must_use]
    pub fn fit(layout: &Layout, sequences: &[&Sequence]) -> Self {
        let (inputs, outputs) = (layout.observation.len(), layout.continuous.len());
        let observation = (0..inputs).map(|column| {
            let rows = sequences.iter().flat_map(|s| s.observations.iter().skip(column).step_by(inputs));
            Scale::robust(rows.map(|&v| f64::from(v)).collect())
        });
        let continuous = (0..outputs).map(|column| {
            let values = sequences.iter().flat_map(|s| s.targets.iter().zip(&s.mask).skip(column).step_by(outputs));
            Scale::fit(values.filter(|(_, mask)| **mask == 1.0).map(|(&value, _)| f64::from(value)))
        });
        Self { observation: observation.collect(), continuous: continuous.collect() }
    }

    /// The same episode in normalised units; targets that do not apply become 0.
    #[must_use]
    pub fn apply(&self, sequence: &Sequence) -> Sequence {
        let mut normalised = sequence.clone();
        for row in normalised.observations.chunks_exact_mut(self.observation.len()) {
            for (value, scale) in row.iter_mut().zip(&self.observation) {
                *value = normalise_observation(f64::from(*value), scale);
            }
        }
        let width = self.continuous.len();
        let rows = normalised.targets.chunks_exact_mut(width).zip(sequence.mask.chunks_exact(width));
        for (row, mask) in rows {
            for ((value, &mask), scale) in row.iter_mut().zip(mask).zip(&self.continuous) {
                *value = if mask == 1.0 { ((f64::from(*value) - scale.mean) / scale.stddev) as f32 } else { 0.0 };
            }
        }
        normalised
    }

    /// Σ ln stddev over the targets that apply, averaged over the steps of `sequences`. Add it to a negative
    /// log-likelihood of normalised targets to get original units.
    #[must_use]
    pub fn mean_log_scale(&self, sequences: &[&Sequence]) -> f64 {
        let log_scales: Vec<f64> = self.continuous.iter().map(|scale| scale.stddev.ln()).collect();
        let steps: usize = sequences.iter().map(|sequence| sequence.steps).sum();
        let total: f64 = sequences
            .iter()
            .flat_map(|sequence| sequence.mask.chunks_exact(log_scales.len()))
            .map(|mask| mask.iter().zip(&log_scales).map(|(&mask, log_scale)| f64::from(mask) * log_scale).sum::<f64>())
            .sum();
        total / steps as f64
    }
}

/// One observation as the network takes it: linear within the usual, logarithmic beyond. A force spike or an object that left the table
/// must neither drive the network far outside of what it has seen nor look like any other.
pub(crate) fn normalise_observation(value: f64, scale: &Scale) -> f32 {
    ((value - scale.mean) / scale.stddev).asinh() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::tests::layout;

    #[test]
    fn masked_rows_do_not_enter_the_moments() {
        let layout = layout(1, 2, &[]);
        let sequence = Sequence {
            observations: vec![1.0, 3.0, 5.0],
            targets: vec![2.0, 9.0, 4.0, f32::NAN, 6.0, 9.0],
            mask: vec![1.0, 1.0, 1.0, 0.0, 1.0, 1.0],
            classes: vec![],
            steps: 3,
        };
        let fitted = Normalisation::fit(&layout, &[&sequence]);
        let spread = (8.0_f64 / 3.0).sqrt();
        let robust = fitted.observation[0];
        assert!((robust.mean - 3.0).abs() < 1e-12 && (robust.stddev - 2.0 / 1.349).abs() < 1e-12, "{robust:?}");
        assert_eq!(fitted.continuous[1], Scale { mean: 9.0, stddev: 1.0 }, "a constant column keeps its unit");
        let normalised = fitted.apply(&sequence);
        assert!((f64::from(normalised.targets[4]) - 2.0 / spread).abs() < 1e-6);
        assert_eq!(normalised.targets[3], 0.0, "a target that does not apply cannot carry a NaN into the loss");
        assert!((fitted.mean_log_scale(&[&sequence]) - spread.ln()).abs() < 1e-12);
    }

    #[test]
    fn a_column_without_any_row_is_left_alone() {
        assert_eq!(Scale::fit(std::iter::empty()), Scale { mean: 0.0, stddev: 1.0 });
    }

    #[test]
    fn small_spread_around_a_large_mean_is_kept() {
        let scale = Scale::fit([1000.0, 1000.01, 1000.02].into_iter());
        assert!((scale.stddev - 0.01 * (2.0_f64 / 3.0).sqrt()).abs() < 1e-10, "{scale:?}");
    }

    #[test]
    fn spikes_are_compressed_and_stay_apart() {
        let scale = Scale { mean: 1.0, stddev: 2.0 };
        let at = |value| normalise_observation(value, &scale);
        assert!((at(1.02) - 0.01).abs() < 1e-6, "linear where it is usual");
        assert!(at(500.0) < 7.0 && at(1000.0) - at(500.0) > 0.6, "{} {}", at(500.0), at(1000.0));
        assert_eq!(at(-3.0), -(2.0_f32.asinh()));
    }

    #[test]
    fn rare_spikes_do_not_widen_the_scale() {
        let usual = (0..100).map(|i| f64::from(i) / 100.0);
        let scale = Scale::robust(usual.chain([1e6; 5]).collect());
        assert!((scale.stddev - 0.52 / 1.349).abs() < 0.01, "{scale:?}");
        // One-hot columns are 0 in nine rows of ten.
        let rare = Scale::robust([vec![0.0; 9], vec![1.0]].concat());
        assert!((rare.mean - 0.1).abs() < 1e-12 && (rare.stddev - 0.3).abs() < 1e-12, "{rare:?}");
    }
}
