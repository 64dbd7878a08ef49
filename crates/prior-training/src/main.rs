//! `cargo xtask train`: trains the prior on a dataset, epoch by epoch, resumable.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{Context as _, Result, anyhow};
use clap::Parser;
use dataset::Reader;
use indicatif::{ProgressBar, ProgressStyle};
use pomdp::Seed;
use prior::features::ActionInput;
use prior::{Layout, NetworkConfig, Schedule, Sequence, TrainConfig, Trainer, curve_csv, write_atomically};
use program::{Failed, typed};

/// Trains the prior: LSTM with a mixture density head over (s, Θ).
#[derive(Debug, Parser)]
#[command(name = "train", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(flatten)]
    arm: program::Arm,
    /// Folder of the dataset [default: runs/data/ROBOT, runs/quick/data/ROBOT with --quick].
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder of the trained prior [default: runs/priors/ROBOT, runs/quick/priors/ROBOT with --quick].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Number of epochs, at most; the learning rate falls over all of them [default: 100, 10 with --quick].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    epochs: Option<u32>,
    /// Stops after this many epochs without a better held-out likelihood.
    #[arg(long, default_value_t = 15)]
    patience: usize,
    /// Probability that an output of an LSTM layer is dropped while training; the paper has none, the held-out likelihood prefers some.
    #[arg(long, default_value_t = 0.1)]
    dropout: f64,
    /// Decoupled weight decay; the paper has none.
    #[arg(long, default_value_t = 0.0)]
    weight_decay: f64,
    /// Keeps the learning rate at 0.001, as published, instead of letting it fall along half a cosine.
    #[arg(long)]
    constant_rate: bool,
    /// Tells the network the action that led to an observation; the paper does not.
    #[arg(long)]
    action_input: bool,
    /// Trains a network that forgets everything after each step, for `calibrate --memoryless`.
    #[arg(long)]
    memoryless: bool,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    work: program::Threads,
    /// A few epochs on the quick dataset.
    #[arg(long)]
    quick: bool,
    /// Fails unless there is an interrupted training to continue. Without this option one is continued where there is one.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask train --quick
  cargo xtask train --robot jaco --epochs 20 --data runs/data/jaco --out runs/priors/jaco-20";

/// What went wrong after the input was found to be good.
const FAILED: Failed = Failed::new("the training stopped, epochs that were finished are kept");

fn main() -> ExitCode {
    program::log_on_request();
    program::resumable("epochs", run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<bool> {
    let root = prior::project_root(arguments.project.root.as_deref(), &std::env::current_dir()?)?;
    let runs = root.join(if arguments.quick { "runs/quick" } else { "runs" });
    let name = prior::robot_name(&arguments.arm.robot);
    let data = arguments.data.clone().unwrap_or_else(|| runs.join("data").join(name));
    let out = arguments.out.clone().unwrap_or_else(|| runs.join("priors").join(name));
    rayon::ThreadPoolBuilder::new().num_threads(arguments.work.count()).build_global()?;

    let robot = &arguments.arm.robot;
    let reader = Reader::open(&data).with_context(|| {
        let quick = if arguments.quick { " --quick" } else { "" };
        let out = typed(&data);
        format!("{out}: no usable dataset, make one with `cargo xtask datagen --robot {robot}{quick} --out {out}`")
    })?;
    let manifest = reader.manifest().clone();
    if manifest.schema.robot != name {
        let found = &manifest.schema.robot;
        return Err(anyhow!("{}: schema.robot is {found}, expected {name}", data.join("meta/info.json").display()));
    }
    let recorded = reader.episodes()?;
    let input = if arguments.action_input { ActionInput::OneHot } else { ActionInput::Off };
    let layout = prior_training::layout_of_dataset(&manifest.schema, input)?;
    let sequences: Vec<Sequence> =
        recorded.iter().map(|episode| prior_training::sequence(&layout, episode)).collect::<Result<_, _>>()?;
    drop(recorded);
    let config = TrainConfig {
        network: NetworkConfig { hidden: vec![128, 128], components: 10, memory: !arguments.memoryless },
        learning_rate: 0.001,
        schedule: if arguments.constant_rate { Schedule::Constant } else { Schedule::Cosine },
        batch: 128,
        chunks: 4,
        held_out: 0.1,
        max_epochs: arguments.epochs.unwrap_or(if arguments.quick { 10 } else { 100 }) as usize,
        patience: arguments.patience,
        clip_norm: Some(10.0),
        weight_decay: arguments.weight_decay,
        dropout: arguments.dropout,
        rescale: true,
    };
    let seed = Seed(arguments.seed);
    whole_file::check_owner(&out, "prior.json")?;
    let state = out.join("training");
    let mut trainer = open_trainer(&out, &state, arguments.resume, &layout, &config, &sequences, seed)?;
    let provenance: BTreeMap<String, String> = [
        ("dataset_plan_hash", manifest.plan_hash.clone()),
        ("dataset_seed", manifest.seed.to_string()),
        ("dataset_transitions", manifest.transitions.to_string()),
        ("dataset_commit", manifest.commit.clone()),
        ("program", format!("train {}", env!("CARGO_PKG_VERSION"))),
    ]
    .map(|(key, value)| (key.to_string(), value))
    .into();
    if !train(&mut trainer, &config, &state).context(FAILED)? {
        return Ok(false);
    }
    let checkpoint = trainer.checkpoint(provenance);
    checkpoint.save(&out).context(FAILED)?;
    write_atomically(&out.join("curve.csv"), curve_csv(trainer.curve()).as_bytes()).context(FAILED)?;
    prior::pictures::learning_curve(name, trainer.curve()).save(&out.join("curve")).context(FAILED)?;
    program::out!(
        "{}: best epoch {} of {}, held-out {:.3} nats a step on {} episodes",
        out.display(),
        checkpoint.facts.best_epoch,
        checkpoint.facts.curve.len(),
        checkpoint.facts.held_out_nll.unwrap_or(f64::NAN),
        checkpoint.facts.held_out_episodes,
    );
    suggest_next(robot, &root, &out);
    Ok(true)
}

/// Compares the prior with episodes of other worlds, and plays with it.
fn suggest_next(robot: &str, root: &Path, out: &Path) {
    let command = |words: &[&str]| ["cargo", "xtask"].iter().chain(words).map(ToString::to_string).collect::<Vec<_>>();
    let (prior, held_out) = (typed(out), root.join("runs/held-out").join(prior::robot_name(robot)));
    let mut next = Vec::new();
    if !held_out.join("meta/info.json").is_file() {
        let data = typed(&held_out);
        let words = ["datagen", "--robot", robot, "--seed", "2", "--transitions", "20000", "--out", &data];
        next.push((command(&words), "makes episodes that it has not seen, for the next command"));
    }
    next.push((command(&["calibrate", "--robot", robot, "--prior", &prior]), "compares it with them"));
    let words = ["eval", "--domain", "D4", "--preset", "paper", "--robot", robot, "--prior", &prior, "--trials", "10"];
    next.push((command(&words), "plays with it"));
    program::next(&next);
}

/// Goes on with the training in `state` where there is one of the same settings, else begins.
fn open_trainer(
    out: &Path,
    state: &Path,
    insist: bool,
    layout: &Layout,
    config: &TrainConfig,
    sequences: &[Sequence],
    seed: Seed,
) -> Result<Trainer> {
    // The manifest comes last: without it a first save was killed half way, and there is nothing to go on with.
    if !state.join("training.json").is_file() {
        if insist {
            return Err(anyhow!("{}: --resume expected an interrupted training, found none", state.display()));
        }
        if let Some(file) = result_in(out) {
            let state = state.display();
            return Err(anyhow!(
                "{}: exists without {state} beside it: choose another --out or remove it",
                file.display()
            ));
        }
        return Ok(Trainer::new(config.clone(), layout.clone(), sequences, seed)?);
    }
    let trainer = Trainer::resume(state, layout, sequences)?;
    let (found, found_seed) = trainer.identity();
    if found != config || found_seed != seed {
        return Err(anyhow!(
            "{}: holds a training with seed {} and {:?}, this one has seed {} and {config:?}: choose another --out or remove the folder",
            state.display(),
            found_seed.0,
            found,
            seed.0,
        ));
    }
    program::say!("{} epochs are finished already", trainer.curve().len());
    Ok(trainer)
}

/// A file in `out` that this program would replace or, with the name of weights, remove.
fn result_in(out: &Path) -> Option<PathBuf> {
    let named = ["prior.json", "curve.csv", "curve.svg", "curve.png"].map(|name| out.join(name));
    let weights = std::fs::read_dir(out).into_iter().flatten().flatten().map(|entry| entry.path());
    let weights =
        weights.filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("weights-")));
    named.into_iter().filter(|path| path.exists()).chain(weights).next()
}

/// Epochs until the end; false where interrupted.
fn train(trainer: &mut Trainer, config: &TrainConfig, state: &Path) -> Result<bool> {
    let interrupted = program::interrupts()?;
    let bar = ProgressBar::new(config.max_epochs as u64);
    let style = "{bar:40} {pos}/{len} epochs, {eta} left, {msg}";
    bar.set_style(ProgressStyle::with_template(style).expect("the template is fixed"));
    bar.set_position(trainer.curve().len() as u64);
    while !trainer.finished() {
        if interrupted.load(Ordering::Relaxed) {
            return Ok(false);
        }
        #[expect(clippy::disallowed_methods, reason = "a program may time its epochs; nothing depends on it")]
        let started = std::time::Instant::now();
        let epoch = trainer.epoch()?;
        trainer.save(state)?;
        bar.inc(1);
        let line = format!(
            "epoch {}: training {:.3}, held out {:.3} nats, best {:.3} at {}, {:.1} s",
            epoch.epoch,
            epoch.training_nll,
            epoch.held_out_nll,
            epoch.best_held_out_nll,
            epoch.best_epoch,
            started.elapsed().as_secs_f64(),
        );
        if bar.is_hidden() {
            program::say!("{line}");
        } else {
            bar.set_message(line);
        }
    }
    bar.finish_and_clear();
    Ok(true)
}
