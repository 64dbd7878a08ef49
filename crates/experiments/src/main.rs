//! `cargo xtask eval`: trials of methods on a domain, or of all domains, to tables.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent::{Method, Timeouts, WorldAddress};
use anyhow::{Context as _, Result, bail};
use clap::Parser;
use cluster::{Engine, Event, Executor, Outcome};
use experiments::{Evaluation, Player, Request, Run, Shard, Suite, SuiteRequest};
use program::{Failed, typed};
use scenario::Selection;

/// Plays trials of methods on a domain, or all tables with --all, and prints the table.
#[derive(Debug, Parser)]
#[command(name = "eval", version, after_help = EXAMPLES)]
struct Arguments {
    /// Domain: D1 to D5, obstacle, tilted, or a scenario file.
    #[arg(long, required_unless_present_any = ["all", "only", "publish", "keep_finished", "python"])]
    domain: Option<String>,
    /// Plays all tables of scenarios/tables, and draws their pictures.
    #[arg(long, conflicts_with_all = ["domain", "robot", "preset", "methods", "world", "executor", "worker"])]
    all: bool,
    /// With --all: plays only these tables (table1), runs (table1-paper) or run directories (table1-paper-D3), separated by commas.
    #[arg(long, value_delimiter = ',', requires = "all", conflicts_with = "domain")]
    only: Vec<String>,
    /// With --all: Python with mujoco and numpy, for the runs in MuJoCo. Without these modules those runs are left out.
    #[arg(long, default_value = "python3", requires = "all", conflicts_with = "domain")]
    python: String,
    /// With --all: counts finished runs of another commit as they are, instead of refusing them; the tables name the commit of each.
    #[arg(long, requires = "all", conflicts_with = "domain")]
    keep_finished: bool,
    /// With --all: copies the combined tables and pictures to assets/results.
    #[arg(long, requires = "all", conflicts_with_all = ["quick", "domain"])]
    publish: bool,
    #[command(flatten)]
    arm: program::Arm,
    /// Preset of belief and planner: surmise, paper, or a file.
    #[arg(long, default_value = scenario::PRESET)]
    preset: String,
    /// Methods, separated by commas: no-rnn, rnn-max, rnn-sampling, mixture, oracle, heuristic [default: no-rnn,mixture with preset surmise;
    /// no-rnn,rnn-max,rnn-sampling with preset paper].
    #[arg(long, value_delimiter = ',')]
    methods: Vec<Method>,
    /// Number of trials of each method [default: the scenario's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    trials: Option<u32>,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// World to play in instead of the simulated one: a command that speaks the world protocol
    /// (docs/src/reference/world-protocol.md) on its standard input and output, run without a shell, or tcp://127.0.0.1:PORT.
    #[arg(long, value_name = "COMMAND|ADDRESS")]
    world: Option<WorldAddress>,
    /// How long a world may take to start and say hello, s [default: 60].
    #[arg(long, value_parser = seconds)]
    world_start_secs: Option<Duration>,
    /// How long a world may take to set up a trial, s [default: 60].
    #[arg(long, value_parser = seconds)]
    world_reset_secs: Option<Duration>,
    /// How long a world may take for an action, s [default: 60].
    #[arg(long, value_parser = seconds)]
    world_act_secs: Option<Duration>,
    /// Who plays: local (threads of this program), slurm (a job array) or hq (HyperQueue): see docs/src/guides/cluster.md.
    #[arg(long, default_value_t = Executor::Local)]
    executor: Executor,
    /// Number of tasks that slurm or hq cut the trials into.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    shards: u32,
    /// Plays only this shard, as the tasks of an array do. The command without --worker makes the tables.
    #[arg(long, value_name = "SHARD")]
    worker: Option<u32>,
    #[command(flatten)]
    work: program::Threads,
    /// Small budgets: a run of a minute or two whose figures mean nothing.
    #[arg(long)]
    quick: bool,
    /// A model.toml that `cargo xtask diagnose` wrote: planner and belief take its effects into account (effects.model).
    #[arg(long, value_name = "FILE", conflicts_with = "all")]
    model: Option<PathBuf>,
    #[command(flatten)]
    overrides: program::Overrides,
    /// Folder of the trained prior [default: the one trained here with the same --quick, else the shipped one].
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Run directory [default: runs/eval/DOMAIN-ROBOT-PRESET, or runs/all with --all; runs/quick/… with --quick].
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    project: program::Project,
    /// Prints the table as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask eval --domain D4 --trials 2
  cargo xtask eval --domain D4 --preset paper --methods rnn-sampling --trials 2
  cargo xtask eval --all --quick --only table1";

/// What went wrong after the input was found to be good.
const FAILED: Failed = Failed::new("the run stopped, finished trials are kept");

fn main() -> ExitCode {
    program::log_on_request();
    program::resumable("trials", run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<bool> {
    let root = scenario::project_root(arguments.project.root.as_deref())?;
    check_shards(arguments)?;
    match &arguments.domain {
        Some(domain) => run_one(arguments, &root, domain),
        None => run_all(arguments, &root),
    }
}

fn run_one(arguments: &Arguments, root: &Path, domain: &str) -> Result<bool> {
    let evaluation = Evaluation::prepare(&request(arguments, root, domain))?;
    match (evaluation.prior_folder(), &arguments.prior) {
        (Some(folder), _) => program::say!("prior: {}", folder.display()),
        (None, Some(_)) => {
            bail!("--prior: none of the methods uses a network: leave it out, or choose other --methods")
        }
        (None, None) => {}
    }
    let out = arguments.out.clone().unwrap_or_else(|| {
        root.join(if arguments.quick { "runs/quick/eval" } else { "runs/eval" }).join(evaluation.name())
    });
    if let Some(index) = arguments.worker {
        let run = evaluation.open_worker(&out, Shard { index, of: arguments.shards })?;
        let interrupted = program::interrupts()?;
        let player = Player { threads: Some(arguments.work.threads.unwrap_or(1)), interrupted: &interrupted };
        return player.play(&evaluation, &run).context(FAILED);
    }
    if let Executor::Engine(engine) = arguments.executor {
        // Before anything is written: a machine without the engine must not leave a folder behind.
        engine.check()?;
    }
    whole_file::check_owner(&out, "run.json")?;
    if let (Some(_), None) = (&arguments.model, &arguments.world)
        && let Some(warning) = evaluation.scenario().truth_warning()
    {
        program::say!("{warning}");
    }
    let run = evaluation.open(&out)?;
    match run.resumed() {
        0 => {}
        1 => program::say!("1 trial is finished already"),
        n => program::say!("{n} trials are finished already"),
    }
    let interrupted = program::interrupts()?;
    let finished = match arguments.executor {
        Executor::Local => {
            let player = Player { threads: arguments.work.threads, interrupted: &interrupted };
            player.play(&evaluation, &run).context(FAILED)?
        }
        Executor::Engine(engine) => submit(engine, &run, arguments, &interrupted)?,
    };
    if !finished {
        return Ok(false);
    }
    let table = evaluation.finish(&run).context(FAILED)?;
    if arguments.json {
        program::out!("{}", serde_json::to_string(&table)?);
    } else {
        program::show(&table.to_markdown());
        if let Some(sentence) = experiments::world_failures(run.trials().context(FAILED)?.values()) {
            program::say!("{sentence}");
        }
        program::say!("written to {}", typed(&out));
        suggest_report(&out);
    }
    Ok(true)
}

fn run_all(arguments: &Arguments, root: &Path) -> Result<bool> {
    let default = || root.join(if arguments.quick { "runs/quick/all" } else { "runs/all" });
    let out = arguments.out.clone().unwrap_or_else(default);
    whole_file::check_folder(&out)?;
    let request = SuiteRequest {
        root: root.to_path_buf(),
        out: out.clone(),
        only: arguments.only.clone(),
        trials: arguments.trials,
        seed: arguments.seed,
        quick: arguments.quick,
        set: arguments.overrides.set.clone(),
        keep_finished: arguments.keep_finished,
        prior: arguments.prior.clone(),
        python: arguments.python.clone(),
        timeouts: timeouts(arguments),
    };
    let mut note = |text: &str| program::say!("{text}");
    let suite = Suite::prepare(request, &mut note)?;
    let interrupted = program::interrupts()?;
    let player = Player { threads: arguments.work.threads, interrupted: &interrupted };
    if !suite.play(&player, &mut note).context(FAILED)? {
        return Ok(false);
    }
    let tables = suite.combine().context(FAILED)?;
    if arguments.json {
        program::out!("{}", serde_json::to_string(&tables)?);
    } else {
        for table in &tables {
            program::out!("{}", table.to_markdown());
        }
        program::say!("written to {}", typed(&out));
        suggest_report(&out);
    }
    if arguments.publish {
        let to = root.join("assets/results");
        suite.publish(&to).context(FAILED)?;
        program::say!("published to {}", to.display());
    }
    Ok(true)
}

/// What to do with a finished run.
fn suggest_report(out: &Path) {
    let report = ["cargo".to_string(), "xtask".into(), "report".into(), typed(out)];
    program::next(&[(report.to_vec(), "makes a page of it: every trial, every failure")]);
}

/// How long a world may take for each of the three, where nothing is asked for.
const WORLD_LIMIT: Duration = Duration::from_secs(60);

fn limits(arguments: &Arguments) -> [Option<Duration>; 3] {
    [arguments.world_start_secs, arguments.world_reset_secs, arguments.world_act_secs]
}

fn timeouts(arguments: &Arguments) -> Timeouts {
    let [start, reset, act] = limits(arguments).map(|limit| limit.unwrap_or(WORLD_LIMIT));
    Timeouts { start, reset, act }
}

fn request(arguments: &Arguments, root: &Path, domain: &str) -> Request {
    Request {
        selection: Selection {
            root: root.to_path_buf(),
            domain: domain.into(),
            robot: arguments.arm.robot.clone(),
            preset: arguments.preset.clone(),
            quick: arguments.quick,
            set: arguments.overrides.set.clone(),
            effects: arguments.model.clone(),
        },
        methods: arguments.methods.clone(),
        trials: arguments.trials,
        seed: arguments.seed,
        prior: arguments.prior.clone(),
        world: arguments.world.clone().map(|address| (address, timeouts(arguments))),
    }
}

/// What no array can do.
fn check_shards(arguments: &Arguments) -> Result<()> {
    if !arguments.all && arguments.world.is_none() && limits(arguments).iter().any(Option::is_some) {
        bail!("--world-start-secs, --world-reset-secs and --world-act-secs are limits of a --world, found none");
    }
    if let Some(shard) = arguments.worker.filter(|shard| *shard >= arguments.shards) {
        bail!("--worker: expected a shard below {}, found {shard}", arguments.shards);
    }
    if let (Executor::Engine(_), Some(WorldAddress::Tcp(_))) = (arguments.executor, &arguments.world) {
        bail!(
            "--executor {}: a world behind a socket of this machine is played in here: expected local",
            arguments.executor
        );
    }
    Ok(())
}

/// Has an engine play what is missing; false where it was interrupted.
fn submit(engine: Engine, run: &Run, arguments: &Arguments, interrupted: &AtomicBool) -> Result<bool> {
    let mut finished = run.resumed();
    let mut report = |event| match event {
        Event::News(news) => program::say!("{news}"),
        Event::Looked => {
            let now = run.trials().map_or(finished, |trials| trials.len());
            if now > finished {
                program::say!("{now} trials are finished");
            }
            finished = now;
        }
    };
    let played = run.play_on(engine, arguments.shards, arguments.work.threads.unwrap_or(1), interrupted, &mut report);
    match played {
        Ok(outcome) => Ok(outcome == Outcome::Finished),
        // The rest is of the kind that is said before anything is played.
        Err(error @ experiments::Error::Cluster(cluster::Error::Refused { .. })) => Err(error.into()),
        Err(error) => Err(error).context(FAILED),
    }
}

/// A time-out on the command line.
fn seconds(text: &str) -> Result<Duration, String> {
    let good = |secs: &f64| (0.001..=86_400.0).contains(secs);
    let secs = text.parse::<f64>().ok().filter(good);
    secs.map(Duration::from_secs_f64).ok_or_else(|| format!("expected 0.001 to 86400 seconds, found `{text}`"))
}
