//! The search of an episode, which all controllers with a search have alike.

use belief::Particles;
use planner::Pomcp;
use pomdp::{Discretise as _, Purpose, Rng, Seed};
use push_task::{Action, Observation, Particle, PushModel};
use scenario::Problem;

use crate::Error;
use crate::controller::{Decision, default_policy};

/// The trees of an episode and their random stream.
pub(crate) struct Searcher<'a> {
    problem: &'a Problem,
    search: Pomcp<PushModel>,
    rng: Rng,
}

impl<'a> Searcher<'a> {
    /// Without a tree so far.
    pub(crate) fn new(problem: &'a Problem, seed: Seed) -> Result<Self, Error> {
        let search = Pomcp::new(problem.scenario.planner.clone())?;
        Ok(Self { problem, search, rng: seed.stream(Purpose::Search, 0) })
    }

    /// Searches from a belief.
    pub(crate) fn decide(&mut self, belief: &Particles<Particle>, remaining: usize) -> Decision {
        let policy = default_policy(self.problem);
        let report = self.search.search(&self.problem.search, belief, policy, remaining, &mut self.rng);
        Decision { action: report.action, search: Some(report) }
    }

    /// Keeps the branch that happened.
    pub(crate) fn prune(&mut self, action: Action, observation: &Observation) {
        self.search.prune(&action, &self.problem.search.key(observation));
    }
}
