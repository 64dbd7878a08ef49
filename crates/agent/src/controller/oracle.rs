//! The upper bound: the same search, from the true state and parameters.

use belief::Particles;
use pomdp::Seed;
use push_task::{Action, Observation, Particle};
use scenario::Problem;

use crate::controller::{Controller, Decision, Searcher, Update};
use crate::{Error, WorldStep};

/// Searches from what is true.
pub(crate) struct OracleController<'a> {
    searcher: Searcher<'a>,
}

impl<'a> OracleController<'a> {
    /// Without a tree so far.
    pub(crate) fn new(problem: &'a Problem, seed: Seed) -> Result<Self, Error> {
        Ok(Self { searcher: Searcher::new(problem, seed)? })
    }
}

impl Controller for OracleController<'_> {
    fn decide(&mut self, truth: Option<&Particle>, remaining: usize) -> Result<Decision, Error> {
        let truth = truth.ok_or(Error::NoTruth)?.clone();
        let belief = Particles::uniform(vec![truth])?;
        Ok(self.searcher.decide(&belief, remaining))
    }

    fn update(&mut self, _: Action, _: &WorldStep) -> Result<Update, Error> {
        Ok(Update::NoBelief)
    }

    fn prune(&mut self, action: Action, observation: &Observation) {
        self.searcher.prune(action, observation);
    }

    fn belief(&self) -> Option<&Particles<Particle>> {
        None
    }
}
