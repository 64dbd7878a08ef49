//! The program `diagnose`: what it writes, and what it refuses.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn diagnose(measured: &Path, out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_diagnose"));
    command.arg("--measured").arg(measured).arg("--out").arg(out).arg("--json").output().unwrap()
}

/// A copy of a recorded set in which a line of a file is changed.
fn changed(folder: &Path, file: &str, change: impl Fn(&str) -> String) -> PathBuf {
    let copy = folder.join("log");
    std::fs::create_dir(&copy).unwrap();
    for name in ["log.toml", "samples.csv"] {
        let text = std::fs::read_to_string(root().join("tests/data/mujoco-logs/logs/set-002").join(name)).unwrap();
        let text = if name == file { change(&text) } else { text };
        std::fs::write(copy.join(name), text).unwrap();
    }
    copy
}

#[test]
fn the_report_keeps_its_contract() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = diagnose(&root().join("tests/data/mujoco-logs/logs/set-003"), &out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let written: Value = serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(report, written);
    assert_eq!(report["verdict"], "effect");
    let effect = &report["effects"][0];
    assert_eq!(effect["name"], "table_tilt");
    assert!(effect["confidence"].as_f64().unwrap() <= 1.0);
    let parameter = &effect["parameters"][0];
    assert_eq!((&parameter["name"], &parameter["unit"]), (&Value::from("slope_x"), &Value::from("rad")));
    assert_eq!(parameter["interval90"].as_array().unwrap().len(), 2);
    assert!(report["confusion_set"].as_array().unwrap().contains(&Value::from("table_tilt")));
    let located = report["located"].as_array().unwrap();
    for key in ["channel", "phase", "share", "p_value"] {
        assert!(located.iter().all(|cell| !cell[key].is_null()), "{key}");
    }
    let shares: f64 = located.iter().map(|cell| cell["share"].as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-9);
    for key in ["before", "after", "noise_floor", "closed_fraction"] {
        assert!(report["heldout"][key].is_number(), "{key}");
    }
    assert_eq!(report["heldout"]["unit"], "chi2 per sample");
    let errors = report["evidence"]["errors"].as_array().unwrap();
    let position = errors.iter().find(|error| error["channel"] == "object_position").unwrap();
    assert_eq!(position["unit"], "m");
    assert!(position["after"].as_f64().unwrap() < position["before"].as_f64().unwrap(), "{position}");
    assert!(report["seed"] == 1 && report["fold"].is_null());
    assert!(report["next_experiment"].is_string() && report["rollouts"].is_u64() && report["seconds"].is_number());
    assert!(std::fs::read_to_string(out.join("model.toml")).unwrap().contains("table_tilt"));
}

#[test]
fn a_part_that_is_none_is_refused() {
    for wrong in ["0/5", "6/5", "1/1", "1", "a/b", "-1/5", "461168601842738791/461168601842738791"] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let mut command = Command::new(env!("CARGO_BIN_EXE_diagnose"));
        command.arg("--measured").arg(root().join("tests/data/mujoco-logs/logs/set-002")).arg("--out").arg(&out);
        let output = command.arg(format!("--fold={wrong}")).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{wrong}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("expected I/K"), "{wrong}");
        assert!(!out.exists());
    }
}

#[test]
fn a_broken_log_ends_with_code_2_one_sentence_and_nothing_written() {
    type Change = fn(&str) -> String;
    let cases: [(&str, Change, &str); 5] = [
        ("log.toml", |text| text.replace("period_secs", "period_minutes"), "period_"),
        ("samples.csv", |text| text.replacen("object_x_m", "object_x_mm", 1), "object_x_m"),
        ("samples.csv", |text| text.replacen("\n0,0.02,", "\n0,-0.02,", 1), "time_secs"),
        ("samples.csv", |text| text.replacen("\n0,0.02,", "\n0,NaN,", 1), "row 2"),
        // Three episodes of sixteen.
        ("samples.csv", |text| text.split_inclusive("\n3,").next().unwrap().trim_end_matches("3,").into(), "episodes"),
    ];
    for (file, change, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let output = diagnose(&changed(folder.path(), file, change), &out);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.starts_with("error: ") && message.trim_end().lines().count() == 1, "{message}");
        assert!(message.contains(expected), "{message}");
        assert!(!out.exists(), "{message}");
    }
    let nowhere = tempfile::tempdir().unwrap();
    let output = diagnose(&nowhere.path().join("missing"), &nowhere.path().join("out"));
    assert_eq!(output.status.code(), Some(2));
}
