//! Building the release programs, and becoming one of them.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result};

/// Selected with every program, and built only where it needs them: with these two, cargo chooses the same features for what programs share, and compiles it
/// once; `tests/suite/architecture.rs` holds that.
const ALWAYS: [&str; 2] = ["report", "import-log"];

/// Says that all programs are built together, as CI does: then they are built so again, which takes no time, and not one by one with other
/// features of what they share, which takes minutes.
pub(crate) const BUILT: &str = "SURMISE_BUILT";

/// The package of a program.
fn package(binary: &str) -> &str {
    match binary {
        "train" | "calibrate" | "posterior-data" => "prior-training",
        "eval" => "experiments",
        "demo" => "report",
        "record-log" | "diagnose-learn" | "arm-learn" => "diagnose-benchmark",
        "diagnose" | "log" => "discrepancy",
        "docs" => "book",
        "robot" => "arm-excitation",
        // Called like their packages.
        other => other,
    }
}

/// Builds a release program, with what it starts, and becomes it.
pub(crate) fn become_program(binary: &str, arguments: &[String]) -> Result<ExitCode> {
    let started: &[&str] = if binary == "diagnose-benchmark" { &["diagnose"] } else { &[] };
    // A first build takes minutes: who looks on should see it.
    let mut selection = if std::io::stderr().is_terminal() { Vec::new() } else { vec!["--quiet"] };
    if std::env::var_os(BUILT).is_some() {
        selection.extend(["--workspace", "--bins"]);
        return build_and_become(&selection, binary, arguments);
    }
    selection.extend(ALWAYS.iter().flat_map(|package| ["--package", package]));
    for binary in [binary].iter().chain(started) {
        selection.extend(["--package", package(binary), "--bin", binary]);
    }
    build_and_become(&selection, binary, arguments)
}

/// Makes recordings for the viewer.
pub(crate) const VIEWER: &str = "to-rerun";

/// The one program that is apart: it brings the viewer's library, which nothing else should wait for.
///
/// Help, and that an episode is not there, are told before that library is built, in a quarter of an hour.
pub(crate) fn become_viewer(arguments: &[String]) -> Result<ExitCode> {
    if asks_for_help(arguments) && !path(VIEWER).exists() {
        program::show(&viewer_help());
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(problem) = missing_episode(arguments) {
        program::complain(&problem);
        return Ok(ExitCode::from(2));
    }
    build_and_become(&["--package", "recording", "--features", "rerun", "--bin", VIEWER], VIEWER, arguments)
}

fn viewer_help() -> String {
    let menu = <crate::Menu as clap::CommandFactory>::command();
    let verb = menu.find_subcommand("rerun").cloned().unwrap_or_default();
    // What is handed on stands below, one by one.
    verb.bin_name("cargo xtask rerun").mut_arg("arguments", |rest| rest.hide(true)).render_long_help().to_string()
}

fn asks_for_help(arguments: &[String]) -> bool {
    arguments.iter().any(|argument| ["-h", "--help", "-V", "--version"].contains(&argument.as_str()))
}

/// What the viewer's program would say of its command line, as far as it is about the episode; `None` where that is there, and where help is asked for.
fn missing_episode(arguments: &[String]) -> Option<String> {
    if asks_for_help(arguments) {
        return None;
    }
    let mut rest = arguments.iter();
    let mut episode = None;
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--out" => drop(rest.next()),
            option if option.starts_with('-') => {}
            path => episode = episode.or(Some(Path::new(path))),
        }
    }
    let Some(episode) = episode else {
        return Some("rerun: expected the folder of an episode of `demo`, or its trace.json, as in `cargo xtask rerun runs/demo/NAME`".into());
    };
    let trace = if episode.is_dir() { episode.join("trace.json") } else { episode.to_path_buf() };
    let is_there = trace.is_file();
    (!is_there).then(|| format!("{}: expected an episode of `demo`, found no such file", trace.display()))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Cargo refuses a selection with a package or a program that does not exist.
    #[test]
    fn every_verb_has_a_program_in_its_package() {
        use clap::CommandFactory as _;
        let output = cargo(&root()).args(["metadata", "--no-deps", "--format-version", "1"]).output().unwrap();
        let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let mut programs = Vec::new();
        for found in metadata["packages"].as_array().unwrap() {
            for target in found["targets"].as_array().unwrap().iter().filter(|target| target["kind"][0] == "bin") {
                programs.push((found["name"].as_str().unwrap(), target["name"].as_str().unwrap()));
            }
        }
        let menu = crate::Menu::command();
        let behind = |verb: &&clap::Command| verb.get_arguments().any(|argument| argument.get_id() == "arguments");
        let verbs: Vec<&str> = menu.get_subcommands().filter(behind).map(clap::Command::get_name).collect();
        assert!(verbs.len() > 10, "{verbs:?}");
        for verb in verbs.into_iter().filter(|verb| *verb != "rerun") {
            assert!(programs.contains(&(package(verb), verb)), "{verb} in {programs:?}");
        }
        assert!(programs.contains(&("recording", VIEWER)));
        assert!(ALWAYS.iter().all(|package| programs.iter().any(|(name, _)| name == package)), "{programs:?}");
    }

    #[test]
    fn an_episode_that_is_not_there_is_told_before_anything_is_built() {
        let folder = tempfile::tempdir().unwrap();
        let problem = |arguments: &[&str]| {
            missing_episode(&arguments.iter().map(ToString::to_string).collect::<Vec<_>>()).unwrap_or_default()
        };
        let path = folder.path().display().to_string();
        let trace = folder.path().join("trace.json");
        let message = format!("{}: expected an episode of `demo`, found no such file", trace.display());
        assert_eq!(problem(&[&path]), message);
        assert_eq!(problem(&["--out", "a.rrd", &path]), message);
        assert!(problem(&["nothere"]).starts_with("nothere: expected an episode"));
        assert!(problem(&[]).starts_with("rerun: expected the folder of an episode"));
        assert!(problem(&["--out", "a.rrd"]).starts_with("rerun: expected"));
        assert!(super::viewer_help().contains("--out <FILE>") && super::viewer_help().contains("trace.json"));
        std::fs::write(&trace, "{}").unwrap();
        for good in
            [&[path.as_str()][..], &[trace.to_str().unwrap()], &["--out=a", &path], &["--help"], &["nothere", "-h"]]
        {
            assert_eq!(problem(good), "", "{good:?}");
        }
    }
}
