//! RockSample(7, 8) and (11, 11), Tag and Tiger with POMCP and classes of observations, and threads.
//!
//! Episodes are those of `problems::episode`: belief updates as in POMCP 1.0, a search of a fixed number of simulations per move with
//! preferred actions in rollouts, c = 20 (the span of the rewards of legal actions), 90 actions at most. In the tree RockSample has
//! preferred actions, Tag all of them: POMCP 1.0 prefers to tag in corners alone, which costs 1 to 2 of the return. Particles: as many as simulations,
//! from 1024 to 8192. Speed is simulations by thread CPU time of the searches alone. Published returns are those at 1 s a move.

use std::time::Instant;

use anyhow::{Result, ensure};
use planner::{ActionPriors, Backup, Budget, Config, Exploration, Observations, Pomcp, RolloutDepth, SearchReport};
use pomdp::{Belief, Discretise, Perturb, Policy, Purpose, Rng, Seed};
use problems::bits::{Advice, Knowledge};
use problems::episode::mean_and_error;
use problems::tiger::{Action, Growls, OPTIMAL};
use problems::{InitialState, Particles, RockSample, Tag, Tiger, episode};
use serde_json::{Map, Value, json};

use super::Effort;
use crate::physics::thread_secs;

/// Most actions of an episode, and horizon of a simulation: γ^90 = 0.01.
const HORIZON: usize = 90;
/// Simulations a move, with the share of the episodes that are played with so many.
pub(super) const BUDGETS: [(usize, u32); 3] = [(1 << 10, 1), (1 << 13, 2), (1 << 15, 4)];

/// Constant c of UCB1.
const EXPLORATION: f64 = 20.0;

fn config(simulations: usize, exploration: f64) -> Config {
    Config {
        budget: Budget::Simulations(simulations),
        exploration: Exploration::Fixed(exploration),
        depth: HORIZON,
        rollout_depth: RolloutDepth::Full,
        action_priors: ActionPriors::Full,
        observations: Observations::Classes,
        backup: Backup::Mean,
        nodes: 1 << 24,
        ..Config::default()
    }
}

/// Adds a row a problem.
///
/// # Errors
///
/// Where one and several threads disagree.
pub(super) fn run(effort: Effort, result: &mut Map<String, Value>, note: &mut impl FnMut(&str)) -> Result<()> {
    let published = |rows: &[(&str, f64, Option<f64>)]| -> Value {
        rows.iter().map(|(who, mean, stderr)| ((*who).to_string(), json!({ "mean": mean, "stderr": stderr }))).collect()
    };
    for (name, model, rows) in [
        (
            "rocksample_7_8",
            RockSample::standard_7_8(),
            [("pomcp", 20.71, Some(0.21)), ("despot", 20.93, Some(0.30)), ("sarsop", 21.47, None)].as_slice(),
        ),
        (
            "rocksample_11_11",
            RockSample::standard_11_11(),
            [("pomcp", 20.01, None), ("despot", 21.75, None), ("sarsop", 21.56, None)].as_slice(),
        ),
    ] {
        note(name);
        result.insert(name.into(), problem(&model, &Advice::default(), effort, &published(rows), note));
    }
    note("tag");
    let rows = [("pomcp", -7.14, Some(0.28)), ("despot", -6.23, Some(0.26)), ("sarsop", -6.03, None)];
    let advice = Advice { tree: Knowledge::Legal, ..Advice::default() };
    result.insert("tag".into(), problem(&Tag::new(), &advice, effort, &published(&rows), note));
    note("tiger");
    result.insert("tiger".into(), tiger());
    note("threads");
    result.insert("threads".into(), threads(effort)?);
    Ok(())
}

/// Returns and speed of one problem.
fn problem<M>(model: &M, advice: &Advice, effort: Effort, published: &Value, note: &mut impl FnMut(&str)) -> Value
where
    M: InitialState + Discretise + Perturb + Sync,
    M::Key: Send,
    M::State: Sync,
    Advice: Policy<M>,
{
    let mut returns = Map::new();
    let (mut simulations, mut secs) = (0, 0.0);
    let budgets = if effort.quick { &BUDGETS[..1] } else { &BUDGETS };
    for &(budget, share) in budgets {
        let episodes = (effort.episodes / share).max(2);
        let mut played = Vec::new();
        let mut depleted = 0;
        for item in 0..u64::from(episodes) {
            let mut planner = Pomcp::new(config(budget, EXPLORATION)).expect("a valid configuration");
            let mut search = Seed(1).stream(Purpose::Search, item);
            let mut world = Seed(1).stream(Purpose::Truth, item);
            let decide = |belief: &Particles<M::State>, last: Option<(&M::Action, &M::Observation)>| {
                if let Some((action, observation)) = last {
                    planner.prune(action, &model.key(observation));
                }
                let start = thread_secs();
                let report = planner.search(model, belief, advice, HORIZON, &mut search);
                secs += thread_secs() - start;
                simulations += report.simulations;
                report.action
            };
            let particles = budget.clamp(1024, 8192);
            let episode = episode::play(model, particles, HORIZON, advice, &mut world, decide);
            depleted += u32::from(episode.depleted);
            played.push(episode.discounted_return);
        }
        let (mean, stderr) = mean_and_error(&played);
        note(&format!("  {budget} simulations: {mean:.2} ± {stderr:.2} (n = {episodes})"));
        returns
            .insert(budget.to_string(), json!({ "mean": mean, "stderr": stderr, "n": episodes, "depleted": depleted }));
    }
    json!({ "simulations_per_second": simulations as f64 / secs, "returns": returns, "published": published })
}

/// Listens: rollouts that cost little.
struct Listens;

impl Policy<Tiger> for Listens {
    fn action(&self, _model: &Tiger, _left: &bool, _rng: &mut Rng) -> Action {
        Action::Listen
    }
}

/// Root values at 2^18 simulations over eight seeds; they lie below the exact ones as long as simulations explore.
fn tiger() -> Value {
    let tiger = Tiger { ends_on_open: false };
    let row = |(horizon, exact): (usize, f64)| {
        let value = |seed| {
            let config = Config { depth: horizon, ..config(1 << 18, 40.0) };
            let mut planner = Pomcp::new(config).expect("a valid configuration");
            let mut rng = Seed(seed).stream(Purpose::Search, 0);
            let report = planner.search(&tiger, &Growls(0), &Listens, horizon, &mut rng);
            report.actions.iter().map(|a| a.value).fold(f64::NEG_INFINITY, f64::max)
        };
        let values: Vec<f64> = (1..=8).map(value).collect();
        let (mean, stderr) = mean_and_error(&values);
        (horizon.to_string(), json!({ "exact": exact, "root_value": mean, "stderr": stderr, "n": 8 }))
    };
    OPTIMAL.into_iter().filter(|(horizon, _)| *horizon <= 5).map(row).collect()
}

/// As many trees as cores, on one thread and on all: wall time and whether the statistics agree.
fn threads(effort: Effort) -> Result<Value> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let model = RockSample::standard_7_8();
    let belief = Particles::initial(&model, 1024, &mut Seed(1).stream(Purpose::InitialBelief, 0));
    let budget = if effort.quick { 1 << 14 } else { 1 << 17 };
    let mut ratios = Vec::new();
    for item in 0..7 {
        let timed = |threads| {
            let config = Config { trees: cores, threads, ..config(budget, EXPLORATION) };
            let mut planner = Pomcp::new(config).expect("a valid configuration");
            #[expect(clippy::disallowed_methods, reason = "a benchmark measures time; no result depends on it")]
            let start = Instant::now();
            let report = search(&mut planner, &model, &belief, item);
            (start.elapsed().as_secs_f64(), report)
        };
        let ((alone, one), (together, all)) = (timed(1), timed(cores));
        ensure!(one == all, "one thread and {cores} threads gave different statistics");
        ratios.push(alone / together);
    }
    ratios.sort_by(f64::total_cmp);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load: Option<f64> = load.split_whitespace().next().and_then(|text| text.parse().ok());
    Ok(
        json!({ "cores": cores, "speedup": ratios[ratios.len() / 2], "best": ratios.last(), "same_statistics": true, "load": load }),
    )
}

fn search(
    planner: &mut Pomcp<RockSample>,
    model: &RockSample,
    belief: &(impl Belief<State = problems::rock_sample::State> + Sync),
    item: u64,
) -> SearchReport<problems::rock_sample::Action> {
    planner.search(model, belief, &Advice::default(), HORIZON, &mut Seed(1).stream(Purpose::Search, item))
}
