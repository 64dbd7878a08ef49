//! `cargo xtask import-log`: published measurements of others as logs.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand, ValueEnum};
use measured_log::{Episode, Error, Format, Log, Notes, import};

/// Turns published measurements into a log that `cargo xtask diagnose --measured` reads; see
/// docs/src/reference/measured-log.md.
#[derive(Debug, Parser)]
#[command(name = "import-log", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    source: Source,
}

#[derive(Debug, Subcommand)]
enum Source {
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
        #[arg(long, value_name = "NEWTONS", default_value_t = import::HARD_BOARD_N)]
        friction_force: f64,
        #[command(flatten)]
        target: Target,
    },
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
  cargo xtask import-log contactnets tosses.csv --out runs/logs/tosses
  cargo xtask import-log cmu-push record.txt.gz --out runs/logs/push";
const CONTACTNETS_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log contactnets tosses.csv --out runs/logs/tosses";
const CMU_PUSH_EXAMPLES: &str = "\
Examples:
  cargo xtask import-log cmu-push record.txt.gz --friction-force 5.0 --out runs/logs/push";

fn main() -> ExitCode {
    // 2 is bad input; a disk that refuses is a failure.
    let (imported, target) = match program::parse::<Arguments>().source {
        Source::Contactnets { source, target } => (import::contactnets(&source), target),
        Source::CmuPush { source, friction_force, target } => (import::cmu_push(&source, friction_force), target),
    };
    program::end(imported.and_then(|(log, notes)| write(&target, &log, &notes)), |error| {
        if let Error::Write { .. } = error { 1 } else { 2 }
    })
}

fn write(target: &Target, log: &Log, notes: &Notes) -> Result<(), Error> {
    whole_file::check_owner(&target.out, "log.toml").map_err(|source| Error::Taken { source })?;
    let format = match target.format {
        Samples::Csv => Format::Csv,
        Samples::Parquet => Format::Parquet,
    };
    measured_log::write(&target.out, log, format, notes)?;
    let rows: usize = log.episodes.iter().map(Episode::rows).sum();
    program::out!("{}: {} episodes, {rows} rows", target.out.display(), log.episodes.len());
    let words = ["cargo", "xtask", "diagnose", "--measured", &program::typed(&target.out)];
    program::next(&[(words.map(String::from).to_vec(), "finds what the log shows and the nominal model lacks")]);
    Ok(())
}
