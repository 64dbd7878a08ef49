//! How the filters of the presets fare on the pushing task: the same worlds, actions and observations, the same most transitions an update.

use std::path::Path;

use agent::with_known_joints;
use anyhow::Result;
use belief::Particles;
use pomdp::{Outcome, Policy as _, Proposals, Purpose, Seed};
use push_task::{Action, HeuristicPolicy, Observation, Particle};
use scenario::{Problem, Selection};
use serde_json::{Map, Value, json};

/// Presets that are compared.
pub const PRESETS: [&str; 2] = ["paper", "surmise"];

/// What to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// Domain.
    pub domain: String,
    /// Worlds.
    pub episodes: u64,
    /// Root seed.
    pub seed: u64,
    /// With the budgets of `--quick`.
    pub quick: bool,
    /// Scenario entries, key=value, for both presets.
    pub set: Vec<String>,
}

/// What the arm did and saw.
struct Record {
    truth: Particle,
    first: Observation,
    steps: Vec<(Action, Observation, Vec<f64>)>,
}

/// Sums over the episodes of one filter.
#[derive(Default)]
struct Sums {
    depleted: u32,
    updates: u32,
    transitions: usize,
    recoveries: usize,
    /// Effective size before resampling (agreeing particles of a filter without weights) and how many updates that was, by step.
    effective: Vec<(f64, u32)>,
    mass: f64,
    friction: f64,
    shape: f64,
    obstacle: f64,
}

/// Tracks `task.episodes` worlds with the filter of each preset.
///
/// # Errors
///
/// A scenario that does not load, or a world that contradicts it.
pub fn run(root: &Path, task: &Task, mut note: impl FnMut(&str)) -> Result<Value> {
    let problem = |preset: &str| -> Result<Problem> {
        let selection = Selection {
            domain: task.domain.clone(),
            preset: preset.into(),
            quick: task.quick,
            set: task.set.clone(),
            ..Selection::new(root)
        };
        Ok(Problem::assemble(&selection.load()?, root)?)
    };
    let problems = [problem(PRESETS[0])?, problem(PRESETS[1])?];
    let mut sums = [Sums::default(), Sums::default()];
    for episode in 0..task.episodes {
        let record = play(&problems[0], Seed(task.seed), episode)?;
        for (problem, sums) in problems.iter().zip(&mut sums) {
            track(problem, &record, Seed(task.seed), episode, sums)?;
        }
        if (episode + 1) % 10 == 0 {
            note(&format!("{} of {} episodes", episode + 1, task.episodes));
        }
    }
    let mut result = Map::new();
    let n = task.episodes as f64;
    for ((preset, problem), s) in PRESETS.iter().zip(&problems).zip(&sums) {
        let effective: Vec<f64> = s.effective.iter().map(|(sum, count)| sum / f64::from(*count)).collect();
        result.insert(
            (*preset).into(),
            json!({
                "depleted_episodes": s.depleted,
                "recoveries": s.recoveries,
                "updates": s.updates,
                "transitions_per_update": s.transitions as f64 / f64::from(s.updates.max(1)),
                "most_transitions_per_update": problem.scenario.belief.transitions(),
                "effective_size_by_step": effective,
                "particles": problem.scenario.belief.particles(),
                "object_mass_log_error": s.mass / n,
                "object_friction_error": s.friction / n,
                "object_shape_probability": s.shape / n,
                "obstacle_brier": s.obstacle / n,
            }),
        );
    }
    result.insert(
        "provenance".into(),
        json!({ "domain": task.domain, "episodes": task.episodes, "seed": task.seed, "quick": task.quick, "set": task.set,
                "policy": "heuristic", "commit": scenario::commit(root) }),
    );
    Ok(Value::Object(result))
}

/// An episode of the heuristic policy, which knows the true object.
fn play(problem: &Problem, seed: Seed, episode: u64) -> Result<Record> {
    let mut world = seed.stream(Purpose::World, episode);
    let mut noise = seed.stream(Purpose::Truth, episode);
    let mut particle = problem.sample_world(&mut world)?;
    let model = &problem.truth;
    let first = model.initial_observation(&mut particle, &mut noise);
    let mut steps = Vec::new();
    for _ in 0..problem.scenario.task.horizon {
        let action = HeuristicPolicy.action(model, &particle, &mut noise);
        let step = model.act(&mut particle, action, &mut noise).0;
        if step.outcome != Outcome::Continue {
            break;
        }
        steps.push((action, step.observation, particle.state.joints_rad.clone()));
    }
    Ok(Record { truth: particle, first, steps })
}

fn track(problem: &Problem, record: &Record, seed: Seed, episode: u64, sums: &mut Sums) -> Result<()> {
    let count = problem.scenario.belief.particles();
    let mut start = seed.stream(Purpose::InitialBelief, episode);
    let mut rng = seed.stream(Purpose::Filter, episode);
    let mut particles = Particles::uniform(problem.initial_particles(count, &record.first, &mut start)?)?;
    let mut tracker = problem.tracker(&record.first)?;
    for (index, (action, observation, joints_rad)) in record.steps.iter().enumerate() {
        let before = particles.clone();
        let updated = tracker.update(&problem.model, before, *action, observation, Proposals::none(), &mut rng);
        match updated {
            Ok((next, report)) => {
                sums.updates += 1;
                sums.transitions += report.transitions;
                sums.recoveries += report.recoveries;
                if sums.effective.len() == index {
                    sums.effective.push((0.0, 0));
                }
                sums.effective[index].0 += report.effective_sample_size_before;
                sums.effective[index].1 += 1;
                particles = with_known_joints(next, joints_rad)?;
            }
            Err(belief::Error::Depleted { attempts, .. }) => {
                sums.depleted += 1;
                sums.updates += 1;
                sums.transitions += attempts;
                break;
            }
            Err(error) => return Err(error.into()),
        }
    }
    // Errors of the last belief there was.
    let truth = &record.truth.theta;
    let mean = |value: &dyn Fn(&Particle) -> f64| particles.iter().map(|(p, w)| w * value(p)).sum::<f64>();
    sums.mass += (mean(&|p| p.theta.object.mass_kg.ln()) - truth.object.mass_kg.ln()).abs();
    sums.friction += (mean(&|p| p.theta.object.friction) - truth.object.friction).abs();
    sums.shape += mean(&|p| f64::from(u8::from(p.theta.object.shape == truth.object.shape)));
    let obstacle = mean(&|p| f64::from(u8::from(p.theta.obstacle.is_some())));
    sums.obstacle += (obstacle - f64::from(u8::from(truth.obstacle.is_some()))).powi(2);
    Ok(())
}
