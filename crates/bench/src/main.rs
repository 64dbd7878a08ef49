//! `cargo xtask bench`: time and accuracy beside peers.

use std::path::PathBuf;
use std::process::ExitCode;

use agent::WorldAddress;
use anyhow::{Context as _, Result};
use bench::physics::{self, Effort, OBSTACLES};
use bench::worlds::Worlds;
use bench::{calibration, decision, log_faults, nudge, planner, policy, prior, report};
use clap::{Parser, Subcommand};
use scenario::Selection;
use serde_json::Value;

/// Benchmarks: time and accuracy, beside peers where those are installed.
#[derive(Debug, Parser)]
#[command(name = "bench", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    what: What,
    /// Project folder [default: the nearest one above with scenarios/base.toml].
    #[arg(long, global = true)]
    root: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Time of one action, in turn with MuJoCo and PyBullet (Python of the variable PYTHON, else python3).
    #[command(after_help = "Examples:\n  cargo xtask bench physics --rounds 3")]
    Physics {
        /// Batches of every program; medians of these are compared.
        #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
        rounds: u32,
        /// Actions in a batch.
        #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
        actions: u32,
        /// Prints one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// How far the belief can be trusted, step by step, on fresh worlds: beside prior and network.
    #[command(
        after_help = "Examples:\n  cargo xtask bench calibration --domain D4 --worlds 4 --quick --out runs/calibration/D4-quick"
    )]
    Calibration {
        #[command(flatten)]
        from: Worlds,
        /// Worlds.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=100_000))]
        worlds: u32,
        /// The small budgets of --quick runs.
        #[arg(long)]
        quick: bool,
        /// Folder of the network [default: the one trained here, else the shipped one].
        #[arg(long)]
        prior: Option<PathBuf>,
        /// World to play in instead of the simulated one, as for `eval`. It has to say what it has drawn: `drawn` in
        /// docs/src/reference/world-protocol.md.
        #[arg(long, value_name = "COMMAND|ADDRESS")]
        world: Option<WorldAddress>,
        /// Also samples the exact posterior at the last belief, twice, with so many particles. Takes minutes a world.
        #[arg(long, value_name = "PARTICLES", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
        reference: Option<u32>,
        /// Folder of the results. Worlds that it has are not played again.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// How far the next reading moves where the object is moved by a hair, in recorded trials: the chaos of a push.
    #[command(
        after_help = "Examples:\n  cargo xtask bench nudge --domain D4 assets/results/table1-surmise-D4/trials.jsonl"
    )]
    Nudge {
        /// File `trials.jsonl` of a run of `eval`.
        trials: PathBuf,
        /// Its domain.
        #[arg(long, default_value = "D4")]
        domain: String,
        /// How far the object is moved along y, m.
        #[arg(long, default_value_t = 1e-8, value_parser = length)]
        nudge_m: f64,
        /// Overrides a scenario entry: key=value.
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// What the policy of the rollouts earns without a search where it knows the world, and how far its leaf values are off.
    #[command(after_help = "Examples:\n  cargo xtask bench policy --domain D4 --worlds 1000")]
    Policy {
        #[command(flatten)]
        from: Worlds,
        /// Worlds.
        #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
        worlds: u32,
        /// The obstacle is known only once it has been touched.
        #[arg(long)]
        blind: bool,
        /// Prints the steps of this world alone.
        #[arg(long, value_name = "WORLD")]
        trace: Option<u32>,
    },
    /// How long a decision takes: the search before each action, and the update of the belief after it.
    #[command(after_help = "Examples:\n  cargo xtask bench decision --domain D4 --worlds 2 --threads 2")]
    Decision {
        #[command(flatten)]
        from: Worlds,
        /// Worlds, played one after the other.
        #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
        worlds: u32,
        #[command(flatten)]
        work: program::Threads,
    },
    /// Speed, returns and exact values of the search on the standard problems.
    #[command(after_help = "Examples:\n  cargo xtask bench planner --quick")]
    Planner {
        /// Episodes a row; of RockSample(7, 8), (11, 11) and Tag with 2^10 simulations a move, half as many with 2^13, a quarter with 2^15.
        #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=100_000))]
        episodes: u32,
        /// Only 2^10 simulations a move of RockSample(7, 8), (11, 11) and Tag.
        #[arg(long)]
        quick: bool,
        /// Only this row of the large and continuous problems: light_dark, rocksample_15_15, laser_tag, vdp_tag or sub_hunt. May be given again.
        #[arg(long = "only", value_name = "ROW")]
        only: Vec<String>,
        /// Root seed of these rows. Options are chosen on 1001 to 1003.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Overrides an option of these rows: row.key=value.
        #[arg(long = "set", value_name = "ROW.KEY=VALUE")]
        set: Vec<String>,
        /// Writes the results there, a row as soon as it is done. A row with the same seed, episodes and options is not played again.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Prints one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Training and inference of the prior, in turn with PyTorch (Python of the variable PYTHON, else python3).
    #[command(after_help = "Examples:\n  cargo xtask bench prior --rounds 3")]
    Prior {
        /// Epochs of every program; medians of these are compared.
        #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
        rounds: u32,
        /// Inference steps in a batch.
        #[arg(long, default_value_t = 5000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
        steps: u32,
        /// Dataset for whole epochs [default: runs/data/sawyer, else runs/quick/data/sawyer, else none].
        #[arg(long)]
        data: Option<PathBuf>,
        /// Also times PyTorch's compiled step, which needs a C++ compiler and a minute.
        #[arg(long)]
        compile: bool,
        /// Prints one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// How often `log check` sees what is wrong with a log: spoils good ones in up to 32 ways.
    #[command(
        after_help = "Examples:\n  cargo xtask bench log-check tests/data/mujoco-logs/logs/set-002 tests/data/mujoco-logs/logs/set-003"
    )]
    LogCheck {
        /// Folders of good logs with robot = "none".
        #[arg(required = true)]
        logs: Vec<PathBuf>,
        /// Writes the spoilt logs into this new folder, for `diagnose`, and makes no table.
        #[arg(long, value_name = "FOLDER", conflicts_with = "json")]
        write: Option<PathBuf>,
        /// Prints one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Errors against MuJoCo's recorded answers and closed forms: the page in the docs of physics-model.
    #[command(after_help = "Examples:\n  cargo xtask bench accuracy")]
    Accuracy {
        /// Writes the page into the project.
        #[arg(long)]
        write: bool,
        /// Overrides a scenario entry: key=value.
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
}

/// A length on the command line.
fn length(text: &str) -> Result<f64, String> {
    let good = |length: &f64| length.is_finite() && *length > 0.0;
    text.parse().ok().filter(good).ok_or_else(|| format!("expected a length above 0, in m, found `{text}`"))
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask bench planner --quick
  cargo xtask bench accuracy";

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let root = scenario::project_root(arguments.root.as_deref())?;
    match &arguments.what {
        What::Physics { rounds, actions, json } => {
            let effort = Effort { rounds: *rounds as usize, actions: *actions as usize };
            let result = physics::run(&root, effort, |text| program::say!("{text}"))?;
            if *json {
                program::out!("{result}");
            } else {
                program::show(&table(&result));
            }
        }
        What::Calibration { from, worlds, quick, prior, world, reference, out } => {
            let (prior, world) = (prior.clone(), world.clone());
            let reference = reference.map(|particles| particles as usize);
            let task =
                calibration::Task { from: from.clone(), worlds: *worlds, quick: *quick, prior, world, reference };
            let summary = calibration::run(&root, &task, out, |text| program::say!("{text}"))?;
            program::show(&calibration::table(&summary));
        }
        What::Nudge { trials, domain, nudge_m, set } => {
            let task = nudge::Task { domain: domain.clone(), nudge_m: *nudge_m, set: set.clone() };
            program::out!("{}", serde_json::to_string_pretty(&nudge::run(&root, &task, trials)?)?);
        }
        What::Policy { from, worlds, blind, trace } => {
            let task = policy::Task { from: from.clone(), worlds: *worlds, blind: *blind, trace: *trace };
            program::out!("{}", policy::run(&root, &task)?);
        }
        What::Decision { from, worlds, work } => {
            let task = decision::Task { from: from.clone(), worlds: *worlds, threads: work.count() };
            let figures = decision::run(&root, &task, |text| program::say!("{text}"))?;
            program::out!("{}", serde_json::to_string_pretty(&figures)?);
        }
        What::Planner { episodes, quick, only, seed, set, out, json } => {
            let effort = planner::Effort { episodes: *episodes, quick: *quick };
            let task = planner::Task { effort, seed: *seed, only: only.clone(), set: set.clone() };
            let open = |folder: &PathBuf| planner::Results::open(folder, scenario::commit(&root));
            let results = out.as_ref().map(open).transpose()?;
            let result = planner::run(&task, results.as_ref(), |text| program::say!("{text}"))?;
            if *json {
                program::out!("{result}");
            } else {
                program::show(&planner::table(&result));
            }
        }
        What::Prior { rounds, steps, data, compile, json } => {
            let made = ["runs/data/sawyer", "runs/quick/data/sawyer"].map(|folder| root.join(folder));
            let data = data.clone().or_else(|| made.into_iter().find(|folder| folder.join("meta/info.json").is_file()));
            let effort = prior::Effort { rounds: *rounds as usize, steps: *steps as usize, data, compile: *compile };
            let result = prior::run(&root, &effort, |text| program::say!("{text}"))?;
            if *json {
                program::out!("{result}");
            } else {
                program::show(&prior::table(&result));
            }
        }
        What::LogCheck { logs, write: Some(folder), .. } => {
            let count = log_faults::write(logs, folder)?;
            program::say!("{}: {count} logs", folder.display());
        }
        What::LogCheck { logs, json, .. } => {
            let table = log_faults::run(logs, scenario::commit(&root))?;
            program::show(&if *json { table.json()? + "\n" } else { table.markdown() });
        }
        What::Accuracy { write, set } => {
            let selection = Selection { set: set.clone(), ..Selection::new(&root) };
            let page = report::page(&root, &selection.load()?.world)?;
            if *write {
                let path = root.join(report::PAGE);
                std::fs::write(&path, &page).with_context(|| path.display().to_string())?;
            } else {
                program::show(&page);
            }
        }
    }
    Ok(())
}

/// The result as Markdown.
fn table(result: &Value) -> String {
    let number = |value: &Value, digits: usize| value.as_f64().map_or("–".into(), |v| format!("{v:.digits$}"));
    let mut text = String::from(
        "| tool | obstacle | ours, µs | MuJoCo pyramidal | ratio | MuJoCo elliptic | ratio | two steps of MuJoCo, pyramidal | elliptic | PyBullet |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (tool, rows) in [("ball", result), ("hand", &result["hand"])] {
        for obstacle in OBSTACLES {
            let row = &rows[obstacle];
            let cells = [
                ("us", 1),
                ("mujoco_pyramidal_us", 1),
                ("ratio", 2),
                ("mujoco_elliptic_us", 1),
                ("ratio_elliptic", 2),
                ("mujoco_pyramidal_2_substeps_us", 1),
                ("mujoco_elliptic_2_substeps_us", 1),
                ("pybullet_us", 1),
            ];
            let cells: Vec<String> = cells.iter().map(|(key, digits)| number(&row[key], *digits)).collect();
            text += &format!("| {tool} | {obstacle} | {} |\n", cells.join(" | "));
        }
    }
    text += "\n| obstacle | restore, µs | control step, µs | transition of the Sawyer, µs | of the Jaco, µs |\n|---|---|---|---|---|\n";
    for obstacle in OBSTACLES {
        let part = &result["parts"][obstacle];
        let transition = |robot: &str| number(&result["transition"][robot][format!("{obstacle}_us")], 1);
        text += &format!(
            "| {obstacle} | {} | {} | {} | {} |\n",
            number(&part["restore_us"], 1),
            number(&part["step_us"], 2),
            transition("sawyer"),
            transition("jaco")
        );
    }
    let scaling = &result["scaling"];
    text +=
        &format!("\nAll {} cores: {} times the throughput of one.\n", scaling["cores"], number(&scaling["speedup"], 2));
    text += &format!("\n{}\n", result["provenance"]);
    text
}
