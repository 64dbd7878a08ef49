//! Tests that cannot run on a machine, because a program, a peer or published data are not there: none of them passes in silence.
//!
//! # Contract
//!
//! A test that cannot run calls [`skipped`] and returns. That
//!
//! - prints the reason past the test harness, which shows no output of tests that pass;
//! - appends one line `TEST: REASON` to the file that the variable `SURMISE_SKIPPED` names, or to `target/skipped.txt` of the workspace;
//! - fails the test where the variable `SURMISE_REQUIRE_ALL` is `1`: there everything has to be installed.
//!
//! `TEST` is `PACKAGE::PATH`, as cargo names them. The file is only ever appended to: `cargo xtask ci` removes it before the tests and counts
//! its lines after them, one a skipped test.
//!
//! # Example
//!
//! ```no_run
//! if std::process::Command::new("python3").arg("--version").output().is_err() {
//!     return skipped::skipped("there is no python3");
//! }
//! ```

use std::io::Write as _;
use std::panic::Location;
use std::path::{Path, PathBuf};

/// The variable that names the file with the tests that were skipped.
pub const FILE: &str = "SURMISE_SKIPPED";
/// The variable that, set to `1`, makes a test fail that would be skipped.
pub const REQUIRE_ALL: &str = "SURMISE_REQUIRE_ALL";

/// Notes that the test that calls this does nothing, and why; the test returns after it.
///
/// # Panics
///
/// Where `SURMISE_REQUIRE_ALL` is `1`, or the file cannot be written.
#[track_caller]
pub fn skipped(reason: &str) {
    let place = Location::caller();
    let required = std::env::var_os(REQUIRE_ALL).is_some_and(|value| value == "1");
    assert!(!required, "{reason}, and {REQUIRE_ALL}=1 says that nothing is to be skipped");
    let file = std::env::var_os(FILE).map_or_else(default_file, PathBuf::from);
    let name = test_name(place);
    let noted = note(&file, &name, reason);
    assert!(noted.is_ok(), "cannot note in {} that {name} is skipped: {noted:?}", file.display());
    // The macros for printing go through the harness.
    let _ = writeln!(std::io::stderr(), "skipped: {name}: {reason}");
}

fn default_file() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.ancestors().nth(2).unwrap_or(package).join("target/skipped.txt")
}

/// Package and path of the test that runs on this thread.
fn test_name(place: &Location) -> String {
    // Cargo and nextest tell the package, the harness names the thread after the test; with one thread it runs tests on the main one.
    let package = std::env::var("CARGO_PKG_NAME").unwrap_or_else(|_| "unknown".into());
    let thread = std::thread::current();
    let test = thread.name().filter(|name| *name != "main").map(String::from);
    let test = test.or_else(|| std::env::var("NEXTEST_TEST_NAME").ok());
    format!("{package}::{}", test.unwrap_or_else(|| format!("{}:{}", place.file(), place.line())))
}

/// Appends a line, in one write, so that tests of several processes do not mix theirs.
fn note(file: &Path, name: &str, reason: &str) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let reason: String = reason.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut open = std::fs::OpenOptions::new().create(true).append(true).open(file)?;
    open.write_all(format!("{name}: {reason}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_name_the_test_and_are_appended() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a/skipped.txt");
        let name = test_name(Location::caller());
        note(&file, &name, "there is no python3").unwrap();
        note(&file, "package::other", "two\nlines").unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        let expected =
            "skipped::tests::lines_name_the_test_and_are_appended: there is no python3\npackage::other: two lines\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn without_a_variable_the_file_is_in_the_target_folder_of_the_workspace() {
        let file = default_file();
        assert!(file.ends_with("target/skipped.txt"), "{file:?}");
        assert!(file.ancestors().nth(2).unwrap().join("Cargo.lock").is_file(), "{file:?}");
    }
}
