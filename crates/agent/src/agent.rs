//! The loop.

use belief::Particles;
use planner::{Pomcp, SearchReport};
use pomdp::{Discretise as _, Outcome, Policy, Prior as _, Proposals, Purpose, Rng, Seed, discounted_return};
use prior::Suggester;
use push_task::sampling::effects::{log_density as log_density_of_effects, sample as sample_effects};
use push_task::{Action, GoalPolicy, HeuristicPolicy, Observation, Particle, PushModel};
use scenario::{Filter, Problem, Rollouts, Tracker, with_known_joints};

use crate::births::with_births;
use crate::{BeliefErrors, Episode, Error, Glimpse, Method, Reason, StepRecord, Watcher, World};

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
enum Mind<'a> {
    /// No search: the last measured position of the object.
    Heuristic,
    /// Search from the true state.
    Oracle(Box<Pomcp<PushModel>>),
    /// Search from the belief.
    Belief(Box<Pomcp<PushModel>>, Particles<Particle>, Tracker<'a>),
}

impl Mind<'_> {
    /// The belief, where there is one.
    fn belief(&self) -> Option<&Particles<Particle>> {
        match self {
            Self::Belief(_, particles, _) => Some(particles),
            Self::Heuristic | Self::Oracle(_) => None,
        }
    }

    /// Keeps how far the belief is from the world's truth, where there are both.
    fn note_errors(&self, world: &dyn World, errors: &mut BeliefErrors) {
        if let (Some(particles), Some(truth)) = (self.belief(), world.truth()) {
            errors.push(particles, truth);
        }
    }
}

struct Streams {
    search: Rng,
    filter: Rng,
    suggestion: Rng,
}

impl Streams {
    fn of(seed: Seed) -> Self {
        Self {
            search: seed.stream(Purpose::Search, 0),
            filter: seed.stream(Purpose::Filter, 0),
            suggestion: seed.stream(Purpose::Suggestion, 0),
        }
    }
}

impl<'a> Agent<'a> {
    /// An agent for `problem`.
    ///
    /// # Errors
    ///
    /// [`Error::NoPrior`] where the method needs one and none is given; [`Error::NoDensity`] where the filter could not weigh what it
    /// suggests.
    pub fn new(problem: &'a Problem, method: Method, prior: Option<&Suggester>) -> Result<Self, Error> {
        if method.needs_prior() && prior.is_none() {
            return Err(Error::NoPrior { method: method.name() });
        }
        let filter = problem.scenario.belief.filter;
        match (method, filter) {
            (Method::RnnMax | Method::RnnSampling, Filter::Weighted) => {
                return Err(Error::NoDensity { method: method.name() });
            }
            (Method::Mixture, Filter::Rejection) => return Err(Error::NoWeights { method: method.name() }),
            _ => {}
        }
        let prior = if method.needs_prior() { prior.cloned() } else { None };
        Ok(Self { problem, method, prior })
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
        let horizon = self.problem.scenario.task.horizon;
        let model = &self.problem.model;
        let mut streams = Streams::of(seed);
        let (mut observation, mut joints_rad) = match world.reset() {
            Err(Error::World(error)) => return Ok(Episode::failed(sentence(&error))),
            reset => reset?,
        };
        if let Some(prior) = &mut self.prior {
            prior.reset();
            prior.suggest(None, &observation);
        }
        let mut mind = self.first_mind(&observation, seed)?;
        let mut belief_errors = BeliefErrors::default();
        mind.note_errors(world, &mut belief_errors);
        let (truth, belief) = (world.truth(), mind.belief());
        watcher.see(&Glimpse { joints_rad: &joints_rad, truth, belief, search: None, step: None });
        let mut object_moved = false;
        let mut steps: Vec<StepRecord> = Vec::new();
        let mut depletions = 0;
        let mut reason = Reason::Horizon;
        let mut failure = None;
        for time in 0..horizon {
            let (mut record, search) =
                self.decide(&mut mind, world, &observation, &joints_rad, horizon - time, &mut streams)?;
            let answer = match world.act(record.action) {
                Err(Error::World(error)) => {
                    (reason, failure) = (Reason::WorldFailed, Some(sentence(&error)));
                    break;
                }
                answer => answer?,
            };
            // Only moving the object (or reaching the goal, which ends the episode) pays more than a plain step.
            object_moved |= answer.reward > self.problem.scenario.task.reward.step;
            record.note_answer(&answer);
            observation = answer.observation;
            joints_rad = answer.joints_rad;
            let context = Context { model, observation: &observation, joints_rad: &joints_rad, object_moved };
            let next = self.carry_on(mind, &mut record, answer.outcome, &context, &mut streams)?;
            let (truth, belief) = (world.truth(), next.as_ref().ok().and_then(Mind::belief));
            let search = search.as_ref();
            watcher.see(&Glimpse { joints_rad: &joints_rad, truth, belief, search, step: Some(&record) });
            mind = match next {
                Ok(next) => next,
                Err(end) => {
                    depletions += usize::from(end == Reason::Depleted);
                    reason = end;
                    steps.push(record);
                    break;
                }
            };
            mind.note_errors(world, &mut belief_errors);
            depletions += usize::from(record.update.as_ref().is_some_and(|u| u.acceptance == 0.0 || u.recoveries > 0));
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
        let belief_errors = (!belief_errors.is_empty()).then_some(belief_errors);
        Ok(Episode { reason, discounted_return, depletions, steps, belief_errors, failure })
    }

    /// What the agent carries on with after an answer; why the episode ends, where it does.
    fn carry_on<'m>(
        &mut self,
        mind: Mind<'m>,
        record: &mut StepRecord,
        outcome: Outcome,
        context: &Context<'_>,
        streams: &mut Streams,
    ) -> Result<Result<Mind<'m>, Reason>, Error> {
        Ok(match outcome {
            Outcome::Terminal => Err(Reason::Goal),
            Outcome::Diverged => Err(Reason::Diverged),
            Outcome::Continue => self.learn(mind, record, context, streams)?.ok_or(Reason::Depleted),
        })
    }

    /// What the agent carries on after an action and its observation; `None` where no particle is left.
    fn learn<'m>(
        &mut self,
        mind: Mind<'m>,
        record: &mut StepRecord,
        context: &Context<'_>,
        streams: &mut Streams,
    ) -> Result<Option<Mind<'m>>, Error> {
        let Context { model, observation, .. } = *context;
        Ok(Some(match mind {
            Mind::Belief(mut search, particles, mut filter) => {
                let rng = &mut streams.suggestion;
                let (particles, proposals) = self.suggestions(particles, &record.action, context, rng)?;
                let mobility = model.config().world.obstacle_mobility;
                let prior = self.prior.as_ref();
                let unknown = &self.problem.beliefs.effects;
                let density = |p: &Particle| {
                    let log_density = prior.map_or(f64::NEG_INFINITY, |prior| prior.log_density(mobility, p));
                    log_density + log_density_of_effects(unknown, &p.theta.effects)
                };
                let proposals = match self.method {
                    Method::Mixture => Proposals::weighted(&proposals, &density),
                    _ => Proposals::unweighted(&proposals),
                };
                match filter.update(model, particles, record.action, observation, proposals, &mut streams.filter) {
                    Ok((particles, report)) => {
                        record.transitions += report.transitions;
                        record.update = Some(report);
                        record.obstacle_share = Some(obstacle_share(&particles));
                        search.prune(&record.action, &model.key(observation));
                        Mind::Belief(search, with_known_joints(particles, context.joints_rad)?, filter)
                    }
                    Err(belief::Error::Depleted { attempts, .. }) => {
                        record.transitions += attempts;
                        return Ok(None);
                    }
                    Err(error) => return Err(error.into()),
                }
            }
            Mind::Oracle(mut search) => {
                search.prune(&record.action, &model.key(observation));
                Mind::Oracle(search)
            }
            Mind::Heuristic => Mind::Heuristic,
        }))
    }

    /// The belief before `action` with the network's births, and the network's suggestions after it; none without a network.
    fn suggestions(
        &mut self,
        belief: Particles<Particle>,
        action: &Action,
        context: &Context<'_>,
        rng: &mut Rng,
    ) -> Result<(Particles<Particle>, Vec<Particle>), Error> {
        let Some(prior) = &mut self.prior else { return Ok((belief, Vec::new())) };
        let config = &self.problem.scenario.agent;
        let belief = with_births(context.model, prior, belief, config.birth_share, rng)?;
        prior.suggest(Some(action), context.observation);
        let mut proposals = suggest(prior, self.method, context, config.proposals, rng);
        complete_effects(self.problem, &belief, &mut proposals, rng);
        Ok((belief, proposals))
    }

    fn first_mind(&self, observation: &Observation, seed: Seed) -> Result<Mind<'a>, Error> {
        let scenario = &self.problem.scenario;
        let search = || Pomcp::new(scenario.planner.clone()).map(Box::new);
        Ok(match self.method {
            Method::Heuristic => Mind::Heuristic,
            Method::Oracle => Mind::Oracle(search()?),
            Method::NoRnn | Method::RnnMax | Method::RnnSampling | Method::Mixture => {
                let mut rng = seed.stream(Purpose::InitialBelief, 0);
                let particles = self.problem.initial_particles(scenario.belief.particles(), observation, &mut rng)?;
                let particles = Particles::uniform(particles)?;
                Mind::Belief(search()?, particles, self.problem.tracker(observation)?)
            }
        })
    }

    fn decide(
        &self,
        mind: &mut Mind<'_>,
        world: &dyn World,
        observation: &Observation,
        joints_rad: &[f64],
        remaining: usize,
        streams: &mut Streams,
    ) -> Result<(StepRecord, Option<SearchReport<Action>>), Error> {
        let model = &self.problem.model;
        let policy: &(dyn Policy<PushModel> + Sync) = match self.problem.scenario.agent.rollouts {
            Rollouts::Heuristic => &HeuristicPolicy,
            Rollouts::Goal => &GoalPolicy,
        };
        let searched = match mind {
            Mind::Heuristic => None,
            Mind::Oracle(search) => {
                let truth = world.truth().ok_or(Error::NoTruth)?.clone();
                let belief = Particles::uniform(vec![truth])?;
                Some(search.search(model, &belief, policy, remaining, &mut streams.search))
            }
            Mind::Belief(search, particles, _) => {
                Some(search.search(model, particles, policy, remaining, &mut streams.search))
            }
        };
        let reused = searched.as_ref().map_or(0, |report| report.reused);
        let (action, value, simulations, transitions) = match &searched {
            Some(report) => {
                let value = report.actions[report.action.index()].value;
                (report.action, Some(value), report.simulations, report.transitions)
            }
            None => (self.heuristic_action(observation, joints_rad), None, 0, 0),
        };
        let record = StepRecord {
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
            out_of_reach: false,
            obstacle_touched: false,
        };
        Ok((record, searched))
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
    if method == Method::Mixture {
        // All of them: leaving out what does not fit would change the density that they are drawn from.
        return (0..count).filter_map(|_| prior.sample_raw(table_height_m, rng)).collect();
    }
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

/// What the network knows nothing of: unknown parameters of effects, from their first distribution, and what effects remember, from the
/// belief before the action.
fn complete_effects(problem: &Problem, belief: &Particles<Particle>, proposals: &mut [Particle], rng: &mut Rng) {
    let memory = belief.iter().next().and_then(|(particle, _)| problem.model.memory_after_action(particle));
    for particle in proposals {
        particle.theta.effects = sample_effects(&problem.beliefs.effects, rng);
        particle.memory.clone_from(&memory);
    }
}

/// An error with its causes.
fn sentence(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

fn obstacle_share(particles: &Particles<Particle>) -> f64 {
    let with = particles.iter().filter(|(particle, _)| particle.theta.obstacle.is_some());
    with.map(|(_, weight)| weight).sum()
}

#[cfg(test)]
mod tests;
