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
/// Draws alone do not tell how much to believe them. Whoever knows the density passes it as a function rather than a number a draw, for a
/// filter needs it at its own particles too: only then are the importance weights of a mixture bounded (the balance heuristic of Veach and
/// Guibas 1995; Owen and Zhou 2000).
#[derive(Clone, Copy)]
pub struct Proposals<'a, S> {
    /// The draws, independent of each other and all that were made: leaving out what does not fit the observation changes the density.
    pub states: &'a [S],
    /// ln q of the draws' static parameters: probability of the structure times density of the continuous parameters in the coordinates of
    /// [`crate::StaticParameters`], the rest of the state integrated out. `None` where it is unknown.
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
    /// Estimate of ln p(o | history, a, structure); −∞ where no particle of the structure explained it. Only where the update reached
    /// temperature 1: else the structures' shares are those of the tempered likelihood.
    pub log_evidence: f64,
    /// Particles of the structure in the new belief.
    pub particles: usize,
}

/// What one belief update did.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UpdateReport {
    /// (Σw)² / Σw² of the new belief; its number of particles where they carry no weights.
    pub effective_sample_size: f64,
    /// The same after weighting with the whole likelihood, before anything was resampled; the number of agreeing particles in a filter
    /// without weights.
    pub effective_sample_size_before: f64,
    /// Estimate of ln p(o | history, a); −∞ where no simulated particle agreed with the observation.
    pub log_evidence: f64,
    /// Share of the simulated particles that agreed with the observation: whose likelihood is not zero.
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
    /// Exponent of the likelihood that the new belief has reached: 1 is the posterior, less a broader one, for the budget was spent.
    pub temperature: f64,
    /// Share of the moves between bridges that were accepted; 0 where there were none.
    pub move_acceptance: f64,
    /// How much less likely the observation is to the best particle than a particle's own observation is to itself on average, nats.
    /// About 0 or below while the belief holds the truth; large where nothing in it explains the observation.
    pub surprise: f64,
    /// Beliefs drawn anew from the start of the episode: 0 or 1.
    pub recoveries: usize,
    /// Probability and evidence of each structure; empty for filters that keep no books on them.
    pub structures: Vec<StructureReport>,
}

/// Bayes filter: (belief, action, observation) to belief.
pub trait Updater<M: GenerativeModel> {
    /// Kind of belief.
    type Belief: Belief<State = M::State>;
    /// Why no belief could be formed; depletion among them.
    type Error: std::error::Error;

    /// Forgets what it remembers of the episode: a new one begins. Nothing, for a filter without memory.
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
