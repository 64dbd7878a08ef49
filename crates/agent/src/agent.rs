//! The loop.

use belief::Particles;
use physics_model::effect::unknown::{log_density as log_density_of_effects, sample as sample_effects};
use physics_model::{Action, GoalPolicy, HeuristicPolicy, Observation, Particle, PushModel};
use planner::Pomcp;
use pomdp::{Discretise as _, Outcome, Policy, Prior as _, Proposals, Purpose, Rng, Seed, discounted_return};
use prior::Suggester;
use scenario::{Filter, Problem, Rollouts, Tracker, with_known_joints};

use crate::births::with_births;
use crate::{BeliefErrors, Episode, Error, Method, Reason, StepRecord, World};

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
    /// Keeps how far the belief is from the world's truth, where there are both.
    fn note_errors(&self, world: &dyn World, errors: &mut BeliefErrors) {
        if let (Self::Belief(_, particles, _), Some(truth)) = (self, world.truth()) {
            errors.push(particles, truth);
        }
    }
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
        let horizon = self.problem.scenario.task.horizon;
        let model = &self.problem.model;
        let mut streams = Streams {
            search: seed.stream(Purpose::Search, 0),
            filter: seed.stream(Purpose::Filter, 0),
            suggestion: seed.stream(Purpose::Suggestion, 0),
        };
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
        let mut object_moved = false;
        let mut steps: Vec<StepRecord> = Vec::new();
        let mut depletions = 0;
        let mut reason = Reason::Horizon;
        let mut failure = None;
        for time in 0..horizon {
            let mut record = self.decide(&mut mind, world, &observation, &joints_rad, horizon - time, &mut streams)?;
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
            match answer.outcome {
                Outcome::Terminal => reason = Reason::Goal,
                Outcome::Diverged => reason = Reason::Diverged,
                Outcome::Continue => {}
            }
            if answer.outcome != Outcome::Continue {
                steps.push(record);
                break;
            }
            let context = Context { model, observation: &observation, joints_rad: &joints_rad, object_moved };
            let Some(next) = self.learn(mind, &mut record, &context, &mut streams)? else {
                depletions += 1;
                steps.push(record);
                reason = Reason::Depleted;
                break;
            };
            mind = next;
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
    ) -> Result<StepRecord, Error> {
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
            out_of_reach: false,
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
mod tests {
    use std::path::Path;

    use physics_model::ObjectShape;
    use pomdp::{Outcome, Updater as _};
    use scenario::{Selection, find_root};

    use super::*;
    use crate::{SimulatedWorld, WorldStep};

    fn problem(domain: &str, set: &[&str]) -> (Problem, Suggester) {
        let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let set = set.iter().map(ToString::to_string).collect();
        let selection = Selection { domain: domain.into(), quick: true, set, ..Selection::new(&root) };
        let problem = Problem::assemble(&selection.load().unwrap(), &root).unwrap();
        let prior = Suggester::load(&root.join("assets/priors/sawyer"), "sawyer", &problem.model).unwrap();
        (problem, prior)
    }

    fn world(problem: &Problem, seed: Seed) -> SimulatedWorld<'_> {
        let start = problem.sample_world(&mut seed.stream(Purpose::World, 0)).unwrap();
        SimulatedWorld::new(&problem.truth, start, seed.stream(Purpose::Truth, 0))
    }

    /// The shipped prior after three moves towards the object.
    fn after_three_moves(problem: &Problem, prior: &mut Suggester) -> WorldStep {
        let mut world = world(problem, Seed(2));
        prior.reset();
        prior.suggest(None, &world.reset().unwrap().0);
        let push = Action::ALL[2];
        let mut last = world.act(push).unwrap();
        prior.suggest(Some(&push), &last.observation);
        for _ in 0..2 {
            last = world.act(push).unwrap();
            prior.suggest(Some(&push), &last.observation);
        }
        last
    }

    #[test]
    fn suggestions_are_possible_worlds_that_agree_with_the_measurement() {
        let (problem, mut prior) = problem("D4", &[]);
        let last = after_three_moves(&problem, &mut prior);
        let model = &problem.model;
        let context =
            Context { model, observation: &last.observation, joints_rad: &last.joints_rad, object_moved: true };
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let sampled = suggest(&prior, Method::RnnSampling, &context, 40, &mut rng);
        assert_eq!(sampled.len(), 40);
        let measured = last.observation.object_pose().0;
        let mut off_m = Vec::new();
        for particle in &sampled {
            assert!(model.check(particle).is_ok() && model.agrees(particle, &last.observation));
            assert_eq!(particle.state.joints_rad, last.joints_rad);
            assert!(particle.object_moved);
            let p = particle.state.object.position_m;
            off_m.push((p[0] - measured[0]).hypot(p[1] - measured[1]));
        }
        off_m.sort_by(f64::total_cmp);
        // Measured to 2 mm; among the draws of one episode 3 mm in the median.
        assert!(off_m[20] < 0.006, "{} m off in the median", off_m[20]);
        assert!(sampled.iter().any(|p| *p != sampled[0]), "draws differ");
        let shapes: std::collections::BTreeSet<ObjectShape> = sampled.iter().map(|p| p.theta.object.shape).collect();
        assert!(shapes.len() > 1, "more than one shape is still possible");
        let strongest = suggest(&prior, Method::RnnMax, &context, 40, &mut rng);
        assert!(strongest.len() == 40 && strongest.iter().all(|p| *p == strongest[0]), "one suggestion, many times");
        // Elsewhere nothing agrees.
        let mut elsewhere = last.observation.clone();
        let at = elsewhere.0.len() - 7;
        elsewhere.0[at] += 0.5;
        let context = Context { observation: &elsewhere, ..context };
        assert!(suggest(&prior, Method::RnnSampling, &context, 5, &mut rng).is_empty());
    }

    #[test]
    fn suggestions_join_the_belief_and_bring_an_unknown_obstacle_into_it() {
        let (problem, prior) = problem("obstacle", &["planner.budget={transitions=60}", "task.horizon=6"]);
        let play = |method, prior| {
            let mut agent = Agent::new(&problem, method, prior).unwrap();
            agent.run(&mut world(&problem, Seed(5)), Seed(5)).unwrap()
        };
        let with = play(Method::RnnSampling, Some(&prior));
        let updates: Vec<_> = with.steps.iter().filter_map(|s| s.update.as_ref()).collect();
        assert!(!updates.is_empty() && updates.iter().all(|u| u.proposed > 0), "{updates:?}");
        assert!(with.steps.iter().filter_map(|s| s.obstacle_share).any(|share| share > 0.0));
        assert!(with.steps[1..].iter().any(|s| s.reused > 0), "the pruned tree keeps its statistics");
        let without = play(Method::NoRnn, None);
        assert!(without.steps.iter().filter_map(|s| s.update.as_ref()).all(|u| u.proposed == 0));
        assert!(without.steps.iter().filter_map(|s| s.obstacle_share).all(|share| share == 0.0));
    }

    #[test]
    fn births_bring_an_unknown_obstacle_into_a_weighted_belief() {
        let (problem, mut prior) = problem("obstacle", &[]);
        let mut world = world(&problem, Seed(5));
        let (observation, _) = world.reset().unwrap();
        prior.reset();
        prior.suggest(None, &observation);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let belief = Particles::uniform(problem.initial_particles(100, &observation, &mut rng).unwrap()).unwrap();
        assert_eq!(obstacle_share(&belief), 0.0);
        let renewed = with_births(&problem.model, &prior, belief.clone(), 0.2, &mut rng).unwrap();
        let born = renewed.count() - 100;
        assert!((10..=20).contains(&born), "{born} of 20 possible");
        // Each of the 20 draws stands for a hundredth, whether the others were possible or not.
        for (index, (particle, weight)) in renewed.iter().enumerate() {
            let expected = if index < 100 { (1.0 - 0.01 * born as f64) / 100.0 } else { 0.01 };
            assert!((weight - expected).abs() < 1e-12, "{index}: {weight} {expected}");
            assert!(problem.model.check(particle).is_ok());
            let near = |p: &Particle| p.state.object.position_m[..2] == particle.state.object.position_m[..2];
            assert!(belief.iter().any(|(p, _)| near(p)), "{index} stands where no particle of the belief stood");
        }
        let share = obstacle_share(&renewed);
        assert!(share > 0.02 && share < 0.2, "{share}");
        // Through the whole loop.
        let settings = ["belief.filter=weighted", "planner.budget={transitions=60}", "task.horizon=6"];
        let shares = |birth: &str| {
            let (problem, prior) = self::problem("obstacle", &[&settings[..], &[birth]].concat());
            let mut agent = Agent::new(&problem, Method::Mixture, Some(&prior)).unwrap();
            let episode = agent.run(&mut self::world(&problem, Seed(5)), Seed(5)).unwrap();
            let shares: Vec<f64> = episode.steps.iter().filter_map(|s| s.obstacle_share).collect();
            assert!(!shares.is_empty());
            shares
        };
        assert!(shares("agent.birth_share=0.2").iter().any(|share| *share > 0.0));
        assert!(shares("agent.birth_share=0.0").iter().all(|share| *share == 0.0));
    }

    #[test]
    fn particles_take_over_the_joints_of_the_arm() {
        let (problem, _) = problem("D1", &[]);
        let mut world = world(&problem, Seed(1));
        let (observation, joints) = world.reset().unwrap();
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let particles = Particles::uniform(problem.initial_particles(20, &observation, &mut rng).unwrap()).unwrap();
        let action = Action::ALL[0];
        let step = world.act(action).unwrap();
        assert_eq!(step.outcome, Outcome::Continue);
        let mut filter = belief::RejectionFilter::new(problem.scenario.belief.rejection.clone()).unwrap();
        let (particles, _) =
            filter.update(&problem.model, particles, &action, &step.observation, Proposals::none(), &mut rng).unwrap();
        let shifted: Vec<f64> = step.joints_rad.iter().map(|q| q + 0.001).collect();
        let particles = with_known_joints(particles, &shifted).unwrap();
        assert!(particles.iter().all(|(p, _)| p.state.joints_rad == shifted));
        assert_ne!(joints, step.joints_rad);
    }
}
