//! The search tree for continuous observations and a finite set of actions: POMCPOW (Sunberg and Kochenderfer, "Online
//! algorithms for POMDPs with continuous state, action, and observation spaces", ICAPS 2018, algorithm 2).
//!
//! A branch holds the states of all simulations that came through it. Each has the likelihood of the branch's
//! observation as weight, and the reward of the step that led to it. A simulation goes on from one drawn by weight, so
//! that below a branch the belief is that of its observation, although no two simulations see the same one.

use pomdp::{GenerativeModel, ObservationModel, Outcome, Policy, Rng, Step};
use rand::RngExt as _;

use crate::believing;
use crate::branching::{Branching, Export, Next};
use crate::nodes::{NodeId, Nodes};
use crate::rollout::{Rollout, Span, rollout};
use crate::{Config, Error, Observations};

/// A state in a branch.
#[derive(Clone, Debug)]
struct Held<S> {
    state: S,
    reward: f64,
    /// Sum of the weights up to this one.
    cumulative: f64,
}

/// The branch that leads to a node.
#[derive(Debug)]
struct Branch<S, O> {
    observation: O,
    /// Simulations that came this way: M(hao).
    passed: u32,
    /// Log likelihood that counts as weight one: that of the state which made the observation. Without it, sharp densities
    /// would leave the range of numbers.
    log_reference: f64,
    held: Vec<Held<S>>,
    /// Next branch of the same action, or [`NodeId::NONE`].
    next: NodeId,
}

impl<S: Clone, O> Branch<S, O> {
    fn add(&mut self, state: &S, reward: f64, log_likelihood: f64) {
        let exponent = log_likelihood - self.log_reference;
        // e^600 is far from infinity, and no sum of as many as fit into memory reaches it. A likelihood that is no number explains nothing.
        let weight = if exponent.is_nan() { 0.0 } else { exponent.min(600.0).exp() };
        let cumulative = self.held.last().map_or(0.0, |last| last.cumulative) + weight;
        self.held.push(Held { state: state.clone(), reward, cumulative });
    }

    /// A state drawn by weight, or none where all weights are zero.
    fn draw(&self, rng: &mut Rng) -> Option<&Held<S>> {
        let total = self.held.last()?.cumulative;
        if total <= 0.0 {
            return None;
        }
        let mark = rng.random::<f64>() * total;
        let index = self.held.partition_point(|held| held.cumulative <= mark);
        // Rounding may put the mark onto the total; the last one of positive weight is where that total was reached.
        Some(&self.held[index.min(self.held.partition_point(|held| held.cumulative < total))])
    }
}

/// All histories under the current one.
#[derive(Debug)]
pub struct WeightedTree<S, O> {
    nodes: Nodes,
    /// Entry n − 1 is the branch to node n.
    branches: Vec<Branch<S, O>>,
    /// States in all branches.
    held: usize,
    factor: f64,
    exponent: f64,
    /// States that a new branch starts with, besides that of its simulation.
    branch_states: usize,
    /// Draws of the belief that is searched from: what branches at the root start from.
    roots: Vec<S>,
}

/// Draws of the belief for each state of a branch at the root.
const ROOTS_PER_BRANCH_STATE: usize = 16;

impl<S: Clone, O> WeightedTree<S, O> {
    fn new(actions: usize, limit: usize, factor: f64, exponent: f64, branch_states: usize) -> Self {
        let (nodes, branches) = (Nodes::new(actions, limit), Vec::new());
        Self { nodes, branches, held: 0, factor, exponent, branch_states, roots: Vec::new() }
    }

    /// A state drawn at a node.
    fn draw_state(&self, node: NodeId, rng: &mut Rng) -> Option<&S> {
        if node == NodeId::ROOT {
            return (!self.roots.is_empty()).then(|| &self.roots[rng.random_range(0..self.roots.len())]);
        }
        self.branches[node.index() - 1].draw(rng).map(|held| &held.state)
    }

    /// States of a branch with their weights, where these are positive.
    fn belief(&self, node: NodeId) -> Vec<(S, f64)> {
        let held = &self.branches[node.index() - 1].held;
        let mut before = 0.0;
        let weighted = held.iter().map(|h| (h, h.cumulative - std::mem::replace(&mut before, h.cumulative)));
        weighted.filter(|(_, weight)| *weight > 0.0).map(|(h, weight)| (h.state.clone(), weight)).collect()
    }

    /// Branches of an action, the newest first.
    fn of(&self, node: NodeId, action: usize) -> impl Iterator<Item = NodeId> {
        let first = self.nodes.slot(node, action).branch;
        let some = |at: NodeId| (at != NodeId::NONE).then_some(at);
        std::iter::successors(some(first), move |at| some(self.branches[at.index() - 1].next))
    }

    /// Whether an action with `visits` and `branches` gets another one.
    fn widens(&self, visits: u32, branches: usize) -> bool {
        branches as f64 <= self.factor * f64::from(visits).powf(self.exponent)
    }

    /// A branch drawn in proportion to the simulations that came through it.
    fn draw(&self, node: NodeId, action: usize, rng: &mut Rng) -> Option<NodeId> {
        let passed = |at: NodeId| u64::from(self.branches[at.index() - 1].passed);
        let total: u64 = self.of(node, action).map(passed).sum();
        let mut mark = if total > 0 { rng.random_range(0..total) } else { return None };
        self.of(node, action).find(|&at| {
            let here = mark < passed(at);
            mark = mark.saturating_sub(passed(at));
            here
        })
    }
}

impl<M> Branching<M> for WeightedTree<M::State, M::Observation>
where
    M: ObservationModel,
    M::State: Send,
    M::Observation: Send,
{
    fn check(config: &Config) -> Result<(), Error> {
        match config.observations {
            Observations::Widening { .. } => Ok(()),
            Observations::Classes => Err(Error::Config {
                key: "observations",
                value: "classes".into(),
                limit: "`widening` for `Pomcpow`; `Pomcp` takes classes".into(),
            }),
        }
    }

    fn new(config: &Config, actions: usize, limit: usize) -> Self {
        let Observations::Widening { factor, exponent } = config.observations else {
            unreachable!("`check` lets only widening through")
        };
        Self::new(actions, limit, factor, exponent, config.branch_states)
    }

    fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    fn nodes_mut(&mut self) -> &mut Nodes {
        &mut self.nodes
    }

    fn size(&self) -> usize {
        self.nodes.count() + self.held
    }

    fn follow(
        &mut self,
        model: &M,
        node: NodeId,
        action: usize,
        state: &mut M::State,
        step: &mut Step<M::Observation>,
        rng: &mut Rng,
    ) -> Next {
        let named = &model.actions()[action];
        let slot = self.nodes.slot(node, action);
        // A new branch takes two places: a node and its first state.
        let full = self.nodes.full(self.held + 1 + self.branch_states);
        if !full && self.widens(slot.visits(), self.of(node, action).count()) {
            let log_likelihood = model.log_likelihood(named, state, &step.observation);
            let log_reference = if log_likelihood.is_finite() { log_likelihood } else { 0.0 };
            let new = self.nodes.add();
            let mut branch = Branch {
                observation: step.observation.clone(),
                passed: 1,
                log_reference,
                held: Vec::new(),
                next: slot.branch,
            };
            branch.add(state, step.reward, log_likelihood);
            for _ in 0..self.branch_states {
                let Some(start) = self.draw_state(node, rng) else { break };
                let mut state = start.clone();
                let step = model.step(&mut state, named, rng);
                if step.outcome == Outcome::Continue {
                    branch.add(&state, step.reward, model.log_likelihood(named, &state, &branch.observation));
                }
            }
            self.held += branch.held.len();
            self.branches.push(branch);
            self.nodes.slot_mut(node, action).branch = new;
            return Next::New(new);
        }
        let Some(child) = self.draw(node, action, rng) else { return Next::Full };
        let branch = &mut self.branches[child.index() - 1];
        branch.passed += 1;
        if !full {
            branch.add(state, step.reward, model.log_likelihood(named, state, &branch.observation));
            self.held += 1;
        }
        // Where no state of the branch explains its observation, the simulation goes on with its own.
        if let Some(held) = branch.draw(rng) {
            (*state, step.reward) = (held.state.clone(), held.reward);
        }
        Next::Known(child)
    }

    fn begin(&mut self, draw: impl FnMut() -> M::State) {
        self.roots.clear();
        self.roots.extend(std::iter::repeat_with(draw).take(ROOTS_PER_BRANCH_STATE * self.branch_states));
    }

    fn rollout<P: Policy<M> + ?Sized>(
        &self,
        model: &M,
        policy: &P,
        state: &mut M::State,
        leaf: Option<NodeId>,
        span: Span,
        rng: &mut Rng,
    ) -> Rollout {
        match leaf {
            Some(leaf) if self.branch_states > 0 => {
                believing::rollout(model, policy, state, self.belief(leaf), span, rng)
            }
            _ => rollout(model, policy, state, span, rng),
        }
    }
}

impl<S: Clone, O> Export for WeightedTree<S, O> {
    fn arena(&self) -> &Nodes {
        &self.nodes
    }

    fn branches(&self, node: NodeId, action: usize) -> Vec<(String, NodeId)> {
        let mut found: Vec<NodeId> = self.of(node, action).collect();
        found.reverse();
        found.into_iter().enumerate().map(|(index, at)| (format!("#{index}"), at)).collect()
    }
}

/// What [`crate::Pomcpow`] keeps of a model.
pub(crate) type TreeOf<M> = WeightedTree<<M as GenerativeModel>::State, <M as GenerativeModel>::Observation>;

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    /// Pays the state's number; the observation says whether it is even, rightly in two of three.
    struct Numbers;

    impl GenerativeModel for Numbers {
        type State = u32;
        type Action = ();
        type Observation = bool;

        fn actions(&self) -> &[()] {
            &[()]
        }

        fn step(&self, state: &mut u32, (): &(), rng: &mut Rng) -> Step<bool> {
            let observation = state.is_multiple_of(2) == rng.random_bool(2.0 / 3.0);
            Step { observation, reward: f64::from(*state), outcome: Outcome::Continue }
        }

        fn discount(&self) -> f64 {
            1.0
        }
    }

    impl ObservationModel for Numbers {
        fn log_likelihood(&self, (): &(), next: &u32, observation: &bool) -> f64 {
            if next.is_multiple_of(2) == *observation { (2.0_f64 / 3.0).ln() } else { (1.0_f64 / 3.0).ln() }
        }
    }

    #[test]
    fn a_simulation_goes_on_from_a_weighted_state_with_the_reward_that_led_to_it() {
        let mut tree = WeightedTree::new(1, 1 << 20, 1.0, 0.0, 0);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let (mut agreed, mut known) = (0, 0);
        for _ in 0..20_000 {
            let mut state = rng.random_range(0..1000);
            let mut step = Numbers.step(&mut state, &(), &mut rng);
            let Next::Known(child) = tree.follow(&Numbers, NodeId::ROOT, 0, &mut state, &mut step, &mut rng) else {
                continue;
            };
            assert_eq!(step.reward, f64::from(state));
            known += 1;
            agreed += u32::from(state.is_multiple_of(2) == tree.branches[child.index() - 1].observation);
        }
        // Null: two of three. n about 20,000, standard deviation of the share 0.0033; tolerance 5 of them, for draws share states.
        let share = f64::from(agreed) / f64::from(known);
        assert!(known > 19_000 && (share - 2.0 / 3.0).abs() < 0.0167, "{share} of {known}");
    }

    #[test]
    fn a_branch_starts_with_states_of_its_parent_weighted_by_its_observation() {
        let mut tree = WeightedTree::new(1, 1 << 20, 1.0, 0.0, 500);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut next = 0;
        Branching::<Numbers>::begin(&mut tree, || {
            next += 1;
            next % 1000
        });
        let mut follow = |node, mut state: u32| {
            let mut step = Numbers.step(&mut state, &(), &mut rng);
            tree.follow(&Numbers, node, 0, &mut state, &mut step, &mut rng)
        };
        let Next::New(first) = follow(NodeId::ROOT, 3) else { panic!("the first step adds a branch") };
        let Next::New(second) = follow(first, 4) else { panic!("so does the first below it") };
        // Shares that the observation fits: 2/3 after one, and 4/5 after another like it. Tolerance 4 binomial standard deviations of 500; the second
        // belief inherits the error of the first, and its observation may differ from the first one: then it is 1/2 of either kind.
        let share = |node: NodeId, even: bool| {
            let belief = tree.belief(node);
            let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
            belief.iter().filter(|(s, _)| s.is_multiple_of(2) == even).map(|(_, weight)| weight).sum::<f64>() / total
        };
        let seen = |node: NodeId| tree.branches[node.index() - 1].observation;
        assert!((share(first, seen(first)) - 2.0 / 3.0).abs() < 0.09);
        let expected = if seen(first) == seen(second) { 0.8 } else { 0.5 };
        assert!((share(second, seen(second)) - expected).abs() < 0.16);
        assert_eq!((tree.belief(first).len(), tree.held), (501, 1002));
    }

    #[test]
    fn states_of_weight_zero_are_never_drawn() {
        let mut branch =
            Branch { observation: (), passed: 1, log_reference: 0.0, held: Vec::new(), next: NodeId::NONE };
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        branch.add(&0, 0.0, f64::NEG_INFINITY);
        assert!(branch.draw(&mut rng).is_none());
        for (state, log_likelihood) in [(1, 0.0), (2, f64::NAN), (3, 1e6), (4, f64::NEG_INFINITY)] {
            branch.add(&state, 0.0, log_likelihood);
        }
        assert!((0..1000).all(|_| branch.draw(&mut rng).is_some_and(|held| held.state == 3)));
    }
}
