//! What chooses actions and learns from their answers: one small interface for the method and its baselines.

mod bridge;
mod heuristic;
mod oracle;
mod rejection;
mod searcher;

use belief::Particles;
use planner::SearchReport;
use pomdp::{Policy, Seed, UpdateReport};
use push_task::{Action, GoalPolicy, HeuristicPolicy, Observation, Particle, PushModel};
use scenario::{Filter, Problem, Rollouts};

use crate::record::End;
use crate::{Error, Method, Network, WorldStep};
use bridge::BridgeController;
pub use bridge::history;
use heuristic::HeuristicController;
use oracle::OracleController;
use rejection::RejectionController;
use searcher::Searcher;

pub(crate) use rejection::obstacle_share;
#[cfg(test)]
pub(crate) use rejection::with_known_joints;

/// An action that was chosen.
#[derive(Debug)]
pub(crate) struct Decision {
    /// The action.
    pub action: Action,
    /// The search that chose it; `None` without search.
    pub search: Option<SearchReport<Action>>,
}

/// What an answer of the world changed.
#[derive(Debug)]
pub(crate) enum Update {
    /// Nothing is believed, so nothing is learnt.
    NoBelief,
    /// There is a new belief.
    Belief {
        /// What the filter did.
        report: UpdateReport,
        /// Share of the particles with an obstacle.
        obstacle_share: f64,
    },
    /// The episode is over.
    End(End),
}

impl Update {
    /// Whether the episode is over.
    pub(crate) const fn ends(&self) -> bool {
        matches!(self, Self::End(_))
    }
}

/// Chooses the actions of one episode, and learns from their answers. Making one is line 1 of Algorithm 1.
pub(crate) trait Controller {
    /// Line 3: searches, and names the action to execute. `truth` is for the oracle alone; `remaining` is the number of actions that the
    /// episode still allows, this one included.
    fn decide(&mut self, truth: Option<&Particle>, remaining: usize) -> Result<Decision, Error>;

    /// Line 6: the belief after `action` and the world's answer, which did not end the episode.
    fn update(&mut self, action: Action, answer: &WorldStep) -> Result<Update, Error>;

    /// Line 7: keeps the branch of the tree that happened. Nothing, where nothing is kept between decisions.
    fn prune(&mut self, action: Action, observation: &Observation);

    /// The belief; `None` where the method has none, and when it is out of particles.
    fn belief(&self) -> Option<&Particles<Particle>>;
}

/// The controller of `method` for an episode that begins with an observation and joint positions, rad. `prior` is given where the method
/// needs one.
pub(crate) fn controller<'a>(
    problem: &'a Problem,
    method: Method,
    prior: Option<&'a mut Network>,
    first: (&Observation, &[f64]),
    seed: Seed,
) -> Result<Box<dyn Controller + 'a>, Error> {
    Ok(match method {
        Method::Heuristic => Box::new(HeuristicController::new(&problem.model, first)),
        Method::Oracle => Box::new(OracleController::new(problem, seed)?),
        Method::NoRnn | Method::RnnMax | Method::RnnSampling | Method::Mixture => {
            match problem.scenario.belief.filter {
                Filter::Rejection => {
                    let prior = prior.and_then(Network::suggester);
                    Box::new(RejectionController::new(problem, method, prior, first.0, seed)?)
                }
                Filter::Bridge => {
                    Box::new(BridgeController::new(problem, prior.and_then(Network::posterior), first, seed)?)
                }
            }
        }
    })
}

/// The policy that ends simulations.
fn default_policy(problem: &Problem) -> &'static (dyn Policy<PushModel> + Sync) {
    match problem.scenario.agent.rollouts {
        Rollouts::Heuristic => &HeuristicPolicy,
        Rollouts::Goal => &GoalPolicy,
    }
}
