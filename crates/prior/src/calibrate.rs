//! Whether what the prior suggests on held-out episodes happens as often as it says.

use crate::fused::{HALF_LOG_TAU, LOG_STDDEV_LIMITS};
use crate::inference::Inference;
use crate::mixture::largest;
use crate::normalise::{Normalisation, Scale};
use crate::{Layout, Sequence};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Bins of a rank histogram, and of the expected calibration error.
const BINS: usize = 20;

/// Independent marginals of the training data: what is known without any observation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// Gaussian of each continuous target, where it applies.
    pub continuous: Vec<Scale>,
    /// Frequency of each label of each class target.
    pub classes: Vec<Vec<f64>>,
}

impl Baseline {
    /// Marginals of `sequences`; the spread of a constant has the same floor as the network's, frequencies start from one
    /// count a label.
    #[must_use]
    pub fn fit(layout: &Layout, normalisation: &Normalisation, sequences: &[&Sequence]) -> Self {
        let (width, kinds) = (layout.continuous.len(), layout.classes.len());
        let continuous = normalisation.continuous.iter().enumerate().map(|(column, scale)| {
            let rows = sequences.iter().flat_map(|s| s.targets.iter().zip(&s.mask).skip(column).step_by(width));
            let squares = rows.filter(|(_, mask)| **mask == 1.0).map(|(&v, _)| (f64::from(v) - scale.mean).powi(2));
            let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
            let stddev = if count > 0.0 { f64::sqrt(sum / count) } else { scale.stddev };
            Scale { mean: scale.mean, stddev: stddev.max(scale.stddev * LOG_STDDEV_LIMITS.0.exp()) }
        });
        let classes = layout.classes.iter().enumerate().map(|(kind, target)| {
            let mut counts = vec![1.0; target.labels.len()];
            for &label in sequences.iter().flat_map(|s| s.classes.iter().skip(kind).step_by(kinds)) {
                counts[usize::from(label)] += 1.0;
            }
            let total: f64 = counts.iter().sum();
            counts.iter().map(|count| count / total).collect()
        });
        Self { continuous: continuous.collect(), classes: classes.collect() }
    }

    /// ln p(values, classes) under the marginals; values whose mask is false do not count.
    #[must_use]
    pub fn log_density(&self, values: &[f64], mask: &[bool], classes: &[usize]) -> f64 {
        let gaussians = values.iter().zip(mask).zip(&self.continuous).filter(|((_, applies), _)| **applies);
        let gaussians = gaussians.map(|((value, _), scale)| {
            let standard = (value - scale.mean) / scale.stddev;
            -0.5 * standard * standard - scale.stddev.ln() - HALF_LOG_TAU
        });
        let labels = classes.iter().zip(&self.classes).map(|(&class, frequencies)| frequencies[class].ln());
        gaussians.sum::<f64>() + labels.sum::<f64>()
    }
}

/// A held-out episode, in original units.
#[derive(Clone, Copy, Debug)]
pub struct Episode<'a> {
    /// Observations and truth.
    pub sequence: &'a Sequence,
    /// First step whose observation follows a contact; none if there was none.
    pub contact: Option<usize>,
}

/// Means over a set of time steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Score {
    /// Time steps.
    pub count: usize,
    /// Negative log-likelihood, nats a step in original units.
    pub nll: f64,
    /// The same of the baseline.
    pub baseline_nll: f64,
}

/// Scores at one step of the episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepReport {
    /// Step in the episode, from 0.
    pub step: usize,
    /// All episodes that last so long.
    pub all: Score,
    /// Those with a contact up to this step.
    pub after_contact: Score,
}

/// Calibration of one continuous target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterReport {
    /// Name in the layout.
    pub name: String,
    /// Time steps at which it applies.
    pub count: usize,
    /// Share of them with the truth inside the central 50 % interval of the marginal.
    pub coverage50: f64,
    /// Share of them with the truth inside the central 90 % interval of the marginal.
    pub coverage90: f64,
    /// Histogram of P(target ≤ truth), flat if calibrated.
    pub ranks: Vec<usize>,
}

/// Accuracy of one class target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassReport {
    /// Name in the layout.
    pub name: String,
    /// Its labels.
    pub labels: Vec<String>,
    /// Share of all time steps at which the likeliest label is the true one.
    pub accuracy: f64,
    /// The same at the last step of each episode.
    pub last_accuracy: f64,
    /// Mean distance between stated confidence and accuracy over equal bins of confidence, weighted by count.
    pub expected_calibration_error: f64,
    /// Time steps by true label (row) and likeliest label (column).
    pub confusion: Vec<Vec<usize>>,
}

/// The calibration report of a prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Held-out episodes.
    pub episodes: usize,
    /// Negative log-likelihood, nats a step in original units.
    pub nll: f64,
    /// The same of the marginals of the training data.
    pub baseline_nll: f64,
    /// One per continuous target.
    pub parameters: Vec<ParameterReport>,
    /// Accuracy of the first class target at the last step of each episode.
    pub shape_accuracy: Option<f64>,
    /// Of the first class target with a label `none`: share of the episodes with a contact in which, at the last step, "none
    /// or something" is right.
    pub obstacle_after_contact_accuracy: Option<f64>,
    /// One per class target.
    pub classes: Vec<ClassReport>,
    /// One per step of the longest episode.
    pub sharpening: Vec<StepReport>,
}

/// What one time step contributes.
struct Record {
    nll: f64,
    baseline_nll: f64,
    /// P(target ≤ truth) where it applies.
    ranks: Vec<Option<f64>>,
    /// True label, likeliest label and its probability, and P(none) of each class target.
    classes: Vec<(usize, usize, f64)>,
    none: f64,
}

/// Runs `inference` over every episode and compares with the truth.
///
/// The rank of a target that does not always apply (the size of an obstacle that may be absent) is taken given the true
/// classes, because components without it say nothing about its value; all other ranks are unconditional.
#[must_use]
pub fn calibrate(inference: &Inference, layout: &Layout, baseline: &Baseline, episodes: &[Episode<'_>]) -> Calibration {
    let width = layout.continuous.len();
    let always: Vec<bool> = (0..width)
        .map(|column| episodes.iter().all(|e| e.sequence.mask.iter().skip(column).step_by(width).all(|&m| m == 1.0)))
        .collect();
    let none =
        layout.classes.iter().enumerate().find_map(|(target, class)| {
            class.labels.iter().position(|label| label == "none").map(|label| (target, label))
        });
    let runs: Vec<Vec<Record>> =
        episodes.par_iter().map(|episode| run(inference, baseline, episode.sequence, &always, none)).collect();
    let score = |records: &mut dyn Iterator<Item = &Record>| {
        let (mut count, mut nll, mut baseline_nll) = (0, 0.0, 0.0);
        for record in records {
            (count, nll, baseline_nll) = (count + 1, nll + record.nll, baseline_nll + record.baseline_nll);
        }
        let divisor = (count as f64).max(1.0);
        Score { count, nll: nll / divisor, baseline_nll: baseline_nll / divisor }
    };
    let total = score(&mut runs.iter().flatten());
    let longest = runs.iter().map(Vec::len).max().unwrap_or(0);
    let sharpening = (0..longest).map(|step| {
        let touched = runs.iter().zip(episodes).filter(|(_, episode)| episode.contact.is_some_and(|at| at <= step));
        StepReport {
            step,
            all: score(&mut runs.iter().filter_map(|records| records.get(step))),
            after_contact: score(&mut touched.filter_map(|(records, _)| records.get(step))),
        }
    });
    let obstacle_after_contact_accuracy = none.and_then(|(target, label)| {
        let touched = runs.iter().zip(episodes).filter(|(_, episode)| episode.contact.is_some());
        let right = touched.filter_map(|(records, _)| records.last()).map(|last| {
            let absent = last.classes[target].0 == label;
            f64::from(u8::from((last.none > 0.5) == absent))
        });
        mean(right)
    });
    let classes: Vec<ClassReport> = (0..layout.classes.len()).map(|target| classify(layout, &runs, target)).collect();
    Calibration {
        episodes: episodes.len(),
        nll: total.nll,
        baseline_nll: total.baseline_nll,
        parameters: (0..width).map(|target| rank(layout, &runs, target)).collect(),
        shape_accuracy: classes.first().map(|report| report.last_accuracy),
        obstacle_after_contact_accuracy,
        classes,
        sharpening: sharpening.collect(),
    }
}

fn run(
    inference: &Inference,
    baseline: &Baseline,
    sequence: &Sequence,
    always: &[bool],
    none: Option<(usize, usize)>,
) -> Vec<Record> {
    let mut inference = inference.clone();
    inference.reset();
    let (width, kinds) = (always.len(), baseline.classes.len());
    let inputs = sequence.observations.len() / sequence.steps.max(1);
    let step = |step: usize| {
        let wide = |values: &[f32], width: usize| -> Vec<f64> {
            values[step * width..(step + 1) * width].iter().map(|&value| f64::from(value)).collect()
        };
        let mixture = inference.step(&wide(&sequence.observations, inputs));
        let values = wide(&sequence.targets, width);
        let mask: Vec<bool> = wide(&sequence.mask, width).iter().map(|&mask| mask == 1.0).collect();
        let truth: Vec<usize> =
            sequence.classes[step * kinds..(step + 1) * kinds].iter().map(|&class| usize::from(class)).collect();
        let ranks = (0..width).map(|target| {
            let given = if always[target] { None } else { Some(truth.as_slice()) };
            mask[target].then(|| mixture.cumulative(target, values[target], given))
        });
        let classes = truth.iter().enumerate().map(|(target, &truth)| {
            let probabilities = mixture.class_probabilities(target);
            let likeliest = largest(&probabilities);
            (truth, likeliest, probabilities[likeliest])
        });
        Record {
            nll: -mixture.log_density_masked(&values, &mask, &truth),
            baseline_nll: -baseline.log_density(&values, &mask, &truth),
            ranks: ranks.collect(),
            classes: classes.collect(),
            none: none.map_or(0.0, |(target, label)| mixture.class_probabilities(target)[label]),
        }
    };
    (0..sequence.steps).map(step).collect()
}

/// Coverage and histogram of one continuous target.
fn rank(layout: &Layout, runs: &[Vec<Record>], target: usize) -> ParameterReport {
    let mut ranks = vec![0; BINS];
    let (mut count, mut inside50, mut inside90) = (0, 0, 0);
    for rank in runs.iter().flatten().filter_map(|record| record.ranks[target]) {
        count += 1;
        inside50 += usize::from((rank - 0.5).abs() <= 0.25);
        inside90 += usize::from((rank - 0.5).abs() <= 0.45);
        ranks[((rank * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    let share = |inside: usize| inside as f64 / (count as f64).max(1.0);
    let name = layout.continuous[target].clone();
    ParameterReport { name, count, coverage50: share(inside50), coverage90: share(inside90), ranks }
}

/// Accuracy of one class target.
fn classify(layout: &Layout, runs: &[Vec<Record>], target: usize) -> ClassReport {
    let labels = layout.classes[target].labels.clone();
    let mut confusion = vec![vec![0; labels.len()]; labels.len()];
    // Count, Σ confidence, Σ correct.
    let mut bins = [(0.0, 0.0, 0.0); BINS];
    for record in runs.iter().flatten() {
        let (truth, likeliest, confidence) = record.classes[target];
        confusion[truth][likeliest] += 1;
        let bin = &mut bins[((confidence * BINS as f64) as usize).min(BINS - 1)];
        let right = f64::from(u8::from(truth == likeliest));
        *bin = (bin.0 + 1.0, bin.1 + confidence, bin.2 + right);
    }
    let total: f64 = bins.iter().map(|bin| bin.0).sum();
    let right = |record: &Record| f64::from(u8::from(record.classes[target].0 == record.classes[target].1));
    ClassReport {
        name: layout.classes[target].name.clone(),
        labels,
        accuracy: mean(runs.iter().flatten().map(right)).unwrap_or(0.0),
        last_accuracy: mean(runs.iter().filter_map(|records| records.last()).map(right)).unwrap_or(0.0),
        expected_calibration_error: bins.iter().map(|bin| (bin.1 - bin.2).abs()).sum::<f64>() / total.max(1.0),
        confusion,
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests;
