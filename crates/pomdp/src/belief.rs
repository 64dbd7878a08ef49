//! What is believed, and how it changes with an action and an observation.

use crate::{GenerativeModel, Rng};

/// A distribution over states that can be sampled: what a search starts from. Never empty.
pub trait Belief {
    /// State of the model.
    type State;

    /// Draws one state.
    fn sample(&self, rng: &mut Rng) -> &Self::State;
}

/// States after the action suggested from outside (a learned prior), with the density that they were drawn from.
///
/// Draws alone do not tell how much to believe them. Pass the density if you know it. It is a function, because a
/// filter evaluates it at its own particles too: that bounds the importance weights of the mixture (balance heuristic;
/// Veach and Guibas 1995, Owen and Zhou 2000).
#[derive(Clone, Copy)]
pub struct Proposals<'a, S> {
    /// All draws that were made, independent of each other. Leaving out those that do not fit the observation would
    /// change the density.
    pub states: &'a [S],
    /// ln q of the draws' static parameters, with the rest of the state integrated out. q is the probability of the
    /// structure times the density of the continuous parameters in the coordinates of [`crate::StaticParameters`].
    /// `None` where it is unknown.
    pub log_density: Option<&'a (dyn Fn(&S) -> f64 + Sync)>,
}

impl<'a, S> Proposals<'a, S> {
    /// No proposals.
    #[must_use]
    pub fn none() -> Self {
        Self { states: &[], log_density: None }
    }

    /// Draws of unknown density.
    #[must_use]
    pub fn unweighted(states: &'a [S]) -> Self {
        Self { states, log_density: None }
    }

    /// Draws from the density `log_density`.
    #[must_use]
    pub fn weighted(states: &'a [S], log_density: &'a (dyn Fn(&S) -> f64 + Sync)) -> Self {
        Self { states, log_density: Some(log_density) }
    }
}

/// What an update says about one discrete structure of the static parameters.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StructureReport {
    /// The structure, as its `Debug` writes it.
    pub structure: String,
    /// Its probability before the observation.
    pub prior: f64,
    /// Its probability after the observation.
    pub posterior: f64,
    /// Estimate of ln p(o | history, a, structure); −∞ where no particle of the structure explained it. Valid only
    /// where the update reached temperature 1. Below that it belongs to the tempered likelihood.
    pub log_evidence: f64,
    /// Particles of the structure in the new belief.
    pub particles: usize,
}

/// What one belief update did.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UpdateReport {
    /// Effective sample size (Σw)² / Σw² of the new belief. For a filter without weights: the number of particles.
    pub effective_sample_size: f64,
    /// Effective sample size after weighting with the whole likelihood and before resampling. For a filter without
    /// weights: the number of particles that agree with the observation.
    pub effective_sample_size_before: f64,
    /// Estimate of ln p(o | history, a); −∞ where no simulated particle agreed with the observation.
    pub log_evidence: f64,
    /// Share of the simulated particles whose likelihood is not zero.
    pub acceptance: f64,
    /// Particles of the new belief.
    pub particles: usize,
    /// Particles in the new belief that come from noise added to older ones.
    pub reinvigorated: usize,
    /// Particles in the new belief that come from outside proposals.
    pub proposed: usize,
    /// Simulated worlds that diverged and were dropped.
    pub diverged: usize,
    /// Transitions simulated for this update.
    pub transitions: usize,
    /// Whether the new belief was resampled.
    pub resampled: bool,
    /// Intermediate distributions between prediction and posterior.
    pub bridges: usize,
    /// Exponent of the likelihood that the new belief has reached. 1 is the posterior. Less is a broader distribution:
    /// the budget ran out first.
    pub temperature: f64,
    /// Share of the moves between bridges that were accepted; 0 where there were none.
    pub move_acceptance: f64,
    /// ln p of a particle's own simulated observation, averaged over the particles, minus the largest ln p of the real
    /// one, nats. About 0 or below while the belief holds the truth. Large where no particle explains the observation.
    pub surprise: f64,
    /// Beliefs drawn anew from the start of the episode: 0 or 1.
    pub recoveries: usize,
    /// Probability and evidence of each structure. Empty for filters that do not track structures.
    pub structures: Vec<StructureReport>,
}

/// Bayes filter: (belief, action, observation) to belief.
pub trait Updater<M: GenerativeModel> {
    /// Kind of belief.
    type Belief: Belief<State = M::State>;
    /// Why no belief could be formed; depletion among them.
    type Error: std::error::Error;

    /// Forgets the episode: a new one begins. A filter without memory does nothing.
    fn reset(&mut self) {}

    /// Belief after `action` was executed in `belief` and `observation` received.
    ///
    /// # Errors
    ///
    /// Depletion, when no particle explains the observation.
    fn update(
        &mut self,
        model: &M,
        belief: Self::Belief,
        action: &M::Action,
        observation: &M::Observation,
        proposals: Proposals<'_, M::State>,
        rng: &mut Rng,
    ) -> Result<(Self::Belief, UpdateReport), Self::Error>;
}
