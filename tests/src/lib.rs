//! Helpers of the end-to-end suite: running the programs as a user does.

pub mod prose;
pub mod slurm;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The checkout.
#[must_use]
pub fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_path_buf()
}

pub use skipped::skipped;

/// Says that `cargo xtask ci` has built the programs: where each test is a process of its own, none has to ask cargo again. The menu builds all
/// programs together then.
pub const BUILT: &str = "SURMISE_BUILT";

/// A release program, built from this checkout if need be, set to run at its root. All programs are built together, as `xtask` does, and
/// once for all tests.
///
/// # Panics
///
/// If it cannot be built.
#[must_use]
pub fn program(binary: &str) -> Command {
    static DONE: OnceLock<bool> = OnceLock::new();
    let root = root();
    let built = DONE.get_or_init(|| {
        if std::env::var_os(BUILT).is_some() {
            return true;
        }
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut command = Command::new(cargo);
        command.current_dir(&root).args(["build", "--release", "--quiet", "--workspace", "--bins"]);
        command.status().is_ok_and(|status| status.success())
    });
    assert!(built, "{binary} does not build");
    // Beside this test's own folder, wherever cargo was told to build.
    let deps = std::env::current_exe().expect("a test knows where it is");
    let release = deps.ancestors().nth(2).expect("a test is built into a folder of its profile");
    let mut command = Command::new(release.join(binary));
    command.current_dir(&root);
    command
}

/// The first episodes of a recorded log, for tests that a diagnosis has to run in, whatever it says.
///
/// # Panics
///
/// If they cannot be written.
pub fn short_log() -> &'static Path {
    const EPISODES: usize = 6;
    const ROWS: usize = 64;
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let (from, folder) =
            (root().join("tests/data/mujoco-logs/logs/set-003"), tempfile::tempdir().expect("a folder"));
        std::fs::copy(from.join("log.toml"), folder.path().join("log.toml")).expect("a recorded log");
        let samples = std::fs::read_to_string(from.join("samples.csv")).expect("a recorded log");
        let mut rows = [0; EPISODES];
        let mut first = |line: &&str| {
            // The header has no number.
            let id = line.split(',').next().and_then(|id| id.parse::<usize>().ok());
            let Some(id) = id else { return true };
            rows.get_mut(id).is_some_and(|row| std::mem::replace(row, *row + 1) < ROWS)
        };
        let short: String = samples.lines().filter(|line| first(line)).flat_map(|line| [line, "\n"]).collect();
        std::fs::write(folder.path().join("samples.csv"), short).expect("room for a log");
        folder
    });
    made.path()
}

/// Runs `binary` with `arguments`, split at spaces.
///
/// # Panics
///
/// If it cannot be started.
#[must_use]
pub fn run(binary: &str, arguments: &str) -> Output {
    program(binary)
        .args(arguments.split_whitespace())
        .output()
        .unwrap_or_else(|error| panic!("{binary} {arguments}: {error}"))
}

/// Standard error of a finished program.
#[must_use]
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// All files below `folder` with their bytes, by relative path, in order.
///
/// # Panics
///
/// If the folder cannot be read.
#[must_use]
pub fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).unwrap_or_else(|e| panic!("{}: {e}", next.display())) {
            let path = entry.expect("the folder is readable").path();
            if path.is_dir() {
                open.push(path);
            } else {
                let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
                found.push((path.strip_prefix(folder).unwrap_or(&path).to_path_buf(), bytes));
            }
        }
    }
    found.sort();
    found
}
