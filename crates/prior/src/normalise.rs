//! Shift and scale of inputs and targets, fitted on the training data and stored with the weights.

use crate::{Layout, Sequence};
use serde::{Deserialize, Serialize};

/// Normalised observations are clipped to ± this many standard deviations, in training and in use: a force spike or an
/// object that left the table must not drive the network far outside of what it has seen.
pub const OBSERVATION_LIMIT: f64 = 10.0;

/// Below this fraction of (1 + |mean|) a column counts as constant and keeps its unit.
///
/// Dividing a constant (the angular velocity of a fixed obstacle, the z part of a quaternion in the plane) by its rounding
/// noise would turn that noise into a signal and the density into an arbitrarily high spike.
const CONSTANT: f64 = 1e-6;

/// Mean and standard deviation of a column.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// Mean over the rows that apply.
    pub mean: f64,
    /// Standard deviation over the rows that apply; 1 for a column without spread.
    pub stddev: f64,
}

impl Scale {
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
            Scale::fit(
                sequences
                    .iter()
                    .flat_map(|s| s.observations.iter().skip(column).step_by(inputs))
                    .map(|&v| f64::from(v)),
            )
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

    /// Mean over the steps of `sequences` of Σ ln stddev over the targets that apply: what has to be added to a negative
    /// log-likelihood of normalised targets to have it in original units.
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

/// One observation as the network takes it.
pub(crate) fn normalise_observation(value: f64, scale: &Scale) -> f32 {
    ((value - scale.mean) / scale.stddev).clamp(-OBSERVATION_LIMIT, OBSERVATION_LIMIT) as f32
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
        assert!(
            (fitted.observation[0].mean - 3.0).abs() < 1e-12 && (fitted.observation[0].stddev - spread).abs() < 1e-12
        );
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
    fn spikes_are_clipped() {
        let scale = Scale { mean: 1.0, stddev: 2.0 };
        assert_eq!(normalise_observation(500.0, &scale), 10.0);
        assert_eq!(normalise_observation(-3.0, &scale), -2.0);
    }
}
