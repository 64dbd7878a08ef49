//! What the policy of a search's rollouts earns by itself where it knows the whole world, and how far its leaf values are off.

use std::path::Path;

use anyhow::Result;
use physics_model::ObjectShape;
use pomdp::{Outcome, Policy as _, Purpose, Seed};
use problems::episode::mean_and_error;
use push_task::config::TaskConfig;
use push_task::{Action, GoalPolicy, Particle, PushModel};
use rayon::prelude::*;
use scenario::Problem;
use serde_json::{Value, json};

use crate::worlds::Worlds;

/// What to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// What worlds are drawn from.
    pub from: Worlds,
    /// Worlds.
    pub worlds: u32,
    /// Whether the obstacle is known only once it has been touched.
    pub blind: bool,
    /// Only this world, step by step.
    pub trace: Option<u32>,
}

/// Actions of an episode from which delays are fitted: later ones are mostly of episodes that are lost.
const FITTED_ACTIONS: usize = 12;

/// A plan of the policy, and the discounted return from there on.
#[derive(Clone, Copy, Debug)]
struct Outlook {
    shape: ObjectShape,
    bent: bool,
    steps: f64,
    discounted_return: f64,
}

/// How a world ended.
struct Played {
    solved: bool,
    discounted_return: f64,
    expected: f64,
    outlooks: Vec<Outlook>,
    /// Only where it is asked for.
    steps: Vec<Value>,
}

/// Follows the goal policy in every world.
///
/// # Errors
///
/// A scenario that does not load, and a distribution without a possible world.
pub fn run(root: &Path, task: &Task) -> Result<Value> {
    let from = &task.from;
    let problem = Problem::assemble(&from.selection(root, "paper").load()?, root)?;
    let play = |world: u32| play(&problem, task, Seed(from.seed).child(Purpose::World, u64::from(world)));
    if let Some(world) = task.trace {
        return Ok(json!(play(world)?.steps));
    }
    let played: Vec<Played> = (0..task.worlds).into_par_iter().map(play).collect::<Result<_>>()?;
    let each = |of: &dyn Fn(&Played) -> f64| -> Vec<f64> { played.iter().map(of).collect() };
    let (mean_return, standard_error) = mean_and_error(&each(&|world| world.discounted_return));
    let unsolved: Vec<usize> = (0..played.len()).filter(|&world| !played[world].solved).collect();
    Ok(json!({
        "domain": from.domain, "robot": from.arm.robot, "seed": from.seed, "worlds": played.len(), "blind": task.blind, "set": from.overrides.set,
        "commit": scenario::commit(root),
        "solved": played.len() - unsolved.len(),
        "return": mean_return, "standard_error": standard_error,
        "leaf_value": mean_and_error(&each(&|world| world.expected)).0,
        "leaf_value_error": mean_and_error(&each(&|world| (world.expected - world.discounted_return).abs())).0,
        "delays": delays(&problem.truth.config().task, &played),
        "unsolved": unsolved,
    }))
}

fn play(problem: &Problem, asked: &Task, seed: Seed) -> Result<Played> {
    let model = &problem.truth;
    let policy = GoalPolicy;
    let mut particle = problem.sample_world(&mut seed.stream(Purpose::World, 0))?;
    let mut rng = seed.stream(Purpose::Truth, 0);
    model.initial_observation(&mut particle, &mut rng);
    let task = model.config().task.clone();
    let expected = policy.leaf_value(model, &particle, task.horizon);
    let mut played =
        Played { solved: false, discounted_return: 0.0, expected, outlooks: Vec::new(), steps: Vec::new() };
    let mut earned = Vec::new();
    let (mut weight, mut known) = (1.0, !asked.blind);
    for left in (1..=task.horizon).rev() {
        let mut believed = particle.clone();
        if !known {
            (believed.theta.obstacle, believed.state.obstacle) = (None, None);
        }
        if task.horizon - left < FITTED_ACTIONS
            && let Some((steps, bent)) = GoalPolicy::plan(model, &particle)
        {
            // What was earned before and its weight, until the return is known.
            earned.push((played.discounted_return, weight));
            let shape = particle.theta.object.shape;
            played.outlooks.push(Outlook { shape, bent, steps, discounted_return: 0.0 });
        }
        let action = policy.action(model, &believed, &mut rng);
        if asked.trace.is_some() {
            played.steps.push(state(model, &particle, action, policy.leaf_value(model, &particle, left)));
        }
        let (step, report) = model.act(&mut particle, action, &mut rng);
        known |= report.obstacle_touched;
        played.discounted_return += weight * step.reward;
        weight *= task.discount;
        if step.outcome != Outcome::Continue {
            played.solved = step.outcome == Outcome::Terminal;
            break;
        }
    }
    for (outlook, (before, weight)) in played.outlooks.iter_mut().zip(earned) {
        outlook.discounted_return = (played.discounted_return - before) / weight;
    }
    Ok(played)
}

/// By shape and way, the number and the factor that make a plan's steps the actions whose worth is nearest to what was earned.
fn delays(task: &TaskConfig, played: &[Played]) -> Value {
    let all: Vec<&Outlook> = played.iter().flat_map(|world| &world.outlooks).collect();
    let fit = |shape: ObjectShape, bent: bool| {
        let some: Vec<&&Outlook> =
            all.iter().filter(|outlook| outlook.shape == shape && outlook.bent == bent).collect();
        let squares = |fixed: f64, factor: f64| -> f64 {
            let error = |o: &&&Outlook| GoalPolicy::worth(task, fixed + factor * o.steps, true) - o.discounted_return;
            some.iter().map(|outlook| error(outlook).powi(2)).sum()
        };
        let grid = (0..32).flat_map(|a| (6..26).map(move |k| (f64::from(a) / 2.0, f64::from(k) / 10.0)));
        let best = grid.map(|(a, k)| (squares(a, k), a, k)).min_by(|x, y| x.0.total_cmp(&y.0));
        best.filter(|_| !some.is_empty())
            .map(|(_, fixed, factor)| json!({ "fixed": fixed, "factor": factor, "plans": some.len() }))
    };
    let rows = [ObjectShape::Box, ObjectShape::Cylinder, ObjectShape::Sphere]
        .map(|shape| (shape.name().to_owned(), json!({ "straight": fit(shape, false), "bent": fit(shape, true) })));
    Value::Object(rows.into_iter().collect())
}

fn state(model: &PushModel, particle: &Particle, action: Action, value: f64) -> Value {
    let mm = |position: [f64; 3]| position.map(|metres| (metres * 1000.0).round());
    let obstacle = particle.theta.obstacle.as_ref().zip(particle.state.obstacle.as_ref());
    json!({
        "tool_mm": mm(model.tool_position_m(&particle.state.joints_rad)),
        "object_mm": mm(particle.state.object.position_m),
        "object": format!("{:?} {:.3?}", particle.theta.object.shape, particle.theta.object.size_m),
        "obstacle_mm": obstacle.map(|(_, body)| mm(body.position_m)),
        "obstacle": obstacle.map(|(theta, _)| format!("{:?} {:.3?}", theta.shape, theta.size_m)),
        "action": action.index(), "value": value,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task(blind: bool, trace: Option<u32>) -> Task {
        let from = Worlds {
            domain: "D4".into(),
            arm: program::Arm { robot: "sawyer".into() },
            seed: 1,
            overrides: program::Overrides::default(),
        };
        Task { from, worlds: 40, blind, trace }
    }

    fn root() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }

    #[test]
    fn an_obstacle_that_has_to_be_felt_costs_return_and_the_same_seed_says_the_same() {
        let [seen, felt] = [false, true].map(|blind| run(&root(), &task(blind, None)).unwrap());
        let value = |figures: &Value, key: &str| figures[key].as_f64().unwrap();
        assert!(value(&seen, "return") > value(&felt, "return") + 1.0, "{seen} {felt}");
        assert_eq!(seen["leaf_value"], felt["leaf_value"], "the same worlds");
        assert_eq!(value(&felt, "solved") as usize + felt["unsolved"].as_array().unwrap().len(), 40);
        assert_eq!(felt, run(&root(), &task(true, None)).unwrap());
    }

    #[test]
    fn a_trace_has_the_steps_of_its_world_alone() {
        let steps = run(&root(), &task(false, Some(3))).unwrap();
        let steps = steps.as_array().unwrap();
        assert!((5..=40).contains(&steps.len()), "{} steps", steps.len());
        assert!(steps.iter().all(|step| step["action"].as_u64().unwrap() < 10 && step["tool_mm"].is_array()));
    }

    #[test]
    fn delays_are_found_again() {
        let problem = Problem::assemble(&scenario::Selection::new(root()).load().unwrap(), &root()).unwrap();
        let task = &problem.truth.config().task;
        // The goal with the first action pays its reward, less one action.
        assert_eq!(GoalPolicy::worth(task, 1.0, true), task.reward.step + task.reward.goal);
        let outlook = |steps: f64| Outlook {
            shape: ObjectShape::Sphere,
            bent: true,
            steps,
            discounted_return: GoalPolicy::worth(task, 2.0 + 1.2 * steps, true),
        };
        let outlooks = (1..12).map(|steps| outlook(f64::from(steps))).collect();
        let world = Played { solved: true, discounted_return: 0.0, expected: 0.0, outlooks, steps: Vec::new() };
        let found = delays(task, &[world]);
        assert_eq!(found["sphere"]["bent"], json!({ "fixed": 2.0, "factor": 1.2, "plans": 11 }));
        assert!(found["sphere"]["straight"].is_null() && found["box"]["bent"].is_null());
    }
}
