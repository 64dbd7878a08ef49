//! `cargo xtask diagnose-learn`: how `diagnose` decides, made from logs of other engines.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use clap::Parser;
use diagnose_benchmark::example::{Example, read, to_lines};
use diagnose_benchmark::judge::{Judged, judge, judge_withheld};
use diagnose_benchmark::learn::{Judgement, learn, leave_one_engine_out};
use discrepancy::decision::Decision;
use serde::Serialize;
use statistics::wilson95;
use whole_file::Existing;

/// Fits how diagnose decides to its answers on logs whose truth is known, and judges it on the engine that was left out.
#[derive(Debug, Parser)]
#[command(name = "diagnose-learn", version, after_help = EXAMPLES)]
struct Arguments {
    /// Folders of logs, each with a folder truth beside them, or files that --examples wrote.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Folder of the answers of diagnose: ANSWERS/FOLDER/LOG/report.json.
    #[arg(long)]
    answers: Option<PathBuf>,
    /// File for what is read of logs and answers, one log a line: enough to learn again without them.
    #[arg(long)]
    examples: Option<PathBuf>,
    /// File that the decision is written to; none: it is judged alone.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Folder for the table of each engine, left out of what judges it.
    #[arg(long)]
    table: Option<PathBuf>,
    /// Begins from this decision, which had learnt from other logs: its weights change little, and what it did not know is learnt.
    #[arg(long, conflicts_with = "unseen")]
    from: Option<PathBuf>,
    /// Judges by this decision, which was made from other logs, instead of learning one: unseen logs.
    #[arg(long, conflicts_with = "out")]
    unseen: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask diagnose-learn runs/worlds/mujoco-all-seed11 runs/worlds/bullet-all-seed11 --answers runs/answers --table runs/table
  cargo xtask diagnose-learn assets/results/diagnose-worlds/seeds-51-52-91.jsonl --out runs/decision.json
  cargo xtask diagnose-learn runs/worlds/mujoco-all-seed501 --answers runs/answers --unseen assets/diagnose/decision.json";

/// The table.
#[derive(Serialize)]
struct Table {
    /// What it was made from.
    provenance: serde_json::Value,
    /// Engine and what is counted of its logs.
    engines: Vec<(String, Judged)>,
    /// Logs whose effect was withheld from what was compared: how many, called `unknown`, called by a name, by one with a confidence of 0.9 and more.
    withheld: [u32; 4],
}

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    check_places(arguments)?;
    let mut examples: Vec<Example> = Vec::new();
    for folder in &arguments.logs {
        examples.extend(read(folder, arguments.answers.as_deref())?);
    }
    let mut logs: Vec<&str> = examples.iter().map(|example| &*example.log).collect();
    logs.sort_unstable();
    if let Some(twice) = logs.windows(2).find(|pair| pair[0] == pair[1]) {
        bail!("{} is there twice: expected each log once, in a folder or in a file of examples", twice[0]);
    }
    let mut engines: Vec<String> = examples.iter().map(|example| example.truth.engine.clone()).collect();
    engines.sort_unstable();
    engines.dedup();
    if arguments.unseen.is_none() && engines.len() < 2 {
        bail!(
            "expected answers on logs of two engines or more, found {} logs of {} engines",
            examples.len(),
            engines.len()
        );
    }
    let earlier = arguments.from.as_deref().map(begun_from).transpose()?;
    let provenance = provenance(&examples, earlier.as_ref());
    let withheld = examples.iter().filter_map(Example::without_truth);
    let all: Vec<Example> = examples.iter().cloned().chain(withheld).collect();
    let judged = match &arguments.unseen {
        Some(path) => unseen(path, &all)?,
        None => leave_one_engine_out(&examples, &all, earlier.as_ref()),
    };
    let (withheld, judged): (Vec<_>, Vec<_>) = judged.into_iter().partition(|judgement| judgement.example.withheld);
    let of = |engine: &str| -> Vec<Judgement> {
        let own = |judgement: &&Judgement| engine.is_empty() || judgement.example.truth.engine == engine;
        judged.iter().filter(own).cloned().collect()
    };
    let mut rows: Vec<(String, Judged)> = engines.iter().map(|engine| (engine.clone(), judge(&of(engine)))).collect();
    rows.push(("all".into(), judge(&of(""))));
    let table = Table { provenance: provenance.clone(), engines: rows, withheld: judge_withheld(&withheld) };
    let text = markdown(&table);
    program::out!("{text}");
    if let Some(files) = tables(arguments) {
        if let Some(folder) = &arguments.table {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let json = serde_json::to_string_pretty(&table)? + "\n";
        for (file, text) in files.iter().zip([&text, &json]) {
            write(file, text)?;
        }
    }
    if let Some(path) = &arguments.examples {
        write(path, &to_lines(&examples)?)?;
    }
    if let Some(out) = &arguments.out {
        let all: Vec<&Example> = examples.iter().collect();
        write(out, &(serde_json::to_string_pretty(&learn(&all, earlier.as_ref(), provenance))? + "\n"))?;
    }
    Ok(())
}

/// The files of the table: text and numbers.
fn tables(arguments: &Arguments) -> Option<[PathBuf; 2]> {
    let name = if arguments.unseen.is_some() { "unseen" } else { "worlds" };
    let folder = arguments.table.as_ref()?;
    Some(["md", "json"].map(|extension| folder.join(name).with_extension(extension)))
}

/// Refuses places that hold something else, before anything is worked out.
fn check_places(arguments: &Arguments) -> Result<()> {
    if let (Some(folder), Some([text, numbers])) = (&arguments.table, tables(arguments)) {
        whole_file::check_folder(folder)?;
        if folder.exists() {
            whole_file::check_own(&text, "a table", |text| text.starts_with("| engine |"))?;
            whole_file::check_own(&numbers, "a table", |text| text.starts_with("{\n  \"provenance\""))?;
        }
    }
    if let Some(path) = &arguments.examples {
        whole_file::check_own(path, "a file of examples", |text| text.starts_with("{\"log\":"))?;
    }
    if let Some(out) = &arguments.out {
        whole_file::check_own(out, "a decision", |text| serde_json::from_str::<Decision>(text).is_ok())?;
    }
    Ok(())
}

/// A decision to begin from.
fn begun_from(path: &std::path::Path) -> Result<Decision> {
    let decision: Decision = diagnose_benchmark::folder::read(path)?;
    let scores = [
        ("effect", &decision.effect, decision.effect_features.len()),
        ("none", &decision.none, decision.log_features.len()),
        ("unknown", &decision.unknown, decision.log_features.len()),
    ];
    for (key, score, features) in scores {
        let found = score.weights.len();
        if found != features {
            bail!(
                "{}: key `{key}.weights`: expected {features} numbers, one for each feature, found {found}",
                path.display()
            );
        }
    }
    Ok(decision)
}

/// Every example with the probabilities of a decision that was made from other logs.
fn unseen<'a>(path: &std::path::Path, examples: &'a [Example]) -> Result<Vec<Judgement<'a>>> {
    let decision: Decision = diagnose_benchmark::folder::read(path)?;
    // What it began from has seen its own.
    let chain = std::iter::successors(Some(&decision.provenance), |of| of.get(BEGUN_FROM));
    let sets: Vec<&serde_json::Value> = chain.filter_map(|of| of["sets"].as_array()).flatten().collect();
    let seen = |example: &Example| sets.iter().any(|set| set["seed"].as_u64() == Some(example.truth.seed));
    if let Some(example) = examples.iter().find(|example| seen(example)) {
        bail!(
            "{}: seed {} served to make {}: expected logs of another seed",
            example.log,
            example.truth.seed,
            path.display()
        );
    }
    Ok(examples.iter().map(|example| Judgement::new(example, &decision)).collect())
}

fn write(path: &std::path::Path, text: &str) -> Result<()> {
    whole_file::write(path, text.as_bytes(), Existing::Replace).map(drop).map_err(program::failed)
}

/// The key of a provenance with that of the decision that another one began from.
const BEGUN_FROM: &str = "begun_from";

fn provenance(examples: &[Example], earlier: Option<&Decision>) -> serde_json::Value {
    let mut sets: Vec<(String, u64, usize)> = Vec::new();
    for example in examples {
        let name = format!("{} {}", example.truth.engine, example.truth.variant);
        match sets.iter_mut().find(|(other, seed, _)| *other == name && *seed == example.truth.seed) {
            Some(set) => set.2 += 1,
            None => sets.push((name, example.truth.seed, 1)),
        }
    }
    sets.sort();
    let mut folders: Vec<&str> = examples.iter().filter_map(|example| Some(example.log.split_once('/')?.0)).collect();
    folders.sort_unstable();
    folders.dedup();
    let sets: Vec<_> = (sets.iter())
        .map(|(engine, seed, logs)| serde_json::json!({ "engine": engine, "seed": seed, "logs": logs }))
        .collect();
    let mut provenance = serde_json::json!({
        "command": "diagnose-learn",
        "version": env!("CARGO_PKG_VERSION"),
        "folders": folders,
        "sets": sets,
        "logs": examples.len(),
    });
    if let Some(earlier) = earlier {
        provenance[BEGUN_FROM] = earlier.provenance.clone();
    }
    provenance
}

fn markdown(table: &Table) -> String {
    let mut text = String::from(
        "| engine | logs | named, of effects that show | `none` called `none` | false alarm | outside called `unknown` | wrong and ≥ 0.9 sure | 90 % intervals cover | calibration error | episodes simulated | s |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (engine, judged) in &table.engines {
        let _ = writeln!(
            text,
            "| {engine} | {} | {} | {} | {} | {} | {} | {} | {:.2} | {:.0} | {:.0} |",
            judged.logs,
            share(judged.effects[1], judged.effects[0]),
            share(judged.none[1], judged.none[0]),
            share(judged.false_alarms, judged.none[0]),
            share(judged.outside[1], judged.outside[0]),
            share(judged.sure_and_wrong, judged.logs),
            share(judged.intervals[1], judged.intervals[0]),
            judged.calibration_error,
            judged.rollouts,
            judged.seconds,
        );
    }
    let Some((_, all)) = table.engines.last() else { return text };
    text.push_str(
        "\n| the effect changes the readings by, noise variances | logs | the search compares it | named |\n|---|---|---|---|\n",
    );
    for (size, [logs, compared, named]) in ["3 to 30", "30 to 300", "more"].iter().zip(&all.by_size) {
        let _ = writeln!(text, "| {size} | {logs} | {} | {} |", share(*compared, *logs), share(*named, *logs));
    }
    text.push_str("\n| confidence in the most probable effect | logs | right |\n|---|---|---|\n");
    for (mean, right, count) in &all.reliability {
        let _ =
            writeln!(text, "| {mean:.2} | {count} | {} |", share((right * f64::from(*count)).round() as u32, *count));
    }
    let [logs, named] = all.effects;
    let _ = writeln!(
        text,
        "\nOf the {} effects that are not named, in {} logs one is named that does nearly the same, such as a force for a tilt.",
        logs - named,
        all.twins
    );
    let _ = writeln!(text, "\nIn {} further logs the effect shows less, and is named rightly.", all.slight);
    let [logs, unknown, named, sure] = table.withheld;
    let _ = writeln!(
        text,
        "\nOf {logs} logs whose effect was withheld from what was compared {unknown} are called `unknown`, {named} get another name, {sure} with a confidence of 0.9 or more."
    );
    let _ =
        writeln!(text, "\nOf {} logs with 11 episodes or fewer {} got a wrong and sure name.", all.few[0], all.few[1]);
    if table.provenance.get(BEGUN_FROM).is_some() {
        text.push_str(
            "\nThe decision that these began from had learnt from all engines: no engine was left out of that.\n",
        );
    }
    text
}

/// A share with its 95 % Wilson interval.
fn share(part: u32, whole: u32) -> String {
    if whole == 0 {
        return "–".to_string();
    }
    let [low, high] = wilson95(part, whole).map(|bound| 100.0 * bound);
    format!("{part} of {whole} ({low:.0} to {high:.0} %)")
}
