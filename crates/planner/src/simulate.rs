//! The simulations of one tree: Silver and Veness 2010, algorithm 1.

use std::time::{Duration, Instant};

use pomdp::{ActionPrior, Belief, GenerativeModel, Outcome, Policy, Rng};

use crate::branching::{Branching, Next};
use crate::config::share;
use crate::gain::Moments;
use crate::nodes::{NodeId, Slot};
use crate::rollout::Span;
use crate::ucb::{self, ReturnRange};
use crate::{ActionPriors, Backup, Budget, Config};

/// What one search did in one tree so far.
#[derive(Debug)]
pub(crate) struct Progress {
    pub(crate) tally: Tally,
    /// Returns of the root's actions.
    pub(crate) returns: Vec<Moments>,
    range: ReturnRange,
}

impl Progress {
    /// Before the first simulation in a tree with these statistics at its root.
    pub(crate) fn new(root: &[Slot]) -> Self {
        let returns = vec![Moments::default(); root.len()];
        Self { tally: Tally::default(), returns, range: ReturnRange::of_means(root) }
    }
}

/// What the simulations of one tree cost.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) simulations: usize,
    pub(crate) transitions: usize,
    pub(crate) depth: usize,
    pub(crate) terminal: usize,
    pub(crate) diverged: usize,
    pub(crate) unexpanded: usize,
    /// Exploration constant of the last simulation.
    pub(crate) exploration: f64,
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

/// What one tree may use up.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Share {
    Simulations(usize),
    Transitions(usize),
    Until(Instant),
}

impl Share {
    /// The part of tree number `index` in the configured budget up to the end of round number `round` of `rounds`. A time is that of this
    /// round, from now on.
    pub(crate) fn of(config: &Config, index: usize, round: usize, rounds: usize) -> Self {
        // All of `n` after the last round. In 128 bits, as both factors may be large.
        let part = |n: usize| (share(n, config.trees, index) as u128 * (round + 1) as u128 / rounds as u128) as usize;
        match config.budget {
            Budget::Simulations(n) => Self::Simulations(part(n)),
            Budget::Transitions(n) => Self::Transitions(part(n)),
            Budget::Milliseconds(n) => {
                // Threads take the trees in turns; a turn lasts as long for every tree.
                let turns = config.trees.div_ceil(config.threads.min(config.trees)) * rounds;
                let turn = Duration::from_millis(n) / u32::try_from(turns).unwrap_or(u32::MAX);
                #[expect(
                    clippy::disallowed_methods,
                    reason = "a budget of wall-clock time is documented as not reproducible"
                )]
                Self::Until(Instant::now() + turn)
            }
        }
    }

    /// Whether one more simulation of at most `depth` transitions may start.
    fn affords(self, tally: &Tally, depth: usize) -> bool {
        match self {
            Self::Simulations(n) => tally.simulations < n,
            Self::Transitions(n) => tally.transitions + depth <= n,
            #[expect(
                clippy::disallowed_methods,
                reason = "a budget of wall-clock time is documented as not reproducible"
            )]
            Self::Until(deadline) => tally.simulations == 0 || Instant::now() < deadline,
        }
    }
}

/// One search in progress.
pub(crate) struct Search<'a, M: GenerativeModel, P: ?Sized, T> {
    model: &'a M,
    policy: &'a P,
    config: &'a Config,
    tree: &'a mut T,
    /// Actions from the root to the horizon of a simulation.
    depth: usize,
    /// Node, action and reward of each step inside the tree; kept to spare an allocation per simulation.
    path: Vec<(NodeId, usize, f64)>,
    priors: Vec<ActionPrior>,
    progress: &'a mut Progress,
}

impl<'a, M, P, T> Search<'a, M, P, T>
where
    M: GenerativeModel,
    P: Policy<M> + ?Sized,
    T: Branching<M>,
{
    pub(crate) fn new(
        model: &'a M,
        policy: &'a P,
        config: &'a Config,
        tree: &'a mut T,
        depth: usize,
        progress: &'a mut Progress,
    ) -> Self {
        let priors = vec![ActionPrior::default(); tree.nodes().actions()];
        Self { model, policy, config, tree, depth, path: Vec::new(), priors, progress }
    }

    /// Simulates from `belief` until the share is used up. `fresh` says that the root was not reached by a simulation yet.
    pub(crate) fn run<B>(mut self, belief: &B, fresh: bool, share: Share, rng: &mut Rng)
    where
        B: Belief<State = M::State> + ?Sized,
    {
        self.tree.begin(|| belief.sample(rng).clone());
        while share.affords(&self.progress.tally, self.depth) {
            self.progress.tally.exploration = self.config.exploration.constant(self.progress.range);
            let state = belief.sample(rng).clone();
            if fresh && self.progress.tally.simulations == 0 {
                self.set_priors(NodeId::ROOT, &state);
            }
            let discounted_return = self.simulate(state, rng);
            self.progress.range.include(discounted_return);
            self.progress.returns[self.path[0].1].record(discounted_return);
        }
    }

    /// One simulation from `state`: down the tree, one new leaf, a rollout, and the returns back up. Returns that of the root.
    fn simulate(&mut self, mut state: M::State, rng: &mut Rng) -> f64 {
        let mut node = NodeId::ROOT;
        let mut tail = 0.0;
        self.path.clear();
        loop {
            let action = ucb::select(self.tree.nodes().slots(node), self.progress.tally.exploration, rng);
            let mut step = self.model.step(&mut state, &self.model.actions()[action], rng);
            if step.outcome != Outcome::Continue || self.path.len() + 1 == self.depth {
                self.path.push((node, action, step.reward));
                self.progress.tally.end(step.outcome);
                break;
            }
            let next = self.tree.follow(self.model, node, action, &mut state, &mut step, rng);
            self.path.push((node, action, step.reward));
            match next {
                Next::Known(child) => node = child,
                Next::New(_) | Next::Full => {
                    let leaf = if let Next::New(child) = next { Some(child) } else { None };
                    match leaf {
                        Some(child) => self.set_priors(child, &state),
                        None => self.progress.tally.unexpanded += 1,
                    }
                    let left = self.depth - self.path.len();
                    let span = Span { actions: self.config.rollout_depth.actions(left), left };
                    let below = self.tree.rollout(self.model, self.policy, &mut state, leaf, span, rng);
                    self.progress.tally.end(below.outcome);
                    self.progress.tally.transitions += below.transitions;
                    tail = below.discounted_return;
                    break;
                }
            }
        }
        self.progress.tally.simulations += 1;
        self.progress.tally.transitions += self.path.len();
        self.progress.tally.depth = self.progress.tally.depth.max(self.path.len());
        self.back_up(tail)
    }

    /// Records returns along the path, above a return of `below` at its end. Returns that of the root.
    fn back_up(&mut self, mut below: f64) -> f64 {
        let discount = self.model.discount();
        let mut discounted_return = below;
        for &(node, action, reward) in self.path.iter().rev() {
            discounted_return = reward + discount * below;
            let nodes = self.tree.nodes_mut();
            nodes.slot_mut(node, action).record(discounted_return);
            below = match self.config.backup {
                Backup::Mean => discounted_return,
                Backup::Watkins => ucb::unless_exploring(nodes.slots(node), action, discounted_return),
            };
        }
        discounted_return
    }

    fn set_priors(&mut self, node: NodeId, state: &M::State) {
        let full = match self.config.action_priors {
            ActionPriors::Off => return,
            ActionPriors::Legal => false,
            ActionPriors::Full => true,
        };
        self.priors.fill(ActionPrior::default());
        self.policy.priors(self.model, state, &mut self.priors);
        self.tree.nodes_mut().set_priors(node, &self.priors, full);
    }
}
