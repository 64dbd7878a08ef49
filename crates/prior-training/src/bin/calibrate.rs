//! `cargo xtask calibrate`: compares what a prior says on held-out episodes with what was true.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, anyhow};
use clap::Parser;
use dataset::Reader;
use prior::calibrate::{Calibration, calibrate};
use prior::features::{self, ActionInput};
use prior::pictures::CALIBRATION;
use prior::{Checkpoint, Episode, Inference, Layout, Models, Sequence, TrainConfig, write_atomically};
use program::typed;

/// Compares what a prior says with the truth of episodes that it was not trained on.
#[derive(Debug, Parser)]
#[command(name = "calibrate", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(flatten)]
    arm: program::Arm,
    /// Folder of the prior [default: the one trained here, runs/priors/ROBOT, else the shipped one].
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Folder of a dataset made with another seed than the training data [default: runs/held-out/ROBOT].
    #[arg(long)]
    data: Option<PathBuf>,
    /// Folder of a prior trained with `train --memoryless` on the same data: a second baseline.
    #[arg(long)]
    memoryless: Option<PathBuf>,
    /// Folder of the report [default: the prior's].
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    work: program::Threads,
    /// Prints the report as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask calibrate --out runs/calibration/sawyer
of episodes that training has not seen, which this makes before:
  cargo xtask datagen --seed 2 --out runs/held-out/sawyer";

/// The report.
const REPORT: &str = "calibration.json";
/// Size of a report, at most; one of 6000 episodes has 120 kB.
const MOST_BYTES: u64 = 64 << 20;
/// Keys of a report of every version.
const KEYS: [&str; 4] = ["episodes", "nll", "baseline_nll", "parameters"];

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let root = prior::project_root(arguments.project.root.as_deref(), &std::env::current_dir()?)?;
    let (robot, name) = (&arguments.arm.robot, prior::robot_name(&arguments.arm.robot));
    let folder =
        arguments.prior.clone().unwrap_or_else(|| prior::default_folder(&root, name, prior::checkpoint::FILE, false));
    let data = arguments.data.clone().unwrap_or_else(|| root.join("runs/held-out").join(name));
    let out = arguments.out.clone().unwrap_or_else(|| folder.clone());
    check_out(&out)?;
    rayon::ThreadPoolBuilder::new().num_threads(arguments.work.count()).build_global()?;

    let checkpoint = Checkpoint::load(&folder, None)?;
    let reader = Reader::open(&data).with_context(|| {
        format!(
            "{}: no usable dataset, make one with `cargo xtask datagen --robot {robot} --seed 2 --out {0}`",
            data.display()
        )
    })?;
    let manifest = reader.manifest();
    let layout = prior_training::layout_of_dataset(&manifest.schema, ActionInput::of(&checkpoint.layout))?;
    let manifest_file = folder.join("prior.json");
    checkpoint.layout.check(&layout, &manifest_file)?;
    if checkpoint.provenance.get("dataset_seed") == Some(&manifest.seed.to_string()) {
        return Err(anyhow!(
            "{}: seed is {}, that of the data the prior was trained on, expected another: its worlds are not held out",
            data.join("meta/info.json").display(),
            manifest.seed
        ));
    }
    let memoryless =
        arguments.memoryless.as_deref().map(|folder| memoryless_peer(folder, &checkpoint, &layout, &manifest_file));
    let memoryless = memoryless.transpose()?;
    let recorded = reader.episodes()?;
    let sequences: Vec<Sequence> =
        recorded.iter().map(|episode| prior_training::sequence(&layout, episode)).collect::<Result<_, _>>()?;
    let first = |episode: &dataset::Episode, event| prior_training::first_event(&manifest.schema, episode, event);
    let episodes: Vec<Episode<'_>> = recorded
        .iter()
        .zip(&sequences)
        .map(|(episode, sequence)| Episode {
            sequence,
            contact: first(episode, "tool_touched"),
            obstacle_contact: first(episode, "obstacle_touched"),
        })
        .collect();
    let inference = checkpoint.inference()?;
    let models = Models { network: &inference, baseline: &checkpoint.baseline, memoryless: memoryless.as_ref() };
    let calibration = calibrate(models, &layout, features::static_columns(&layout), &episodes);
    let json = serde_json::to_string_pretty(&calibration)? + "\n";
    // The report first: pictures beside it are those of a report.
    write_atomically(&out.join(REPORT), json.as_bytes())?;
    for (name, figure) in prior::pictures::calibration(name, &calibration) {
        figure.save(&out.join(name))?;
    }
    if arguments.json {
        program::out!("{}", serde_json::to_string(&calibration)?);
    } else {
        print(&calibration);
        program::say!("written to {}", typed(&out.join(REPORT)));
        suggest_next(robot, &folder);
    }
    Ok(())
}

/// Refuses a folder whose files of the names of results are not those of an earlier report. Reports lie beside priors, so the file itself has to
/// say what it is.
fn check_out(out: &Path) -> Result<()> {
    whole_file::check_owner(out, "prior.json")?;
    let report = out.join(REPORT);
    if !report.exists() {
        let pictures = CALIBRATION.iter().flat_map(|name| ["svg", "png"].map(|end| out.join(name).with_extension(end)));
        return match pictures.into_iter().find(|picture| picture.exists()) {
            Some(picture) => {
                Err(anyhow!("{}: exists without {REPORT} beside it: choose another --out", picture.display()))
            }
            None => Ok(()),
        };
    }
    let found = whole_file::read(&report, MOST_BYTES).ok().and_then(|text| serde_json::from_slice(&text).ok());
    let found: serde_json::Value = found.unwrap_or_default();
    if KEYS.iter().all(|key| found.get(key).is_some()) {
        Ok(())
    } else {
        Err(anyhow!("{}: exists, and is not a report of this program: choose another --out", report.display()))
    }
}

/// The network without memory that is compared with `checkpoint`: the same data, seed and settings, but for its memory.
fn memoryless_peer(
    folder: &Path,
    checkpoint: &Checkpoint,
    layout: &Layout,
    checkpoint_file: &Path,
) -> Result<Inference> {
    let memoryless = Checkpoint::load(folder, Some(layout))?;
    let file = folder.join("prior.json");
    if memoryless.network.memory {
        return Err(anyhow!("{}: network.memory is true, expected false", file.display()));
    }
    let (ours, theirs) = (&checkpoint.facts, &memoryless.facts);
    let network = ours.config.network.clone();
    let config = TrainConfig { network, ..theirs.config.clone() };
    if ours.data_blake3 != theirs.data_blake3 || ours.seed != theirs.seed || ours.config != config {
        return Err(anyhow!(
            "{}: was trained on other data, with another seed or other settings, expected those of {}",
            file.display(),
            checkpoint_file.display()
        ));
    }
    Ok(memoryless.inference()?)
}

/// Plays with the network.
fn suggest_next(robot: &str, folder: &Path) {
    let folder = typed(folder);
    let options = ["--domain", "D4", "--preset", "paper", "--robot", robot, "--prior", &folder, "--trials", "10"];
    let words = ["cargo", "xtask", "eval"].iter().chain(&options).map(ToString::to_string).collect();
    program::next(&[(words, "plays with it")]);
}

fn print(calibration: &Calibration) {
    let Calibration { episodes, steps, nll, baseline_nll, .. } = calibration;
    program::out!(
        "{episodes} episodes, {steps} steps; nats a step: network {nll:.2}, sampling distribution {baseline_nll:.2}"
    );
    if let Some(memoryless) = calibration.memoryless_nll {
        program::out!("the same network without memory: {memoryless:.2}");
    }
    program::out!(
        "\n{:<20} {:>8} {:>7} {:>7} {:>6} {:>9} {:>8}",
        "parameter",
        "episodes",
        "50 %",
        "90 %",
        "±",
        "90 % last",
        "touched"
    );
    for parameter in calibration.parameters.iter().filter(|p| calibration.static_targets.contains(&p.name)) {
        program::out!(
            "{:<20} {:>8} {:>7.3} {:>7.3} {:>6.3} {:>9.3} {:>8.3}",
            parameter.name,
            parameter.episodes,
            parameter.coverage50,
            parameter.coverage90,
            parameter.coverage90_stderr,
            parameter.coverage90_last.unwrap_or(f64::NAN),
            parameter.coverage90_last_touched.unwrap_or(f64::NAN),
        );
    }
    program::out!("");
    for class in &calibration.classes {
        program::out!(
            "{}: right at the last step in {:.3}, expected calibration error {:.3}, confusion {:?}",
            class.name,
            class.last_accuracy,
            class.expected_calibration_error,
            class.last_confusion
        );
    }
    if let Some(found) = calibration.obstacle_after_contact_accuracy {
        let touched = calibration.obstacle_contact_episodes;
        let denied = calibration.no_obstacle_accuracy.unwrap_or(f64::NAN);
        program::out!(
            "obstacle found in {found:.3} of {touched} episodes that touched it, denied in {denied:.3} without one"
        );
        let since: Vec<String> = calibration.obstacle_found_since_touch.iter().map(|f| format!("{f:.2}")).collect();
        let untouched = calibration.untouched_obstacle_found.unwrap_or(f64::NAN);
        program::out!("by steps since the touch: {}; of those that nothing touched {untouched:.3}", since.join(" "));
    }
    program::out!("\nsteps since the first contact, nats of Θ: network, sampling distribution, without memory");
    for report in calibration.sharpening.iter().filter(|r| r.since_contact.count > 0) {
        let score = &report.since_contact;
        let memoryless = score.static_nll.memoryless.map_or(String::new(), |nll| format!("{nll:>8.2}"));
        program::out!(
            "{:>4} {:>7} {:>8.2} {:>8.2} {memoryless}",
            report.step,
            score.count,
            score.static_nll.network.unwrap_or(f64::NAN),
            score.static_nll.baseline.unwrap_or(f64::NAN)
        );
    }
}
