//! `cargo xtask arm-learn`: how the diagnosis of arms decides, made from simulated logs of several engines, and judged on the engine that was left out.

mod learn;
mod score;
mod truth;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use arm_diagnosis::{Considered, Decision, Leftover, Log, Settings, diagnose_with};
use clap::Parser;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use whole_file::Existing;

use learn::learn;
use score::table;
use truth::{Truth, off, read_truths};

/// Makes and judges how the diagnosis of arms decides, from logs whose truth is known.
#[derive(Debug, Parser)]
#[command(name = "arm-learn", version, after_help = EXAMPLES)]
struct Arguments {
    /// Folders of logs with truth.json, as tests/peers/arms/arm_logs.py makes them.
    #[arg(required = true)]
    sets: Vec<PathBuf>,
    /// Folder for what was found in each log, which a later call takes up.
    #[arg(long)]
    answers: PathBuf,
    /// Writes the decision that all logs together teach.
    #[arg(long, conflicts_with = "unseen")]
    out: Option<PathBuf>,
    /// Judges this decision on the logs instead of learning from them; refuses sets that it was learnt from.
    #[arg(long)]
    unseen: Option<PathBuf>,
    /// Writes the tables.
    #[arg(long)]
    table: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask arm-learn runs/arms/mujoco-2 runs/arms/drake-3 --answers runs/arms/answers --out assets/diagnose/arm-decision.json --table runs/arms/table.md
  cargo xtask arm-learn runs/arms/mujoco-12 --answers runs/arms/answers --unseen assets/diagnose/arm-decision.json --table runs/arms/unseen.md";

/// What was found in a log, but for the decision.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Answer {
    considered: Vec<Considered>,
    leftover: Leftover,
    confusion_set: Vec<String>,
    /// Of the effect that is right, where it was found: how far values are off, in halves of the fit's own 90 % intervals.
    off: BTreeMap<String, f64>,
}

/// A log with its truth and what was found.
struct Case {
    truth: Truth,
    answer: Answer,
}

fn main() -> ExitCode {
    program::end(run(&program::parse()), program::code)
}

fn run(arguments: &Arguments) -> Result<()> {
    whole_file::check_own(&arguments.table, "a table", |text| text.starts_with("| logs |"))?;
    if let Some(out) = &arguments.out {
        whole_file::check_own(out, "a decision", |text| serde_json::from_str::<Decision>(text).is_ok())?;
    }
    let cases = answered(arguments)?;
    let text = match &arguments.unseen {
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
            let decision: Decision = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
            for set in &arguments.sets {
                let name = set_name(set);
                if decision.learnt_from.contains(&name) {
                    bail!("{name} is not unseen: {} was learnt from it", path.display());
                }
            }
            let judged: Vec<(&Case, &Decision)> = cases.iter().map(|case| (case, &decision)).collect();
            table(&judged)
        }
        None => {
            let engines: std::collections::BTreeSet<&str> =
                cases.iter().map(|case| case.truth.engine.as_str()).collect();
            let others: BTreeMap<&str, Decision> = engines
                .iter()
                .map(|engine| (*engine, learn(cases.iter().filter(|case| case.truth.engine != *engine), Vec::new())))
                .collect();
            let judged: Vec<(&Case, &Decision)> =
                cases.iter().map(|case| (case, &others[case.truth.engine.as_str()])).collect();
            if let Some(out) = &arguments.out {
                let decision = learn(cases.iter(), arguments.sets.iter().map(|set| set_name(set)).collect());
                let text = serde_json::to_string_pretty(&decision)? + "\n";
                whole_file::write(out, text.as_bytes(), Existing::Replace)?;
            }
            table(&judged)
        }
    };
    whole_file::write(&arguments.table, text.as_bytes(), Existing::Replace)?;
    program::show(&text);
    Ok(())
}

fn set_name(set: &Path) -> String {
    set.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Diagnoses the logs that have no answer yet.
fn answered(arguments: &Arguments) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for set in &arguments.sets {
        let truths = read_truths(set)?;
        let folder = arguments.answers.join(set_name(set));
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let answers: Vec<Result<Option<Case>>> = truths
            .into_par_iter()
            .map(|(name, truth)| {
                let path = folder.join(format!("{name}.json"));
                if let Ok(text) = std::fs::read_to_string(&path) {
                    return Ok(Some(Case {
                        truth,
                        answer: serde_json::from_str(&text).with_context(|| path.display().to_string())?,
                    }));
                }
                let log = Log::read(&set.join(&name))?;
                let Some(answer) = answer(&log, &truth) else { return Ok(None) };
                whole_file::write(&path, serde_json::to_string(&answer)?.as_bytes(), Existing::Replace)?;
                program::say!("{}/{name}", set_name(set));
                Ok(Some(Case { truth, answer }))
            })
            .collect();
        for answer in answers {
            cases.extend(answer?);
        }
    }
    Ok(cases)
}

/// The findings; values are those of the right effect, whatever the decision says of it.
fn answer(log: &Log, truth: &Truth) -> Option<Answer> {
    // Whatever decides does not change what was found, but for the width of intervals.
    let own = Decision { widen: BTreeMap::new(), ..Decision::shipped().clone() };
    let diagnosis = diagnose_with(log, &Settings::default(), &own)?;
    let off = off(truth, &diagnosis);
    Some(Answer {
        considered: diagnosis.considered,
        leftover: diagnosis.leftover,
        confusion_set: diagnosis.confusion_set,
        off,
    })
}
