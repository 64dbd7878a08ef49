//! `eval --all`: every table by one command, the same after a kill.

use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

use end_to_end::{files, program, stderr};
use serde_json::Value;

/// Some runs of each table, with budgets that only go through every step.
const RUNS: &str = "--all --only table1-paper-D4,table1-surmise-D3,table1-surmise-D5,table2-paper,table2-paper-mujoco,\
                    ablation-rejection-filter --quick --trials 2 --set task.horizon=4 --set planner.budget={transitions=60} \
                    --set belief.rejection.particles=30 --set belief.rejection.max_attempts=90 \
                    --set belief.bridge.draws=20 --set belief.bridge.effective=10 \
                    --python no-such-python";

fn all(rest: &str, out: &Path) -> Output {
    let mut command = program("eval");
    command.args(RUNS.split_whitespace()).args(rest.split_whitespace()).arg("--out").arg(out).output().unwrap()
}

/// Files below `folder` by name, without the clock's values.
fn results(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let without_clock = |(path, bytes): (std::path::PathBuf, Vec<u8>)| {
        let name = path.display().to_string();
        if !name.ends_with("trials.jsonl") {
            return (!name.starts_with("clock.")).then_some((name, bytes));
        }
        let text = String::from_utf8(bytes).unwrap();
        let lines = text.lines().map(|line| line.split(",\"seconds\":").next().unwrap().to_string());
        Some((name, lines.collect::<Vec<_>>().join("\n").into_bytes()))
    };
    files(folder).into_iter().filter_map(without_clock).collect()
}

#[test]
fn all_tables_are_the_same_for_one_thread_and_two_and_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, killed) = (folder.path().join("whole"), folder.path().join("killed"));
    let output = all("--threads 2", &whole);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("table2-paper-mujoco-obstacle is left out"), "{}", stderr(&output));

    let mut child = program("eval")
        .args(RUNS.split_whitespace())
        .args(["--threads", "1", "--out"])
        .arg(&killed)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // In the middle of the second run.
    let log = killed.join("table1-surmise-D3/trials.jsonl");
    while std::fs::metadata(&log).map_or(0, |file| file.len()) == 0 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        std::thread::sleep(Duration::from_micros(200));
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success(), "it ended before it could be killed");
    assert!(!killed.join("table1.md").exists(), "a killed run has no combined table");
    let output = all("--threads 1", &killed);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("table1-paper-D4 (1 of 7): 0 trials to play"), "{}", stderr(&output));

    let (first, second) = (results(&whole), results(&killed));
    let names = |results: &[(String, Vec<u8>)]| results.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&first), names(&second));
    for ((name, a), (_, b)) in first.iter().zip(&second) {
        assert!(a == b, "{name} differs after a kill");
    }
    for name in ["figure4.svg", "figure4.png", "table1-D5.png", "table1-steps.svg", "table2.md", "ablation-success.png"]
    {
        assert!(names(&first).contains(&name.to_string()), "{name} is missing");
    }
    check_table(&whole.join("table1.json"));
    let ablation: Value = serde_json::from_slice(&std::fs::read(whole.join("ablation.json")).unwrap()).unwrap();
    assert_eq!(ablation["rows"][0]["run"], "surmise", "the runs that it is compared with stand first");
    assert!(ablation["comparisons"].as_array().unwrap().iter().all(|c| c["first"]["run"] == "surmise"));

    // Another seed does not go on in this folder.
    let output = all("--seed 2", &whole);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("`seed` is 1, this run has 2"), "{}", stderr(&output));
    assert!(results(&whole) == first, "a refused run changes nothing");
}

fn check_table(file: &Path) {
    let table: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    // Five methods on D4, four on D3 and on D5.
    assert_eq!(table["rows"].as_array().unwrap().len(), 13);
    assert_eq!(table["rows"][2]["published"], serde_json::json!({"successes": 10, "trials": 30}));
    for key in ["interval95", "failures", "reasons", "mean_large_forces", "mean_out_of_reach"] {
        assert!(!table["rows"][0][key].is_null(), "{key}");
    }
    // No run has played all domains of a pool.
    assert!(table["totals"].as_array().unwrap().is_empty());
    let missing = table["missing"].as_array().unwrap();
    assert!(missing.contains(&"table1-paper-D1".into()) && !missing.contains(&"table1-paper-D4".into()), "{missing:?}");
    let source = &table["provenance"]["runs"]["table1-surmise-D3"];
    assert!(source["scenario_hash"].is_string() && source["prior_hash"].is_string(), "{source}");
    let text = table.to_string();
    assert!(!text.contains("\"/"), "no path of this machine");
}

#[test]
fn what_all_cannot_mean_is_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let cases: [(&str, &[&str]); 8] = [
        ("--all --only table9", &["table9", "table1-paper"]),
        ("--all --domain D4", &["--domain"]),
        ("--all --quick --publish", &["--publish", "--quick"]),
        ("--only table1", &["--all"]),
        ("--domain D4 --only table1", &["--domain"]),
        ("--domain D4 --python python3", &["--domain"]),
        ("--domain D4 --publish", &["--domain"]),
        ("--all --set task.horizn=3", &["task.horizn", "horizon"]),
    ];
    for (arguments, parts) in cases {
        let output = program("eval").args(arguments.split_whitespace()).arg("--out").arg(&out).output().unwrap();
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments}: {message}");
    }
    assert!(!out.exists(), "a refused run leaves nothing behind");
}

#[test]
fn published_tables_are_copied_without_their_runs_and_without_paths() {
    let folder = tempfile::tempdir().unwrap();
    let (root, out) = (folder.path().join("project"), folder.path().join("out"));
    for part in ["scenarios", "assets/robots", "assets/priors"] {
        for (path, bytes) in files(&end_to_end::root().join(part)) {
            let target = root.join(part).join(path);
            std::fs::create_dir_all(target.parent().unwrap()).unwrap();
            std::fs::write(target, bytes).unwrap();
        }
    }
    let arguments = "--all --publish --only table2-paper --trials 1 --threads 1 --set task.horizon=2 \
                     --set planner.budget={transitions=60} --set belief.rejection.particles=30 --set belief.rejection.max_attempts=90";
    let mut command = program("eval");
    command.args(arguments.split_whitespace()).arg("--root").arg(&root).arg("--out").arg(&out);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let published = files(&root.join("assets/results"));
    let names: Vec<String> = published.iter().map(|(path, _)| path.display().to_string()).collect();
    for name in ["table2.json", "table2.csv", "table2.md", "table2-success.svg", "table2-success.png", "clock.md"] {
        assert!(names.contains(&name.to_string()), "{name} in {names:?}");
    }
    assert!(names.iter().all(|name| !name.contains('/')), "no run directories: {names:?}");
    let project = folder.path().display().to_string();
    for (path, bytes) in published {
        assert!(!String::from_utf8_lossy(&bytes).contains(&project), "{} names a path", path.display());
        assert_eq!(std::fs::read(out.join(&path)).unwrap(), bytes, "{}", path.display());
    }
}
