//! The upper bound: the same search, from the true state and parameters.

use belief::Particles;
use planner::Pomcp;
use pomdp::{Discretise as _, Purpose, Rng, Seed};
use push_task::{Action, Observation, Particle, PushModel};
use scenario::Problem;

use crate::controller::{Controller, Decision, Update, default_policy};
use crate::{Error, WorldStep};

/// Searches from what is true.
pub(crate) struct OracleController<'a> {
    problem: &'a Problem,
    search: Pomcp<PushModel>,
    rng: Rng,
}

impl<'a> OracleController<'a> {
    /// Without a tree so far.
    pub(crate) fn new(problem: &'a Problem, seed: Seed) -> Result<Self, Error> {
        let search = Pomcp::new(problem.scenario.planner.clone())?;
        Ok(Self { problem, search, rng: seed.stream(Purpose::Search, 0) })
    }
}

impl Controller for OracleController<'_> {
    fn decide(&mut self, truth: Option<&Particle>, remaining: usize) -> Result<Decision, Error> {
        let truth = truth.ok_or(Error::NoTruth)?.clone();
        let belief = Particles::uniform(vec![truth])?;
        let policy = default_policy(self.problem);
        let report = self.search.search(&self.problem.model, &belief, policy, remaining, &mut self.rng);
        Ok(Decision { action: report.action, search: Some(report) })
    }

    fn update(&mut self, _: Action, _: &WorldStep) -> Result<Update, Error> {
        Ok(Update::NoBelief)
    }

    fn prune(&mut self, action: Action, observation: &Observation) {
        self.search.prune(&action, &self.problem.model.key(observation));
    }

    fn belief(&self) -> Option<&Particles<Particle>> {
        None
    }
}
