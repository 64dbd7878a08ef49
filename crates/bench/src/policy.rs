//! What the policy of a search's rollouts earns by itself where it knows the whole world, and how far its leaf values are off.

use std::path::Path;

use anyhow::Result;
use pomdp::{Outcome, Policy as _, Purpose, Seed};
use push_task::{Action, GoalPolicy, Particle, PushModel};
use rayon::prelude::*;
use scenario::{Problem, Selection};
use serde_json::{Value, json};

/// What to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// Domain or scenario file.
    pub domain: String,
    /// Arm; `None` for the domain's own.
    pub robot: Option<String>,
    /// Worlds.
    pub worlds: u32,
    /// Root seed.
    pub seed: u64,
    /// Whether the obstacle is known only once it has been touched.
    pub blind: bool,
    /// Only this world, step by step.
    pub trace: Option<u32>,
    /// Scenario entries, key=value.
    pub set: Vec<String>,
}

/// How a world ended.
struct Played {
    solved: bool,
    discounted_return: f64,
    expected: f64,
    steps: Vec<Value>,
}

/// Follows the goal policy in every world.
///
/// # Errors
///
/// A scenario that does not load, and a distribution without a possible world.
pub fn run(root: &Path, task: &Task) -> Result<Value> {
    let (set, robot) = (task.set.clone(), task.robot.clone());
    let mut selection = Selection { domain: task.domain.clone(), set, ..Selection::new(root) };
    if let Some(robot) = robot {
        selection.robot = robot;
    }
    let problem = Problem::assemble(&selection.load()?, root)?;
    let worlds: Vec<u32> = task.trace.map_or_else(|| (0..task.worlds).collect(), |world| vec![world]);
    let played: Vec<Played> = worlds
        .par_iter()
        .map(|&world| play(&problem, task.blind, Seed(task.seed).child(Purpose::World, u64::from(world))))
        .collect::<Result<_>>()?;
    if task.trace.is_some() {
        return Ok(json!(played[0].steps));
    }
    let count = played.len() as f64;
    let mean = |of: &dyn Fn(&Played) -> f64| played.iter().map(of).sum::<f64>() / count;
    let mean_return = mean(&|world| world.discounted_return);
    let variance = mean(&|world| (world.discounted_return - mean_return).powi(2)) * count / (count - 1.0).max(1.0);
    let unsolved: Vec<u32> =
        worlds.iter().zip(&played).filter(|(_, world)| !world.solved).map(|(&index, _)| index).collect();
    Ok(json!({
        "domain": task.domain, "robot": task.robot, "seed": task.seed, "worlds": played.len(), "blind": task.blind, "set": task.set,
        "commit": scenario::commit(root),
        "solved": played.len() - unsolved.len(),
        "return": mean_return, "standard_error": (variance / count).sqrt(),
        "leaf_value": mean(&|world| world.expected),
        "leaf_value_error": mean(&|world| (world.expected - world.discounted_return).abs()),
        "unsolved": unsolved,
    }))
}

fn play(problem: &Problem, blind: bool, seed: Seed) -> Result<Played> {
    let model = &problem.truth;
    let policy = GoalPolicy;
    let mut particle = problem.sample_world(&mut seed.stream(Purpose::World, 0))?;
    let mut rng = seed.stream(Purpose::Truth, 0);
    model.initial_observation(&mut particle, &mut rng);
    let task = model.config().task.clone();
    let expected = policy.leaf_value(model, &particle, task.horizon);
    let mut played = Played { solved: false, discounted_return: 0.0, expected, steps: Vec::new() };
    let (mut weight, mut known) = (1.0, !blind);
    for left in (1..=task.horizon).rev() {
        let mut believed = particle.clone();
        if !known {
            (believed.theta.obstacle, believed.state.obstacle) = (None, None);
        }
        let action = policy.action(model, &believed, &mut rng);
        played.steps.push(state(model, &particle, action, policy.leaf_value(model, &particle, left)));
        let (step, report) = model.act(&mut particle, action, &mut rng);
        known |= report.obstacle_touched;
        played.discounted_return += weight * step.reward;
        weight *= task.discount;
        if step.outcome != Outcome::Continue {
            played.solved = step.outcome == Outcome::Terminal;
            break;
        }
    }
    Ok(played)
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
        Task { domain: "D4".into(), robot: None, worlds: 40, seed: 1, blind, trace, set: Vec::new() }
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
}
