//! `cargo xtask diagnose-benchmark`: how well `diagnose` names what only the scorer knows.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Result};
use clap::Parser;
use diagnose_benchmark::folder::{Folder, Identity, TABLES, name};
use diagnose_benchmark::generate::Actions;
use diagnose_benchmark::plan::{Options, Plan, VERSION};
use diagnose_benchmark::score::{Score, score};
use diagnose_benchmark::table::{Table, sets_to_csv};
use indicatif::{ProgressBar, ProgressStyle};
use physics_model::EffectKind;
use program::Failed;
use rayon::prelude::*;
use whole_file::Existing;

/// Generates logs with a hidden effect, has diagnose explain them, and scores its answers.
#[derive(Debug, Parser)]
#[command(name = "diagnose-benchmark", version, after_help = EXAMPLES)]
struct Arguments {
    /// Number of sets with an effect of the catalogue, for each kind of actions.
    #[arg(long, default_value_t = 204)]
    sets: u32,
    /// Number of sets without an effect, for each kind of actions.
    #[arg(long, default_value_t = 100)]
    none: u32,
    /// Number of sets with an effect outside the catalogue, for each kind of actions.
    #[arg(long, default_value_t = 40)]
    unknown: u32,
    /// Number of sets with two effects, for each kind of actions.
    #[arg(long, default_value_t = 40)]
    pairs: u32,
    /// Number of sets of an arm; one in three has no effect.
    #[arg(long, default_value_t = 12)]
    arms: u32,
    /// Kinds of actions.
    #[arg(long, value_delimiter = ',', value_enum, default_values = ["designed", "passive"])]
    actions: Vec<Actions>,
    /// Effects of the catalogue, separated by commas [default: all].
    #[arg(long, value_delimiter = ',')]
    only: Vec<EffectKind>,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the benchmark.
    #[arg(long, default_value = "runs/diagnose-benchmark")]
    out: PathBuf,
    #[command(flatten)]
    work: program::Threads,
    /// Only scores the answers that are there.
    #[arg(long)]
    score_only: bool,
    /// Adds baselines: what simpler programs reach on the same sets.
    #[arg(long)]
    baselines: bool,
    /// Program that answers [default: diagnose, beside this program].
    #[arg(long)]
    diagnose: Option<PathBuf>,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask diagnose-benchmark --sets 4 --none 2 --unknown 2 --pairs 0 --arms 0
  cargo xtask diagnose-benchmark --sets 4 --none 2 --unknown 2 --pairs 0 --arms 0 --score-only";

/// What went wrong after the input was found to be good.
const FAILED: Failed = Failed::new("the benchmark stopped, finished sets are kept");

/// Scores between two lines that say how many there are.
const SCORES_A_LINE: usize = 50;

fn main() -> ExitCode {
    program::resumable("sets", run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<bool> {
    let arms = arguments.project.root.as_deref();
    if let Some(root) = arms {
        physics_model::robot::check_root(root)?;
    }
    let options = Options {
        version: VERSION,
        seed: arguments.seed,
        sets: arguments.sets,
        none: arguments.none,
        unknown: arguments.unknown,
        pairs: arguments.pairs,
        arms: arguments.arms,
        actions: arguments.actions.clone(),
        only: arguments.only.clone(),
    };
    let diagnose = match &arguments.diagnose {
        Some(path) => path.clone(),
        None => std::env::current_exe().context("cannot find this program")?.with_file_name("diagnose"),
    };
    let solver = match std::fs::read(&diagnose) {
        Ok(bytes) => blake3::hash(&bytes).to_hex().to_string(),
        Err(_) if arguments.score_only => String::new(),
        Err(error) => return Err(error).with_context(|| format!("cannot read the solver {}", diagnose.display())),
    };
    let identity = Identity { options: options.clone(), project: env!("CARGO_PKG_VERSION").into(), solver };
    let folder = Folder::open(&arguments.out, &identity, arguments.score_only)?;
    let plan = Plan::new(options);
    let interrupted = program::interrupts()?;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(arguments.work.count()).build().context("cannot start threads")?;
    if !arguments.score_only && !answer(&folder, &plan, &diagnose, arms, &pool, &interrupted)? {
        return Ok(false);
    }
    let scored = AtomicUsize::new(0);
    program::say!("scoring {} sets", plan.len());
    let one = |set| {
        let result = score(&folder, set, arms, arguments.baselines);
        let done = 1 + scored.fetch_add(1, Ordering::Relaxed);
        // With the baselines it takes a while, too.
        if done.is_multiple_of(SCORES_A_LINE) {
            program::say!("{done} of {} sets are scored", plan.len());
        }
        result
    };
    let results: Vec<Result<Option<Score>>> =
        pool.install(|| (0..plan.len()).into_par_iter().with_max_len(1).map(one).collect());
    let scores: Vec<Score> =
        results.into_iter().filter_map(Result::transpose).collect::<Result<_>>().context(FAILED)?;
    let table = Table::new(&scores, plan.len() - scores.len(), arguments.baselines);
    write(&folder, &table, &scores).context(FAILED)?;
    program::show(&format!("{}\n{}", table.to_markdown(), table.confusion_to_markdown()));
    program::say!("written to {}: table.md, confusion.md, sets.csv", program::typed(&arguments.out));
    Ok(true)
}

/// Generates and answers what is missing; false where it was interrupted.
fn answer(
    folder: &Folder,
    plan: &Plan,
    diagnose: &Path,
    arms: Option<&Path>,
    pool: &rayon::ThreadPool,
    interrupted: &AtomicBool,
) -> Result<bool> {
    let missing: Vec<usize> =
        (0..plan.len()).filter(|set| !folder.is_answered(*set) || !folder.truth(*set).exists()).collect();
    if missing.len() < plan.len() {
        program::say!("{} sets are finished already", plan.len() - missing.len());
    }
    let bar = ProgressBar::new(missing.len() as u64);
    let style = "{bar:40} {pos}/{len} sets, {per_sec}, {eta} left {msg}";
    bar.set_style(ProgressStyle::with_template(style).context("the template of the bar")?);
    bar.enable_steady_tick(Duration::from_millis(200));
    let one = |set: &usize| {
        if interrupted.load(Ordering::Relaxed) {
            return Ok(());
        }
        let done = folder.generate(plan, *set, arms).and_then(|()| folder.solve(diagnose, *set, arms));
        bar.inc(1);
        if bar.is_hidden() && done.is_ok() {
            program::say!("{}: answered, {} of {}", name(*set), bar.position(), missing.len());
        }
        if let Err(error) = done {
            // An interrupt ends the solvers too.
            if interrupted.load(Ordering::Relaxed) {
                return Ok(());
            }
            bar.suspend(|| program::say!("{}: {error:#}", name(*set)));
            return Err(error);
        }
        Ok(())
    };
    let results: Vec<Result<()>> = pool.install(|| missing.par_iter().with_max_len(1).map(one).collect());
    bar.finish_and_clear();
    if interrupted.load(Ordering::Relaxed) {
        return Ok(false);
    }
    results.into_iter().collect::<Result<Vec<()>>>().context(FAILED)?;
    Ok(true)
}

fn write(folder: &Folder, table: &Table, scores: &[Score]) -> Result<()> {
    let texts = [
        serde_json::to_string_pretty(table)? + "\n",
        table.to_markdown(),
        table.to_csv(),
        table.confusion_to_markdown(),
        table.confusion_to_csv(),
        sets_to_csv(scores),
    ];
    for (file, text) in TABLES.iter().zip(texts) {
        whole_file::write(&folder.root().join(file), text.as_bytes(), Existing::Replace)?;
    }
    Ok(())
}
