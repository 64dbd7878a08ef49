//! `cargo xtask datagen`: generates a dataset, shard by shard, resumable.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow};
use clap::Parser;
use cluster::{Array, Engine, Event, Executor, Lock, Outcome};
use datagen::Generator;
use dataset::{Plan, ShardInfo, ShardState};
use indicatif::{ProgressBar, ProgressStyle};
use program::{Failed, typed};
use rayon::prelude::*;
use scenario::Selection;

/// Generates training data: randomised worlds, heuristic policy, recorded transitions.
#[derive(Debug, Parser)]
#[command(name = "datagen", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(flatten)]
    arm: program::Arm,
    /// Transitions to generate [default: 150000 for sawyer, 200000 for jaco, 8000 with --quick].
    #[arg(long)]
    transitions: Option<u64>,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of shards of the dataset, at most one an episode [default: 20, or fewer].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    shards: Option<u32>,
    /// Who makes the shards: local (threads of this program), slurm (a job array) or hq (HyperQueue): see docs/src/guides/cluster.md.
    #[arg(long, default_value_t = Executor::Local)]
    executor: Executor,
    /// Makes only this shard, as the tasks of an array do. The command without --worker finishes the dataset.
    #[arg(long, value_name = "SHARD")]
    worker: Option<u32>,
    #[command(flatten)]
    work: program::Threads,
    /// A small dataset, in a minute.
    #[arg(long)]
    quick: bool,
    /// Scenario of the worlds: a name in scenarios/ or a file.
    #[arg(long, default_value = "training")]
    scenario: String,
    #[command(flatten)]
    overrides: program::Overrides,
    /// Folder of the dataset [default: runs/data/ROBOT, runs/quick/data/ROBOT with --quick].
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    project: program::Project,
    /// Prints the result as one JSON object.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask datagen --quick
  cargo xtask datagen --robot jaco --transitions 4000 --shards 4 --out runs/data/jaco-small";

/// Shards where none are asked for.
const SHARDS: u32 = 20;
/// What went wrong after the input was found to be good.
const FAILED: Failed = Failed::new("the run stopped, finished shards are kept");

fn main() -> ExitCode {
    program::log_on_request();
    program::resumable("shards", run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<bool> {
    let job = Job::new(arguments)?;
    if let Some(shard) = arguments.worker {
        job.plan.open(&job.out)?;
        job.worker(shard)?;
        return Ok(true);
    }
    if let Executor::Engine(engine) = arguments.executor {
        // Before anything is written: a machine without the engine must not leave a plan behind.
        engine.check()?;
    }
    whole_file::check_owner(&job.out, "plan.json")?;
    // A dataset begins with its plan: a manifest or data without one are somebody else's.
    let parts = ["meta/info.json", "data"].map(|part| job.out.join(part));
    if let Some(part) = parts.iter().find(|part| part.exists() && !job.out.join("plan.json").exists()) {
        anyhow::bail!(
            "{}: it lies in a folder without plan.json, which datagen writes first: choose another folder",
            part.display()
        );
    }
    job.plan.open(&job.out)?;
    let _lock = Lock::take(&job.out.join("plan.json"))?;
    let missing = job.missing_shards()?;
    let resumed = job.plan.shards as usize - missing.len();
    if resumed > 0 {
        program::say!("{resumed} of {} shards are finished already", job.plan.shards);
    }
    let interrupted = program::interrupts()?;
    let bar = progress(missing.len() as u64 * job.plan.episodes_per_shard, "episodes");
    #[expect(clippy::disallowed_methods, reason = "a program may measure its rate")]
    let started = std::time::Instant::now();
    match arguments.executor {
        Executor::Local => job.play_here(&missing, arguments.work.count(), &bar, &interrupted)?,
        Executor::Engine(engine) => job.submit(engine, &missing, &bar, &interrupted)?,
    }
    bar.finish_and_clear();
    if interrupted.load(Ordering::Relaxed) {
        return Ok(false);
    }
    let manifest = job.finish().context(FAILED)?;
    job.print(&manifest, &missing, started.elapsed().as_secs_f64(), arguments.json);
    if !arguments.json {
        suggest_train(&job, &arguments.arm.robot, arguments.quick);
    }
    Ok(true)
}

/// What to do with a finished dataset.
fn suggest_train(job: &Job, robot: &str, quick: bool) {
    let mut train: Vec<String> =
        ["cargo", "xtask", "train", "--robot", robot, "--data", &typed(&job.out)].map(String::from).to_vec();
    train.extend(quick.then(|| "--quick".into()));
    program::next(&[(train, "trains the prior on it")]);
}

/// A dataset to be made.
struct Job {
    out: PathBuf,
    robot: String,
    plan: Plan,
    hash: String,
    generator: Generator,
}

impl Job {
    /// Checks the input and writes nothing: a faulty arm must not leave a plan behind.
    fn new(arguments: &Arguments) -> Result<Self> {
        let root = scenario::project_root(arguments.project.root.as_deref())?;
        let scenario = Selection {
            robot: arguments.arm.robot.clone(),
            domain: arguments.scenario.clone(),
            set: arguments.overrides.set.clone(),
            ..Selection::new(&root)
        }
        .load()?;
        let robot = scenario.robot.name.clone();
        let transitions = arguments.transitions.unwrap_or(match (arguments.quick, robot.as_str()) {
            (true, _) => 8_000,
            (false, "jaco") => 200_000,
            (false, _) => 150_000,
        });
        if transitions == 0 {
            return Err(anyhow!("--transitions: expected at least 1, found 0"));
        }
        let episodes = u32::try_from(datagen::episodes(&scenario, transitions)).unwrap_or(u32::MAX);
        let shards = arguments.shards.unwrap_or(SHARDS.min(episodes));
        if shards > episodes {
            return Err(anyhow!(
                "--shards: expected at most {episodes}, as {transitions} transitions take so many episodes, found {shards}"
            ));
        }
        if let Some(shard) = arguments.worker.filter(|shard| *shard >= shards) {
            return Err(anyhow!("--worker: expected a shard below {shards}, found {shard}"));
        }
        let folder = if arguments.quick { "runs/quick/data" } else { "runs/data" };
        let out = arguments.out.clone().unwrap_or_else(|| root.join(folder).join(&robot));
        let commit = match scenario::commit(&root) {
            // A node without git plays what it was sent to play.
            unknown if unknown == "unknown" && arguments.worker.is_some() => Plan::read(&out)?.commit,
            commit => commit,
        };
        let plan = datagen::plan(&scenario, commit, transitions, arguments.seed, shards);
        let generator = Generator::new(&scenario, &root, arguments.seed)?;
        Ok(Self { out, robot, hash: plan.hash(), plan, generator })
    }

    /// Makes a shard, unless it is there.
    fn make(&self, index: u32) -> Result<ShardInfo> {
        let plan = &self.plan;
        let first = u64::from(index) * plan.episodes_per_shard;
        let (rows, counts) = self.generator.shard(first, plan.episodes_per_shard)?;
        Ok(dataset::write_shard(&self.out, index, &plan.schema, &plan.provenance(), &counts, &rows)?)
    }

    /// What a task of an array does.
    fn worker(&self, shard: u32) -> Result<()> {
        if !matches!(dataset::shard_state(&self.out, shard, &self.hash)?, ShardState::Finished(_)) {
            self.make(shard).context(FAILED)?;
        }
        program::say!("shard {shard} is finished");
        Ok(())
    }

    fn play_here(&self, missing: &[u32], threads: usize, bar: &ProgressBar, interrupted: &AtomicBool) -> Result<()> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let make = |&index: &u32| {
            if interrupted.load(Ordering::Relaxed) {
                return Ok(());
            }
            let info = self.make(index)?;
            bar.inc(self.plan.episodes_per_shard);
            if bar.is_hidden() {
                program::say!("shard {index}: {} transitions", info.rows - info.episodes);
            }
            Ok(())
        };
        let results: Vec<Result<()>> = pool.install(|| missing.par_iter().map(make).collect());
        results.into_iter().collect::<Result<Vec<()>>>().context(FAILED)?;
        Ok(())
    }

    fn submit(&self, engine: Engine, missing: &[u32], bar: &ProgressBar, interrupted: &AtomicBool) -> Result<()> {
        let array = Array { engine, label: "datagen", folder: &self.out, processors: 1 };
        let there = |index: &&u32| self.out.join(dataset::shard_path(**index)).exists();
        let mut report = |event| match event {
            Event::News(news) => bar.suspend(|| program::say!("{news}")),
            Event::Looked => {
                bar.set_position(missing.iter().filter(there).count() as u64 * self.plan.episodes_per_shard);
            }
        };
        match array.run(|| self.missing_shards(), interrupted, &mut report) {
            Ok(Outcome::Finished | Outcome::Interrupted) => Ok(()),
            Err(error) if matches!(error.downcast_ref(), Some(cluster::Error::Unfinished { .. })) => {
                Err(error.context(FAILED))
            }
            Err(error) => Err(error),
        }
    }

    fn missing_shards(&self) -> Result<Vec<u32>> {
        let mut missing = Vec::new();
        for index in 0..self.plan.shards {
            match dataset::shard_state(&self.out, index, &self.hash)? {
                ShardState::Finished(_) => {}
                ShardState::Missing => missing.push(index),
                ShardState::Broken(reason) => {
                    let file = self.out.join(dataset::shard_path(index));
                    return Err(anyhow!(
                        "{}: expected a whole shard, {reason}: remove the file to make it again",
                        file.display()
                    ));
                }
            }
        }
        Ok(missing)
    }

    /// Writes the manifest and clears away what killed workers left.
    fn finish(&self) -> Result<dataset::Manifest> {
        let manifest = dataset::finish(&self.out, &self.plan)?;
        let mut folders = vec![self.out.clone(), self.out.join("meta")];
        folders.extend(manifest.shards.iter().filter_map(|s| self.out.join(&s.path).parent().map(Path::to_path_buf)));
        folders.dedup();
        for folder in folders {
            whole_file::sweep(&folder)?;
        }
        cluster::tidy(&self.out)?;
        Ok(manifest)
    }

    fn print(&self, manifest: &dataset::Manifest, made: &[u32], seconds: f64, json: bool) {
        let shards = manifest.shards.iter().filter(|s| made.contains(&s.index));
        let rate = shards.map(|s| s.rows - s.episodes).sum::<u64>() as f64 / seconds;
        if json {
            let summary = serde_json::json!({
                "out": self.out, "robot": self.robot, "transitions": manifest.transitions, "episodes": manifest.episodes,
                "counts": manifest.counts, "seconds": seconds, "transitions_per_second": rate,
            });
            program::out!("{summary}");
            return;
        }
        program::out!(
            "{}: {} transitions in {} episodes, {} shards; {}; {:.1} s, {:.0} transitions/s",
            self.out.display(),
            manifest.transitions,
            manifest.episodes,
            self.plan.shards,
            manifest.counts.iter().map(|(k, v)| format!("{k} {v}")).collect::<Vec<_>>().join(", "),
            seconds,
            rate,
        );
    }
}

/// A bar with rate and time left on a terminal; hidden elsewhere, where a line a shard is printed instead.
fn progress(length: u64, unit: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    let template = format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
    bar.set_style(ProgressStyle::with_template(&template).expect("the template is fixed"));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
