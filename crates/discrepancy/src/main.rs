//! `cargo xtask diagnose`: where simulation and measurement disagree, and which effect is missing.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use discrepancy::answer::{FILES, Place, check_place, owner};
use discrepancy::interval::decimals;
use discrepancy::{Answer, Error, ModelFile, Nominal, Report, Settings, Verdict, diagnose_watched, rig_tool};
use measured_log::Robot;
use physics_model::EffectConfig;
use physics_model::robot::{check_root, find_root};
use program::typed;
use serde::Deserialize;

#[path = "program/bar.rs"]
mod bar;
#[path = "program/folder.rs"]
mod folder;
#[path = "program/joints.rs"]
mod joints;

/// Finds where simulation and measurement disagree, names the missing effect, adds it to the model and shows the gap shrink.
#[derive(Debug, Parser)]
#[command(name = "diagnose", version, after_help = EXAMPLES)]
struct Arguments {
    /// Folder of the log: log.toml with samples.csv or samples.parquet (docs/src/reference/measured-log.md), or that of an arm's joints alone
    /// (docs/src/reference/joint-log.md).
    #[arg(long, required_unless_present = "list_effects")]
    measured: Option<PathBuf>,
    /// Model to begin with instead of the log's nominal one: the model.toml of an earlier diagnosis.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Folder for the answer: report, model and files of other simulators [default: runs/diagnose/NAME of the log's folder; where that holds the answer to another
    /// log, runs/diagnose/NAME- and a hash].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Seed of the hold-out split and of the bootstrap.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Holds out part I of K of the episodes instead of the share that the log says: K runs make a cross-validation.
    #[arg(long, value_name = "I/K", value_parser = fold)]
    fold: Option<[usize; 2]>,
    #[command(flatten)]
    work: program::Threads,
    /// Lists the effects that can be named: parameters, what shows them, what they are confused with.
    #[arg(long, conflicts_with_all = ["measured", "model", "out", "fold"])]
    list_effects: bool,
    /// Prints report.json, or the list of effects as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask diagnose --list-effects
  cargo xtask diagnose --measured tests/data/mujoco-logs/logs/set-003 --out runs/diagnose/first";

impl Arguments {
    /// An option that a log of joints alone has no use for.
    fn only_for_objects(&self) -> Option<&'static str> {
        let given = [("--model", self.model.is_some()), ("--fold", self.fold.is_some())];
        given.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }
}

fn main() -> ExitCode {
    // 2 is bad input, such as a place that may not be written; a disk that refuses is a failure.
    program::end(run(&program::parse()), |error| match error {
        Error::Write { source: whole_file::Error { source, .. } } | Error::Folder { source, .. } => {
            if source.kind() == ErrorKind::PermissionDenied { 2 } else { 1 }
        }
        _ => 2,
    })
}

#[expect(clippy::disallowed_methods, reason = "the report says how long it took; nothing depends on it")]
fn run(arguments: &Arguments) -> Result<(), Error> {
    let started = Instant::now();
    // Fails where a pool exists already: not here.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(arguments.work.count()).build_global();
    // Clap asks for it unless the effects are to be listed.
    let Some(measured) = &arguments.measured else { return list_effects(arguments.json) };
    if let Some(root) = &arguments.project.root {
        check_root(root)?;
    }
    if arm_diagnosis::is_joint_log(measured) {
        if let Some(option) = arguments.only_for_objects() {
            let reason = format!("has no object, and {option} is for logs that have one");
            return Err(Error::Unfit { log: measured.display().to_string(), reason });
        }
        return joints::run(measured, arguments.out.as_ref(), arguments.seed, arguments.json);
    }
    let log = measured_log::read(measured)?;
    let mut nominal = Nominal::new(&log.header, rig_tool(&log, arguments.project.root.as_deref())?)?;
    let owner = owner(measured);
    let default = || folder::default(Path::new("runs/diagnose"), measured, &owner, &FILES);
    let out = arguments.out.clone().unwrap_or_else(default);
    let begun = match &arguments.model {
        Some(path) => Some((path.display().to_string(), begin_with(path, &out, &mut nominal)?)),
        None => None,
    };
    // Before a minute is spent on what could not be written.
    check_place(&out, &owner)?;
    let place = Place::make(&out, &owner)?;
    let settings = Settings { seed: arguments.seed, fold: arguments.fold, ..Settings::default() };
    let name = measured.display().to_string();
    // A log that says too little leaves nothing behind.
    let watched = diagnose_watched(&log, &name, &nominal, &settings, &bar::Bar::new());
    let diagnosis = match watched {
        Ok(diagnosis) => diagnosis,
        Err(error) => {
            place.give_up();
            return Err(error);
        }
    };
    let begun = begun.as_ref().map(|(name, model)| (name.as_str(), model));
    let answer = Answer::new((&name, &log), &nominal, &diagnosis, &settings, begun, started.elapsed().as_secs_f64());
    answer.write(&place.claim)?;
    if arguments.json {
        program::show(&answer.json()?);
    } else {
        print_summary(&answer.report);
        suggest_next(arguments, measured, &answer.report, &out, log.header.robot);
    }
    Ok(())
}

fn list_effects(json: bool) -> Result<(), Error> {
    let text = if json {
        let list = serde_json::to_string_pretty(&discrepancy::listing::list());
        list.map_err(|error| Error::Model { reason: error.to_string() })? + "\n"
    } else {
        discrepancy::listing::text()
    };
    program::show(&text);
    Ok(())
}

/// Gives a nominal model what the file at `path` says; it must not be one that this diagnosis would write over.
fn begin_with(path: &Path, out: &Path, nominal: &mut Nominal) -> Result<ModelFile, Error> {
    let model = ModelFile::read(path)?;
    if path.canonicalize().ok().is_some_and(|path| out.join("model.toml").canonicalize().is_ok_and(|own| own == path)) {
        let reason = "expected another folder for the results than the model's: --out would write over it";
        return Err(Error::Model { reason: format!("{}: {reason}", path.display()) });
    }
    model.apply_as(&path.display().to_string(), nominal)?;
    Ok(model)
}

/// Parts of a cross-validation, at most.
const MOST_PARTS: usize = 1000;

/// Part and number of parts, the part counted from 0.
fn fold(text: &str) -> Result<[usize; 2], String> {
    let parts = text.split_once('/').and_then(|(part, parts)| Some([part.parse().ok()?, parts.parse().ok()?]));
    match parts {
        Some([part, parts]) if (2..=MOST_PARTS).contains(&parts) && (1..=parts).contains(&part) => {
            Ok([part - 1, parts])
        }
        _ => Err("expected I/K with 2 to 1000 parts and I from 1 to K, as in 1/5".into()),
    }
}

fn print_summary(report: &Report) {
    for warning in &report.warnings {
        program::out!("Check the log: {}", warning.sentence);
    }
    program::out!("{}", report.summary);
    if let Some(reason) = &report.reason {
        program::out!("  why unknown: {reason}");
    }
    for effect in &report.effects {
        program::out!("  {} (confidence {:.2}): {}", effect.name, effect.confidence, effect.description);
        for value in &effect.parameters {
            let [low, high] = value.interval90;
            let digits = decimals(value.interval90, value.value);
            program::out!(
                "    {} = {:.digits$} {} (90 %: {low:.digits$} to {high:.digits$})",
                value.key,
                value.value,
                value.unit
            );
        }
    }
    let names = report.confusion_set.join(", ");
    if report.effects.is_empty() && !names.is_empty() {
        program::out!("  the evidence favours {names}, but too little to name it");
    } else if report.confusion_set.len() > 1 {
        program::out!("  this log does not tell apart: {names}");
    }
    if let Some(description) = &report.description {
        program::out!("  what is left: {description}");
    }
    for cell in report.located.iter().filter(|cell| cell.share > 0.0 && cell.stands_out()).take(3) {
        let (channel, phase) = (cell.channel.name(), cell.phase.name());
        program::out!("  {:3.0} % of the gap: {channel}, {phase} (p = {:.3})", 100.0 * cell.share, cell.p_value);
    }
    if let Some(sentence) = report.thinned.sentence() {
        program::out!("  {sentence}");
    }
    if let Some(sentence) = report.left_out_sentence() {
        program::out!("  {sentence}");
    }
    report.retuned_sentences().iter().for_each(|sentence| program::out!("  {sentence}"));
    program::out!("  {}", report.noise_sentence());
    program::out!("  {}", report.split.sentence());
    program::out!("  next experiment: {}", report.next_experiment);
    program::out!("{} simulated episodes, {:.0} s", report.rollouts, report.seconds);
}

/// What to do with the answer: look at it, ask what is left, plan with it.
fn suggest_next(arguments: &Arguments, measured: &Path, report: &Report, out: &Path, robot: Robot) {
    program::say!("open {} in a browser: where, what, how sure", typed(&out.join("report.html")));
    if report.verdict != Verdict::Effect {
        return;
    }
    let command =
        |words: &[&str]| ["cargo", "xtask"].iter().chain(words).map(ToString::to_string).collect::<Vec<String>>();
    let (log, model) = (typed(measured), typed(&out.join("model.toml")));
    let name = out.file_name().map_or_else(|| "log".into(), |name| name.to_string_lossy().into_owned());
    let again = typed(&out.with_file_name(format!("{name}-again")));
    let mut commands = vec![(
        command(&["diagnose", "--measured", &log, "--model", &model, "--out", &again]),
        "shows whether anything is left",
    )];
    if let Some((robot, truth)) = simulated_truth(arguments, out, robot) {
        let mut plan = command(&["eval", "--domain", "D1", "--robot", robot, "--methods", "no-rnn", "--trials", "10"]);
        plan.extend(["--model".into(), model, "--set".into(), truth]);
        commands.push((plan, "plans with it, in a simulated world that has it too"));
    }
    program::next(&commands);
}

/// What every scenario begins with.
#[derive(Deserialize)]
struct Base {
    effects: Lists,
}

/// Effects of the simulated true world.
#[derive(Deserialize)]
struct Lists {
    truth: Vec<EffectConfig>,
}

/// The arm of a log in scenarios, and the override that gives a simulated world the effects of the model that was found; none outside a project.
fn simulated_truth(arguments: &Arguments, out: &Path, robot: Robot) -> Option<(&'static str, String)> {
    let robot = match robot {
        Robot::Sawyer => "sawyer",
        Robot::Jaco => "jaco",
        // Whatever pushed there, no task of ours has it.
        Robot::None => return None,
    };
    let root = arguments.project.root.clone().or_else(|| find_root(Path::new(".")).ok())?;
    let base: Base = toml::from_str(&std::fs::read_to_string(root.join("scenarios/base.toml")).ok()?).ok()?;
    let found = ModelFile::read(&out.join("model.toml")).ok()?;
    let truth = base.effects.truth;
    let lacks = |effect: &&EffectConfig| truth.iter().all(|known| known.kind() != effect.kind());
    let effects: Vec<&EffectConfig> = truth.iter().chain(found.effects().iter().filter(lacks)).collect();
    Some((robot, format!("effects.truth={}", toml::Value::try_from(effects).ok()?)))
}
