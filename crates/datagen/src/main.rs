//! `cargo xtask datagen`: generates a dataset, shard by shard, resumable.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow};
use clap::Parser;
use dataset::ShardState;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use scenario::Selection;

/// Generates training data: randomised worlds, heuristic policy, recorded transitions.
#[derive(Debug, Parser)]
#[command(name = "datagen", version)]
struct Arguments {
    /// Arm: sawyer or jaco.
    #[arg(long, default_value = "sawyer")]
    robot: String,
    /// Transitions to generate [default: 150000 for sawyer, 200000 for jaco, 8000 with --quick].
    #[arg(long)]
    transitions: Option<u64>,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Shards to cut the dataset into.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    shards: u32,
    /// Worker threads [default: all cores].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// A small dataset, in a minute.
    #[arg(long)]
    quick: bool,
    /// Scenario of the worlds: a name in scenarios/ or a file.
    #[arg(long, default_value = "training")]
    scenario: String,
    /// Overrides a scenario entry: key=value.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder of the dataset [default: runs/data/ROBOT, runs/quick/data/ROBOT with --quick].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Project folder [default: the nearest one above with scenarios/base.toml].
    #[arg(long)]
    root: Option<PathBuf>,
    /// Prints the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// What went wrong after the input was found to be good.
#[derive(Debug)]
struct Failed;

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the run stopped, finished shards are kept")
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
            eprintln!("interrupted: finished shards are kept, run the same command again to go on");
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
    let scenario = Selection {
        robot: arguments.robot.clone(),
        domain: arguments.scenario.clone(),
        set: arguments.set.clone(),
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
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| root.join(if arguments.quick { "runs/quick/data" } else { "runs/data" }).join(&robot));
    let plan = datagen::plan(&scenario, scenario::commit(&root), transitions, arguments.seed, arguments.shards);
    // Before anything is written: a faulty arm must not leave a plan behind.
    let generator = datagen::Generator::new(&scenario, &root, arguments.seed)?;
    plan.open(&out)?;
    let hash = plan.hash();
    let missing = missing_shards(&plan, &out, &hash)?;
    let resumed = plan.shards as usize - missing.len();
    if resumed > 0 {
        eprintln!("{resumed} of {} shards are finished already", plan.shards);
    }
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot listen for interrupts")?;

    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads.unwrap_or(0) as usize).build()?;
    let bar = progress(missing.len() as u64 * plan.episodes_per_shard, "episodes");
    #[expect(clippy::disallowed_methods, reason = "a program may measure its rate")]
    let started = std::time::Instant::now();
    let made = AtomicU64::new(0);
    let results: Vec<Result<()>> = pool.install(|| {
        missing
            .par_iter()
            .map(|&index| {
                if interrupted.load(Ordering::Relaxed) {
                    return Ok(());
                }
                let first = u64::from(index) * plan.episodes_per_shard;
                let (rows, counts) = generator.shard(first, plan.episodes_per_shard)?;
                let info = dataset::write_shard(&out, index, &plan.schema, &plan.provenance(), &counts, &rows)?;
                bar.inc(plan.episodes_per_shard);
                if bar.is_hidden() {
                    eprintln!("shard {index}: {} transitions", info.rows - info.episodes);
                }
                made.fetch_add(info.rows - info.episodes, Ordering::Relaxed);
                Ok(())
            })
            .collect()
    });
    bar.finish_and_clear();
    results.into_iter().collect::<Result<Vec<()>>>().context(Failed)?;
    if interrupted.load(Ordering::Relaxed) {
        return Ok(false);
    }
    let manifest = dataset::finish(&out, &plan).context(Failed)?;
    let seconds = started.elapsed().as_secs_f64();
    let rate = made.load(Ordering::Relaxed) as f64 / seconds;
    if arguments.json {
        let summary = serde_json::json!({
            "out": out, "robot": robot, "transitions": manifest.transitions, "episodes": manifest.episodes,
            "counts": manifest.counts, "seconds": seconds, "transitions_per_second": rate,
        });
        println!("{summary}");
    } else {
        println!(
            "{}: {} transitions in {} episodes, {} shards; {}; {:.1} s, {:.0} transitions/s",
            out.display(),
            manifest.transitions,
            manifest.episodes,
            plan.shards,
            manifest.counts.iter().map(|(k, v)| format!("{k} {v}")).collect::<Vec<_>>().join(", "),
            seconds,
            rate,
        );
    }
    Ok(true)
}

fn missing_shards(plan: &dataset::Plan, out: &std::path::Path, hash: &str) -> Result<Vec<u32>> {
    let mut missing = Vec::new();
    for index in 0..plan.shards {
        match dataset::shard_state(out, index, hash)? {
            ShardState::Finished(_) => {}
            ShardState::Missing => missing.push(index),
            ShardState::Broken(reason) => {
                let file = out.join(dataset::shard_path(index));
                return Err(anyhow!(
                    "{}: expected a whole shard, {reason}: remove the file to make it again",
                    file.display()
                ));
            }
        }
    }
    Ok(missing)
}

/// A bar with rate and time left on a terminal; hidden elsewhere, where a line a shard is printed instead.
fn progress(length: u64, unit: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    let template = format!("{{bar:40}} {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
    bar.set_style(ProgressStyle::with_template(&template).expect("the template is fixed"));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
