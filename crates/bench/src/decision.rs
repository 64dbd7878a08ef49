//! How long a decision takes: the search before each action, and the update of the belief after it.

use std::cell::Cell;
use std::path::Path;
use std::time::Instant;

use agent::{Agent, Episode, Error, Method, Network, SimulatedWorld, StepView, Watcher, World, WorldStep};
use anyhow::{Context as _, Result};
use pomdp::{Purpose, Seed};
use push_task::{Action, Observation, Particle};
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
    /// Threads of search and update; 0 is for all cores.
    pub threads: usize,
}

/// What took place between two moments.
#[derive(Clone, Debug, Default)]
struct Part {
    seconds: Vec<f64>,
    transitions: Vec<f64>,
}

/// Time and work of decisions.
#[derive(Clone, Debug, Default)]
struct Parts {
    search: Part,
    update: Part,
}

/// When the part that runs began. World and watcher hold it together.
struct Stopwatch(Cell<Instant>);

impl Stopwatch {
    #[expect(clippy::disallowed_methods, reason = "a benchmark measures time")]
    fn start() -> Self {
        Self(Cell::new(Instant::now()))
    }

    /// Seconds since the last call.
    #[expect(clippy::disallowed_methods, reason = "a benchmark measures time")]
    fn lap(&self) -> f64 {
        let now = Instant::now();
        now.duration_since(self.0.replace(now)).as_secs_f64()
    }
}

/// A world that notes how long it waited for an action.
struct Timed<'a> {
    world: SimulatedWorld<'a>,
    watch: &'a Stopwatch,
    waited: &'a Cell<f64>,
}

impl World for Timed<'_> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
        self.world.reset()
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, Error> {
        self.waited.set(self.watch.lap());
        let answer = self.world.act(action);
        self.watch.lap();
        answer
    }

    fn truth(&self) -> Option<&Particle> {
        self.world.truth()
    }
}

/// Sorts what the stopwatch says into search and update.
struct Onlooker<'a> {
    watch: &'a Stopwatch,
    waited: &'a Cell<f64>,
    parts: Parts,
}

impl Watcher for Onlooker<'_> {
    fn see(&mut self, view: &StepView<'_>) {
        let seconds = self.watch.lap();
        let Some(step) = view.step else { return };
        let of_update = step.update.as_ref().map_or(0, |update| update.transitions);
        let add = |part: &mut Part, seconds, transitions: usize| {
            part.seconds.push(seconds);
            part.transitions.push(transitions as f64);
        };
        add(&mut self.parts.search, self.waited.get(), step.transitions - of_update);
        // From the last action nothing is learnt.
        if step.update.is_some() {
            add(&mut self.parts.update, seconds, of_update);
        }
        self.watch.lap();
    }
}

/// Plays the worlds one after the other with the preset `surmise` and its network.
///
/// # Errors
///
/// A scenario or network that does not load, and a world that contradicts it.
pub fn run(root: &Path, task: &Task, note: impl Fn(&str) + Sync) -> Result<Value> {
    let from = &task.from;
    let scenario = from.selection(root, "surmise").load()?;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(task.threads).build().context("cannot start so many threads")?;
    let problem = Problem::assemble(&scenario, root)?.searched_by(pool.current_num_threads());
    let network = Network::load(&Network::default_folder(root, &problem, false), &problem)?;
    let mut parts = pool.install(|| {
        (0..task.worlds).try_fold(Parts::default(), |parts, number| {
            let seed = Seed(from.seed).child(Purpose::World, u64::from(number));
            let (parts, episode) = play(&problem, &network, seed, parts)?;
            note(&format!("world {number}: {} after {} actions", episode.reason.name(), episode.steps.len()));
            anyhow::Ok(parts)
        })
    })?;
    Ok(json!({
        "domain": from.domain, "robot": from.arm.robot, "worlds": task.worlds, "seed": from.seed, "set": from.overrides.set,
        "threads": scenario.planner.threads, "commit": scenario::commit(root),
        "search": figures(&mut parts.search), "update": figures(&mut parts.update),
    }))
}

/// Plays one world, and adds its decisions.
fn play(problem: &Problem, network: &Network, seed: Seed, parts: Parts) -> Result<(Parts, Episode)> {
    let start = problem.sample_world(&mut seed.stream(Purpose::World, 0))?;
    let (watch, waited) = (Stopwatch::start(), Cell::new(0.0));
    let world = SimulatedWorld::new(&problem.truth, start, seed.stream(Purpose::Truth, 0));
    let mut world = Timed { world, watch: &watch, waited: &waited };
    let mut onlooker = Onlooker { watch: &watch, waited: &waited, parts };
    let episode = Agent::new(problem, Method::Mixture, Some(network))?.run_watched(&mut world, seed, &mut onlooker)?;
    Ok((onlooker.parts, episode))
}

/// Number, mean and quantiles.
fn figures(part: &mut Part) -> Value {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (seconds, transitions) = (mean(&part.seconds), mean(&part.transitions));
    let quantile = |values: &mut [f64], level| statistics::quantile(values, level);
    json!({
        "count": part.seconds.len(), "transitions": transitions, "seconds": seconds,
        "median_s": quantile(&mut part.seconds, 0.5), "q90_s": quantile(&mut part.seconds, 0.9), "max_s": quantile(&mut part.seconds, 1.0),
        "us_per_transition": 1e6 * seconds / transitions,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_are_counted_with_their_search_and_their_update() {
        let root = scenario::find_root(env!("CARGO_MANIFEST_DIR").as_ref()).unwrap();
        let set = ["planner.budget={ transitions = 200 }", "task.horizon=3"].map(String::from).to_vec();
        let from = Worlds {
            domain: "D1".into(),
            arm: program::Arm { robot: "sawyer".into() },
            seed: 3,
            overrides: program::Overrides { set },
        };
        let task = Task { from, worlds: 2, threads: 1 };
        let found = run(&root, &task, |_| ()).unwrap();
        assert_eq!((&found["search"]["count"], &found["update"]["count"]), (&json!(6), &json!(6)), "{found}");
        let number = |part: &str, key: &str| found[part][key].as_f64().unwrap();
        for part in ["search", "update"] {
            // Quantiles are of the same numbers as the mean, and work takes time.
            assert!(number(part, "median_s") > 0.0 && number(part, "max_s") >= number(part, "seconds"), "{found}");
            assert!(number(part, "transitions") > 0.0, "{found}");
        }
        assert!(number("search", "transitions") <= 200.0, "{found}");
    }
}
