//! Episodes of the loop in small worlds.

use std::path::Path;

use agent::{Agent, Error, Method, Network, Reason, SimulatedWorld, World, WorldStep};
use pomdp::{Outcome, Purpose, Seed};
use push_task::{Action, Observation, Particle};
use scenario::{Problem, Selection, find_root};

fn problem(domain: &str, set: &[&str]) -> Problem {
    preset("paper", domain, set)
}

fn preset(preset: &str, domain: &str, set: &[&str]) -> Problem {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let set = set.iter().map(ToString::to_string).collect();
    let selection =
        Selection { preset: preset.into(), domain: domain.into(), quick: true, set, ..Selection::new(&root) };
    Problem::assemble(&selection.load().unwrap(), &root).unwrap()
}

fn world(problem: &Problem, seed: Seed) -> SimulatedWorld<'_> {
    let start = problem.sample_world(&mut seed.stream(Purpose::World, 0)).unwrap();
    SimulatedWorld::new(&problem.truth, start, seed.stream(Purpose::Truth, 0))
}

#[test]
fn the_oracle_pushes_a_box_to_the_goal() {
    let problem = problem("D1", &["planner.budget={transitions=600}", "task.horizon=20"]);
    let successes = (0..4)
        .filter(|&trial| {
            let seed = Seed(trial);
            let mut agent = Agent::new(&problem, Method::Oracle, None).unwrap();
            let episode = agent.run(&mut world(&problem, seed), seed).unwrap();
            assert_eq!(episode.success(), episode.steps.last().unwrap().reward > 50.0);
            episode.success()
        })
        .count();
    assert!(successes >= 3, "{successes} of 4");
}

#[test]
fn the_same_seed_plays_the_same_episode() {
    let problem = problem("D3", &["planner.budget={transitions=100}", "task.horizon=4"]);
    let play = |seed| {
        let mut agent = Agent::new(&problem, Method::NoRnn, None).unwrap();
        agent.run(&mut world(&problem, seed), seed).unwrap()
    };
    let first = play(Seed(3));
    assert_eq!(play(Seed(3)), first);
    assert_ne!(play(Seed(4)), first);
    for step in &first.steps {
        let most = problem.scenario.belief.rejection.max_attempts;
        assert!(step.transitions > 0 && step.transitions <= 100 + most, "{step:?}");
    }
}

#[test]
fn the_bridge_filter_keeps_the_belief_through_an_episode_within_its_transitions() {
    let problem = preset("surmise", "D4", &["planner.budget={transitions=100}", "task.horizon=8"]);
    let config = &problem.scenario.belief.bridge;
    let play = |seed| {
        let mut agent = Agent::new(&problem, Method::NoRnn, None).unwrap();
        agent.run(&mut world(&problem, seed), seed).unwrap()
    };
    let first = play(Seed(3));
    assert_eq!(play(Seed(3)), first);
    assert!(first.steps.len() == 8 || first.reason != Reason::Horizon, "{:?}", first.reason);
    for (index, step) in first.steps.iter().enumerate() {
        let most = config.draws * (index + 1 + config.kept);
        assert!(step.transitions > 0 && step.transitions <= 100 + most, "{step:?}");
    }
    let updates: Vec<_> = first.steps.iter().filter_map(|s| s.update.as_ref()).collect();
    assert!(updates.len() >= 4, "{} updates", updates.len());
    for update in updates {
        assert!(update.effective_sample_size >= config.effective * (1.0 - 1e-6), "{update:?}");
        assert!((0.0..=1.0).contains(&update.temperature), "{update:?}");
    }
}

#[test]
fn the_network_brings_an_unknown_obstacle_into_the_bridge_filter() {
    let problem = preset("surmise", "obstacle", &["planner.budget={transitions=60}", "task.horizon=4"]);
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let network = Network::load(&root.join("assets/priors/sawyer-fixed"), &problem).unwrap();
    let shares = |method, network| {
        let mut agent = Agent::new(&problem, method, network).unwrap();
        let episode = agent.run(&mut world(&problem, Seed(5)), Seed(5)).unwrap();
        let shares: Vec<f64> = episode.steps.iter().filter_map(|s| s.obstacle_share).collect();
        assert!(!shares.is_empty());
        shares
    };
    assert!(shares(Method::Mixture, Some(&network)).iter().all(|share| *share > 0.0 && *share < 1.0));
    assert!(shares(Method::NoRnn, None).iter().all(|share| *share == 0.0));
}

#[test]
fn a_method_that_needs_a_prior_says_so() {
    let problem = problem("D1", &[]);
    for method in [Method::RnnMax, Method::RnnSampling] {
        assert!(matches!(Agent::new(&problem, method, None), Err(Error::NoPrior { .. })), "{method:?}");
    }
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let prior = Network::load(&root.join("assets/priors/sawyer"), &problem).unwrap();
    let bridge = self::problem("D1", &["belief.filter=\"bridge\""]);
    let unweighted = Agent::new(&problem, Method::Mixture, Some(&prior));
    assert!(matches!(unweighted, Err(Error::NoWeights { .. })), "the filter has no weights");
    let refused = Agent::new(&bridge, Method::RnnSampling, Some(&prior));
    assert!(matches!(refused, Err(Error::NoDensity { .. })), "the filter needs the density of what is suggested");
    let refused = Agent::new(&bridge, Method::Mixture, Some(&prior));
    assert!(matches!(refused, Err(Error::OtherNetwork { .. })), "the filter asks what the episode began with");
}

/// A world whose object jumps by half a metre: nothing in any belief explains that.
struct Jumping<'a>(SimulatedWorld<'a>);

impl World for Jumping<'_> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
        self.0.reset()
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, Error> {
        let mut step = self.0.act(action)?;
        let at = step.observation.0.len() - 7;
        step.observation.0[at] += 0.5;
        step.outcome = Outcome::Continue;
        Ok(step)
    }

    fn truth(&self) -> Option<&Particle> {
        self.0.truth()
    }
}

#[test]
fn an_observation_that_no_particle_explains_ends_the_episode_as_depleted() {
    let problem = problem("D1", &["planner.budget={transitions=60}"]);
    let seed = Seed(1);
    let mut agent = Agent::new(&problem, Method::NoRnn, None).unwrap();
    let episode = agent.run(&mut Jumping(world(&problem, seed)), seed).unwrap();
    assert_eq!((episode.reason, episode.steps.len(), episode.depletions), (Reason::Depleted, 1, 1));
}

/// A world whose object is first seen where the task has ended.
struct Ended<'a>(SimulatedWorld<'a>, [f64; 2]);

impl World for Ended<'_> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
        let (mut observation, joints_rad) = self.0.reset()?;
        let at = observation.0.len() - 7;
        observation.0[at..at + 2].copy_from_slice(&self.1);
        Ok((observation, joints_rad))
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, Error> {
        self.0.act(action)
    }

    fn truth(&self) -> Option<&Particle> {
        self.0.truth()
    }
}

#[test]
fn a_first_observation_that_no_start_explains_ends_the_episode_before_its_first_action() {
    let problem = preset("surmise", "D1", &[]);
    let goal = &problem.scenario.task.goal;
    let seed = Seed(1);
    let mut agent = Agent::new(&problem, Method::NoRnn, None).unwrap();
    let episode = agent.run(&mut Ended(world(&problem, seed), [goal.x_m, goal.y_m]), seed).unwrap();
    assert_eq!((episode.reason, episode.steps.len()), (Reason::Depleted, 0));
    assert_eq!(episode.belief_errors, None, "there was no belief");
}

#[test]
fn the_errors_of_the_first_belief_and_of_each_update_are_kept_where_there_is_a_belief_and_a_truth() {
    let problem = problem("D4", &["planner.budget={transitions=60}", "task.horizon=5"]);
    let play = |method| {
        let mut agent = Agent::new(&problem, method, None).unwrap();
        agent.run(&mut world(&problem, Seed(3)), Seed(3)).unwrap()
    };
    let episode = play(Method::NoRnn);
    let updates = episode.steps.iter().filter(|step| step.update.is_some()).count();
    let errors = episode.belief_errors.unwrap();
    assert!(updates > 0 && errors.len() == updates + 1, "{updates} updates, {} errors", errors.len());
    assert_eq!((errors.shape_probability.len(), errors.obstacle_m.len()), (errors.len(), errors.len()));
    let shares = errors.shape_probability.iter().chain(&errors.obstacle_probability);
    assert!(shares.chain(&errors.friction).all(|value| (0.0..=1.0).contains(value)), "{errors:?}");
    for method in [Method::Oracle, Method::Heuristic] {
        assert_eq!(play(method).belief_errors, None, "{method:?} has no belief");
    }
}

#[test]
fn the_first_belief_of_the_obstacle_task_knows_no_obstacle() {
    let unaware = problem("obstacle", &[]);
    let seed = Seed(1);
    let (observation, _) = world(&unaware, seed).reset().unwrap();
    let mut rng = seed.stream(Purpose::InitialBelief, 0);
    let particles = unaware.initial_particles(100, &observation, &mut rng).unwrap();
    assert!(particles.iter().all(|p| p.theta.obstacle.is_none()));
    let aware = problem("D4", &[]);
    let particles = aware.initial_particles(100, &observation, &mut rng).unwrap();
    let with = particles.iter().filter(|p| p.theta.obstacle.is_some()).count();
    // Three quarters of the domain's worlds: within 4 standard deviations of 4.3.
    assert!((58..=92).contains(&with), "{with} of 100");
    let (position, _) = observation.object_pose();
    for particle in &particles {
        let p = particle.state.object.position_m;
        assert!((p[0] - position[0]).abs() < 0.01 && (p[1] - position[1]).abs() < 0.01, "{p:?} {position:?}");
    }
}
