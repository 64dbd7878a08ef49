//! `cargo xtask log check`: what a log's own readings say against it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use discrepancy::{Error, Nominal, rig_tool, warning};
use log_check::{Alignment, Check, Correction, Estimate, Reading, Sensor};
use measured_log::{Format, Log, Notes};
use physics_model::rig::RigTool;
use physics_model::robot::check_root;
use program::typed;

/// Looks at a measured log before anything is concluded from it.
#[derive(Debug, Parser)]
#[command(name = "log", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Says what is in a log, what looks wrong with units, frames, sizes, clocks and sensors, and what it cannot show.
    #[command(after_help = EXAMPLES)]
    Check(Checked),
    /// Fits how tool and object lie to each other, from the rows in which one pushes the other: the tracker's frame, the object's size, its clock.
    #[command(
        after_help = "Examples:\n  cargo xtask log align tests/data/mujoco-logs/logs/set-003\n  cargo xtask log align runs/my-log --fix runs/my-log-aligned"
    )]
    Align(Aligned),
}

#[derive(Debug, clap::Args)]
struct Aligned {
    /// Folder of the log.
    log: PathBuf,
    /// Writes a copy in which the object's poses and size are as fitted; the folder must not hold a log yet.
    #[arg(long, value_name = "DIR")]
    fix: Option<PathBuf>,
    /// Prints the values as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    project: program::Project,
}

#[derive(Debug, clap::Args)]
struct Checked {
    /// Folder of the log: log.toml with samples.csv or samples.parquet.
    log: PathBuf,
    /// Writes a copy in which everything that can be mended is, and says what was done; the folder must not hold a log yet.
    #[arg(long, value_name = "DIR")]
    fix: Option<PathBuf>,
    /// Simulates nothing: skips what held-out episodes say of each other way in which the log may be meant.
    #[arg(long)]
    readings_only: bool,
    /// Ends with exit code 1 if anything looks wrong, for scripts.
    #[arg(long)]
    deny: bool,
    /// Prints the check as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask log check tests/data/mujoco-logs/logs/set-003
  cargo xtask log check runs/my-log --fix runs/my-log-mended
  cargo xtask log align runs/my-log";

/// Split of the episodes for what is simulated: that of `diagnose` without `--seed`.
const SEED: u64 = 1;

fn main() -> ExitCode {
    let mut denied = false;
    let done = match program::parse::<Arguments>().verb {
        Verb::Check(options) => run(&options).map(|wrong| denied = wrong && options.deny),
        Verb::Align(options) => align(&options),
    };
    let code = program::end(done, |error| if let Error::Folder { .. } = error { 1 } else { 2 });
    if denied { ExitCode::from(1) } else { code }
}

fn run(options: &Checked) -> Result<bool, Error> {
    if let Some(root) = &options.project.root {
        check_root(root)?;
    }
    let log = read(&options.log)?;
    let tool = rig_tool(&log, options.project.root.as_deref())?;
    let check = warning::check(&log, &tool);
    let nominal = Nominal::new(&log.header, tool)?;
    let sentences: Vec<String> = if options.readings_only {
        check.suspicions.iter().map(log_check::Suspicion::sentence).collect()
    } else {
        warning::warnings(&log, &nominal, &check, SEED).into_iter().map(|warning| warning.sentence).collect()
    };
    if options.json {
        let json = serde_json::to_string_pretty(&check).map_err(|error| Error::Model { reason: error.to_string() })?;
        program::show(&(json + "\n"));
    } else {
        print(&log, &check, &sentences);
        if !sentences.is_empty() && options.fix.is_none() {
            program::out!("{MENDED}");
        }
    }
    if let Some(out) = &options.fix {
        fix(&log, &check, &options.log, out)?;
    }
    Ok(!check.suspicions.is_empty())
}

/// A log with an object.
fn read(folder: &Path) -> Result<measured_log::Log, Error> {
    if arm_diagnosis::is_joint_log(folder) {
        let reason = "is a log of an arm's joints, which `diagnose` reads and this program does not";
        return Err(Error::Unfit { log: folder.display().to_string(), reason: reason.into() });
    }
    Ok(measured_log::read(folder)?)
}

fn align(options: &Aligned) -> Result<(), Error> {
    if let Some(root) = &options.project.root {
        check_root(root)?;
    }
    let log = read(&options.log)?;
    let tool = rig_tool(&log, options.project.root.as_deref())?;
    let arm = if let RigTool::Arm(arm) = &tool { Some(&**arm) } else { None };
    let unfit = |reason| Error::Unfit { log: options.log.display().to_string(), reason };
    let found = log_check::align(&log, arm).map_err(unfit)?;
    if options.json {
        let json = serde_json::to_string_pretty(&found).map_err(|error| Error::Model { reason: error.to_string() })?;
        program::show(&(json + "\n"));
    } else {
        print_alignment(&found);
    }
    if let Some(out) = &options.fix {
        let readings = found.correction.readings();
        if readings.is_empty() {
            program::say!("nothing of it is to be moved or scaled: no copy was written");
            return Ok(());
        }
        let done: Vec<String> = readings.iter().map(Reading::words).collect();
        copy(&readings.iter().fold(log, |log, reading| reading.apply(&log)), &done, &options.log, out)?;
    }
    Ok(())
}

fn print_alignment(found: &Alignment) {
    let [before, after] = found.distance_m.map(|distance| 1e3 * distance);
    program::out!(
        "The tool pushes the object in {} episodes. Their surfaces are then {before:.2} mm apart in the median; aligned {after:.2} mm.",
        found.episodes
    );
    let [x, y, z] = found.translation_m;
    let size = Estimate { value: found.size_factor.value - 1.0, ..found.size_factor };
    let rows = [
        ("object's poses, x", x, 1e3, "mm"),
        ("object's poses, y", y, 1e3, "mm"),
        ("object's poses, z", z, 1e3, "mm"),
        ("object's poses, about z", found.yaw_rad, 1f64.to_degrees(), "°"),
        ("object's lengths", size, 100.0, "%"),
        ("object's clock, late", found.late_secs, 1e3, "ms"),
    ];
    for (what, estimate, factor, unit) in rows {
        let says = if estimate.shows() { "" } else { "  (no more than chance)" };
        program::out!("  {what:24} {:+8.2} ± {:.2} {unit}{says}", factor * estimate.value, factor * estimate.stddev);
    }
    if found.correction == Correction::default() {
        program::out!("Tool and object lie as the log says.");
        return;
    }
    print_mapping(&found.correction);
}

/// The lines of a mapping that correct it.
fn print_mapping(correction: &Correction) {
    let Correction { frame, size_factor, late_secs } = correction;
    if frame.is_some() || late_secs.is_some() {
        program::out!("In the mapping of `import-log`, where the object has no frame and no offset yet:\n");
        program::out!("[object]");
    }
    if frame.is_some() {
        program::out!("frame = \"aligned\"");
    }
    if let Some(late_secs) = late_secs {
        program::out!("offset_secs = {:.4}  # needs grid.sample = \"linear\"", -late_secs);
    }
    if let Some(([x, y, z], yaw_rad)) = frame {
        program::out!(
            "\n[frames.aligned]\ntranslation_m = [{x:.5}, {y:.5}, {z:.5}]\nrpy_deg = [0.0, 0.0, {:.3}]",
            yaw_rad.to_degrees()
        );
        program::out!("\nThe same frame is that of [object_velocity] and [object_spin], where the mapping has them.");
    }
    if let Some(factor) = size_factor {
        program::out!("The lengths of `log.object` are to be multiplied by {factor:.4}.");
    }
}

/// What to do about what looks wrong.
const MENDED: &str =
    "`cargo xtask log check LOG --fix NEW` writes a copy in which what can be mended is (docs/src/guides/check.md).";

fn print(log: &Log, check: &Check, sentences: &[String]) {
    let rows: usize = log.episodes.iter().map(measured_log::Episode::rows).sum();
    program::out!("{} episodes, {rows} rows.", log.episodes.len());
    program::out!(
        "{:18} {:>9} {:>10} {:>9} {:>10}  range of all its columns",
        "by first column",
        "readings",
        "a second",
        "gap, s",
        "step"
    );
    for sensor in &check.sensors {
        program::out!("{}", line(sensor));
    }
    if let Some(clock) = &check.clock {
        program::out!(
            "{} comes every {:.3} ms, give or take {:.3} ms; {} gaps.",
            clock.column,
            1e3 * clock.period_secs,
            1e3 * clock.jitter_secs,
            clock.gaps
        );
    }
    if let Some(touch) = check.fit.touch {
        program::out!(
            "The object sets out {} times; the tool then touches it in {:.0} % and is {:.1} mm from its surface in the median.",
            touch.onsets,
            100.0 * touch.met,
            1e3 * touch.distance_m.abs()
        );
    }
    if let Some(rest) = check.fit.rest {
        program::out!(
            "At rest it leans by {:.1}° and its lowest point is {:.1} mm {} the table, in the median of {} episodes.",
            rest.tilt_rad.to_degrees(),
            1e3 * rest.height_m.abs(),
            if rest.height_m < 0.0 { "below" } else { "above" },
            rest.episodes
        );
    }
    if let Some(forces) = check.forces {
        program::out!(
            "Forces point {:.0}° away from the way out of the object and are {:.2} times friction · weight, in the median of {} episodes.",
            forces.cosine.clamp(-1.0, 1.0).acos().to_degrees(),
            forces.strength,
            forces.episodes
        );
    }
    for sentence in sentences {
        program::out!("Wrong? {sentence}");
    }
    if sentences.is_empty() {
        program::out!("Nothing looks wrong.");
    }
    for what in &check.not_told {
        program::out!("This log does not tell {what}.");
    }
}

fn line(sensor: &Sensor) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "–".into(), |value| format!("{value:.4}"));
    format!(
        "{:18} {:>9} {:>10} {:>9.3} {:>10}  {:.4} to {:.4}",
        sensor.column,
        sensor.read,
        sensor.rate_hz.map_or_else(|| "–".into(), |rate| format!("{rate:.1}")),
        sensor.longest_gap_secs,
        number(sensor.smallest_step),
        sensor.range[0],
        sensor.range[1]
    )
}

/// Writes the log as it may be meant.
fn fix(log: &Log, check: &Check, source: &Path, out: &Path) -> Result<(), Error> {
    let readings: Vec<&Reading> = check.suspicions.iter().filter_map(|suspicion| suspicion.readings.first()).collect();
    let mut mended = readings.iter().fold(log.clone(), |log, reading| reading.apply(&log));
    let mut done: Vec<String> = readings.iter().map(|reading| reading.words()).collect();
    if let Some(alive) = log_check::without_dead(&mended) {
        mended = alive;
        done.push("without the columns of dead sensors".into());
    }
    if done.is_empty() {
        program::say!("nothing of it can be mended here: no copy was written");
        return Ok(());
    }
    copy(&mended, &done, source, out)
}

/// Writes a changed copy of a log, and says what was done.
fn copy(mended: &Log, done: &[String], source: &Path, out: &Path) -> Result<(), Error> {
    whole_file::check_owner(out, "log.toml").map_err(|source| measured_log::Error::Taken { source })?;
    let mut notes = Notes::new();
    notes.insert("", format!("A copy of {}, {}.", source.display(), done.join(", ")));
    measured_log::write(out, mended, Format::Csv, &notes)?;
    done.iter().for_each(|words| program::say!("{}: {words}", typed(out)));
    program::next(&[(
        ["cargo", "xtask", "diagnose", "--measured", &typed(out)].map(String::from).to_vec(),
        "diagnoses the mended copy",
    )]);
    Ok(())
}
