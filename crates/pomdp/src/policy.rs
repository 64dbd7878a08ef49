//! Action choice without search.

use crate::{GenerativeModel, Rng};

/// A policy on the full state: default policy of rollouts, baseline, data collection.
pub trait Policy<M: GenerativeModel> {
    /// Action to take in `state`.
    fn action(&self, model: &M, state: &M::State, rng: &mut Rng) -> M::Action;
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
