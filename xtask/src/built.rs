//! Building the release programs, and becoming one of them.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result};

/// Selected with every program, and built only where it needs them: with these two, cargo chooses the same features for what programs share, and compiles it
/// once; `tests/suite/architecture.rs` holds that. Those that train bring burn, with other features, and compile it all once more.
const ALWAYS: [&str; 2] = ["report", "measured-log"];

/// The package of a program.
fn package(binary: &str) -> &str {
    match binary {
        "train" | "calibrate" => "prior",
        "eval" => "experiments",
        "demo" => "report",
        "import-log" => "measured-log",
        "record-log" => "diagnose-benchmark",
        "diagnose" => "discrepancy",
        "docs" => "book",
        // Called like their packages.
        other => other,
    }
}

/// Builds a release program, with what it starts, and becomes it.
pub(crate) fn become_program(binary: &str, arguments: &[String]) -> Result<ExitCode> {
    let started: &[&str] = if binary == "diagnose-benchmark" { &["diagnose"] } else { &[] };
    // A first build takes minutes: who looks on should see it.
    let mut selection = if std::io::stderr().is_terminal() { Vec::new() } else { vec!["--quiet"] };
    selection.extend(ALWAYS.iter().flat_map(|package| ["--package", package]));
    for binary in [binary].iter().chain(started) {
        selection.extend(["--package", package(binary), "--bin", binary]);
    }
    build_and_become(&selection, binary, arguments)
}

/// Makes recordings for the viewer.
pub(crate) const VIEWER: &str = "to-rerun";

/// The one program that is apart: it brings the viewer's library, which nothing else should wait for.
pub(crate) fn become_viewer(arguments: &[String]) -> Result<ExitCode> {
    build_and_become(&["--package", "recording", "--features", "rerun", "--bin", VIEWER], VIEWER, arguments)
}

fn build_and_become(selection: &[&str], binary: &str, arguments: &[String]) -> Result<ExitCode> {
    let root = root();
    let built = cargo(&root).args(["build", "--release"]).args(selection).status();
    if !built.context("cannot run cargo")?.success() {
        return Ok(ExitCode::FAILURE);
    }
    let path = path(binary);
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

/// Where a release program is or will be.
pub(crate) fn path(binary: &str) -> PathBuf {
    folder().join(binary).with_extension(std::env::consts::EXE_EXTENSION)
}

/// Where cargo puts release programs, wherever it was told to build: this one is one of them.
pub(crate) fn folder() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    own.parent().map_or_else(|| root().join("target/release"), Path::to_path_buf)
}

pub(crate) fn cargo(root: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    command
}

/// The workspace that this program was built in.
pub(crate) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_path_buf()
}
