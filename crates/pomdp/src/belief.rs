//! What is believed, and how it changes with an action and an observation.

use crate::{GenerativeModel, Rng};

/// A distribution over states that can be sampled: what a search starts from. Never empty.
pub trait Belief {
    /// State of the model.
    type State;

    /// Draws one state.
    fn sample(&self, rng: &mut Rng) -> &Self::State;
}

/// States after the action suggested from outside, such as by a learned prior.
#[derive(Clone, Copy, Debug)]
pub struct Proposals<'a, S> {
    /// Draws that agree with the observation, independent of each other.
    pub states: &'a [S],
}

impl<'a, S> Proposals<'a, S> {
    /// No proposals.
    #[must_use]
    pub fn none() -> Self {
        Self { states: &[] }
    }

    /// These draws.
    #[must_use]
    pub fn new(states: &'a [S]) -> Self {
        Self { states }
    }
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
    /// there were too few particles for the rest.
    pub temperature: f64,
    /// Share of the moves between bridges that were accepted; 0 where there were none.
    pub move_acceptance: f64,
}

/// Bayes filter: (belief, action, observation) to belief.
pub trait Updater<M: GenerativeModel> {
    /// Kind of belief.
    type Belief: Belief<State = M::State>;
    /// Why no belief could be formed; depletion among them.
    type Error: std::error::Error;

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
