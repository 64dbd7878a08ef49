//! `cargo xtask eval`: trials of methods on a domain, to a table.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent::{Agent, Method, Timeouts, WorldAddress};
use anyhow::{Context as _, Result};
use clap::Parser;
use experiments::{Provenance, Run, RunIdentity, Worlds, play, play_external};
use indicatif::{ProgressBar, ProgressStyle};
use pomdp::Seed;
use prior::Suggester;
use rayon::prelude::*;
use scenario::{Filter, Problem, Selection};

/// Plays trials of methods on a domain and prints the table.
#[derive(Debug, Parser)]
#[command(name = "eval", version)]
struct Arguments {
    /// Domain: D1 to D5, obstacle, or a scenario file.
    #[arg(long)]
    domain: String,
    /// Arm: sawyer or jaco.
    #[arg(long, default_value = "sawyer")]
    robot: String,
    /// Preset of belief and planner.
    #[arg(long, default_value = "paper")]
    preset: String,
    /// Methods, separated by commas: no-rnn, rnn-max, rnn-sampling, mixture, oracle, heuristic [default: no-rnn,rnn-max,rnn-sampling;
    /// no-rnn,mixture with preset surmise].
    #[arg(long, value_delimiter = ',')]
    methods: Vec<Method>,
    /// Trials a method [default: the scenario's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    trials: Option<u32>,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// World to play in instead of the simulated one: a command that speaks the world protocol (docs/world-protocol.md) on its
    /// standard input and output, run without a shell, or tcp://127.0.0.1:PORT.
    #[arg(long, value_name = "COMMAND|ADDRESS")]
    world: Option<WorldAddress>,
    /// How long a world may take to start and say hello, s.
    #[arg(long, default_value = "60", value_parser = seconds)]
    world_start_secs: Duration,
    /// How long a world may take to set up a trial, s.
    #[arg(long, default_value = "60", value_parser = seconds)]
    world_reset_secs: Duration,
    /// How long a world may take for an action, s.
    #[arg(long, default_value = "60", value_parser = seconds)]
    world_act_secs: Duration,
    /// Worker threads, each with a world of its own [default: all cores; 1 with a world behind a socket].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Small budgets: a run of a minute or two whose figures mean nothing.
    #[arg(long)]
    quick: bool,
    /// Overrides a scenario entry: key=value.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder of the trained prior [default: the one trained here with the same --quick, else the shipped one].
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Run directory [default: runs/eval/DOMAIN-ROBOT-PRESET, runs/quick/eval/… with --quick].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Project folder [default: the nearest one above with scenarios/base.toml].
    #[arg(long)]
    root: Option<PathBuf>,
    /// Prints the table as JSON.
    #[arg(long)]
    json: bool,
}

/// What went wrong after the input was found to be good.
#[derive(Debug)]
struct Failed;

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the run stopped, finished trials are kept")
    }
}

fn main() -> ExitCode {
    // Silent unless RUST_LOG asks: results go to files, progress to the bar.
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "off".into());
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("interrupted: finished trials are kept, run the same command again to go on");
            ExitCode::from(130)
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(if error.downcast_ref::<Failed>().is_some() { 1 } else { 2 })
        }
    }
}

fn run(arguments: &Arguments) -> Result<bool> {
    let root = match &arguments.root {
        Some(root) => root.clone(),
        None => scenario::find_root(&std::env::current_dir()?)?,
    };
    let mut scenario = Selection {
        root: root.clone(),
        domain: arguments.domain.clone(),
        robot: arguments.robot.clone(),
        preset: arguments.preset.clone(),
        quick: arguments.quick,
        set: arguments.set.clone(),
    }
    .load()?;
    if let Some(trials) = arguments.trials {
        scenario.evaluation.trials = trials;
    }
    let mut methods = arguments.methods.clone();
    if methods.is_empty() {
        methods = match scenario.belief.filter {
            Filter::Rejection => vec![Method::NoRnn, Method::RnnMax, Method::RnnSampling],
            Filter::Weighted => vec![Method::NoRnn, Method::Mixture],
        };
    }
    methods.sort();
    methods.dedup();
    let problem = Problem::assemble(&scenario, &root)?;
    let prior = if methods.iter().any(|m| m.needs_prior()) {
        let default = || prior::default_folder(&root, &scenario.robot.name, arguments.quick);
        let folder = arguments.prior.clone().unwrap_or_else(default);
        let prior = Suggester::load(&folder, &scenario.robot.name, &problem.model)?;
        eprintln!("prior: {}", folder.display());
        Some(prior)
    } else {
        None
    };
    // What a method cannot do is said before a folder is made.
    for method in &methods {
        Agent::new(&problem, *method, prior.as_ref())?;
    }
    let worlds = match &arguments.world {
        Some(_) if methods.contains(&Method::Oracle) => return Err(agent::Error::NoTruth.into()),
        Some(address) => {
            let (start, reset, act) =
                (arguments.world_start_secs, arguments.world_reset_secs, arguments.world_act_secs);
            Some(Worlds::start(address.clone(), Timeouts { start, reset, act }, &problem)?)
        }
        None => None,
    };
    let world = worlds.as_ref().map(|worlds| worlds.identity().clone());
    let provenance = Provenance {
        run: RunIdentity {
            version: 1,
            scenario_hash: scenario.hash(),
            seed: arguments.seed,
            prior_hash: prior.as_ref().map(|p| p.hash().to_string()),
            urdf_hash: scenario.urdf_hash(&root)?,
            commit: scenario::commit(&root),
            world: world.clone(),
        },
        program: format!("eval {}", env!("CARGO_PKG_VERSION")),
        methods,
        trials: scenario.evaluation.trials,
    };
    let out = arguments.out.clone().unwrap_or_else(|| {
        let world = world.map_or_else(String::new, |world| format!("-{}", world.name));
        let name = format!("{}-{}-{}{world}", scenario.name, scenario.robot.name, scenario.preset);
        root.join(if arguments.quick { "runs/quick/eval" } else { "runs/eval" }).join(name)
    });
    let run = Run::open(&out, provenance, &scenario.to_toml())?;
    if run.resumed() > 0 {
        eprintln!("{} trials are finished already", run.resumed());
    }
    if !play_missing(&run, &problem, prior.as_ref(), worlds.as_ref(), arguments).context(Failed)? {
        return Ok(false);
    }
    let s = &scenario;
    // The published figures are those of the paper's own simulation.
    let published = if worlds.is_some() { &BTreeMap::new() } else { &s.evaluation.published };
    let table = run.finish(&s.name, &s.robot.name, &s.preset, published).context(Failed)?;
    if arguments.json {
        println!("{}", serde_json::to_string(&table)?);
    } else {
        print!("{}", table.to_markdown());
        eprintln!("written to {}", out.display());
    }
    Ok(true)
}

/// Plays what is missing on all threads; false where it was interrupted.
fn play_missing(
    run: &Run,
    problem: &Problem,
    prior: Option<&Suggester>,
    worlds: Option<&Worlds<'_>>,
    arguments: &Arguments,
) -> Result<bool> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot listen for interrupts")?;
    let missing = run.missing();
    let bar = ProgressBar::new(missing.len() as u64);
    let style = "{bar:40} {pos}/{len} trials, {per_sec}, {eta} left {msg}";
    bar.set_style(ProgressStyle::with_template(style).expect("the template is fixed"));
    bar.enable_steady_tick(Duration::from_millis(200));
    // One robot behind a socket plays one trial at a time.
    let socket = matches!(arguments.world, Some(WorldAddress::Tcp(_)));
    let threads = arguments.threads.unwrap_or(u32::from(socket));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build()?;
    let failed = AtomicBool::new(false);
    let results: Vec<Result<()>> = pool.install(|| {
        missing
            .par_iter()
            .with_max_len(1)
            .map(|&(method, trial)| {
                if interrupted.load(Ordering::Relaxed) || failed.load(Ordering::Relaxed) {
                    return Ok(());
                }
                #[expect(clippy::disallowed_methods, reason = "a program may time its trials; nothing depends on it")]
                let started = std::time::Instant::now();
                let seed = Seed(arguments.seed);
                let played = match worlds {
                    Some(worlds) => play_external(problem, method, prior, seed, trial, worlds),
                    None => play(problem, method, prior, seed, trial),
                };
                let (mut record, _) = played.inspect_err(|_| failed.store(true, Ordering::Relaxed))?;
                record.seconds = started.elapsed().as_secs_f64();
                run.keep(&record)?;
                if let Some(failure) = &record.failure {
                    bar.suspend(|| eprintln!("{} trial {trial}: {failure}", method.name()));
                }
                bar.inc(1);
                if bar.is_hidden() {
                    let end = record.reason.name();
                    eprintln!(
                        "{} trial {trial}: {end} after {} actions, {:.1} s",
                        method.name(),
                        record.steps,
                        record.seconds
                    );
                }
                Ok(())
            })
            .collect()
    });
    bar.finish_and_clear();
    results.into_iter().collect::<Result<Vec<()>>>()?;
    Ok(!interrupted.load(Ordering::Relaxed))
}

/// A time-out on the command line.
fn seconds(text: &str) -> Result<Duration, String> {
    let good = |secs: &f64| (0.001..=86_400.0).contains(secs);
    let secs = text.parse::<f64>().ok().filter(good);
    secs.map(Duration::from_secs_f64).ok_or_else(|| format!("expected 0.001 to 86400 seconds, found `{text}`"))
}
