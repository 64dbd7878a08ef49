//! How far a belief can be trusted: fresh worlds, played with the agent, and what prior, network and filter say at each step.
//!
//! Everything is about worlds: an interval of a figure is a bootstrap over them, because the steps of an episode share one world. The filter is
//! asked in the very episode that its agent plays. Prior and network, on the same history, give as many draws as the filter aims at.

mod episode;
mod figures;
mod reference;
mod summary;
mod table;

use std::path::{Path, PathBuf};
use std::time::Duration;

use agent::{ExternalWorld, Network, Timeouts, World as _, WorldAddress, WorldIdentity};
use anyhow::{Context as _, Result, bail, ensure};
use prior::posterior::STEP_VALUES;
use prior_training::starts;
use push_task::coordinates::START;
use rayon::prelude::*;
use scenario::{Problem, Selection};
use serde_json::{Value, json};
use whole_file::Existing;

use crate::worlds::Worlds;

pub use episode::{Row, World};
pub use table::table;

/// The preset whose belief is looked at.
const PRESET: &str = "surmise";
/// How long an external world may take for an answer.
const WORLD_LIMIT: Duration = Duration::from_secs(60);
/// What is missing in an answer.
const NO_DRAWN: &str = "expected `drawn` in its answer to `reset` (docs/src/reference/world-protocol.md)";
/// Keys of `task.json` that have to be those of the task.
const OF_TASK: [&str; 6] = ["version", "scenario", "seed", "network", "world", "reference"];
/// Version of what is kept of a world.
const VERSION: u32 = 2;
/// Most bytes of a world's file.
const MOST_BYTES: u64 = 1 << 24;

/// What to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// What worlds are drawn from.
    pub from: Worlds,
    /// Worlds.
    pub worlds: u32,
    /// With the budgets of `--quick`.
    pub quick: bool,
    /// Folder of the network; the default one where `None`.
    pub prior: Option<PathBuf>,
    /// World to play in; the simulated one where `None`. It has to say what it has drawn.
    pub world: Option<WorldAddress>,
    /// Particles of the exact posterior after the last action; not asked for where `None`.
    pub reference: Option<usize>,
}

/// An external world.
#[derive(Debug)]
struct External {
    address: WorldAddress,
    identity: WorldIdentity,
}

impl External {
    /// Starts it, and sets up world 0, to see whether it says what it has drawn. What else may be wrong with that world costs one world.
    fn new(address: &WorldAddress, problem: &Problem, seed: u64) -> Result<Self> {
        let mut world = ExternalWorld::start(address, timeouts(), problem)?;
        let identity = world.identity().clone();
        let mut episode = world.episode(problem, 0, episode::seed(seed, 0).0);
        let answered = episode.reset().is_ok();
        let silent = format!("the world {} does not say what it has drawn: {NO_DRAWN}", identity.name);
        ensure!(!answered || episode.drawn().is_some(), silent);
        Ok(Self { address: address.clone(), identity })
    }

    fn start(&self, problem: &Problem) -> Result<ExternalWorld> {
        let world = ExternalWorld::start(&self.address, timeouts(), problem)?;
        let (was, is) = (&self.identity, world.identity());
        ensure!(was == is, "the world was {} {} and is {} {} now", was.name, was.version, is.name, is.version);
        Ok(world)
    }

    /// What it says it is. How it was reached says nothing of a result.
    fn name(&self) -> Value {
        json!({ "name": self.identity.name, "version": self.identity.version })
    }

    /// A socket is one world: as `eval` does, its episodes are played in turn.
    fn is_one(&self) -> bool {
        matches!(self.address, WorldAddress::Tcp(_))
    }
}

fn timeouts() -> Timeouts {
    Timeouts { start: WORLD_LIMIT, reset: WORLD_LIMIT, act: WORLD_LIMIT }
}

/// Plays the worlds that `out` does not have yet, and writes `calibration.json`, `calibration.md` and pictures there.
///
/// # Errors
///
/// A scenario or network that does not load, a world that contradicts it, and a folder of another task.
pub fn run(root: &Path, task: &Task, out: &Path, note: impl Fn(&str) + Sync) -> Result<Value> {
    let Task { from, worlds, quick, prior, world, reference } = task;
    let selection = Selection { quick: *quick, ..from.selection(root, PRESET) };
    let scenario = selection.load()?;
    let problem = Problem::assemble(&scenario, root)?;
    let folder = prior.clone().unwrap_or_else(|| Network::default_folder(root, &problem, *quick));
    let network = Network::load(&folder, &problem)?;
    let mut identity = json!({
        "version": VERSION, "scenario": scenario, "seed": from.seed, "network": network.hash(),
    });
    let external = world.as_ref().map(|address| External::new(address, &problem, from.seed)).transpose()?;
    if let Some(external) = &external {
        identity["world"] = external.name();
    }
    if let Some(particles) = reference {
        identity["reference"] = json!(particles);
    }
    let own = out.join("task.json");
    let mut commit = json!(scenario::commit(root));
    if own.exists() {
        let found: Value = serde_json::from_slice(&whole_file::read(&own, MOST_BYTES)?)
            .with_context(|| format!("{} is no task of this benchmark: move it away", own.display()))?;
        if let Some(key) = OF_TASK.into_iter().find(|key| found.get(key) != identity.get(key)) {
            let (there, here) = (short(&found, key), short(&identity, key));
            let place = out.display();
            bail!("{place} holds the worlds of another task ({key}{there}, here{here}): choose another folder");
        }
        // That of the worlds, not that of whoever counts them.
        commit = found.get("commit").cloned().unwrap_or(commit);
    } else {
        let mut there = std::fs::read_dir(out).into_iter().flatten().flatten();
        if let Some(file) = there.next() {
            let (place, file) = (out.display(), file.file_name());
            bail!("{place} holds {}, which this benchmark did not write: choose another folder", file.display());
        }
        std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
        identity["commit"] = commit.clone();
        whole_file::write(&own, pretty(&identity).as_bytes(), Existing::Keep)?;
    }
    std::fs::create_dir_all(out.join("worlds"))
        .with_context(|| format!("cannot make the folder {}", out.join("worlds").display()))?;
    let one = |number: u32| -> Result<World> {
        let path = out.join(format!("worlds/{number:04}.json"));
        if path.exists() {
            return serde_json::from_slice(&whole_file::read(&path, MOST_BYTES)?)
                .with_context(|| format!("{} is no world of this benchmark: move it away", path.display()));
        }
        let world = episode::play(&problem, &network, from.seed, number, external.as_ref(), *reference)
            .with_context(|| format!("world {number}"))?;
        // What failed is tried again by the next call.
        if let Some(failure) = &world.failure {
            note(&format!("world {number}: {failure}"));
            return Ok(world);
        }
        whole_file::write(&path, serde_json::to_string(&world)?.as_bytes(), Existing::Replace)?;
        note(&format!("world {number}: {} after {} actions", world.reason, world.filter.len().saturating_sub(1)));
        Ok(world)
    };
    let played: Vec<World> = if external.as_ref().is_some_and(External::is_one) {
        (0..*worlds).map(one).collect::<Result<_>>()?
    } else {
        (0..*worlds).into_par_iter().map(one).collect::<Result<_>>()?
    };
    // What failed is counted, and says nothing of a belief.
    let (failed, played): (Vec<World>, Vec<World>) = played.into_iter().partition(|world| world.failure.is_some());
    ensure!(!played.is_empty(), "every world failed: {}", failed[0].failure.as_deref().unwrap_or_default());
    let mut provenance = json!({
        "domain": scenario.name, "robot": scenario.robot.name, "preset": scenario.preset, "worlds": task.worlds, "seed": from.seed,
        "set": from.overrides.set, "quick": quick, "network": network.hash(), "commit": commit,
    });
    if let Some(external) = &external {
        provenance["world"] = external.name();
        provenance["failed"] = json!(failed.len());
    }
    let summary = summary::summary(&played, &provenance);
    whole_file::write(&out.join("calibration.json"), pretty(&summary).as_bytes(), Existing::Replace)?;
    whole_file::write(&out.join("calibration.md"), table(&summary).as_bytes(), Existing::Replace)?;
    save_starts(&problem, &network, &played, &provenance, out)?;
    figures::save(&summary, out).map(|()| summary)
}

/// The episodes as arrays, for `training/coverage.py`.
fn save_starts(problem: &Problem, network: &Network, worlds: &[World], provenance: &Value, out: &Path) -> Result<()> {
    let Network::Posterior(network) = network else { bail!("expected the network of a bridge filter") };
    let rows = || worlds.iter().map(|world| &world.values).filter(|values| !values.is_empty());
    let longest = rows().map(Vec::len).max().unwrap_or(0);
    let padded = |values: &Vec<f32>| {
        let missing = longest - values.len();
        values
            .iter()
            .copied()
            .chain(std::iter::repeat_n(f32::NAN, missing))
            .flat_map(f32::to_le_bytes)
            .collect::<Vec<_>>()
    };
    let bytes: Vec<u8> = rows().flat_map(padded).collect();
    let steps = longest.saturating_sub(2 + START) / STEP_VALUES;
    let mobility = problem.scenario.world.obstacle_mobility;
    let about = starts::about(problem, network.distribution(), mobility, [rows().count(), steps], provenance);
    Ok(starts::write(&out.join("starts"), &bytes, &about)?)
}

/// A key's value where it is short enough for a sentence.
fn short(task: &Value, key: &str) -> String {
    let text = task.get(key).map_or_else(|| "none".into(), Value::to_string);
    if text.len() < 100 { format!(" {text}") } else { String::new() }
}

fn pretty(value: &Value) -> String {
    serde_json::to_string_pretty(value).expect("plain data has a JSON form") + "\n"
}
