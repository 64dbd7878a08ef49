//! One real step in the view of one belief: what its stages share.

use pomdp::{GenerativeModel, ObservationModel, Outcome, Partition, Proposals, Rng, StaticParameters};

use super::config::WeightedConfig;
use super::prediction::Prediction;
use super::simulate::{Simulated, step};
use super::size::wanted;
use crate::diagnostics::log_sum_exp;
use crate::resample::Quota;

/// What the weighted filter asks of a model. Implemented for everything that has it.
pub trait Trackable:
    GenerativeModel<State: Send + Sync, Action: Sync, Observation: Sync>
    + ObservationModel
    + StaticParameters
    + Partition
    + Sync
{
}

impl<M> Trackable for M where
    M: GenerativeModel<State: Send + Sync, Action: Sync, Observation: Sync>
        + ObservationModel
        + StaticParameters
        + Partition
        + Sync
{
}

/// A simulated particle: the state that it came from, with which parameters, and where it went.
#[derive(Clone)]
pub(crate) struct Walker<S> {
    pub(crate) ancestor: usize,
    pub(crate) proposed: bool,
    pub(crate) theta: Vec<f64>,
    pub(crate) next: S,
    pub(crate) log_likelihood: f64,
}

/// What was simulated so far.
#[derive(Clone, Copy, Default)]
pub(crate) struct Tally {
    pub(crate) transitions: usize,
    pub(crate) agreeing: usize,
    pub(crate) diverged: usize,
    pub(crate) terminal: usize,
    own_sum: f64,
    own_count: usize,
}

impl Tally {
    pub(crate) fn add<S>(&mut self, simulated: &Simulated<S>) {
        self.transitions += 1;
        self.agreeing += usize::from(simulated.log_likelihood > f64::NEG_INFINITY);
        self.diverged += usize::from(simulated.outcome == Outcome::Diverged);
        self.terminal += usize::from(simulated.outcome == Outcome::Terminal);
        if simulated.own.is_finite() {
            self.own_sum += simulated.own;
            self.own_count += 1;
        }
    }

    /// Mean ln likelihood of a particle's own observation; +∞ where nothing could be simulated.
    pub(crate) fn own(&self) -> f64 {
        if self.own_count == 0 { f64::INFINITY } else { self.own_sum / self.own_count as f64 }
    }
}

/// Weighted walkers, and how they came about.
pub(crate) struct Posterior<S> {
    pub(crate) walkers: Vec<Walker<S>>,
    /// Normalised.
    pub(crate) log_weights: Vec<f64>,
    pub(crate) log_evidence: f64,
    pub(crate) bridges: usize,
    pub(crate) temperature: f64,
    pub(crate) move_acceptance: f64,
    /// Particles that differ in their parameters from the belief's.
    pub(crate) moved: usize,
    /// Whether anything was resampled.
    pub(crate) resampled: bool,
    /// Resampled and moved at the last exponent: nothing is left to do.
    pub(crate) fresh: bool,
}

/// One real step in the view of one belief.
pub(crate) struct Round<'a, M: Trackable> {
    pub(crate) model: &'a M,
    pub(crate) action: &'a M::Action,
    pub(crate) observation: &'a M::Observation,
    pub(crate) config: &'a WeightedConfig,
    pub(crate) prediction: &'a Prediction<M>,
    pub(crate) proposals: Proposals<'a, M::State>,
    pub(crate) tally: Tally,
}

impl<M: Trackable> Round<'_, M> {
    /// ln q(θ) / p(θ) at a particle of the belief; −∞ without proposals.
    pub(crate) fn log_ratio(&self, ancestor: usize, theta: &[f64], start: Option<&M::State>) -> f64 {
        match self.proposals.log_density {
            Some(density) if !self.proposals.states.is_empty() && self.config.proposal_share > 0.0 => {
                let kind = self.prediction.kinds[ancestor];
                let state = start.unwrap_or(&self.prediction.states[ancestor]);
                let ratio = density(state) - self.prediction.log_density(kind, theta);
                if ratio.is_nan() { f64::NEG_INFINITY } else { ratio }
            }
            _ => f64::NEG_INFINITY,
        }
    }

    pub(crate) fn step(&self, start: M::State, rng: &mut Rng) -> Simulated<M::State> {
        step(self.model, self.action, self.observation, start, rng)
    }

    pub(crate) fn quota(&self) -> Quota {
        Quota { particles: self.config.structure_quota, threshold: self.config.structure_threshold }
    }

    pub(crate) fn kinds(&self, walkers: &[Walker<M::State>]) -> Vec<usize> {
        walkers.iter().map(|w| self.prediction.kinds[w.ancestor]).collect()
    }

    /// Number of particles that `weights` over `walkers` ask for.
    pub(crate) fn wanted(&self, weights: &[f64], walkers: &[Walker<M::State>], rng: &mut Rng) -> usize {
        let cell = |i: usize| (self.prediction.kinds[walkers[i].ancestor], self.model.cell(&walkers[i].next));
        wanted(self.config, weights, cell, rng)
    }
}

/// Proposals that became particles.
pub(crate) struct Offers<S> {
    /// Proposals used, those included that are no possible particle of this belief.
    pub(crate) drawn: usize,
    pub(crate) walkers: Vec<Walker<S>>,
    /// ln q(θ) / p(θ) of each.
    pub(crate) log_ratios: Vec<f64>,
}

/// ln of (1 − α) + α q/p: the density of the mixture over that of the prediction.
pub(crate) fn mixture(share: f64, log_ratio: f64) -> f64 {
    let proposed = share.ln() + log_ratio;
    if proposed == f64::INFINITY { proposed } else { log_sum_exp([(1.0 - share).ln(), proposed].into_iter()) }
}
