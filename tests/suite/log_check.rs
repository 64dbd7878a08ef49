//! `log check`, as somebody with a wrong log meets it.

use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::{root, run, stderr};

const GOOD: &str = "tests/data/mujoco-logs/logs/set-003";

fn stdout(output: &std::process::Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Folders with altered logs that once got sure wrong names, beside the repository where it has them, and what is to be said of each.
const CASES: [(&str, &[&str]); 10] = [
    ("added-mass-grams", &["added_mass_kg is 300", "grams"]),
    ("force-sensor-dead", &["wrist_fx_n", "dead"]),
    ("gravity-in-g", &["gravity_mps2 = 1:"]),
    ("lengths-swapped", &["lengths of the object along x and y exchanged"]),
    ("noise-ten-times-too-small", &["object_position a noise of", "scatter"]),
    ("one-force-reading", &["1000.0000 in one row", "episode 1 at"]),
    ("quaternion-conjugate", &["its conjugate", "held-out error goes from"]),
    ("stamps-1-percent-long", &["20.200 ms", "period_secs says 20.000 ms"]),
    ("tracker-frame-turned", &["poses turned by 270° about z", "held-out error goes from"]),
    ("wrench-sign", &["with the wrench reversed", "held-out error goes from"]),
];

#[test]
fn a_good_log_is_not_accused_and_altered_ones_are() {
    let output = run("log", &format!("check {GOOD} --deny"));
    let text = stdout(&output);
    assert!(output.status.success() && text.contains("Nothing looks wrong."), "{text}{}", stderr(&output));
    let cases: PathBuf = root().join("../shared/cases");
    let python = Command::new("python3").arg("--version").output().is_ok_and(|output| output.status.success());
    if !python || !cases.is_dir() {
        return skipped::skipped("the altered logs need python3 and the folder shared/cases beside the repository");
    }
    let folder = tempfile::tempdir().unwrap();
    for (case, words) in CASES {
        let log = folder.path().join(case);
        let make = cases.join(case).join("make.py");
        let made = Command::new("python3").arg(make).arg(root()).arg(&log).output().unwrap();
        assert!(made.status.success(), "{case}: {}", stderr(&made));
        let output = run("log", &format!("check {} --deny", log.display()));
        let text = stdout(&output);
        assert_eq!(output.status.code(), Some(1), "{case}: {text}{}", stderr(&output));
        for word in words {
            assert!(text.contains(word), "{case}: expected {word:?} in\n{text}");
        }
    }
}

#[test]
fn a_mended_copy_is_written_once_and_looks_right() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let fixed = folder.path().join("fixed");
    turned(&log);
    let output = run("log", &format!("check {} --readings-only --fix {}", log.display(), fixed.display()));
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("its conjugate"), "{}", stderr(&output));
    assert!(run("log", &format!("check {} --readings-only --deny", fixed.display())).status.success());
    let again = run("log", &format!("check {} --readings-only --fix {}", log.display(), fixed.display()));
    assert_eq!(again.status.code(), Some(2), "{}", stderr(&again));
}

/// A log whose quaternions lead the other way.
fn turned(log: &Path) {
    std::fs::create_dir(log).unwrap();
    let source = root().join(GOOD);
    std::fs::copy(source.join("log.toml"), log.join("log.toml")).unwrap();
    let text = std::fs::read_to_string(source.join("samples.csv")).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let column = header.split(',').position(|name| name == "object_qw").unwrap();
    let rows = lines.map(|line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let cell = &mut cells[column];
        *cell = match cell.strip_prefix('-') {
            Some(positive) => positive.to_owned(),
            None if cell.is_empty() => String::new(),
            None => format!("-{cell}"),
        };
        cells.join(",")
    });
    let all: Vec<String> = std::iter::once(header.to_owned()).chain(rows).collect();
    std::fs::write(log.join("samples.csv"), all.join("\n") + "\n").unwrap();
}
