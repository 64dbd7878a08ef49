//! `robot excite`: writes a motion.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, Result, ensure};
use arm_dynamics::{Arm, Selection};
use arm_excitation::{Excitation, Question, Settings, excitation};
use clap::Args;
use serde_json::json;
use whole_file::Existing;

/// Rows a second: a log needs 20.
const LEAST_HZ: f64 = 20.0;
const MOST_HZ: f64 = 1e5;
/// Most rows of a file.
const MOST_ROWS: f64 = 2e6;

/// What is asked for on the command line.
#[derive(Debug, Args)]
pub(crate) struct Excite {
    /// URDF file, or TOML file with a table [robot].
    file: PathBuf,
    /// Joints of the arm, base first, separated by commas [default: the longest chain of joints that turn].
    #[arg(long, value_delimiter = ',')]
    joints: Option<Vec<String>>,
    /// Link at the end of the last rod [default: the last one of the chain].
    #[arg(long)]
    tip: Option<String>,
    /// What the log should tell, with what else may be wrong unknown as well; for masses no payload is carried.
    #[arg(long, value_enum, default_value_t = Question::All)]
    tell: Question,
    /// Length, s.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Rows a second.
    #[arg(long, default_value_t = 100.0)]
    rate: f64,
    /// Share of each joint's fastest rate.
    #[arg(long, default_value_t = 0.5)]
    speed: f64,
    /// Radius of the links, which are taken for rods from joint to joint, m.
    #[arg(long, default_value_t = 0.06)]
    radius: f64,
    /// Height of the floor, m in the base frame.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, conflicts_with = "no_floor")]
    floor: f64,
    /// There is no floor.
    #[arg(long)]
    no_floor: bool,
    /// Motions that are tried, 64 or more.
    #[arg(long, default_value_t = 2000)]
    tries: usize,
    /// Of all that is drawn.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Prints what the log would tell as JSON.
    #[arg(long)]
    json: bool,
    /// CSV file of the motion, which must not exist.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub(crate) fn run(asked: &Excite) -> Result<()> {
    let selection = Selection { joints: asked.joints.clone(), tip: asked.tip.clone() };
    let folder = asked.out.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.map_or(Ok(()), whole_file::check_folder)?;
    let arm = Arm::open(&asked.file, &selection)?;
    ensure!(!asked.out.exists(), "{} is there already: choose another name", asked.out.display());
    let settings = Settings {
        question: asked.tell,
        seconds: asked.seconds,
        speed: asked.speed,
        radius_m: asked.radius,
        floor_m: (!asked.no_floor).then_some(asked.floor),
        tries: asked.tries,
        seed: asked.seed,
    };
    settings.check()?;
    let rows = asked.rate * asked.seconds;
    ensure!(
        (LEAST_HZ..=MOST_HZ).contains(&asked.rate) && rows <= MOST_ROWS,
        "--rate is {}, expected {LEAST_HZ} to {MOST_HZ} rows a second and at most {MOST_ROWS} in all",
        asked.rate
    );
    let found = excitation(&arm, &settings, |tried, of, nats| match nats {
        Some(nats) => program::say!("{tried} of {of} motions, {nats:.1} nats"),
        None => program::say!("{tried} of {of} motions, none keeps the limits yet"),
    })?;
    let text = table(&arm, &found, asked.rate);
    folder
        .map_or(Ok(()), std::fs::create_dir_all)
        .with_context(|| format!("cannot make the folder of {}", asked.out.display()))?;
    let written = whole_file::write(&asked.out, text.as_bytes(), Existing::Keep)?;
    ensure!(written, "{} is there already: choose another name", asked.out.display());
    if asked.json {
        let summary = json!({
            "question": settings.question, "nats": found.nats, "random_nats_median": found.random_median,
            "random_motions": found.random, "random_motions_that_keep_the_limits": found.random_nats.len(),
            "spreads": found.spreads, "notes": found.notes.iter().chain(arm.notes()).collect::<Vec<_>>(),
        });
        program::show(&(serde_json::to_string_pretty(&summary).context("JSON")? + "\n"));
    } else {
        print(&found, arm.notes());
    }
    program::say!("written to {}", asked.out.display());
    Ok(())
}

/// Columns in the order of the joints, as in a log: those of positions and rates are what a controller is told.
fn table(arm: &Arm, found: &Excitation, rate: f64) -> String {
    let mut text = String::from("time_secs");
    for units in [["rad", "m"], ["rps", "mps"], ["rps2", "mps2"]] {
        for (index, joint) in arm.joints().iter().enumerate() {
            let _ = write!(text, ",command_joint_{index}_{}", units[usize::from(joint.slides)]);
        }
    }
    text.push('\n');
    let seconds = found.motion.seconds();
    // The end, where the arm rests, is a row too.
    let rows = (rate * seconds - 1e-6).ceil() as usize;
    for time in (0..rows).map(|row| row as f64 / rate).chain([seconds]) {
        let samples = found.motion.at(time);
        let _ = write!(text, "{time:.6}");
        for value in samples
            .iter()
            .map(|s| s.position)
            .chain(samples.iter().map(|s| s.rate))
            .chain(samples.iter().map(|s| s.acceleration))
        {
            let _ = write!(text, ",{value:.9}");
        }
        text.push('\n');
    }
    text
}

/// Three digits that say something.
fn digits(value: f64) -> String {
    let places = if value > 0.0 { (2 - value.log10().floor() as i32).clamp(0, 12) } else { 0 };
    format!("{value:.*}", places as usize)
}

fn print(found: &Excitation, of_file: &[String]) {
    program::out!("{:<60} {:>12} {:>12}  unit", "number", "before", "after");
    for spread in &found.spreads {
        let name = whole_file::one_line(&spread.name, 60);
        program::out!("{name:<60} {:>12} {:>12}  {}", digits(spread.before), digits(spread.after), spread.unit);
    }
    program::out!(
        "Standard deviations before the log and after it, where torques are off by 2 % of what is typical, anew every 0.1 s."
    );
    let compared = match found.random_median {
        Some(middle) => format!(
            "of {} random motions, wide and small, {} keep the limits and tell {middle:.1} in the middle",
            found.random,
            found.random_nats.len()
        ),
        None => format!("none of {} random motions keeps the limits", found.random),
    };
    program::out!("The log is expected to tell {:.1} nats; {compared}.", found.nats);
    for note in found.notes.iter().chain(of_file) {
        program::out!("  {note}");
    }
    program::out!("Masses stand in the frames of their joints, whose z is the axis.");
    program::out!(
        "Links were taken for rods from joint to joint, the first from the file's root: look at the motion in a simulator first."
    );
}
