//! Algorithm 1, and who plays it.

use pomdp::{Outcome, Seed};
use scenario::{Filter, Problem};

use crate::controller::{Update, controller};
use crate::episode_log::EpisodeLog;
use crate::record::End;
use crate::{Episode, Error, Method, Network, Watcher, World};

/// Plays episodes of a problem with one method.
#[derive(Debug)]
pub struct Agent<'a> {
    problem: &'a Problem,
    method: Method,
    prior: Option<Network>,
}

impl<'a> Agent<'a> {
    /// An agent for `problem`.
    ///
    /// # Errors
    ///
    /// [`Error::NoPrior`] where the method needs one and none is given; [`Error::NoDensity`] where the filter could not weigh what it
    /// suggests; [`Error::OtherNetwork`] where it is of another kind.
    pub fn new(problem: &'a Problem, method: Method, prior: Option<&Network>) -> Result<Self, Error> {
        if method.needs_prior() && prior.is_none() {
            return Err(Error::NoPrior { method: method.name() });
        }
        let filter = problem.scenario.belief.filter;
        match (method, filter) {
            (Method::RnnMax | Method::RnnSampling, Filter::Bridge) => {
                return Err(Error::NoDensity { method: method.name() });
            }
            (Method::Mixture, Filter::Rejection) => return Err(Error::NoWeights { method: method.name() }),
            _ => {}
        }
        let prior = prior.filter(|_| method.needs_prior());
        match (prior, filter) {
            (Some(Network::Suggester(_)), Filter::Bridge) | (Some(Network::Posterior(_)), Filter::Rejection) => {
                return Err(Error::OtherNetwork { filter: filter.name() });
            }
            _ => {}
        }
        Ok(Self { problem, method, prior: prior.cloned() })
    }

    /// Plays one episode. `seed` is the trial's own seed.
    ///
    /// # Errors
    ///
    /// Where the scenario and the first observation contradict each other. Depletion and a world that fails are no errors: they end the
    /// episode.
    pub fn run(&mut self, world: &mut dyn World, seed: Seed) -> Result<Episode, Error> {
        self.run_watched(world, seed, &mut ())
    }

    /// The same before the eyes of a watcher, which changes nothing.
    ///
    /// # Errors
    ///
    /// As [`Self::run`].
    pub fn run_watched(
        &mut self,
        world: &mut dyn World,
        seed: Seed,
        watcher: &mut dyn Watcher,
    ) -> Result<Episode, Error> {
        let mut log = EpisodeLog::new(watcher);
        let end = match self.play(world, seed, &mut log) {
            Err(Error::World(error)) => End::WorldFailed(error),
            played => played?,
        };
        Ok(log.finish(&end, self.problem.scenario.task.discount))
    }

    /// Algorithm 1 of Hayashi et al. (ICRA 2019). The numbers are the lines of the paper's listing, and the words are the paper's.
    fn play(&mut self, world: &mut dyn World, seed: Seed, log: &mut EpisodeLog<'_>) -> Result<End, Error> {
        let (observation, joints_rad) = world.reset()?;
        // 1: Initialize belief b(s, Θ) over state s and physical parameters Θ.
        let first = (&observation, joints_rad.as_slice());
        let mut controller = match controller(self.problem, self.method, self.prior.as_mut(), first, seed) {
            Err(Error::Belief(belief::Error::Depleted { attempts, .. })) => {
                log.begin(&joints_rad, world.truth(), None);
                return Ok(End::OutOfParticles { transitions: attempts });
            }
            made => made?,
        };
        log.begin(&joints_rad, world.truth(), controller.belief());
        // 2: repeat
        for remaining in (1..=self.problem.scenario.task.horizon).rev() {
            // 3: Construct a search tree from simulations starting from {s', Θ'} ~ b(s, Θ).
            let decision = controller.decide(world.truth(), remaining)?;
            // 4: Execute planned action a in the world.
            // 5: Receive observation o from the world.
            let answer = world.act(decision.action)?;
            let update = match answer.outcome {
                // 6: Update the belief b(s, Θ) with particle reinvigoration by {s, Θ} ~ RNN(o).
                Outcome::Continue => controller.update(decision.action, &answer)?,
                Outcome::Terminal => Update::End(End::Goal),
                Outcome::Diverged => Update::End(End::Diverged),
            };
            // 7: Prune the tree.
            if !update.ends() {
                controller.prune(decision.action, &answer.observation);
            }
            log.step(&decision, &answer, &update, world.truth(), controller.belief());
            // 8: until Terminating or Out of particles.
            if let Update::End(end) = update {
                return Ok(end);
            }
        }
        Ok(End::Horizon)
    }
}

#[cfg(test)]
mod tests;
