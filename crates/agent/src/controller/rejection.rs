//! The method of the paper: POMCP from a belief that a rejection filter keeps.

use belief::{Particles, RejectionFilter};
use pomdp::{Proposals, Purpose, Rng, Seed, Updater as _};
use prior::Suggester;
use push_task::{Action, Observation, Particle};
use scenario::Problem;

use crate::controller::{Controller, Decision, Searcher, Update};
use crate::proposals::{Context, Proposer};
use crate::record::End;
use crate::{Error, Method, WorldStep};

/// Searches from a belief, which the network helps to keep where the method has one.
pub(crate) struct RejectionController<'a> {
    problem: &'a Problem,
    searcher: Searcher<'a>,
    /// `None` once it is out of particles.
    belief: Option<Particles<Particle>>,
    filter: RejectionFilter,
    proposer: Option<Proposer<'a>>,
    /// Whether the object has ever been moved.
    object_moved: bool,
    streams: Streams,
}

/// A random stream for each kind of draw.
struct Streams {
    filter: Rng,
    suggestion: Rng,
}

impl<'a> RejectionController<'a> {
    /// With the first belief, which knows the first observation; `prior` has seen it too.
    pub(crate) fn new(
        problem: &'a Problem,
        method: Method,
        prior: Option<&'a mut Suggester>,
        first: &Observation,
        seed: Seed,
    ) -> Result<Self, Error> {
        let scenario = &problem.scenario;
        let mut rng = seed.stream(Purpose::InitialBelief, 0);
        let particles = problem.initial_particles(scenario.belief.rejection.particles, first, &mut rng)?;
        Ok(Self {
            problem,
            searcher: Searcher::new(problem, seed)?,
            belief: Some(Particles::uniform(particles)?),
            filter: RejectionFilter::new(scenario.belief.rejection.clone())?,
            proposer: prior.map(|prior| Proposer::new(problem, method, prior, first)),
            object_moved: false,
            streams: Streams {
                filter: seed.stream(Purpose::Filter, 0),
                suggestion: seed.stream(Purpose::Suggestion, 0),
            },
        })
    }
}

impl Controller for RejectionController<'_> {
    fn decide(&mut self, _: Option<&Particle>, remaining: usize) -> Result<Decision, Error> {
        let belief = self.belief.as_ref().expect("an episode ends when it is out of particles");
        Ok(self.searcher.decide(belief, remaining))
    }

    fn update(&mut self, action: Action, answer: &WorldStep) -> Result<Update, Error> {
        let model = &self.problem.model;
        let WorldStep { observation, joints_rad, .. } = answer;
        // Only moving the object pays more than a plain step; the goal, which pays too, ends the episode.
        self.object_moved |= answer.reward > self.problem.scenario.task.reward.step;
        let context = Context { model, observation, joints_rad, object_moved: self.object_moved };
        let belief = self.belief.take().expect("an episode ends when it is out of particles");
        let mut drawn = Vec::new();
        if let Some(proposer) = &mut self.proposer {
            drawn = proposer.propose(&belief, action, &context, &mut self.streams.suggestion);
        }
        let proposals = Proposals::new(&drawn);
        match self.filter.update(model, belief, &action, observation, proposals, &mut self.streams.filter) {
            Ok((belief, report)) => {
                let obstacle_share = obstacle_share(&belief);
                self.belief = Some(with_known_joints(belief, joints_rad)?);
                Ok(Update::Belief { report, obstacle_share })
            }
            Err(belief::Error::Depleted { attempts, .. }) => {
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

/// The arm's own joint positions, rad, are known: particles whose simulated move ended elsewhere (stopped by a contact) take them over after
/// each update.
///
/// # Errors
///
/// Never for a belief that came out of a filter: its weights are a distribution.
///
/// # Panics
///
/// Where a particle has another number of joints.
pub(crate) fn with_known_joints(
    particles: Particles<Particle>,
    joints_rad: &[f64],
) -> Result<Particles<Particle>, belief::Error> {
    let weights: Vec<f64> = particles.iter().map(|(_, weight)| weight).collect();
    let mut states = particles.into_states();
    for particle in &mut states {
        particle.state.joints_rad.copy_from_slice(joints_rad);
    }
    Particles::weighted(states, weights)
}

/// Share of the particles with an obstacle.
pub(crate) fn obstacle_share(particles: &Particles<Particle>) -> f64 {
    let with = particles.iter().filter(|(particle, _)| particle.theta.obstacle.is_some());
    with.map(|(_, weight)| weight).sum()
}
