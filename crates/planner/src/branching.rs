//! What a search needs of a tree, for both kinds of branching.

use pomdp::{GenerativeModel, Policy, Rng, Step};

use crate::nodes::{NodeId, Nodes};
use crate::rollout::{Rollout, Span, rollout};
use crate::{Config, Error};

/// Where a simulation goes after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// To a history that the tree held already.
    Known(NodeId),
    /// To one that was added by this step.
    New(NodeId),
    /// Out of the tree, which has no place for another node.
    Full,
}

/// A tree that grows by the observations of its simulations.
pub trait Branching<M: GenerativeModel>: Send + Sized {
    /// Whether `config` describes this kind of tree.
    fn check(config: &Config) -> Result<(), Error>;

    /// A root without statistics in a tree of at most `limit` nodes.
    fn new(config: &Config, actions: usize, limit: usize) -> Self;

    /// Statistics of its nodes.
    fn nodes(&self) -> &Nodes;

    /// Statistics of its nodes.
    fn nodes_mut(&mut self) -> &mut Nodes;

    /// What counts against the limit.
    fn size(&self) -> usize;

    /// Follows the branch of a step that did not end the simulation; may replace the state and the reward by others that fit the
    /// branch.
    fn follow(
        &mut self,
        model: &M,
        node: NodeId,
        action: usize,
        state: &mut M::State,
        step: &mut Step<M::Observation>,
        rng: &mut Rng,
    ) -> Next;

    /// A search begins; `draw` draws from its belief.
    fn begin(&mut self, _draw: impl FnMut() -> M::State) {}

    /// The tail of a simulation in `state` that left the tree by the new node `leaf`, or because there was no place for one.
    fn rollout<P: Policy<M> + ?Sized>(
        &self,
        model: &M,
        policy: &P,
        state: &mut M::State,
        _leaf: Option<NodeId>,
        span: Span,
        rng: &mut Rng,
    ) -> Rollout {
        rollout(model, policy, state, span, rng)
    }
}

/// What an export needs of a tree.
pub trait Export {
    /// Statistics of its nodes.
    fn arena(&self) -> &Nodes;

    /// Branches of an action in a fixed order, with a label of the observation.
    fn branches(&self, node: NodeId, action: usize) -> Vec<(String, NodeId)>;
}
