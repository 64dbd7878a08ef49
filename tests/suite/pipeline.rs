//! Data, training and trials through the programs: same seed, same bytes, whatever the threads and whatever was killed.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::OnceLock;
use std::time::Duration;

use end_to_end::{files, program, run, stderr};
use tempfile::TempDir;

const DATA: &str = "--transitions 2000 --shards 10 --set data.episode_actions=10";
const SEARCH: &str = "--domain D4 --preset paper --quick --trials 2 --set planner.budget={transitions=120} --set belief.rejection.particles=30 \
                      --set belief.rejection.max_attempts=90";

/// A small dataset and a prior trained on it for three epochs, made once for all tests.
pub(crate) struct Trained {
    _folder: TempDir,
    pub(crate) data: PathBuf,
    pub(crate) prior: PathBuf,
}

pub(crate) fn trained() -> &'static Trained {
    static TRAINED: OnceLock<Trained> = OnceLock::new();
    TRAINED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let (data, prior) = (folder.path().join("data"), folder.path().join("prior"));
        succeed("datagen", &format!("{DATA} --threads 2 --out {}", data.display()));
        succeed("train", &train(&data, &prior, 2));
        Trained { _folder: folder, data, prior }
    })
}

fn train(data: &Path, out: &Path, threads: usize) -> String {
    format!("--epochs 3 --threads {threads} --data {} --out {}", data.display(), out.display())
}

fn evaluate(out: &Path, threads: usize) -> String {
    let prior = trained().prior.display();
    format!("{SEARCH} --threads {threads} --prior {prior} --out {}", out.display())
}

fn succeed(binary: &str, arguments: &str) -> String {
    let output = run(binary, arguments);
    assert!(output.status.success(), "{binary} {arguments}: {}", stderr(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Starts a program, kills it as soon as `reached` says so, and returns whether it was still running then.
fn kill_when(binary: &str, arguments: &str, reached: impl Fn() -> bool) -> bool {
    let mut child =
        program(binary).args(arguments.split_whitespace()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !reached() {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    // SIGKILL on Unix: no handler runs.
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// Files of a run directory without the wall-clock times of the trials.
fn results(folder: &Path) -> Vec<(PathBuf, String)> {
    let text = |(path, bytes): (PathBuf, Vec<u8>)| {
        let text = String::from_utf8(bytes).unwrap();
        let without_time = text.lines().map(|line| line.split(",\"seconds\":").next().unwrap().to_string());
        (path, without_time.collect::<Vec<_>>().join("\n"))
    };
    files(folder).into_iter().map(text).collect()
}

#[test]
fn an_episode_of_demo_is_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let play = |threads: &str| {
        let out = folder.path().join(threads);
        let trees = "--set planner.trees=3";
        succeed("demo", &format!("--domain D4 --quick {trees} --threads {threads} --out {}", out.display()));
        files(&out)
    };
    assert!(play("1") == play("3"));
}

#[test]
fn a_dataset_is_the_same_for_one_thread_and_two_and_after_a_kill() {
    let expected = files(&trained().data);
    assert!(expected.len() >= 12, "plan, manifest and ten shards");
    let folder = tempfile::tempdir().unwrap();
    let single = folder.path().join("single");
    succeed("datagen", &format!("{DATA} --threads 1 --out {}", single.display()));
    assert!(files(&single) == expected, "one thread and two give different bytes");

    let killed = folder.path().join("killed");
    let arguments = format!("{DATA} --threads 1 --out {}", killed.display());
    let first = killed.join("data/chunk-000/file-000.parquet");
    assert!(kill_when("datagen", &arguments, || first.exists()), "it ended before it could be killed");
    assert!(!killed.join("meta/info.json").exists(), "a killed run has no manifest");
    succeed("datagen", &arguments);
    let visible = |path: &Path| !path.file_name().unwrap().to_string_lossy().starts_with('.');
    let resumed: Vec<_> = files(&killed).into_iter().filter(|(path, _)| visible(path)).collect();
    assert!(resumed == expected, "a killed and resumed dataset differs");
}

#[test]
fn a_prior_is_the_same_for_one_thread_and_two_and_after_a_kill() {
    let prior_files = |folder: &Path| -> Vec<_> {
        files(folder).into_iter().filter(|(path, _)| !path.starts_with("training")).collect()
    };
    let expected = prior_files(&trained().prior);
    let names: Vec<String> = expected.iter().map(|(path, _)| path.display().to_string()).collect();
    assert!(names.contains(&"prior.json".into()) && names.contains(&"curve.png".into()), "{names:?}");
    let folder = tempfile::tempdir().unwrap();
    let single = folder.path().join("single");
    succeed("train", &train(&trained().data, &single, 1));
    assert!(prior_files(&single) == expected, "one thread and two give different priors");

    let killed = folder.path().join("killed");
    let arguments = train(&trained().data, &killed, 1);
    // The state appears after the first epoch.
    let saved = killed.join("training/training.json");
    assert!(kill_when("train", &arguments, || saved.exists()), "it ended before it could be killed");
    succeed("train", &arguments);
    assert!(prior_files(&killed) == expected, "a killed and resumed prior differs");
}

#[test]
fn a_calibration_report_is_the_same_for_one_thread_and_two_and_wants_other_worlds() {
    let folder = tempfile::tempdir().unwrap();
    let (data, memoryless) = (folder.path().join("data"), folder.path().join("memoryless"));
    succeed("datagen", &format!("{DATA} --seed 2 --out {}", data.display()));
    succeed("train", &format!("--memoryless {}", train(&trained().data, &memoryless, 2)));
    let arguments = |data: &Path, threads: usize, out: &Path| {
        let (prior, data, memoryless) = (trained().prior.display(), data.display(), memoryless.display());
        format!("--prior {prior} --data {data} --memoryless {memoryless} --threads {threads} --out {}", out.display())
    };
    let (double, single) = (folder.path().join("double"), folder.path().join("single"));
    let printed = succeed("calibrate", &format!("--json {}", arguments(&data, 2, &double)));
    succeed("calibrate", &arguments(&data, 1, &single));
    assert!(files(&double) == files(&single), "one thread and two give different reports");
    let report: serde_json::Value = serde_json::from_str(&printed).unwrap();
    for key in ["nll", "baseline_nll", "memoryless_nll", "shape_accuracy", "obstacle_after_contact_accuracy"] {
        assert!(report[key].as_f64().is_some_and(f64::is_finite), "{key}: {}", report[key]);
    }
    let mass = report["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "object_mass_kg").unwrap();
    assert!(mass["coverage90"].as_f64().is_some() && mass["coverage50"].as_f64().is_some(), "{mass}");

    let refused = run("calibrate", &arguments(&trained().data, 1, &folder.path().join("none")));
    let message = stderr(&refused);
    assert_eq!(refused.status.code(), Some(2), "{message}");
    assert!(message.contains("info.json: seed is 1") && message.contains("expected another"), "{message}");
    assert!(!folder.path().join("none").exists());
}

#[test]
fn a_table_is_the_same_for_one_thread_and_two_and_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    let printed = succeed("eval", &evaluate(&whole, 2));
    assert_eq!(printed, std::fs::read_to_string(whole.join("table.md")).unwrap());
    let expected = results(&whole);
    let names: Vec<String> = expected.iter().map(|(path, _)| path.display().to_string()).collect();
    assert_eq!(names, ["run.json", "scenario.toml", "table.csv", "table.json", "table.md", "trials.jsonl"]);

    let killed = folder.path().join("killed");
    let arguments = evaluate(&killed, 1);
    let log = killed.join("trials.jsonl");
    let one_trial = || std::fs::metadata(&log).is_ok_and(|m| m.len() > 0);
    assert!(kill_when("eval", &arguments, one_trial), "it ended before it could be killed");
    assert!(!killed.join("table.md").exists(), "a killed run has no table");
    succeed("eval", &arguments);
    assert_eq!(results(&killed), expected);
}

#[test]
fn the_table_has_the_keys_that_machines_read() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let text = succeed("eval", &format!("{} --json", evaluate(&out, 2)));
    let table: serde_json::Value = serde_json::from_str(&text).unwrap();
    let row = &table["rows"][2];
    assert_eq!((row["domain"].as_str(), row["robot"].as_str()), (Some("D4"), Some("sawyer")));
    assert_eq!((row["preset"].as_str(), row["method"].as_str()), (Some("paper"), Some("rnn-sampling")));
    assert_eq!(row["trials"], 2);
    assert!(row["successes"].as_u64().unwrap() <= 2);
    assert_eq!(row["interval95"].as_array().unwrap().len(), 2);
    assert_eq!(row["published"], serde_json::json!({"successes": 10, "trials": 30}));
    for key in ["scenario_hash", "seed", "prior_hash", "commit"] {
        assert!(!table["provenance"][key].is_null(), "{key}");
    }
    let trials = std::fs::read_to_string(out.join("trials.jsonl")).unwrap();
    assert_eq!(trials.lines().count(), 6);
    for line in trials.lines() {
        let trial: serde_json::Value = serde_json::from_str(line).unwrap();
        for key in ["seed", "success", "steps", "reason", "depletions", "transitions", "seconds"] {
            assert!(!trial[key].is_null(), "{key} in {line}");
        }
    }
}

#[test]
fn both_arms_play_an_episode() {
    let folder = tempfile::tempdir().unwrap();
    for (domain, robot) in [("D5", "sawyer"), ("obstacle", "jaco"), ("D4", "jaco")] {
        let out = folder.path().join(format!("{domain}-{robot}"));
        let arguments = format!(
            "--domain {domain} --robot {robot} --preset paper --quick --trials 1 --methods no-rnn,oracle,heuristic \
             --set planner.budget={{transitions=120}} --set belief.rejection.max_attempts=90 --out {}",
            out.display()
        );
        succeed("eval", &arguments);
        assert_eq!(std::fs::read_to_string(out.join("trials.jsonl")).unwrap().lines().count(), 3);
    }
}
