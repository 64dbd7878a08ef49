//! `cargo xtask scenario`: explains scenario files, and describes their format to editors.

mod table;

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, anyhow};
use clap::{Parser, Subcommand};
use program::{Failed, typed};
use scenario::{Explanation, FileKind, PRESET, Problem, Scenario, Selection, file_schema, project_root};

/// Explains scenario files, and describes their format to editors.
#[derive(Debug, Parser)]
#[command(name = "scenario", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Resolves a scenario, checks it with its arm, and lists every key: value, unit, meaning, and the layer that says so.
    #[command(after_help = CHECK_EXAMPLES)]
    Check(Check),
    /// Prints the JSON Schema of scenario files, for editors that complete and check TOML; assets/schemas/ holds the same.
    #[command(
        after_help = "In an editor with taplo (\"Even Better TOML\"), the first line of a file in scenarios/ can name it:\n  \
        #:schema ../assets/schemas/scenario.json\n\n\
        Examples:\n  cargo xtask scenario schema\n  cargo xtask scenario schema --robot"
    )]
    Schema {
        /// The schema of robot files (scenarios/robots/) in place of that of all other layers.
        #[arg(long)]
        robot: bool,
    },
}

#[derive(Debug, clap::Args)]
struct Check {
    /// Domain, a name in scenarios/ or a file; a resolved scenario.toml of a run too.
    #[arg(value_name = "FILE|DOMAIN")]
    domain: String,
    #[command(flatten)]
    arm: program::Arm,
    /// Preset: surmise, paper, or a file.
    #[arg(long, default_value = PRESET)]
    preset: String,
    /// With the layer that --quick lays over a preset.
    #[arg(long)]
    quick: bool,
    /// A model.toml of diagnose: its effects become those of the planner's model.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    overrides: program::Overrides,
    /// Lists only keys that begin with this: planner, task.reward, distribution.object.
    #[arg(long, value_name = "PREFIX")]
    only: Option<String>,
    /// Prints one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask scenario check D4
  cargo xtask scenario schema";
const CHECK_EXAMPLES: &str = "\
Examples:
  cargo xtask scenario check D4
  cargo xtask scenario check D4 --robot jaco --only planner
  cargo xtask scenario check D4 --set task.horizon=20 --json";

fn main() -> ExitCode {
    program::finish(run(&program::parse::<Arguments>().task))
}

fn run(task: &Task) -> Result<()> {
    let text = match task {
        Task::Check(check) => explain(check)?,
        Task::Schema { robot } => {
            let kind = if *robot { FileKind::Robot } else { FileKind::Scenario };
            format!(
                "{:#}
",
                file_schema(kind)
            )
        }
    };
    program::print(&text).context(Failed::new("cannot print"))?;
    if let Task::Check(check) = task
        && !check.json
    {
        suggest_next(check);
    }
    Ok(())
}

/// What a check prints.
fn explain(check: &Check) -> Result<String> {
    let root = project_root(check.project.root.as_deref())?;
    let selection = Selection {
        root: root.clone(),
        domain: check.domain.clone(),
        robot: check.arm.robot.clone(),
        preset: check.preset.clone(),
        quick: check.quick,
        set: check.overrides.set.clone(),
        effects: check.model.clone(),
    };
    let (scenario, mut explanations) = selection.explain()?;
    // The arm, and whether it reaches its start.
    Problem::assemble(&scenario, &root)?;
    if let Some(prefix) = &check.only {
        explanations.retain(|explanation| explanation.key.starts_with(prefix.as_str()));
        if explanations.is_empty() {
            return Err(anyhow!("--only {prefix}: expected the beginning of a key, no key of this scenario has it"));
        }
    }
    if let Some(warning) = check.model.as_ref().and_then(|_| scenario.truth_warning()) {
        program::say!("{warning}");
    }
    Ok(if check.json { json(&scenario, &explanations) } else { text(&scenario, &explanations) })
}

/// Plays what was checked, with the same choices.
fn suggest_next(check: &Check) {
    let mut chosen = vec!["--domain".to_string(), check.domain.clone()];
    for (option, value, usual) in [("--robot", &check.arm.robot, "sawyer"), ("--preset", &check.preset, PRESET)] {
        if value != usual {
            chosen.extend([option.to_string(), value.clone()]);
        }
    }
    chosen.extend(check.quick.then(|| "--quick".into()));
    chosen.extend(check.overrides.set.iter().flat_map(|set| ["--set".to_string(), set.clone()]));
    let command = |words: &[&str]| words.iter().map(ToString::to_string).collect::<Vec<_>>();
    let model = check.model.iter().flat_map(|path| ["--model".to_string(), typed(path)]);
    // Apart from what a network plays of it, which is another run.
    let stem = |name: &str| std::path::Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let runs = if check.quick { "runs/quick/eval" } else { "runs/eval" };
    let out = format!("{runs}/{}-{}-{}-oracle", stem(&check.domain), stem(&check.arm.robot), stem(&check.preset));
    let oracle = ["--methods", "oracle,heuristic", "--out", &out].map(String::from);
    let eval = [command(&["cargo", "xtask", "eval"]), chosen.clone(), oracle.to_vec(), model.collect()].concat();
    let mut next = vec![(eval, "plays it with full knowledge, and without a plan: can it be solved?")];
    if check.model.is_none() {
        let demo = [command(&["cargo", "xtask", "demo"]), chosen, command(&["--method", "no-rnn"])].concat();
        next.push((demo, "shows one episode"));
    }
    program::next(&next);
}

fn json(scenario: &Scenario, explanations: &[Explanation]) -> String {
    let report = serde_json::json!({
        "scenario": scenario.name,
        "robot": scenario.robot.name,
        "preset": scenario.preset,
        "hash": scenario.hash(),
        "keys": explanations,
    });
    format!("{report:#}\n")
}

fn text(scenario: &Scenario, explanations: &[Explanation]) -> String {
    let width = terminal_size::terminal_size().filter(|_| std::io::stdout().is_terminal());
    let table = table::render(explanations, width.map(|(terminal_size::Width(columns), _)| usize::from(columns)));
    let Scenario { name, preset, robot, .. } = scenario;
    format!("{table}\n{name} for {} with preset {preset} is good: {} keys\n", robot.name, explanations.len())
}
