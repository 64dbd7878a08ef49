//! What is believed, and how it changes with an action and an observation.

use serde::{Deserialize, Serialize};

use crate::{GenerativeModel, Rng};

/// A distribution over states that can be sampled: what a search starts from. Never empty.
pub trait Belief {
    /// State of the model.
    type State;

    /// Draws one state.
    fn sample(&self, rng: &mut Rng) -> &Self::State;
}

/// What one belief update did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UpdateReport {
    /// (Σw)² / Σw² of the new belief; its number of particles where they carry no weights.
    pub effective_sample_size: f64,
    /// Estimate of ln p(o | history, a); −∞ where no simulated particle agreed with the observation.
    pub log_evidence: f64,
    /// Share of the simulated particles that agreed with the observation.
    pub acceptance: f64,
    /// Particles in the new belief that come from noise added to older ones.
    pub reinvigorated: usize,
    /// Particles in the new belief that come from outside proposals.
    pub proposed: usize,
    /// Simulated worlds that diverged and were dropped.
    pub diverged: usize,
    /// Transitions simulated for this update.
    pub transitions: usize,
}

/// Bayes filter: (belief, action, observation) to belief.
pub trait Updater<M: GenerativeModel> {
    /// Kind of belief.
    type Belief: Belief<State = M::State>;
    /// Why no belief could be formed; depletion among them.
    type Error: std::error::Error;

    /// Belief after `action` was executed in `belief` and `observation` received.
    ///
    /// `proposals` are states after the action suggested from outside (a learned prior); empty where there is none.
    ///
    /// # Errors
    ///
    /// Depletion, when no particle explains the observation.
    fn update(
        &self,
        model: &M,
        belief: Self::Belief,
        action: &M::Action,
        observation: &M::Observation,
        proposals: &[M::State],
        rng: &mut Rng,
    ) -> Result<(Self::Belief, UpdateReport), Self::Error>;
}
