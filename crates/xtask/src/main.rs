//! The menu: one verb, one release program. It builds what it runs, and never links it.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result};
use clap::{Parser, Subcommand};

/// Commands of the project. `cargo xtask VERB --help` lists the options of a verb.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", version)]
struct Menu {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Generates training data.
    #[command(disable_help_flag = true)]
    Datagen(Rest),
    /// Trains the prior.
    #[command(disable_help_flag = true)]
    Train(Rest),
    /// Compares what the prior says of held-out episodes with the truth.
    #[command(disable_help_flag = true)]
    Calibrate(Rest),
    /// Plays trials of methods on a domain and prints the table.
    #[command(disable_help_flag = true)]
    Eval(Rest),
    /// Turns published measurements into a log that can be diagnosed.
    #[command(disable_help_flag = true)]
    ImportLog(Rest),
    /// Records a log in the true world of a scenario, to rehearse a diagnosis.
    #[command(disable_help_flag = true)]
    RecordLog(Rest),
    /// Finds where a log and the simulation disagree and names the missing effect.
    #[command(disable_help_flag = true)]
    Diagnose(Rest),
    /// Has diagnose explain generated logs whose hidden effect it cannot know, and scores its answers.
    #[command(disable_help_flag = true)]
    DiagnoseBenchmark(Rest),
    /// Times the parts and checks their accuracy, beside peers where those are installed.
    #[command(disable_help_flag = true)]
    Bench(Rest),
    /// Runs exactly what CI runs: formatting, lints, all tests.
    Ci,
}

#[derive(Debug, clap::Args)]
struct Rest {
    /// Options of the program.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

fn main() -> ExitCode {
    let result = match Menu::parse().verb {
        Verb::Datagen(rest) => program("datagen", &rest.arguments),
        Verb::Train(rest) => program("train", &rest.arguments),
        Verb::Calibrate(rest) => program("calibrate", &rest.arguments),
        Verb::Eval(rest) => program("eval", &rest.arguments),
        Verb::ImportLog(rest) => program("import-log", &rest.arguments),
        Verb::RecordLog(rest) => program("record-log", &rest.arguments),
        Verb::Diagnose(rest) => program("diagnose", &rest.arguments),
        Verb::DiagnoseBenchmark(rest) => program("diagnose-benchmark", &rest.arguments),
        Verb::Bench(rest) => program("bench", &rest.arguments),
        Verb::Ci => ci(),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

/// Builds the release programs and becomes one of them. All are built together: built one by one, cargo would choose other features for
/// the shared dependencies and compile them again.
fn program(binary: &str, arguments: &[String]) -> Result<ExitCode> {
    let root = root();
    let built = cargo(&root).args(["build", "--release", "--quiet", "--workspace", "--bins"]).status();
    if !built.context("cannot run cargo")?.success() {
        return Ok(ExitCode::FAILURE);
    }
    let path = target(&root).join("release").join(binary);
    let mut command = Command::new(&path);
    command.args(arguments);
    // Becoming the program hands on its exit code, its terminal and every signal, an interrupt among them.
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt as _;
        Err(command.exec()).with_context(|| format!("cannot run {}", path.display()))
    }
    #[cfg(not(unix))]
    {
        let status = command.status().with_context(|| format!("cannot run {}", path.display()))?;
        Ok(ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)))
    }
}

fn ci() -> Result<ExitCode> {
    let root = root();
    let steps: [&[&str]; 3] = [
        &["fmt", "--all", "--check"],
        &["clippy", "--release", "--workspace", "--all-targets", "--", "--deny", "warnings"],
        &["test", "--release", "--workspace"],
    ];
    for step in steps {
        eprintln!("cargo {}", step.join(" "));
        if !cargo(&root).args(step).status().context("cannot run cargo")?.success() {
            return Ok(ExitCode::FAILURE);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn cargo(root: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    command
}

/// The workspace that this program was built in.
fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.ancestors().nth(2).unwrap_or(package).to_path_buf()
}

fn target(root: &Path) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from)
}
