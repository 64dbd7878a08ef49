//! What a search does with its budget, its tree, its horizon and its generator, on small models with known answers.

mod advice_and_trees;
mod budget_and_statistics;

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

use planner::{
    ActionPriors, Backup, Budget, Config, Error, Exploration, ExportLimit, Observations, Pomcp, RolloutDepth, Stop,
    TreeNode,
};
use pomdp::{
    ActionPrior, Belief, Discretise, GenerativeModel, Outcome, Policy, Purpose, Rng, Seed, Step, UniformPolicy,
    conformance,
};
use proptest::prelude::*;

thread_local! {
    static CLONES: Cell<usize> = const { Cell::new(0) };
}

/// A count of steps whose clones are counted.
#[derive(Debug, PartialEq)]
struct Counted(usize);

impl Clone for Counted {
    fn clone(&self) -> Self {
        CLONES.with(|c| c.set(c.get() + 1));
        Self(self.0)
    }
}

/// Three actions and four equally likely observations; rewards come from a table, the world ends as told.
struct Noise {
    rewards: [f64; 3],
    discount: f64,
    /// Step at which the given action ends the world, and how.
    ending: Option<(usize, usize, Outcome)>,
    steps: AtomicUsize,
}

impl Noise {
    fn new(rewards: [f64; 3]) -> Self {
        Self { rewards, discount: 0.9, ending: None, steps: AtomicUsize::new(0) }
    }
}

impl GenerativeModel for Noise {
    type State = Counted;
    type Action = usize;
    type Observation = u8;

    fn actions(&self) -> &[usize] {
        &[0, 1, 2]
    }

    fn step(&self, state: &mut Counted, action: &usize, rng: &mut Rng) -> Step<u8> {
        self.steps.fetch_add(1, Ordering::Relaxed);
        state.0 += 1;
        let outcome = match self.ending {
            Some((step, fatal, outcome)) if step == state.0 && fatal == *action => outcome,
            _ => Outcome::Continue,
        };
        Step { observation: rng.random_range(0..4), reward: self.rewards[*action], outcome }
    }

    fn discount(&self) -> f64 {
        self.discount
    }
}

impl Discretise for Noise {
    type Key = u8;

    fn key(&self, observation: &u8) -> u8 {
        *observation
    }
}

/// One action, one observation, and an end at the third step.
struct OneAction(Outcome);

impl GenerativeModel for OneAction {
    type State = Counted;
    type Action = ();
    type Observation = ();

    fn actions(&self) -> &[()] {
        &[()]
    }

    fn step(&self, state: &mut Counted, (): &(), _rng: &mut Rng) -> Step<()> {
        state.0 += 1;
        Step { observation: (), reward: 0.0, outcome: if state.0 == 3 { self.0 } else { Outcome::Continue } }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl Discretise for OneAction {
    type Key = ();

    fn key(&self, (): &()) {}
}

struct Known(Counted);

impl Belief for Known {
    type State = Counted;

    fn sample(&self, _rng: &mut Rng) -> &Counted {
        &self.0
    }
}

fn config(budget: Budget, depth: usize) -> Config {
    Config {
        budget,
        exploration: Exploration::ReturnRange(1.0),
        depth,
        rollout_depth: RolloutDepth::Full,
        action_priors: ActionPriors::Off,
        observations: Observations::Classes,
        backup: Backup::Mean,
        nodes: 1 << 24,
        ..Config::default()
    }
}

fn rng(item: u64) -> Rng {
    Seed(1).stream(Purpose::Search, item)
}

const START: Known = Known(Counted(0));
