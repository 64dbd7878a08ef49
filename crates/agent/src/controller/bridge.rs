//! The method with a belief over whole histories: the network's estimate, and the exact likelihood as far as its draws carry it.

use belief::{BridgeFilter, Particles};
use pomdp::{Purpose, Rng, Seed};
use prior::PosteriorNetwork;
use push_task::{Action, Coordinates, History, Observation, Particle};
use scenario::{InitialObstacle, Problem};

use crate::controller::{Controller, Decision, Searcher, Update, obstacle_share};
use crate::record::End;
use crate::{Error, Estimate, WorldStep};

/// Searches from a belief over whole histories.
pub(crate) struct BridgeController<'a> {
    problem: &'a Problem,
    searcher: Searcher<'a>,
    history: History<'a>,
    filter: BridgeFilter<Particle, Estimate<'a>>,
    prior: Option<&'a mut PosteriorNetwork>,
    /// `None` once it is out of particles.
    belief: Option<Particles<Particle>>,
    rng: Rng,
}

impl<'a> BridgeController<'a> {
    /// With the first belief, which knows the first observation and where the joints are, rad. `prior` is the network, where the method has
    /// one.
    pub(crate) fn new(
        problem: &'a Problem,
        mut prior: Option<&'a mut PosteriorNetwork>,
        first: (&Observation, &[f64]),
        seed: Seed,
    ) -> Result<Self, Error> {
        if let Some(network) = &mut prior {
            network.reset();
            network.observe(&problem.model, None, first.0, first.1);
        }
        let history = history(problem, prior.as_deref(), first.0);
        let mut rng = seed.stream(Purpose::Filter, 0);
        let estimate = estimate(&history, prior.as_deref());
        let filter = BridgeFilter::new(problem.scenario.belief.bridge.clone(), &history, estimate, &mut rng)?;
        let belief = Some(filter.belief()?);
        Ok(Self { problem, searcher: Searcher::new(problem, seed)?, history, filter, prior, belief, rng })
    }
}

/// An episode that began with `first`. Where the scenario's first belief knows of no obstacle, a network does, from the worlds of its training. It then
/// counts obstacles as often as the domain has them, as on the other domains. The paper does not say how often its training data had them.
#[must_use]
pub fn history<'a>(problem: &'a Problem, prior: Option<&PosteriorNetwork>, first: &Observation) -> History<'a> {
    let mut distribution = problem.beliefs.clone();
    if let (InitialObstacle::None, Some(_)) = (problem.scenario.initial_belief.obstacle, prior) {
        distribution.obstacle.shape = problem.worlds.obstacle.shape;
    }
    History::new(Coordinates::new(&problem.model, &distribution, &problem.start_joints_rad, first))
}

/// What the network says, or the prior.
fn estimate<'a>(history: &History<'a>, prior: Option<&PosteriorNetwork>) -> Estimate<'a> {
    prior.map_or_else(|| Estimate::prior(history), |network| Estimate::network(history, network))
}

impl Controller for BridgeController<'_> {
    fn decide(&mut self, _: Option<&Particle>, remaining: usize) -> Result<Decision, Error> {
        let belief = self.belief.as_ref().expect("an episode ends when it is out of particles");
        Ok(self.searcher.decide(belief, remaining))
    }

    fn update(&mut self, action: Action, answer: &WorldStep) -> Result<Update, Error> {
        self.history.push(action, &answer.observation, &answer.joints_rad);
        if let Some(network) = &mut self.prior {
            network.observe(&self.problem.model, Some(action), &answer.observation, &answer.joints_rad);
        }
        let estimate = estimate(&self.history, self.prior.as_deref());
        match self.filter.update(&self.history, estimate, &mut self.rng) {
            Ok(report) => {
                let belief = self.filter.belief()?;
                let obstacle_share = obstacle_share(&belief);
                self.belief = Some(belief);
                Ok(Update::Belief { report, obstacle_share })
            }
            Err(belief::Error::Depleted { attempts, .. }) => {
                self.belief = None;
                Ok(Update::End(End::OutOfParticles { transitions: attempts }))
            }
            Err(error) => Err(error.into()),
        }
    }

    fn prune(&mut self, action: Action, observation: &Observation) {
        self.searcher.prune(action, observation);
    }

    fn belief(&self) -> Option<&Particles<Particle>> {
        self.belief.as_ref()
    }
}
