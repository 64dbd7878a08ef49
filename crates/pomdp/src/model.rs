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
    /// A model that knows its own error takes the true next state to be s' plus that error, and integrates the error
    /// out here.
    fn log_likelihood(&self, action: &Self::Action, next: &Self::State, observation: &Self::Observation) -> f64;

    /// Draws the model's error from its posterior given `observation`, and adds it to the simulated state. It is the
    /// error that [`Self::log_likelihood`] integrates out. A filter that corrects the states it keeps uses the optimal
    /// proposal for this error (Doucet, Godsill and Andrieu 2000). A model without an error term does nothing.
    fn correct(&self, _next: &mut Self::State, _observation: &Self::Observation, _rng: &mut Rng) {}
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

/// A model whose state holds parameters that stay fixed during an episode. Liu–West smoothing moves their continuous
/// part. A weighted filter tracks the probability of their discrete part.
///
/// The discrete part, [`Self::Structure`], says how many continuous values there are and what they mean. Example: shape
/// of the object and class of the obstacle; values that do not apply to a shape are left out. The continuous part has
/// unconstrained coordinates, in which a Gaussian makes sense: ln of a mass or a size, logit of a friction coefficient,
/// an angle near its mean. A value that no action changes, such as the pose of a fixed obstacle, is also a parameter.
/// Include it if it is not observed.
///
/// Check an implementation with [`crate::conformance::check_static_parameters`].
pub trait StaticParameters: GenerativeModel {
    /// Discrete part of the parameters. No step changes it.
    type Structure: Clone + Ord + std::fmt::Debug + Send + Sync;

    /// Discrete part of the parameters of `state`.
    fn structure(&self, state: &Self::State) -> Self::Structure;

    /// Continuous part, in unconstrained coordinates. All states of a structure have equally many values; there may be
    /// none.
    fn parameters(&self, state: &Self::State) -> Vec<f64>;

    /// `state` with other continuous parameters and the same structure. Whatever depends on them is updated: an object
    /// that gets taller still stands on its table. `None` where the result is impossible: a value outside its range,
    /// bodies that overlap.
    fn with_parameters(&self, state: &Self::State, parameters: &[f64]) -> Option<Self::State>;
}

/// A model whose states fall into coarse cells. An adaptive filter counts occupied cells to measure how spread out a
/// belief is.
pub trait Partition: GenerativeModel {
    /// Cell of a state.
    type Cell: Clone + Ord + std::fmt::Debug;

    /// Cell of `state`. The structure of its parameters need not be part of it: filters count cells per structure.
    fn cell(&self, state: &Self::State) -> Self::Cell;
}
