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
fn changed(folder: &Path, (set, file): (&str, &str), change: impl Fn(&str) -> String) -> PathBuf {
    let copy = folder.join("log");
    std::fs::create_dir(&copy).unwrap();
    for name in ["log.toml", "samples.csv"] {
        let text = std::fs::read_to_string(root().join("tests/data/mujoco-logs/logs").join(set).join(name)).unwrap();
        let text = if name == file { change(&text) } else { text };
        std::fs::write(copy.join(name), text).unwrap();
    }
    copy
}

/// A copy of a recorded set with so many of its episodes, which are numbered.
fn first_episodes(folder: &Path, set: &str, episodes: usize) -> PathBuf {
    let kept =
        |line: &&str| line.split(',').next().and_then(|id| id.parse::<usize>().ok()).is_none_or(|id| id < episodes);
    changed(folder, (set, "samples.csv"), |samples| {
        samples.lines().filter(kept).flat_map(|line| [line, "\n"]).collect()
    })
}

#[test]
fn the_report_keeps_its_contract() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = diagnose(&first_episodes(folder.path(), "set-003", 8), &out);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    // How far it is stands on standard error.
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    for stage in ["re-tuning", "screening", "fitting", "comparing"] {
        assert!(
            said.lines().any(|line| line.starts_with(stage) && line.contains("simulated episodes")),
            "{stage}: {said}"
        );
    }
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

/// Samples in which the columns `names` of each row are another number.
fn each(text: &str, names: &[&str], change: impl Fn(f64) -> f64) -> String {
    let mut lines = text.lines();
    let head = lines.next().unwrap();
    let columns: Vec<usize> = head.split(',').enumerate().filter(|(_, n)| names.contains(n)).map(|(i, _)| i).collect();
    assert_eq!(columns.len(), names.len());
    let row = |line: &str| {
        let cell = |(i, cell): (usize, &str)| match cell.parse::<f64>() {
            Ok(value) if columns.contains(&i) => change(value).to_string(),
            _ => cell.into(),
        };
        line.split(',').enumerate().map(cell).collect::<Vec<String>>().join(",") + "\n"
    };
    format!("{head}\n{}", lines.map(row).collect::<String>())
}

/// Every row of an episode is its first one.
fn still(text: &str) -> String {
    let mut first = String::new();
    let row = |line: &str| {
        let cells: Vec<&str> = line.splitn(3, ',').collect();
        if cells[1] == "0" || first.is_empty() {
            first = cells[2].into();
        }
        format!("{},{},{first}\n", cells[0], cells[1])
    };
    text.lines().map(row).collect()
}

#[test]
fn numbers_that_cannot_be_meant_are_refused_before_anything_is_simulated() {
    type Change = fn(&str) -> String;
    const OBJECT: [&str; 3] = ["object_x_m", "object_y_m", "object_z_m"];
    let cases: [(&str, Change, &str); 8] = [
        ("log.toml", |text| text.replace("period_secs = 0.02", "period_secs = 1e-9"), "about as many rows as"),
        ("log.toml", |text| text.replace("period_secs = 0.02", "period_secs = 9.0"), "about as many rows as"),
        ("samples.csv", |text| each(text, &["time_secs"], |t| 1e3 * t), "about as many rows as"),
        ("samples.csv", |text| each(text, &OBJECT, |x| 1e3 * x), "are positions in m"),
        ("samples.csv", |text| still(text), "something moves"),
        (
            "log.toml",
            |text| text.replace("mass_kg = { mean = 0.5, stddev = 0.075 }", "mass_kg = 1e-300"),
            "object.mass_kg",
        ),
        ("log.toml", |text| text.replace("com_m = [0.0,", "com_m = [0.5,"), "object.com_m[0]"),
        ("log.toml", |text| text.replace("object_position_m = 0.0005", "object_position_m = 1e-300"), "noise.object"),
    ];
    for (file, change, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("deep/out");
        let output = diagnose(&changed(folder.path(), ("set-002", file), change), &out);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.starts_with("error: ") && message.trim_end().lines().count() == 1, "{message}");
        assert!(message.contains(expected) && message.contains("log"), "{message}");
        assert!(!folder.path().join("deep").exists(), "{message}");
    }
}

#[test]
fn results_are_not_written_over_the_model_and_not_where_they_cannot_be() {
    let log = root().join("tests/data/mujoco-logs/logs/set-002");
    let run = |out: &Path, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_diagnose"));
        let output = command.arg("--measured").arg(&log).arg("--out").arg(out).args(more).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.toml");
    std::fs::write(&model, "version = 1\n[effects]\nmodel = []\n").unwrap();
    let (code, message) = run(folder.path(), &["--model", model.to_str().unwrap()]);
    assert!(code == Some(2) && message.contains("write over") && message.contains("model.toml"), "{message}");
    let taken = tempfile::tempdir().unwrap();
    std::fs::create_dir(taken.path().join("report.html")).unwrap();
    let (code, message) = run(taken.path(), &[]);
    assert!(code == Some(2) && message.contains("report.html") && message.contains("found a folder"), "{message}");
    let (code, message) = run(&taken.path().join("out"), &["--threads", "100000"]);
    assert!(code == Some(2) && message.contains("expected a whole number, 1 to 4096, found `100000`"), "{message}");
}

/// A log of a Sawyer whose joints follow one another around, beside an object that rests.
fn of_an_arm(folder: &Path, columns: bool) -> PathBuf {
    const HOME: [f64; 7] = [-0.3222, -0.7935, 0.0381, 1.9327, -0.0638, 0.4328, 3.079];
    let log = folder.join("log");
    std::fs::create_dir(&log).unwrap();
    let header = "version = 1\nrobot = \"sawyer\"\nperiod_secs = 0.02\ngravity_mps2 = 9.81\n[table]\nheight_m = -0.1\nfriction = 0.4\n[object]\nshape = \"box\"\n\
                  size_m = [0.08, 0.06, 0.05]\nmass_kg = 0.5\ncom_m = [0.0, 0.0, 0.0]\n[noise]\nobject_position_m = 0.0005\nobject_orientation_rad = 0.003\n\
                  joint_position_rad = 0.001\n[split]\nholdout_fraction = 0.3\n";
    std::fs::write(log.join("log.toml"), header).unwrap();
    let joints: String = if columns { (0..7).map(|j| format!(",joint_{j}_rad")).collect() } else { String::new() };
    let mut text = format!(
        "episode,time_secs,action,object_x_m,object_y_m,object_z_m,object_qx,object_qy,object_qz,object_qw{joints}\n"
    );
    for episode in 0..8_u32 {
        for row in 0..40_u32 {
            // The first pose is missing: the episode begins with the second row.
            let pose = if row == 0 { ",,,,,," } else { "0.9,0.4,-0.075,0,0,0,1" };
            text += &format!("{episode},{},2,{pose}", 0.02 * f64::from(row));
            let turned = 0.004 * f64::from(row.saturating_sub(12));
            for (joint, home) in HOME.iter().enumerate().filter(|_| columns) {
                text += &format!(",{}", if joint == 0 { home + turned } else { *home });
            }
            text += "\n";
        }
    }
    std::fs::write(log.join("samples.csv"), text).unwrap();
    log
}

#[test]
fn joints_suffice_for_an_arm_and_actions_alone_do_not_say_where_it_went() {
    let folder = tempfile::tempdir().unwrap();
    let run = |log: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_diagnose"));
        command.arg("--measured").arg(log).arg("--out").arg(log.with_file_name("out")).arg("--root").arg(root());
        command.arg("--json").output().unwrap()
    };
    let output = run(&of_an_arm(folder.path(), true));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["left_out"], serde_json::json!([]));
    assert!(report["evidence"]["errors"].as_array().unwrap().iter().any(|error| error["channel"] == "joint_position"));

    let other = tempfile::tempdir().unwrap();
    let output = run(&of_an_arm(other.path(), false));
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("`action` alone does not say where"), "{message}");
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
        let output = diagnose(&changed(folder.path(), ("set-002", file), change), &out);
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
