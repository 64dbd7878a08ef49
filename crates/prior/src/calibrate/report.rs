//! The calibration report: what is compared, in numbers.

use serde::{Deserialize, Serialize};

/// Negative log-likelihoods of the same values, nats per step, for the targets as written in the dataset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Likelihoods {
    /// The network; null over no steps.
    pub network: Option<f64>,
    /// The sampling distribution; null over no steps.
    pub baseline: Option<f64>,
    /// The same network trained without memory, where one was given.
    pub memoryless: Option<f64>,
}

/// Means over a set of time steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Score {
    /// Time steps.
    pub count: usize,
    /// All targets, state and Θ.
    pub nll: Likelihoods,
    /// Those that stay the same in an episode alone: Θ.
    pub static_nll: Likelihoods,
    /// Stated standard deviation of each static target divided by the standard deviation of the truth, averaged over
    /// the steps where the target applies.
    pub spread: Vec<f64>,
    /// Mean probability of the true label of each class target.
    pub class_probability: Vec<f64>,
}

/// Scores at one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepReport {
    /// Step, from 0.
    pub step: usize,
    /// All episodes that last so long.
    pub all: Score,
    /// Those with a contact up to this step.
    pub after_contact: Score,
    /// Those without.
    pub before_contact: Score,
    /// Here `step` is counted from the first contact: 0 is the first observation after it.
    pub since_contact: Score,
}

/// Calibration of one continuous target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterReport {
    /// Name in the layout.
    pub name: String,
    /// Time steps at which it applies.
    pub count: usize,
    /// Episodes in which it applies: rows of one episode share their Θ, so this is the sample size of the coverage.
    pub episodes: usize,
    /// Share of the steps with the truth inside the central 50 % interval of the marginal.
    pub coverage50: f64,
    /// Share of the steps with the truth inside the central 90 % interval of the marginal.
    pub coverage90: f64,
    /// Standard error of `coverage90`, from the spread of the episodes' shares.
    pub coverage90_stderr: f64,
    /// Coverage of the 90 % interval up to the first contact; null where there is no such step.
    pub coverage90_before_contact: Option<f64>,
    /// The same after it.
    pub coverage90_after_contact: Option<f64>,
    /// The same at the last step of each episode.
    pub coverage90_last: Option<f64>,
    /// The same at the last step of the episodes in which the obstacle was touched.
    pub coverage90_last_touched: Option<f64>,
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
    /// The same at the last step of each episode.
    pub last_confusion: Vec<Vec<usize>>,
}

/// The calibration report of a prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Held-out episodes.
    pub episodes: usize,
    /// Time steps.
    pub steps: usize,
    /// Negative log-likelihood of the network, nats a step.
    pub nll: f64,
    /// The same of the sampling distribution.
    pub baseline_nll: f64,
    /// The same of the network without memory, where one was given.
    pub memoryless_nll: Option<f64>,
    /// One per continuous target.
    pub parameters: Vec<ParameterReport>,
    /// Names of the static targets, in the order of [`Score::spread`].
    pub static_targets: Vec<String>,
    /// Accuracy of the first class target at the last step of each episode.
    pub shape_accuracy: Option<f64>,
    /// For the first class target with a label `none`: share of the episodes with an obstacle contact that end with
    /// P(obstacle) above one half.
    pub obstacle_after_contact_accuracy: Option<f64>,
    /// Episodes of that share.
    pub obstacle_contact_episodes: usize,
    /// Share of the episodes without an obstacle that end with P(none) above one half. A network that always says
    /// "obstacle" scores 1 above and 0 here.
    pub no_obstacle_accuracy: Option<f64>,
    /// Mean of the two: one half without any knowledge.
    pub obstacle_balanced_accuracy: Option<f64>,
    /// Share of the episodes with an untouched obstacle that end with P(obstacle) above one half.
    pub untouched_obstacle_found: Option<f64>,
    /// Share of the episodes with an obstacle contact that have P(obstacle) above one half, by steps since the first
    /// contact, as long as half of these episodes last.
    pub obstacle_found_since_touch: Vec<f64>,
    /// One per class target.
    pub classes: Vec<ClassReport>,
    /// One per step of the longest episode.
    pub sharpening: Vec<StepReport>,
}
