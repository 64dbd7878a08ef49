//! What can be simulated: the generative model and its optional abilities.

use crate::Rng;

/// How a step ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The episode goes on.
    Continue,
    /// The task is over (goal reached or failed); nothing follows.
    Terminal,
    /// The simulated world became impossible (NaN, flying objects, deep penetration): its likelihood is zero. Filters
    /// drop such a hypothesis and count it; a planner treats it as an end without further reward.
    Diverged,
}

/// What one action brought.
#[derive(Clone, Debug, PartialEq)]
pub struct Step<O> {
    /// What the sensors say after the action.
    pub observation: O,
    /// Reward of this action, undiscounted.
    pub reward: f64,
    /// Whether the episode goes on.
    pub outcome: Outcome,
}

/// A simulator of transitions, observations and rewards: G(s, a) of a POMDP. The unknown parameters are part of the state.
pub trait GenerativeModel {
    /// State with the fixed but unknown parameters Θ.
    type State: Clone;
    /// Action.
    type Action: Clone + PartialEq;
    /// Observation.
    type Observation: Clone;

    /// Every action, in a fixed order. Not empty.
    fn actions(&self) -> &[Self::Action];

    /// Advances `state` in place by one action. Equal states and equal streams give equal steps.
    fn step(&self, state: &mut Self::State, action: &Self::Action, rng: &mut Rng) -> Step<Self::Observation>;

    /// Discount γ in [0, 1] of one action.
    fn discount(&self) -> f64;
}

/// A model whose observation density can be evaluated.
pub trait ObservationModel: GenerativeModel {
    /// ln p(o | a, s'); −∞ for an impossible observation.
    ///
    /// A model with noise on s' may leave it out of the state and integrate it out here.
    fn log_likelihood(&self, action: &Self::Action, next: &Self::State, observation: &Self::Observation) -> f64;
}

/// A model whose observations fall into discrete classes. They are the branches of the search tree and the acceptance
/// test of the rejection filter.
pub trait Discretise: GenerativeModel {
    /// Class of an observation.
    type Key: Clone + Ord + std::fmt::Debug;

    /// Class of `observation`.
    fn key(&self, observation: &Self::Observation) -> Self::Key;
}

/// A model that can move a hypothesis a little: the artificial noise of particle reinvigoration.
pub trait Perturb: GenerativeModel {
    /// Adds zero-mean noise to every uncertain value of `state`, within its physical range.
    fn perturb(&self, state: &mut Self::State, rng: &mut Rng);
}
