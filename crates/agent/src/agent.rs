//! The loop.

use belief::{Particles, RejectionFilter};
use physics_model::{Action, HeuristicPolicy, Observation, Particle, PushModel};
use planner::Pomcp;
use pomdp::{Discretise as _, Prior as _, Outcome, Purpose, Rng, Seed, Updater as _, discounted_return};
use prior::Suggester;
use scenario::Problem;

use crate::{Episode, Error, Method, Reason, StepRecord, World};

/// Attempts at drawing one possible suggestion.
const DRAWS_PER_PROPOSAL: usize = 10;

/// Plays episodes of a problem with one method.
#[derive(Debug)]
pub struct Agent<'a> {
    problem: &'a Problem,
    method: Method,
    prior: Option<Suggester>,
}

/// What an agent carries from step to step.
enum Mind {
    /// No search: the last measured position of the object.
    Heuristic,
    /// Search from the true state.
    Oracle(Box<Pomcp<PushModel>>),
    /// Search from the belief.
    Belief(Box<Pomcp<PushModel>>, Particles<Particle>),
}

struct Streams {
    search: Rng,
    filter: Rng,
    suggestion: Rng,
}

impl<'a> Agent<'a> {
    /// An agent for `problem`.
    ///
    /// # Errors
    ///
    /// [`Error::NoPrior`] where the method needs one and none is given.
    pub fn new(problem: &'a Problem, method: Method, prior: Option<&Suggester>) -> Result<Self, Error> {
        if method.needs_prior() && prior.is_none() {
            return Err(Error::NoPrior { method: method.name() });
        }
        let prior = if method.needs_prior() { prior.cloned() } else { None };
        Ok(Self { problem, method, prior })
    }

    /// Plays one episode. `seed` is the trial's own seed.
    ///
    /// # Errors
    ///
    /// Where the world fails, or the scenario and the first observation contradict each other. Depletion is not an error: it
    /// ends the episode.
    pub fn run(&mut self, world: &mut dyn World, seed: Seed) -> Result<Episode, Error> {
        let horizon = self.problem.scenario.task.horizon;
        let model = &self.problem.model;
        let mut streams = Streams {
            search: seed.stream(Purpose::Search, 0),
            filter: seed.stream(Purpose::Filter, 0),
            suggestion: seed.stream(Purpose::Suggestion, 0),
        };
        let (mut observation, mut joints_rad) = world.reset()?;
        if let Some(prior) = &mut self.prior {
            prior.reset();
            prior.suggest(None, &observation);
        }
        let mut mind = self.first_mind(&observation, seed)?;
        let mut object_moved = false;
        let mut steps: Vec<StepRecord> = Vec::new();
        let mut depletions = 0;
        let mut reason = Reason::Horizon;
        for time in 0..horizon {
            let mut record = self.decide(&mut mind, world, &observation, &joints_rad, horizon - time, &mut streams)?;
            let answer = world.act(record.action)?;
            // Only moving the object (or reaching the goal, which ends the episode) pays more than a plain step.
            object_moved |= answer.reward > self.problem.scenario.task.reward.step;
            record.observation = answer.observation.clone();
            record.reward = answer.reward;
            record.large_force = answer.report.events.large_force;
            record.obstacle_touched = answer.report.obstacle_touched;
            observation = answer.observation;
            joints_rad = answer.joints_rad;
            match answer.outcome {
                Outcome::Terminal => reason = Reason::Goal,
                Outcome::Diverged => reason = Reason::Diverged,
                Outcome::Continue => {}
            }
            if answer.outcome != Outcome::Continue {
                steps.push(record);
                break;
            }
            let proposals = match &mut self.prior {
                Some(prior) => {
                    prior.suggest(Some(&record.action), &observation);
                    let context = Context { model, observation: &observation, joints_rad: &joints_rad, object_moved };
                    let count = self.problem.scenario.agent.proposals;
                    suggest(prior, self.method, &context, count, &mut streams.suggestion)
                }
                None => Vec::new(),
            };
            mind = match mind {
                Mind::Belief(mut search, particles) => {
                    let filter = RejectionFilter::new(self.problem.scenario.belief.clone())?;
                    match filter.update(model, particles, &record.action, &observation, &proposals, &mut streams.filter)
                    {
                        Ok((particles, report)) => {
                            depletions += usize::from(report.acceptance == 0.0);
                            record.transitions += report.transitions;
                            record.update = Some(report);
                            record.obstacle_share = Some(obstacle_share(&particles));
                            search.prune(&record.action, &model.key(&observation));
                            Mind::Belief(search, with_joints(particles, &joints_rad)?)
                        }
                        Err(belief::Error::Depleted { attempts, .. }) => {
                            depletions += 1;
                            record.transitions += attempts;
                            steps.push(record);
                            reason = Reason::Depleted;
                            break;
                        }
                        Err(error) => return Err(error.into()),
                    }
                }
                Mind::Oracle(mut search) => {
                    search.prune(&record.action, &model.key(&observation));
                    Mind::Oracle(search)
                }
                Mind::Heuristic => Mind::Heuristic,
            };
            tracing::debug!(
                time,
                action = record.action.index(),
                value = record.value,
                reward = record.reward,
                acceptance = record.update.as_ref().map(|u| u.acceptance),
                obstacle_share = record.obstacle_share,
                "step"
            );
            steps.push(record);
        }
        let rewards = steps.iter().map(|s| s.reward);
        let discounted_return = discounted_return(rewards, self.problem.scenario.task.discount);
        Ok(Episode { reason, discounted_return, depletions, steps })
    }

    fn first_mind(&self, observation: &Observation, seed: Seed) -> Result<Mind, Error> {
        let scenario = &self.problem.scenario;
        let search = || Pomcp::new(scenario.planner.clone()).map(Box::new);
        Ok(match self.method {
            Method::Heuristic => Mind::Heuristic,
            Method::Oracle => Mind::Oracle(search()?),
            Method::NoRnn | Method::RnnMax | Method::RnnSampling => {
                let mut rng = seed.stream(Purpose::InitialBelief, 0);
                let particles = self.problem.initial_particles(scenario.belief.particles, observation, &mut rng)?;
                let particles = Particles::uniform(particles)?;
                Mind::Belief(search()?, particles)
            }
        })
    }

    fn decide(
        &self,
        mind: &mut Mind,
        world: &dyn World,
        observation: &Observation,
        joints_rad: &[f64],
        remaining: usize,
        streams: &mut Streams,
    ) -> Result<StepRecord, Error> {
        let model = &self.problem.model;
        let searched = match mind {
            Mind::Heuristic => None,
            Mind::Oracle(search) => {
                let truth = world.truth().ok_or(Error::NoTruth)?.clone();
                let belief = Particles::uniform(vec![truth])?;
                Some(search.search(model, &belief, &HeuristicPolicy, remaining, &mut streams.search))
            }
            Mind::Belief(search, particles) => {
                Some(search.search(model, particles, &HeuristicPolicy, remaining, &mut streams.search))
            }
        };
        let reused = searched.as_ref().map_or(0, |report| report.reused);
        let (action, value, simulations, transitions) = match searched {
            Some(report) => {
                let value = report.actions[report.action.index()].value;
                (report.action, Some(value), report.simulations, report.transitions)
            }
            None => (self.heuristic_action(observation, joints_rad), None, 0, 0),
        };
        Ok(StepRecord {
            action,
            observation: Observation(Vec::new()),
            reward: 0.0,
            value,
            simulations,
            reused,
            transitions,
            update: None,
            obstacle_share: None,
            large_force: false,
            obstacle_touched: false,
        })
    }

    /// The heuristic policy knows the tool (from the arm) and the object's centre (measured), nothing else.
    fn heuristic_action(&self, observation: &Observation, joints_rad: &[f64]) -> Action {
        HeuristicPolicy.action_towards(&self.problem.model, joints_rad, observation.object_pose().0)
    }
}

struct Context<'a> {
    model: &'a PushModel,
    observation: &'a Observation,
    joints_rad: &'a [f64],
    object_moved: bool,
}

/// Suggested particles after the latest observation: possible worlds that agree with it as far as can be told without
/// simulating the action again.
fn suggest(prior: &Suggester, method: Method, context: &Context<'_>, count: usize, rng: &mut Rng) -> Vec<Particle> {
    let complete = |mut particle: Particle| {
        particle.state.joints_rad = context.joints_rad.to_vec();
        particle.object_moved = context.object_moved;
        particle.force = context.model.measured_force(context.observation);
        let fits = context.model.check(&particle).is_ok() && context.model.agrees(&particle, context.observation);
        fits.then_some(particle)
    };
    let table_height_m = context.model.config().world.table_height_m;
    if method == Method::RnnMax {
        let strongest = prior.strongest(table_height_m).and_then(complete);
        return strongest.into_iter().flat_map(|particle| std::iter::repeat_n(particle, count)).collect();
    }
    let mut particles = Vec::with_capacity(count);
    for _ in 0..count * DRAWS_PER_PROPOSAL {
        if particles.len() == count {
            break;
        }
        particles.extend(prior.sample(table_height_m, rng).and_then(complete));
    }
    particles
}

/// The arm's own joint positions are known: particles whose simulated move ended elsewhere (stopped by a contact) take them over.
fn with_joints(particles: Particles<Particle>, joints_rad: &[f64]) -> Result<Particles<Particle>, Error> {
    let weights: Vec<f64> = particles.iter().map(|(_, weight)| weight).collect();
    let mut states = particles.into_states();
    for particle in &mut states {
        particle.state.joints_rad.copy_from_slice(joints_rad);
    }
    Ok(Particles::weighted(states, weights)?)
}

fn obstacle_share(particles: &Particles<Particle>) -> f64 {
    let with = particles.iter().filter(|(particle, _)| particle.theta.obstacle.is_some());
    with.map(|(_, weight)| weight).sum()
}
