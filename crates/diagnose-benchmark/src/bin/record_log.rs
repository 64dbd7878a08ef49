//! `cargo xtask record-log`: a log of the true world of a scenario, to rehearse a diagnosis before a robot is at hand.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Parser;
use diagnose_benchmark::example::{Named, Truth};
use diagnose_benchmark::generate::Actions;
use diagnose_benchmark::rehearsal::{difference, record};
use discrepancy::ModelFile;
use measured_log::{Episode, Format, Log, Notes};
use physics_model::EffectConfig;
use pomdp::Seed;
use program::typed;
use scenario::{Problem, Selection};
use whole_file::Existing;

/// Records pushes of one object in the true world of a scenario as a log for diagnose, with the effects that the model knows of as model.toml.
#[derive(Debug, Parser)]
#[command(name = "record-log", version, after_help = EXAMPLES)]
struct Arguments {
    /// Domain: tilted, D1 to D5, obstacle, or a scenario file.
    #[arg(long, default_value = "tilted")]
    domain: String,
    #[command(flatten)]
    arm: program::Arm,
    #[command(flatten)]
    overrides: program::Overrides,
    /// Pushes: designed to tell effects apart, or passive, as they come.
    #[arg(long, value_enum, default_value = "designed")]
    actions: Actions,
    /// Seed of the object, the pushes and the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the log; it must not hold one yet.
    #[arg(long)]
    out: PathBuf,
    /// File for what the log hides (`--set effects.truth=[…]`), as diagnose-learn reads it: FOLDER/truth/log-000.json of a log in FOLDER/log-000.
    #[arg(long)]
    truth: Option<PathBuf>,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask record-log --domain tilted --actions passive --out runs/rehearsal/log
  cargo xtask record-log --domain D1 --actions designed --out runs/rehearsal/level";

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let root = scenario::project_root(arguments.project.root.as_deref())?;
    let selection = Selection {
        domain: arguments.domain.clone(),
        robot: arguments.arm.robot.clone(),
        set: arguments.overrides.set.clone(),
        ..Selection::new(&root)
    };
    let problem = Problem::assemble(&selection.load()?, &root)?;
    whole_file::check_owner(&arguments.out, "log.toml")?;
    let model_file = arguments.out.join("model.toml");
    if !arguments.out.join("log.toml").exists() && model_file.exists() {
        bail!("{}: exists without log.toml beside it: choose another --out", model_file.display());
    }
    if let Some(truth) = &arguments.truth {
        if truth.exists() || truth.starts_with(&arguments.out) {
            bail!("--truth {}: expected a file that is not there, outside of the log", truth.display());
        }
        let known = &problem.scenario.effects;
        if let Some(effect) = known.model.iter().find(|effect| !known.truth.contains(effect)) {
            bail!(
                "--truth: effects.model has {}, expected it in effects.truth with the same values",
                effect.kind().name()
            );
        }
    }
    let log = record(&problem, arguments.actions, Seed(arguments.seed))?;
    let truth = (arguments.truth.as_ref())
        .map(|path| anyhow::Ok((path, truth(arguments, &root, &problem, &log)?)))
        .transpose()?;
    match measured_log::write(&arguments.out, &log, Format::Csv, &Notes::new()) {
        Err(taken @ measured_log::Error::Exists { .. }) => return Err(taken.into()),
        Err(error) => return Err(program::failed(error)),
        Ok(()) => {}
    }
    let model = ModelFile::of_effects(problem.scenario.effects.model.clone()).to_toml()?;
    whole_file::write(&model_file, model.as_bytes(), Existing::Replace).map_err(program::failed)?;
    if let Some((path, truth)) = truth {
        let text = serde_json::to_string_pretty(&truth)? + "\n";
        whole_file::write(path, text.as_bytes(), Existing::Keep).map_err(program::failed)?;
    }
    let rows: usize = log.episodes.iter().map(Episode::rows).sum();
    program::out!("{}: {} episodes, {rows} rows", arguments.out.display(), log.episodes.len());
    let (folder, model) = (typed(&arguments.out), typed(&model_file));
    let words = ["cargo", "xtask", "diagnose", "--measured", &folder, "--model", &model];
    program::next(&[(words.map(String::from).to_vec(), "finds what the log shows and the model lacks")]);
    Ok(())
}

/// What a log of this problem hides, beside the same log without it.
fn truth(arguments: &Arguments, root: &Path, problem: &Problem, log: &Log) -> Result<Truth> {
    let mut scenario = problem.scenario.clone();
    let effects = &mut scenario.effects;
    let (known, hidden) =
        std::mem::take(&mut effects.truth).into_iter().partition(|effect| effects.model.contains(effect));
    effects.truth = known;
    let hidden: Vec<EffectConfig> = hidden;
    let without = record(&Problem::assemble(&scenario, root)?, arguments.actions, Seed(arguments.seed))?;
    Ok(Truth {
        engine: "rapier".into(),
        variant: arguments.arm.robot.clone(),
        seed: arguments.seed,
        effects: hidden.iter().map(Named::new).collect(),
        outside: Vec::new(),
        detectable: Some(difference(log, &without)),
        natural: Vec::new(),
        designed: arguments.actions == Actions::Designed,
        episodes: log.episodes.len(),
    })
}
