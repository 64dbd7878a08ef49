//! Whether what the prior suggests on held-out episodes happens as often as it says.

mod baseline;
mod report;

use std::ops::Range;

use rayon::prelude::*;

pub use baseline::Baseline;
pub use report::{Calibration, ClassReport, Likelihoods, ParameterReport, Score, StepReport};

use crate::inference::Inference;
use crate::mixture::{Mixture, largest};
use crate::normalise::Scale;
use crate::{Layout, Sequence};

/// Bins of a rank histogram, and of the expected calibration error.
const BINS: usize = 20;

/// A held-out episode.
#[derive(Clone, Copy, Debug)]
pub struct Episode<'a> {
    /// Observations and truth.
    pub sequence: &'a Sequence,
    /// First step whose observation follows a contact of the tool; none if there was none.
    pub contact: Option<usize>,
    /// First step whose observation follows a touch of the obstacle, by the tool or by the object.
    pub obstacle_contact: Option<usize>,
}

/// What is compared.
#[derive(Clone, Copy, Debug)]
pub struct Models<'a> {
    /// The network.
    pub network: &'a Inference,
    /// The sampling distribution.
    pub baseline: &'a Baseline,
    /// The same network trained without memory.
    pub memoryless: Option<&'a Inference>,
}

/// What one time step contributes.
struct Record {
    nll: Likelihoods,
    static_nll: Likelihoods,
    /// P(target ≤ truth) where it applies.
    ranks: Vec<Option<f64>>,
    /// Of each static target, where it applies.
    spread: Vec<Option<f64>>,
    /// True label, likeliest label and its probability, and probability of the true one, of each class target.
    classes: Vec<(usize, usize, f64, f64)>,
    none: f64,
}

/// Runs the models over every episode and compares with the truth; `static_columns` are the continuous targets that stay the same
/// in an episode.
///
/// Some targets do not always apply, such as the size of an obstacle that may be absent. Their rank is conditional on
/// applying: each class has a label with which the target was seen to apply. Components without that label do not
/// count.
#[must_use]
pub fn calibrate(
    models: Models<'_>,
    layout: &Layout,
    static_columns: Range<usize>,
    episodes: &[Episode<'_>],
) -> Calibration {
    let width = layout.continuous.len();
    let targets: Vec<Target> = (0..width).map(|column| Target::of(column, layout, episodes)).collect();
    let none =
        layout.classes.iter().enumerate().find_map(|(target, class)| {
            class.labels.iter().position(|label| label == "none").map(|label| (target, label))
        });
    let what = What { models, targets: &targets, none, static_columns: static_columns.clone() };
    let runs: Vec<Vec<Record>> = episodes.par_iter().map(|episode| what.run(episode.sequence)).collect();
    let total = score(runs.iter().flatten());
    let obstacles = obstacles(&runs, episodes, none);
    let classes: Vec<ClassReport> = (0..layout.classes.len()).map(|target| classify(layout, &runs, target)).collect();
    Calibration {
        episodes: episodes.len(),
        steps: total.count,
        nll: total.nll.network.unwrap_or(f64::NAN),
        baseline_nll: total.nll.baseline.unwrap_or(f64::NAN),
        memoryless_nll: total.nll.memoryless,
        parameters: (0..width).map(|target| rank(layout, &runs, episodes, target)).collect(),
        static_targets: layout.continuous[static_columns].to_vec(),
        shape_accuracy: classes.first().map(|report| report.last_accuracy),
        obstacle_after_contact_accuracy: obstacles.found,
        obstacle_contact_episodes: obstacles.touched,
        no_obstacle_accuracy: obstacles.denied,
        obstacle_balanced_accuracy: obstacles.found.zip(obstacles.denied).map(|(found, denied)| 0.5 * (found + denied)),
        untouched_obstacle_found: obstacles.untouched,
        obstacle_found_since_touch: obstacles.since,
        classes,
        sharpening: sharpening(&runs, episodes),
    }
}

/// Of one continuous target.
struct Target {
    /// Labels of each class target with which it applies, `[class targets][labels]`.
    labels: Vec<Vec<bool>>,
    /// Standard deviation of the truth where it applies.
    stddev: f64,
}

impl Target {
    fn of(column: usize, layout: &Layout, episodes: &[Episode<'_>]) -> Self {
        let (width, kinds) = (layout.continuous.len(), layout.classes.len());
        let mut labels: Vec<Vec<bool>> = layout.classes.iter().map(|target| vec![false; target.labels.len()]).collect();
        let mut values = Vec::new();
        for sequence in episodes.iter().map(|episode| episode.sequence) {
            let rows = sequence.mask.iter().zip(&sequence.targets).skip(column).step_by(width).enumerate();
            for (row, (_, value)) in rows.filter(|(_, (mask, _))| **mask == 1.0) {
                values.push(f64::from(*value));
                for (labels, &class) in labels.iter_mut().zip(&sequence.classes[row * kinds..]) {
                    labels[usize::from(class)] = true;
                }
            }
        }
        Self { labels, stddev: Scale::fit(values.into_iter()).stddev }
    }
}

struct What<'a> {
    models: Models<'a>,
    targets: &'a [Target],
    none: Option<(usize, usize)>,
    static_columns: Range<usize>,
}

impl What<'_> {
    fn run(&self, sequence: &Sequence) -> Vec<Record> {
        let afresh = |inference: &Inference| {
            let mut inference = inference.clone();
            inference.reset();
            inference
        };
        let mut network = afresh(self.models.network);
        let mut memoryless = self.models.memoryless.map(afresh);
        let inputs = sequence.observations.len() / sequence.steps.max(1);
        let step = |step: usize| {
            let observation = wide(&sequence.observations, step, inputs);
            let memoryless = memoryless.as_mut().map(|memoryless| memoryless.step(&observation));
            self.record(network.step(&observation), memoryless, sequence, step)
        };
        (0..sequence.steps).map(step).collect()
    }

    fn record(&self, mixture: &Mixture, memoryless: Option<&Mixture>, sequence: &Sequence, step: usize) -> Record {
        let baseline = self.models.baseline;
        let (width, kinds) = (self.targets.len(), baseline.labels.len());
        let values = wide(&sequence.targets, step, width);
        let mask: Vec<bool> = wide(&sequence.mask, step, width).iter().map(|&mask| mask == 1.0).collect();
        let labels = &sequence.classes[step * kinds..(step + 1) * kinds];
        let truth: Vec<usize> = labels.iter().map(|&class| usize::from(class)).collect();
        let ranks = (0..width).map(|target| {
            mask[target].then(|| mixture.cumulative(target, values[target], &self.targets[target].labels))
        });
        let classes = truth.iter().enumerate().map(|(target, &truth)| {
            let probabilities = mixture.class_probabilities(target);
            let likeliest = largest(&probabilities);
            (truth, likeliest, probabilities[likeliest], probabilities[truth])
        });
        let spread = self.static_columns.clone().map(|target| (&self.targets[target], mask[target], target)).map(
            |(Target { labels, stddev }, applies, target)| applies.then(|| mixture.stddev(target, labels) / stddev),
        );
        let likelihoods = |mask: &[bool]| Likelihoods {
            network: Some(-mixture.log_density_masked(&values, mask, &truth)),
            baseline: Some(-baseline.log_density(&values, mask, labels)),
            memoryless: memoryless.map(|memoryless| -memoryless.log_density_masked(&values, mask, &truth)),
        };
        let statics: Vec<bool> = mask.iter().enumerate().map(|(i, &m)| m && self.static_columns.contains(&i)).collect();
        Record {
            nll: likelihoods(&mask),
            static_nll: likelihoods(&statics),
            ranks: ranks.collect(),
            spread: spread.collect(),
            classes: classes.collect(),
            none: self.none.map_or(0.0, |(target, label)| mixture.class_probabilities(target)[label]),
        }
    }
}

fn wide(values: &[f32], step: usize, width: usize) -> Vec<f64> {
    values[step * width..(step + 1) * width].iter().map(|&value| f64::from(value)).collect()
}

fn score<'a>(records: impl Iterator<Item = &'a Record>) -> Score {
    let records: Vec<&Record> = records.collect();
    let average = |of: &dyn Fn(&Record) -> Option<f64>| mean(records.iter().filter_map(|record| of(record)));
    let likelihoods = |of: &dyn Fn(&Record) -> Likelihoods| Likelihoods {
        network: average(&|record| of(record).network),
        baseline: average(&|record| of(record).baseline),
        memoryless: average(&|record| of(record).memoryless),
    };
    let (statics, kinds) = records.first().map_or((0, 0), |first| (first.spread.len(), first.classes.len()));
    Score {
        count: records.len(),
        nll: likelihoods(&|record| record.nll),
        static_nll: likelihoods(&|record| record.static_nll),
        spread: (0..statics).map(|i| average(&|record| record.spread[i]).unwrap_or(0.0)).collect(),
        class_probability: (0..kinds).map(|i| average(&|record| Some(record.classes[i].3)).unwrap_or(0.0)).collect(),
    }
}

fn sharpening(runs: &[Vec<Record>], episodes: &[Episode<'_>]) -> Vec<StepReport> {
    let longest = runs.iter().map(Vec::len).max().unwrap_or(0);
    let report = |step: usize| {
        let part = |wanted: bool| {
            let touched = |episode: &Episode<'_>| episode.contact.is_some_and(|at| at <= step);
            let chosen = runs.iter().zip(episodes).filter(move |(_, episode)| touched(episode) == wanted);
            score(chosen.filter_map(|(records, _)| records.get(step)))
        };
        let since = runs.iter().zip(episodes);
        StepReport {
            step,
            all: score(runs.iter().filter_map(|records| records.get(step))),
            after_contact: part(true),
            before_contact: part(false),
            since_contact: score(since.filter_map(|(records, episode)| records.get(episode.contact? + step))),
        }
    };
    (0..longest).map(report).collect()
}

struct Obstacles {
    found: Option<f64>,
    touched: usize,
    denied: Option<f64>,
    untouched: Option<f64>,
    since: Vec<f64>,
}

fn obstacles(runs: &[Vec<Record>], episodes: &[Episode<'_>], none: Option<(usize, usize)>) -> Obstacles {
    let ends = || runs.iter().zip(episodes).filter_map(|(records, episode)| Some((records.last()?, episode)));
    let touched = || ends().filter(|(_, episode)| episode.obstacle_contact.is_some());
    let is_absent = |last: &Record| none.is_some_and(|(target, label)| last.classes[target].0 == label);
    let absent = ends().filter(|(last, _)| is_absent(last));
    let untouched = ends().filter(|(last, episode)| !is_absent(last) && episode.obstacle_contact.is_none());
    let since = |step: usize| -> Vec<f64> {
        let at = runs.iter().zip(episodes).filter_map(|(records, e)| records.get(e.obstacle_contact? + step));
        at.map(|record| f64::from(u8::from(record.none < 0.5))).collect()
    };
    let count = touched().count();
    let since = (0..).map(since).take_while(|found| none.is_some() && !found.is_empty() && 2 * found.len() >= count);
    let share = |right: bool| f64::from(u8::from(right));
    Obstacles {
        found: none.and_then(|_| mean(touched().map(|(last, _)| share(last.none < 0.5)))),
        touched: none.map_or(0, |_| touched().count()),
        denied: mean(absent.map(|(last, _)| share(last.none > 0.5))),
        untouched: none.and_then(|_| mean(untouched.map(|(last, _)| share(last.none < 0.5)))),
        since: since.filter_map(|found| mean(found.into_iter())).collect(),
    }
}

/// Coverage and histogram of one continuous target.
fn rank(layout: &Layout, runs: &[Vec<Record>], of: &[Episode<'_>], target: usize) -> ParameterReport {
    let mut ranks = vec![0; BINS];
    let (mut count, mut inside50, mut inside90) = (0, 0, 0_usize);
    // Steps and steps inside the 90 % interval of each episode.
    let mut episodes = Vec::new();
    for records in runs {
        let (mut steps, mut inside) = (0, 0);
        for rank in records.iter().filter_map(|record| record.ranks[target]) {
            steps += 1;
            inside50 += usize::from((rank - 0.5).abs() <= 0.25);
            inside += usize::from((rank - 0.5).abs() <= 0.45);
            ranks[((rank * BINS as f64) as usize).min(BINS - 1)] += 1;
        }
        if steps > 0 {
            (count, inside90) = (count + steps, inside90 + inside);
            episodes.push((steps as f64, inside as f64));
        }
    }
    let share = |inside: usize| inside as f64 / (count as f64).max(1.0);
    let coverage90 = share(inside90);
    let coverage = |part: &dyn Fn(&Episode<'_>, usize, usize) -> bool| {
        let inside = runs.iter().zip(of).flat_map(|(records, episode)| {
            let steps = records.iter().enumerate();
            let chosen = steps.filter(move |(step, _)| part(episode, *step, records.len()));
            chosen.filter_map(|(_, record)| record.ranks[target])
        });
        mean(inside.map(|rank| f64::from(u8::from((rank - 0.5).abs() <= 0.45))))
    };
    let after = |episode: &Episode<'_>, step: usize| episode.contact.is_some_and(|at| at <= step);
    // Of a ratio of sums over independent episodes (Cochran 1977, section 6.3).
    let squares: f64 = episodes.iter().map(|(steps, inside)| (inside - coverage90 * steps).powi(2)).sum();
    ParameterReport {
        name: layout.continuous[target].clone(),
        count,
        episodes: episodes.len(),
        coverage50: share(inside50),
        coverage90,
        coverage90_stderr: squares.sqrt() / (count as f64).max(1.0),
        coverage90_before_contact: coverage(&|episode, step, _| !after(episode, step)),
        coverage90_after_contact: coverage(&|episode, step, _| after(episode, step)),
        coverage90_last: coverage(&|_, step, steps| step + 1 == steps),
        coverage90_last_touched: coverage(&|episode, step, steps| {
            step + 1 == steps && episode.obstacle_contact.is_some()
        }),
        ranks,
    }
}

/// Accuracy of one class target.
fn classify(layout: &Layout, runs: &[Vec<Record>], target: usize) -> ClassReport {
    let labels = layout.classes[target].labels.clone();
    let empty = || vec![vec![0; labels.len()]; labels.len()];
    let (mut confusion, mut last_confusion) = (empty(), empty());
    for last in runs.iter().filter_map(|records| records.last()) {
        last_confusion[last.classes[target].0][last.classes[target].1] += 1;
    }
    // Count, Σ confidence, Σ correct.
    let mut bins = [(0.0, 0.0, 0.0); BINS];
    for record in runs.iter().flatten() {
        let (truth, likeliest, confidence, _) = record.classes[target];
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
        last_confusion,
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests;
