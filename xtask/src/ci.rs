//! `cargo xtask ci`: exactly what CI runs; with `--all-features` also what is too slow for it.

use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::Instant;

use anyhow::{Context as _, Result};

use crate::built::{BUILT, cargo, folder, root};

/// Tests that are named with their times.
const SLOWEST: usize = 10;
/// Where tests say that they did nothing, and why: a line `TEST: reason` each.
const SKIPPED: &str = "target/skipped.txt";
/// The variable that says so to tests.
const SKIPPED_FILE: &str = "SURMISE_SKIPPED";
/// With the value 1: nothing may be skipped.
const REQUIRE_ALL: &str = "SURMISE_REQUIRE_ALL";

/// Tests run beside each other, and threads of several programs that wait for work take turns on the same cores. What threads must not change is tested with
/// counts of its own.
const ONE_THREAD: (&str, &str) = ("RAYON_NUM_THREADS", "1");

/// Clippy's driver compiles what it has looked at, so one build lints and makes programs and tests. `cargo clippy` would check all dependencies besides, for what
/// a build of them says as well: three minutes of a cold run. Numbers are those of other builds: some optimisations of the workspace's own code are left to LLVM. The second variable is how `cargo clippy -- --deny warnings` tells the driver.
const LINTED: [(&str, &str); 2] = [
    ("RUSTC_WORKSPACE_WRAPPER", "clippy-driver"),
    ("CLIPPY_ARGS", "--deny__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__"),
];

const CHECKS: [&[&str]; 2] = [&["fmt", "--all", "--check"], &["build", "--release", "--workspace", "--all-targets"]];
const WITH_NEXTEST: [&[&str]; 2] = [
    &["nextest", "run", "--release", "--workspace", "--profile", "ci"],
    &["test", "--release", "--workspace", "--doc"],
];
const WITHOUT: [&[&str]; 1] = [&["test", "--release", "--workspace", "--no-fail-fast"]];

/// The writer of recordings for the Rerun viewer.
const ALL_FEATURES: &[&str] = &["check", "--release", "--package", "recording", "--features", "rerun", "--all-targets"];

/// What to check.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Also checks what is behind cargo features, which CI leaves out: the writer of recordings for the Rerun viewer, with 400 crates.
    #[arg(long)]
    all_features: bool,
}

pub(crate) fn run(options: &Options) -> Result<ExitCode> {
    let root = root();
    let skipped = root.join(SKIPPED);
    if skipped.exists() {
        std::fs::remove_file(&skipped).with_context(|| format!("cannot remove {}", skipped.display()))?;
    }
    for step in CHECKS {
        if !passes(&root, step)? {
            return Ok(ExitCode::FAILURE);
        }
    }
    let nextest = cargo(&root).args(["nextest", "--version"]).output().is_ok_and(|output| output.status.success());
    let tests: &[&[&str]] = if nextest {
        &WITH_NEXTEST
    } else {
        program::say!(
            "cargo-nextest is not installed: cargo test runs the tests, and says nothing of how long each takes"
        );
        &WITHOUT
    };
    let mut passed = true;
    for step in tests.iter().copied().chain(options.all_features.then_some(ALL_FEATURES)) {
        passed &= passes(&root, step)?;
    }
    if nextest {
        // target/release → target/nextest
        let report = folder().with_file_name("nextest").join("ci/junit.xml");
        let text = std::fs::read_to_string(&report).unwrap_or_default();
        program::say!("{}", slowest(&text));
    }
    let text = std::fs::read_to_string(&skipped).unwrap_or_default();
    program::say!("{}", of_skipped(&text));
    let required = std::env::var_os(REQUIRE_ALL).is_some_and(|value| value == "1");
    let complete = !required || text.trim().is_empty();
    if !complete {
        program::say!("{REQUIRE_ALL}=1 says that no test may be skipped");
    }
    Ok(if passed && complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

#[expect(clippy::disallowed_methods, reason = "how long a step takes is said, nothing depends on it")]
fn passes(root: &Path, step: &[&str]) -> Result<bool> {
    program::say!("cargo {}", step.join(" "));
    let started = Instant::now();
    let mut command: Command = cargo(root);
    command
        .args(step)
        .env(BUILT, "1")
        .env(SKIPPED_FILE, root.join(SKIPPED))
        .env(ONE_THREAD.0, ONE_THREAD.1)
        .envs(LINTED);
    let passed = command.status().context("cannot run cargo")?.success();
    program::say!("cargo {}: {:.0} s", step[0], started.elapsed().as_secs_f64());
    Ok(passed)
}

/// The slowest tests of a report in JUnit's form.
fn slowest(junit: &str) -> String {
    let mut tests: Vec<(f64, String)> = junit.split("<testcase ").skip(1).filter_map(test_case).collect();
    tests.sort_by(|a, b| b.0.total_cmp(&a.0));
    let total: f64 = tests.iter().map(|(secs, _)| secs).sum();
    let lines = tests.iter().take(SLOWEST).map(|(secs, name)| format!("\n{secs:8.1} s  {name}"));
    format!("the slowest of {} tests, which took {total:.0} s one by one:{}", tests.len(), lines.collect::<String>())
}

/// Seconds and name of a test, from the attributes of its element.
fn test_case(element: &str) -> Option<(f64, String)> {
    let tag = element.split('>').next()?;
    let value = |key: &str| {
        let rest = tag.split_once(&format!("{key}=\""))?.1;
        rest.split_once('"').map(|(value, _)| value.to_owned())
    };
    // `classname` ends in the letters of `name`.
    let name = tag.split_once("name=\"").filter(|(before, _)| before.is_empty() || before.ends_with(' '));
    let name = name.and_then(|(_, rest)| rest.split_once('"')).map(|(name, _)| name.to_owned());
    Some((value(" time")?.parse().ok()?, format!("{} {}", value("classname")?, name.or_else(|| value(" name"))?)))
}

/// How many tests were skipped, and why.
fn of_skipped(text: &str) -> String {
    let mut lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    // Tests end in any order.
    lines.sort_unstable();
    lines.dedup();
    let listed: String = lines.iter().map(|line| format!("\n  {line}")).collect();
    format!("skipped tests: {}{listed}", lines.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    const JUNIT: &str = r#"<testsuites><testsuite name="prior" tests="2">
        <testcase name="trains" classname="prior::shipped" timestamp="2026-11-25T09:00:00+00:00" time="12.5"></testcase>
        <testcase name="loads" classname="prior" timestamp="x" time="0.004"/>
        <testcase name="kills::eval" classname="end-to-end::suite" timestamp="x" time="80.0"><failure/></testcase>
    </testsuite></testsuites>"#;

    /// How the driver is told is no stable interface: a toolchain that told it otherwise would let every warning pass.
    #[test]
    fn what_clippy_warns_of_does_not_compile() {
        let folder = tempfile::tempdir().unwrap();
        let compiles = |name: &str, code: &str| {
            let file = folder.path().join(name).with_extension("rs");
            std::fs::write(&file, code).unwrap();
            let mut driver = Command::new(LINTED[0].1);
            driver
                .args(["rustc", "--crate-type", "lib", "--emit", "metadata", "--out-dir"])
                .arg(folder.path())
                .arg(file);
            let output = driver.env(LINTED[1].0, LINTED[1].1).output();
            output.expect("clippy is installed: rustup component add clippy").status.success()
        };
        assert!(compiles("good", "pub fn five() -> i32 { 5 }"));
        assert!(!compiles("clippy", "pub fn five() -> i32 { return 5; }"));
        assert!(!compiles("rustc", "pub fn five() -> i32 { let x = 1; 5 }"));
    }

    #[test]
    fn the_slowest_tests_come_first() {
        let text = slowest(JUNIT);
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        assert_eq!(lines[0], "the slowest of 3 tests, which took 93 s one by one:");
        assert_eq!(
            lines[1..],
            ["80.0 s  end-to-end::suite kills::eval", "12.5 s  prior::shipped trains", "0.0 s  prior loads"]
        );
        assert!(slowest("").contains("of 0 tests"));
    }

    #[test]
    fn what_was_skipped_is_counted_with_its_reason() {
        assert_eq!(of_skipped(""), "skipped tests: 0");
        let text = of_skipped("b: no browser\na: no python3\n\nb: no browser\n");
        assert_eq!(text, "skipped tests: 2\n  a: no python3\n  b: no browser");
    }
}
