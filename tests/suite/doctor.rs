//! `doctor` tells what is missing, and fails for what is required alone.

use std::path::Path;
use std::process::Output;

use end_to_end::program;
use serde_json::Value;

/// A program that prints `text`, in `folder`.
#[cfg(unix)]
fn fake(folder: &Path, name: &str, script: &str) {
    use std::os::unix::fs::PermissionsExt as _;
    let path = folder.join(name);
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

fn report(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {output:?}"))
}

fn state(report: &Value, name: &str) -> String {
    let checks = report["checks"].as_array().unwrap();
    let check = checks.iter().find(|check| check["name"] == name).unwrap_or_else(|| panic!("{name}: {report:#}"));
    let state = check["state"].as_str().unwrap();
    assert_eq!(state == "ok", check["remedy"] == "", "{check}");
    assert!(check["needed_for"].as_str().is_some_and(|text| !text.is_empty()), "{check}");
    state.to_string()
}

#[test]
fn the_machine_that_built_this_has_what_is_required_to_build() {
    let output = program("xtask").args(["doctor", "--json", "--python", "/nowhere/python"]).output().unwrap();
    let report = report(&output);
    for name in [
        "rustc",
        "cargo",
        "C compiler",
        "writing the build",
        "prior of sawyer",
        "prior of jaco",
        "prior of sawyer-fixed",
    ] {
        assert_eq!(state(&report, name), "ok", "{report:#}");
    }
    assert_eq!(state(&report, "python modules"), "missing");
    let checks = report["checks"].as_array().unwrap();
    let good = checks.iter().all(|check| check["state"] == "ok" || check["required"] == false);
    assert_eq!(report["ok"], good);
    assert_eq!(output.status.code(), Some(i32::from(!good)), "optional things that are missing are no failure");
}

#[cfg(unix)]
#[test]
fn what_is_missing_or_broken_is_told_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    fake(folder.path(), "rustc", "echo 'rustc 1.70.0 (old)'");
    fake(folder.path(), "cc", "echo 'cc: no headers' >&2; exit 1");
    fake(folder.path(), "squeue", "echo 'squeue: error: no controller' >&2; exit 1");
    fake(folder.path(), "sbatch", "echo slurm");
    fake(folder.path(), "srun", "echo slurm");
    fake(folder.path(), "python3", "echo 'python 3.12.0'; echo 'mujoco 4.0.0'; echo 'numpy 2.0.0'");
    fake(folder.path(), "hq", "echo 'hq 0.24.0'");
    let doctor = |arguments: &[&str]| {
        let mut command = program("xtask");
        command.arg("doctor").args(arguments).env("PATH", folder.path()).env_remove("CC").env_remove("CARGO");
        command.output().unwrap()
    };
    let output = doctor(&["--json"]);
    assert_eq!(output.status.code(), Some(1));
    let report = report(&output);
    let expected = [
        ("rustc", "broken"),
        ("cargo", "missing"),
        ("C compiler", "broken"),
        ("disk for the build", "missing"),
        ("Slurm", "broken"),
        ("HyperQueue", "ok"),
        ("python modules", "ok"),
        ("Chromium", "missing"),
        ("rerun viewer", "missing"),
        ("prior of sawyer", "ok"),
    ];
    for (name, expected) in expected {
        assert_eq!(state(&report, name), expected, "{name}: {report:#}");
    }
    let text = String::from_utf8(doctor(&[]).stdout).unwrap();
    assert!(text.contains("1.70.0 is older than"), "{text}");
    assert!(text.contains("→ rustup update stable"), "{text}");
    assert!(text.contains("Required, but missing or broken: rustc, cargo, C compiler"), "{text}");
}
