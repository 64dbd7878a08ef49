//! The planner: trees that persist between decisions.

use std::fmt::Debug;
use std::marker::PhantomData;

use pomdp::{Belief, Discretise, GenerativeModel, Policy, Rng};

use crate::branching::{Branching, Export};
use crate::export::{self, ExportLimit, TreeNode};
use crate::gain::{Contest, Moments};
use crate::nodes::{NodeId, Slot};
use crate::simulate::{Progress, Search, Share, Tally};
use crate::tree::KeyTree;
use crate::ucb::{self, ActionStats};
use crate::widening::TreeOf;
use crate::{Budget, Config, Error, parallel};

/// POMCP on classes of observations: [`search`](Planner::search), act, [`prune`](Planner::prune), search again.
///
/// Differences from the printed algorithm: the root state is sampled from a belief that is passed in, not from
/// particles in the nodes. The root exists before the first simulation. Simulations end at a stated depth instead of
/// where γ^depth < ε.
pub type Pomcp<M> = Planner<M, KeyTree<<M as Discretise>::Key>>;

/// POMCPOW on continuous observations: [`search`](Planner::search), act, [`reset`](Planner::reset), search again.
///
/// No branch belongs to the real observation, so the tree is dropped after each action.
///
/// Differences from the printed algorithm: those of [`Pomcp`]. All actions of the model's finite set are tried.
/// Branches do not hold states that end the episode, because an agent sees that its episode has ended.
pub type Pomcpow<M> = Planner<M, TreeOf<M>>;

/// A search with `config.trees` trees that persist between decisions: see [`Pomcp`] and [`Pomcpow`].
pub struct Planner<M: GenerativeModel, T> {
    config: Config,
    actions: Vec<M::Action>,
    /// Each with whether a simulation has reached its root. Empty until the first search.
    trees: Vec<(T, Root)>,
    model: PhantomData<fn(&M)>,
}

/// Whether a root carries what simulations found there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Root {
    Fresh,
    Known,
}

/// Why a search stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Stop {
    /// All simulations of the budget were made.
    Simulations,
    /// The next simulation could have overrun the budget of transitions.
    Transitions,
    /// Time was up.
    Time,
    /// More would not have paid: [`crate::EarlyStop`].
    LittleToGain,
}

/// What one search found and what it cost, all trees together.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SearchReport<A> {
    /// Action that [`crate::Choice`] names; among equals the first.
    pub action: A,
    /// Statistics of the root's actions in the model's order, including kept subtrees and initial visits. With several
    /// trees a value is the mean of all their returns.
    pub actions: Vec<ActionStats>,
    /// Simulations of this search.
    pub simulations: usize,
    /// Transitions of the model in this search.
    pub transitions: usize,
    /// Most actions that a simulation of this search took inside a tree.
    pub depth: usize,
    /// Nodes after this search. In widened trees the states that they hold count too.
    pub nodes: usize,
    /// Visits of the roots from earlier searches, initial visits included.
    pub reused: u64,
    /// Simulations that ended in a terminal state.
    pub terminal: usize,
    /// Simulations whose world diverged.
    pub diverged: usize,
    /// Simulations that found no room for a new node, because `nodes` were used up.
    pub unexpanded: usize,
    /// Exploration constant c of the last simulation; the mean over the trees.
    pub exploration: f64,
    /// Why the search stopped.
    pub stop: Stop,
}

impl<M: GenerativeModel, T: Branching<M>> Planner<M, T> {
    /// A planner without a tree.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] where a value lies outside its limits.
    pub fn new(config: Config) -> Result<Self, Error> {
        config.validate()?;
        T::check(&config)?;
        Ok(Self { config, actions: Vec::new(), trees: Vec::new(), model: PhantomData })
    }

    /// Searches from `belief` and returns the action to execute.
    ///
    /// `remaining_horizon` is the number of actions that the episode still allows, the next one included. Every simulation
    /// clones one state of the belief and steps that clone in place.
    ///
    /// # Panics
    ///
    /// If no action remains, if the model has no actions or changed them since the last [`reset`](Self::reset), or if
    /// the policy calls every action of a state illegal.
    pub fn search<B, P>(
        &mut self,
        model: &M,
        belief: &B,
        policy: &P,
        remaining_horizon: usize,
        rng: &mut Rng,
    ) -> SearchReport<M::Action>
    where
        M: Sync,
        B: Belief<State = M::State> + Sync + ?Sized,
        P: Policy<M> + Sync + ?Sized,
    {
        assert!(remaining_horizon > 0, "remaining_horizon is 0: there is no action left to plan");
        let config = &self.config;
        if self.trees.is_empty() {
            self.actions = model.actions().to_vec();
            let tree = |index| self.new_tree(index);
            self.trees = (0..config.trees).map(tree).collect();
        }
        assert!(self.actions == model.actions(), "the model's actions changed under a kept tree: call `reset` first");
        let reused = self.trees.iter().map(|(tree, _)| tree.nodes().visits(NodeId::ROOT)).sum();
        let depth = config.depth.min(remaining_horizon);

        let started = self.trees.iter_mut().map(|entry| {
            let progress = Progress::new(entry.0.nodes().slots(NodeId::ROOT));
            (entry, progress)
        });
        let mut started: Vec<_> = started.collect();
        let rounds = config.early_stop.map_or(1, |early| early.rounds);
        let mut enough = false;
        for round in 0..rounds {
            parallel::for_each(&mut started, config.threads, rng, |index, ((tree, root), progress), rng| {
                let share = Share::of(config, index, round, rounds);
                Search::new(model, policy, config, tree, depth, progress).run(belief, *root == Root::Fresh, share, rng);
                // A round may be too short for a simulation.
                if progress.tally.simulations > 0 {
                    *root = Root::Known;
                }
            });
            enough = round + 1 < rounds && enough_is_known(config, &started, round + 1);
            if enough {
                break;
            }
        }
        let tallies: Vec<Tally> = started.into_iter().map(|(_, progress)| progress.tally).collect();

        let stats = merged(self.trees.iter().map(|(tree, _)| tree.nodes().slots(NodeId::ROOT)));
        let best = ucb::best(&stats, config.choice).expect("a valid budget affords at least one simulation");
        let sum = |count: fn(&Tally) -> usize| tallies.iter().map(count).sum();
        let report = SearchReport {
            action: self.actions[best].clone(),
            actions: stats,
            simulations: sum(|t| t.simulations),
            transitions: sum(|t| t.transitions),
            depth: tallies.iter().map(|t| t.depth).max().unwrap_or(0),
            nodes: self.trees.iter().map(|(tree, _)| tree.size()).sum(),
            reused,
            terminal: sum(|t| t.terminal),
            diverged: sum(|t| t.diverged),
            unexpanded: sum(|t| t.unexpanded),
            exploration: tallies.iter().map(|t| t.exploration).sum::<f64>() / tallies.len() as f64,
            stop: match config.budget {
                _ if enough => Stop::LittleToGain,
                Budget::Simulations(_) => Stop::Simulations,
                Budget::Transitions(_) => Stop::Transitions,
                Budget::Milliseconds(_) => Stop::Time,
            },
        };
        #[cfg(feature = "tracing")]
        {
            let SearchReport { simulations, transitions, nodes, unexpanded, exploration, .. } = report;
            let value = report.actions[best].value;
            tracing::debug!(best, value, reused, simulations, transitions, nodes, unexpanded, exploration, "search");
        }
        report
    }

    /// Forgets the trees: a new episode begins.
    pub fn reset(&mut self) {
        self.trees.clear();
    }

    fn new_tree(&self, index: usize) -> (T, Root) {
        let limit = crate::config::share(self.config.nodes, self.config.trees, index);
        (T::new(&self.config, self.actions.len(), limit), Root::Fresh)
    }
}

/// Statistics of the root's actions over all trees, each given by the slots of its root.
fn merged<'a>(roots: impl Iterator<Item = &'a [Slot]>) -> Vec<ActionStats> {
    let mut stats = Vec::new();
    for root in roots {
        stats.resize(root.len(), ActionStats::default());
        for (merged, slot) in stats.iter_mut().zip(root) {
            merged.merge(slot.stats());
        }
    }
    stats
}

/// Whether the search may end here, after so many rounds: [`crate::EarlyStop`].
fn enough_is_known<M, T>(config: &Config, trees: &[(&mut (T, Root), Progress)], rounds_done: usize) -> bool
where
    M: GenerativeModel,
    T: Branching<M>,
{
    let Some(early) = config.early_stop else { return false };
    let roots = || trees.iter().map(|(entry, _)| entry.0.nodes().slots(NodeId::ROOT));
    let stats = merged(roots());
    let Some(best) = ucb::best(&stats, config.choice) else { return false };
    let mut returns = vec![Moments::default(); stats.len()];
    for (_, progress) in trees {
        returns.iter_mut().zip(&progress.returns).for_each(|(merged, own)| merged.merge(*own));
    }
    let legal: Vec<bool> = (0..stats.len()).map(|action| roots().any(|root| root[action].legal())).collect();
    early.is_enough(&Contest::new(&stats, &returns, &legal, best), rounds_done)
}

impl<M: GenerativeModel, T: Export> Planner<M, T> {
    /// Tree number `tree` as data. `None` if there is no such tree.
    #[must_use]
    pub fn tree(&self, tree: usize, limit: ExportLimit) -> Option<TreeNode>
    where
        M::Action: Debug,
    {
        let (tree, _) = self.trees.get(tree)?;
        let names: Vec<String> = self.actions.iter().map(|action| format!("{action:?}")).collect();
        Some(export::node(tree, NodeId::ROOT, &names, limit))
    }
}

impl<M> Planner<M, KeyTree<M::Key>>
where
    M: Discretise,
    M::Key: Send,
{
    /// Moves the root to the history after `action` and an observation of class `key`; everything else is dropped.
    ///
    /// A history that was never simulated leaves an empty tree. Without a tree nothing happens.
    ///
    /// # Panics
    ///
    /// If the model has no such action.
    pub fn prune(&mut self, action: &M::Action, key: &M::Key) {
        if self.trees.is_empty() {
            return;
        }
        let action = self.actions.iter().position(|a| a == action).expect("the executed action is one of the model's");
        for index in 0..self.trees.len() {
            if !self.trees[index].0.prune(action, key) {
                self.trees[index] = self.new_tree(index);
            }
        }
    }
}
