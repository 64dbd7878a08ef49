//! Action choice without search, and what else a search may be told about a problem.

use crate::{GenerativeModel, Rng};

/// What is known of one action at a new node of a search, before it was simulated there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActionPrior {
    /// Whether the action may be taken at all. At least one action of a state is legal.
    pub legal: bool,
    /// Simulations that the prior value stands for: N_init.
    pub visits: u32,
    /// Prior of the discounted return: V_init. Without effect where `visits` is zero.
    pub value: f64,
}

impl Default for ActionPrior {
    fn default() -> Self {
        Self { legal: true, visits: 0, value: 0.0 }
    }
}

/// A policy on the full state: default policy of rollouts, baseline, data collection; with optional advice for a search.
///
/// A search asks in a state that was sampled from a belief: advice that looks at what the agent cannot see makes the search
/// optimistic. States may carry what the agent knows of its history (counts of measurements, its last action), so that advice can
/// depend on the history without being given one.
pub trait Policy<M: GenerativeModel> {
    /// Action to take in `state`.
    fn action(&self, model: &M, state: &M::State, rng: &mut Rng) -> M::Action;

    /// Writes what is known of the actions at a new node, one entry per action of the model and in its order: which are illegal
    /// and which are preferred (Silver and Veness 2010, section 5). `state` is that of the simulation that adds the node. Every
    /// entry arrives as [`ActionPrior::default`]; by default nothing is known.
    fn priors(&self, _model: &M, _state: &M::State, _priors: &mut [ActionPrior]) {}

    /// Discounted return expected from `state` on, where a rollout was cut with `actions_left` actions to go before the horizon of
    /// its simulation. Zero by default. Never asked in a terminal state nor at the horizon.
    fn leaf_value(&self, _model: &M, _state: &M::State, _actions_left: usize) -> f64 {
        0.0
    }
}

/// Uniform choice over all actions.
#[derive(Clone, Copy, Debug, Default)]
pub struct UniformPolicy;

impl<M: GenerativeModel> Policy<M> for UniformPolicy {
    fn action(&self, model: &M, _state: &M::State, rng: &mut Rng) -> M::Action {
        use rand::RngExt as _;
        let actions = model.actions();
        actions[rng.random_range(0..actions.len())].clone()
    }
}
