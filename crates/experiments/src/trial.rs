//! One trial: a drawn world, one method.

use agent::{Agent, BeliefErrors, Episode, Method, Network, Reason, SimulatedWorld, Watcher};
use pomdp::{Purpose, Seed};
use scenario::Problem;
use serde::{Deserialize, Serialize};

use crate::clock::{DecisionTimes, Stopwatch, Timed};
use crate::{Error, Worlds};

/// What is kept of a trial: one line of `trials.jsonl`. All before `seconds` is a function of scenario, method, trial and seed; `seconds` and
/// what follows is the clock's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialRecord {
    /// Method.
    pub method: Method,
    /// Number of the trial, from 0. Equal numbers are equal worlds, for every method.
    pub trial: u32,
    /// Seed of the trial.
    pub seed: u64,
    /// The object reached the goal region.
    pub success: bool,
    /// Why it ended.
    pub reason: Reason,
    /// Actions taken.
    pub steps: usize,
    /// Σ γ^t r_t.
    pub discounted_return: f64,
    /// Updates in which no simulated particle agreed with the observation.
    pub depletions: usize,
    /// Transitions simulated for search and belief.
    pub transitions: usize,
    /// Actions with a force above the limit.
    pub large_forces: usize,
    /// Actions that would have left the reachable region, and were not made.
    pub out_of_reach: usize,
    /// The world has an obstacle; false where an external one does not say.
    pub has_obstacle: bool,
    /// The object or the tool pushed against it.
    pub obstacle_touched: bool,
    /// Actions taken, by index.
    pub actions: Vec<u8>,
    /// Errors of the beliefs; null without a belief, or in a world that does not know its truth.
    pub belief_errors: Option<BeliefErrors>,
    /// What the world did wrong, where that ended the trial.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Wall-clock time of the trial, s.
    pub seconds: f64,
    /// Wall-clock time of all decisions, s: from an answer of the world to the next action.
    pub decision_seconds: f64,
    /// Wall-clock time of the slowest decision, s.
    pub slowest_decision_seconds: f64,
}

/// Plays trial number `trial` of `method` and reports it.
///
/// World, sensor noise, search, filter and suggestions have their own streams under the trial's seed, so methods share worlds and
/// noise.
///
/// # Errors
///
/// [`Error::Trial`] with its cause.
pub fn play(
    problem: &Problem,
    method: Method,
    prior: Option<&Network>,
    root: Seed,
    trial: u32,
) -> Result<(TrialRecord, Episode), Error> {
    play_watched(problem, method, prior, root, trial, &mut ())
}

/// The same before the eyes of a watcher.
///
/// # Errors
///
/// As [`play`].
pub fn play_watched(
    problem: &Problem,
    method: Method,
    prior: Option<&Network>,
    root: Seed,
    trial: u32,
    watcher: &mut dyn Watcher,
) -> Result<(TrialRecord, Episode), Error> {
    let failed = |source: agent::Error| Error::Trial { trial, method: method.name(), source };
    let started = Stopwatch::start();
    let seed = root.child(Purpose::World, u64::from(trial));
    let start = problem.sample_world(&mut seed.stream(Purpose::World, 0)).map_err(|e| failed(e.into()))?;
    let has_obstacle = start.theta.obstacle.is_some();
    let mut world = SimulatedWorld::new(&problem.truth, start, seed.stream(Purpose::Truth, 0));
    let mut timed = Timed::new(&mut world);
    let played = Agent::new(problem, method, prior).and_then(|mut a| a.run_watched(&mut timed, seed, watcher));
    let episode = played.map_err(failed)?;
    let times = timed.times();
    Ok((record(method, trial, seed, has_obstacle, &episode).timed(started, times), episode))
}

/// The same in an external world, which is asked for the scene of the trial. A world that fails ends the trial with a record, and the next
/// trial gets a fresh one.
///
/// # Errors
///
/// [`Error::NoWorld`] and [`Error::OtherWorld`] if there is no suitable world; [`Error::Trial`] if the method cannot be
/// played.
pub fn play_external(
    problem: &Problem,
    method: Method,
    prior: Option<&Network>,
    root: Seed,
    trial: u32,
    worlds: &Worlds,
) -> Result<(TrialRecord, Episode), Error> {
    let failed = |source: agent::Error| Error::Trial { trial, method: method.name(), source };
    let started = Stopwatch::start();
    let seed = root.child(Purpose::World, u64::from(trial));
    let mut agent = Agent::new(problem, method, prior).map_err(failed)?;
    let mut world = worlds.take(method, trial)?;
    let mut scene = world.episode(problem, trial, seed.0);
    let mut timed = Timed::new(&mut scene);
    let episode = match agent.run(&mut timed, seed) {
        // What it first measured cannot be: an object inside the tool, for example.
        Err(agent::Error::Scenario(error)) => Episode::failed(format!("the first observation and the task: {error}")),
        played => played.map_err(failed)?,
    };
    let times = timed.times();
    let has_obstacle = scene.has_obstacle().unwrap_or(false);
    if episode.failure.is_none() {
        worlds.give_back(world);
    }
    Ok((record(method, trial, seed, has_obstacle, &episode).timed(started, times), episode))
}

fn record(method: Method, trial: u32, seed: Seed, has_obstacle: bool, episode: &Episode) -> TrialRecord {
    TrialRecord {
        method,
        trial,
        seed: seed.0,
        success: episode.success(),
        reason: episode.reason,
        steps: episode.steps.len(),
        discounted_return: episode.discounted_return,
        depletions: episode.depletions,
        transitions: episode.transitions(),
        large_forces: episode.steps.iter().filter(|s| s.large_force).count(),
        out_of_reach: episode.steps.iter().filter(|s| s.out_of_reach).count(),
        has_obstacle,
        obstacle_touched: episode.steps.iter().any(|s| s.obstacle_touched),
        actions: episode.steps.iter().map(|s| s.action.into()).collect(),
        belief_errors: episode.belief_errors.clone(),
        failure: episode.failure.clone(),
        seconds: 0.0,
        decision_seconds: 0.0,
        slowest_decision_seconds: 0.0,
    }
}

impl TrialRecord {
    fn timed(self, started: Stopwatch, times: DecisionTimes) -> Self {
        let (decision_seconds, slowest_decision_seconds) = (times.sum_secs, times.slowest_secs);
        Self { seconds: started.seconds(), decision_seconds, slowest_decision_seconds, ..self }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A trial that reached the goal.
    pub(crate) fn record() -> TrialRecord {
        TrialRecord {
            method: Method::NoRnn,
            trial: 0,
            seed: 1,
            success: true,
            reason: Reason::Goal,
            steps: 4,
            discounted_return: 0.5,
            depletions: 0,
            transitions: 10,
            large_forces: 0,
            out_of_reach: 0,
            has_obstacle: false,
            obstacle_touched: false,
            actions: vec![2; 4],
            belief_errors: None,
            failure: None,
            seconds: 0.1,
            decision_seconds: 0.08,
            slowest_decision_seconds: 0.03,
        }
    }
}
