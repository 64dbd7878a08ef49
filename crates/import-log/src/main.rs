//! `cargo xtask import-log`: recordings and published measurements of others as logs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand, ValueEnum};
use import_log::{Error, Mapping, Source, draft, published};
use measured_log::{Episode, Format, Log, Notes};

/// Turns a recording, or published measurements, into a log that `cargo xtask diagnose --measured` reads; see
/// docs/src/guides/import.md.
#[derive(Debug, Parser)]
#[command(name = "import-log", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// CSV with any separator, or Parquet.
    #[command(after_help = TABLE_EXAMPLES)]
    Table(Recording),
    /// MCAP files: messages of ROS 2 or ROS 1, JSON or Protobuf.
    #[command(after_help = MCAP_EXAMPLES)]
    Mcap(Recording),
    /// ROS 2 bags: folders with metadata.yaml, in MCAP or sqlite3.
    #[command(after_help = ROS2_EXAMPLES)]
    Ros2(Recording),
    /// LeRobot data sets of version 2 or 3: folders with meta/info.json.
    #[command(after_help = LEROBOT_EXAMPLES)]
    Lerobot(Recording),
    /// Tosses of a cube (ContactNets): a CSV file, or a folder with one tosses_*.csv.
    #[command(after_help = CONTACTNETS_EXAMPLES)]
    Contactnets {
        /// The file or folder.
        source: PathBuf,
        #[command(flatten)]
        target: Target,
    },
    /// Pushes of a triangle (MLab_EXP): one text file, plain or gzip, named or in a folder named after the feet.
    #[command(after_help = CMU_PUSH_EXAMPLES)]
    CmuPush {
        /// The file.
        source: PathBuf,
        /// Force of friction between triangle and board, N: 4.2 on the hard, 5.0 on the wooden board.
        #[arg(long, value_name = "NEWTONS", default_value_t = published::HARD_BOARD_N)]
        friction_force: f64,
        #[command(flatten)]
        target: Target,
    },
}

#[derive(Debug, clap::Args)]
struct Recording {
    /// Files or folders; several follow each other.
    #[arg(required = true)]
    sources: Vec<PathBuf>,
    /// What each channel is made of; see docs/src/reference/import-mapping.md.
    #[arg(long, value_name = "MAP.toml", required_unless_present = "draft_map")]
    map: Option<PathBuf>,
    /// Writes a mapping from what the first source holds, with guesses and gaps marked, and imports nothing.
    #[arg(long, value_name = "MAP.toml", conflicts_with_all = ["map", "out", "format"])]
    draft_map: Option<PathBuf>,
    /// Folder of the log; it must not hold one yet.
    #[arg(long, required_unless_present = "draft_map")]
    out: Option<PathBuf>,
    /// Format of the samples.
    #[arg(long, value_enum, default_value_t = Samples::Csv)]
    format: Samples,
}

#[derive(Debug, clap::Args)]
struct Target {
    /// Folder of the log; it must not hold one yet.
    #[arg(long)]
    out: PathBuf,
    /// Format of the samples.
    #[arg(long, value_enum, default_value_t = Samples::Csv)]
    format: Samples,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Samples {
    Csv,
    Parquet,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask import-log ros2 tests/data/import/ros2_mcap --draft-map rig.toml
  cargo xtask import-log ros2 tests/data/import/ros2_mcap --map tests/data/import/ros2_mcap.toml --out runs/logs/rig";
const TABLE_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log table tests/data/import/rig.csv --map tests/data/import/rig.toml --out runs/logs/table";
const MCAP_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log mcap tests/data/import/json.mcap --map tests/data/import/json.toml --out runs/logs/mcap";
const ROS2_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log ros2 tests/data/import/ros2_sqlite --map tests/data/import/ros2_sqlite.toml --out runs/logs/ros2";
const LEROBOT_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log lerobot tests/data/import/lerobot --map tests/data/import/lerobot.toml --out runs/logs/lerobot";
const CONTACTNETS_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log contactnets tests/data/contactnets/tosses_12.csv --out runs/logs/tosses";
const CMU_PUSH_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log cmu-push record.txt.gz --friction-force 5.0 --out runs/logs/push";

fn main() -> ExitCode {
    // 2 is bad input; a disk that refuses is a failure.
    program::end(run(program::parse::<Arguments>().verb), |error| if error.is_failure() { 1 } else { 2 })
}

fn run(verb: Verb) -> Result<(), Error> {
    match verb {
        Verb::Table(recording) => recorded("table", Source::Table, &recording),
        Verb::Mcap(recording) => recorded("mcap", Source::Mcap, &recording),
        Verb::Ros2(recording) => recorded("ros2", Source::Ros2, &recording),
        Verb::Lerobot(recording) => recorded("lerobot", Source::Lerobot, &recording),
        Verb::Contactnets { source, target } => {
            let (log, notes) = published::contactnets(&source)?;
            write(&target, &log, &notes)
        }
        Verb::CmuPush { source, friction_force, target } => {
            let (log, notes) = published::cmu_push(&source, friction_force)?;
            write(&target, &log, &notes)
        }
    }
}

fn recorded(verb: &str, source: Source, recording: &Recording) -> Result<(), Error> {
    if let Some(path) = &recording.draft_map {
        return write_draft(verb, source, &recording.sources, path);
    }
    let (map, out) = (recording.map.clone().unwrap_or_default(), recording.out.clone().unwrap_or_default());
    let target = Target { out, format: recording.format };
    check(&target.out)?;
    let mapping = Mapping::read(&map)?;
    if mapping.unfilled() > 0 {
        let count = mapping.unfilled();
        program::say!("warning: {}: {count} numbers are still marked FILL: they are placeholders", map.display());
    }
    let log = source.import(&recording.sources, &mapping)?;
    write(&target, &log, &mapping.notes(verb, &recording.sources))
}

fn write_draft(verb: &str, source: Source, sources: &[PathBuf], path: &Path) -> Result<(), Error> {
    let text = draft(source, sources)?;
    if !whole_file::write(path, text.as_bytes(), whole_file::Existing::Keep)? {
        let found = std::io::Error::new(std::io::ErrorKind::AlreadyExists, "it exists, and nothing is overwritten");
        return Err(Error::Io { action: "write", path: path.to_owned(), source: found });
    }
    program::out!("{}: check what is marked GUESS, fill what is marked FILL", path.display());
    let words = ["cargo", "xtask", "import-log", verb].map(String::from);
    let sources = sources.iter().map(|source| program::typed(source));
    let rest = ["--map".into(), program::typed(path), "--out".into(), "runs/logs/mine".into()];
    program::next(&[(words.into_iter().chain(sources).chain(rest).collect(), "makes the log")]);
    Ok(())
}

fn check(out: &Path) -> Result<(), Error> {
    whole_file::check_owner(out, "log.toml").map_err(|source| measured_log::Error::Taken { source })?;
    Ok(())
}

fn write(target: &Target, log: &Log, notes: &Notes) -> Result<(), Error> {
    check(&target.out)?;
    let format = match target.format {
        Samples::Csv => Format::Csv,
        Samples::Parquet => Format::Parquet,
    };
    measured_log::write(&target.out, log, format, notes)?;
    let rows: usize = log.episodes.iter().map(Episode::rows).sum();
    program::out!("{}: {} episodes, {rows} rows", target.out.display(), log.episodes.len());
    for line in import_log::summary(log) {
        program::out!("  {line}");
    }
    let folder = program::typed(&target.out);
    let check = ["cargo", "xtask", "log", "check", &folder].map(String::from).to_vec();
    let diagnose = ["cargo", "xtask", "diagnose", "--measured", &folder].map(String::from).to_vec();
    program::next(&[
        (check, "looks for wrong units, frames, signs and clocks"),
        (diagnose, "finds what the log shows and the nominal model lacks"),
    ]);
    Ok(())
}
