//! The search: Silver and Veness 2010, algorithm 1.

use pomdp::{Belief, Discretise, Outcome, Policy, Rng};
use serde::{Deserialize, Serialize};

use crate::rollout::rollout;
use crate::tree::{Child, NodeId, Tree};
use crate::ucb::{self, ActionStats, ReturnRange};
use crate::{Config, Error};

/// POMCP with a tree that persists between decisions: [`search`](Self::search), act, [`prune`](Self::prune), search again.
///
/// Differences from the printed algorithm: the root sampler is a belief from outside instead of particles in the nodes; the
/// root exists before the first simulation; simulations end at a stated depth instead of where γ^depth < ε.
pub struct Pomcp<M: Discretise> {
    config: Config,
    actions: Vec<M::Action>,
    tree: Option<Tree<M::Key>>,
}

/// What one search found and what it cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchReport<A> {
    /// Action with the highest mean return; among equals the one with more visits, then the first.
    pub action: A,
    /// Statistics of the root's actions in the model's order, those of a kept subtree included.
    pub actions: Vec<ActionStats>,
    /// Simulations of this search.
    pub simulations: usize,
    /// Transitions of the model in this search.
    pub transitions: usize,
    /// Most actions that one simulation of this search took inside the tree.
    pub depth: usize,
    /// Nodes of the tree after this search.
    pub nodes: usize,
    /// Visits of the root that were kept from earlier searches.
    pub reused: u64,
    /// Simulations that ended in a terminal state.
    pub terminal: usize,
    /// Simulations whose world diverged.
    pub diverged: usize,
    /// Exploration constant c of the last simulation.
    pub exploration: f64,
}

impl<M: Discretise> Pomcp<M> {
    /// A planner without a tree.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] where a value lies outside its limits.
    pub fn new(config: Config) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self { config, actions: Vec::new(), tree: None })
    }

    /// Searches from `belief` and names the action to execute.
    ///
    /// `remaining_horizon` is the number of actions that the episode still allows, the next one included. Every simulation
    /// clones one state of the belief and steps that clone in place.
    ///
    /// # Panics
    ///
    /// When no action remains, when the model has no actions, or when they changed since the last [`reset`](Self::reset).
    pub fn search<B, P>(
        &mut self,
        model: &M,
        belief: &B,
        policy: &P,
        remaining_horizon: usize,
        rng: &mut Rng,
    ) -> SearchReport<M::Action>
    where
        B: Belief<State = M::State> + ?Sized,
        P: Policy<M> + ?Sized,
    {
        assert!(remaining_horizon > 0, "remaining_horizon is 0: there is no action left to plan");
        if self.tree.is_none() {
            self.actions = model.actions().to_vec();
        }
        assert!(self.actions == model.actions(), "the model's actions changed under a kept tree: call `reset` first");
        let tree = self.tree.get_or_insert_with(|| Tree::new(self.actions.len()));
        let root = tree.stats(Tree::<M::Key>::ROOT);
        let reused = root.iter().map(|s| s.visits).sum();
        let mut returns = ReturnRange::of_means(root);
        let depth = self.config.depth.min(remaining_horizon);

        let mut search =
            Search { model, policy, config: &self.config, tree, depth, path: Vec::new(), tally: Tally::default() };
        let mut exploration = 0.0;
        while self.config.budget.affords(search.tally.simulations, search.tally.transitions, depth) {
            exploration = self.config.exploration.constant(returns);
            returns.include(search.simulate(belief.sample(rng).clone(), exploration, rng));
        }

        let tally = search.tally;
        let stats = tree.stats(Tree::<M::Key>::ROOT).to_vec();
        let best = ucb::best(&stats).expect("a valid budget affords at least one simulation");
        let nodes = tree.node_count();
        tracing::debug!(best, value = stats[best].value, reused, nodes, exploration, ?tally, "search");
        SearchReport {
            action: self.actions[best].clone(),
            actions: stats,
            simulations: tally.simulations,
            transitions: tally.transitions,
            depth: tally.depth,
            nodes,
            reused,
            terminal: tally.terminal,
            diverged: tally.diverged,
            exploration,
        }
    }

    /// Moves the root to the history after `action` and an observation of class `key`; everything else is dropped.
    ///
    /// A history that was never simulated leaves an empty tree. Without a tree nothing happens.
    ///
    /// # Panics
    ///
    /// When `action` is none of the model's.
    pub fn prune(&mut self, action: &M::Action, key: &M::Key) {
        let Some(tree) = &mut self.tree else { return };
        let index = self.actions.iter().position(|a| a == action).expect("the executed action is one of the model's");
        tree.prune(index, key);
    }

    /// Forgets the tree: a new episode begins.
    pub fn reset(&mut self) {
        self.tree = None;
    }
}

/// What the simulations of one search cost.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    simulations: usize,
    transitions: usize,
    depth: usize,
    terminal: usize,
    diverged: usize,
}

impl Tally {
    fn end(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Continue => {}
            Outcome::Terminal => self.terminal += 1,
            Outcome::Diverged => self.diverged += 1,
        }
    }
}

/// One search in progress.
struct Search<'a, M: Discretise, P: ?Sized> {
    model: &'a M,
    policy: &'a P,
    config: &'a Config,
    tree: &'a mut Tree<M::Key>,
    /// Actions from the root to the horizon of a simulation.
    depth: usize,
    /// Node, action and reward of each step inside the tree; kept to spare an allocation per simulation.
    path: Vec<(NodeId, usize, f64)>,
    tally: Tally,
}

impl<M: Discretise, P: Policy<M> + ?Sized> Search<'_, M, P> {
    /// One simulation from `state`: down the tree, one new leaf, a rollout, and the returns back up. Returns that of the root.
    fn simulate(&mut self, mut state: M::State, exploration: f64, rng: &mut Rng) -> f64 {
        let mut node = Tree::<M::Key>::ROOT;
        let mut tail = 0.0;
        self.path.clear();
        loop {
            let action = ucb::select(self.tree.stats(node), exploration, rng);
            let step = self.model.step(&mut state, &self.model.actions()[action], rng);
            self.path.push((node, action, step.reward));
            if step.outcome != Outcome::Continue || self.path.len() == self.depth {
                self.tally.end(step.outcome);
                break;
            }
            match self.tree.child(node, action, self.model.key(&step.observation)) {
                Child::Known(child) => node = child,
                Child::New => {
                    let actions = self.config.rollout_depth.actions(self.depth - self.path.len());
                    let below = rollout(self.model, self.policy, &mut state, actions, rng);
                    self.tally.end(below.outcome);
                    self.tally.transitions += below.transitions;
                    tail = below.discounted_return;
                    break;
                }
            }
        }
        self.tally.simulations += 1;
        self.tally.transitions += self.path.len();
        self.tally.depth = self.tally.depth.max(self.path.len());
        for &(node, action, reward) in self.path.iter().rev() {
            tail = reward + self.model.discount() * tail;
            self.tree.record(node, action, tail);
        }
        tail
    }
}
