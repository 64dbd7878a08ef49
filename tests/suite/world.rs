//! `eval --world`: trials in a world that is another program.

use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

use end_to_end::{files, program, skipped, stderr};
use serde_json::Value;

const TASK: &str = "--domain obstacle --robot jaco --preset paper --quick --set task.horizon=20 --set planner.budget={transitions=100} --set belief.rejection.particles=30 \
                    --set belief.rejection.max_attempts=90";
const EXAMPLE: &str = "python3 assets/worlds/example_world.py";

fn eval(world: &str, rest: &str, out: &Path) -> Output {
    let mut command = program("eval");
    command.args(TASK.split_whitespace()).args(rest.split_whitespace());
    command.args(["--world", world, "--out"]).arg(out).output().unwrap()
}

/// A world of the protocol's tests: see `crates/agent/tests/worlds/misbehaving.rs`.
fn misbehaving(mode: &str) -> String {
    format!("'{}' {mode}", program("misbehaving-world").get_program().display())
}

fn python_missing() -> bool {
    let missing = !std::process::Command::new("python3").arg("--version").output().is_ok_and(|o| o.status.success());
    if missing {
        skipped("there is no python3");
    }
    missing
}

fn trials(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("trials.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Files of a run directory without the wall-clock times of the trials.
fn results(folder: &Path) -> Vec<(String, String)> {
    let text = |(path, bytes): (std::path::PathBuf, Vec<u8>)| {
        let text = String::from_utf8(bytes).unwrap();
        let lines = text.lines().map(|line| line.split(",\"seconds\":").next().unwrap().to_string());
        (path.display().to_string(), lines.collect::<Vec<_>>().join("\n"))
    };
    files(folder).into_iter().map(text).collect()
}

#[test]
fn the_example_world_gives_the_same_bytes_for_one_thread_and_two_and_after_a_kill() {
    if python_missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let [first, second, killed] = ["first", "second", "killed"].map(|name| folder.path().join(name));
    let rest = |threads: u32| format!("--methods heuristic,no-rnn --trials 6 --threads {threads}");
    for (out, threads) in [(&first, 1), (&second, 2)] {
        let output = eval(EXAMPLE, &rest(threads), out);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    assert_eq!(results(&first), results(&second));

    let mut child = program("eval")
        .args(TASK.split_whitespace())
        .args(rest(1).split_whitespace())
        .args(["--world", EXAMPLE, "--out"])
        .arg(&killed)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let log = killed.join("trials.jsonl");
    while std::fs::metadata(&log).map_or(0, |file| file.len()) == 0 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        std::thread::sleep(Duration::from_micros(200));
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success(), "it ended before it could be killed");
    let output = eval(EXAMPLE, &rest(1), &killed);
    assert!(output.status.success() && stderr(&output).contains("finished already"), "{}", stderr(&output));
    assert_eq!(results(&killed), results(&first));

    let table: Value = serde_json::from_slice(&std::fs::read(first.join("table.json")).unwrap()).unwrap();
    let world = &table["provenance"]["world"];
    assert_eq!(
        (&world["name"], &world["version"], &world["address"]),
        (&"example".into(), &"1".into(), &EXAMPLE.into())
    );
    let row =
        |method: &str| table["rows"].as_array().unwrap().iter().find(|row| row["method"] == method).unwrap().clone();
    assert_eq!(row("heuristic")["successes"], 6, "nothing is in the way of the disc");
    assert!(row("no-rnn")["published"].is_null(), "the paper has no figures of this world");
    assert!(trials(&first).iter().all(|trial| trial.get("failure").is_none()));

    // Another world, or none, does not go on in this folder.
    let output = eval(&format!("{EXAMPLE} again"), &rest(1), &first);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("run.json") && stderr(&output).contains("`world`"), "{}", stderr(&output));
}

#[test]
fn trials_of_a_world_that_dies_are_recorded_and_the_next_gets_a_fresh_one() {
    let folder = tempfile::tempdir().unwrap();
    let output = eval(&misbehaving("act-die"), "--methods heuristic --trials 3 --threads 2", folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    let trials = trials(folder.path());
    assert_eq!(trials.len(), 3);
    for trial in &trials {
        assert_eq!((&trial["reason"], &trial["success"]), (&"world-failed".into(), &false.into()));
        let failure = trial["failure"].as_str().unwrap();
        assert!(failure.contains("`act`") && failure.contains("exit status: 3"), "{failure}");
    }
    assert!(std::fs::read_to_string(folder.path().join("table.md")).unwrap().contains("world-failed 3"));
}

#[test]
fn a_world_that_does_not_start_again_stops_the_run_which_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    let (out, marker) = (folder.path().join("out"), folder.path().join("started"));
    let world = misbehaving(&format!("act-die - '{}'", marker.display()));
    let play = || eval(&world, "--methods heuristic --trials 3 --threads 1", &out);
    for played in 1..=2 {
        let output = play();
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("no world to play it in") && message.contains("exit status: 4"), "{message}");
        assert_eq!(trials(&out).len(), played);
        std::fs::remove_file(&marker).unwrap();
    }
    assert!(play().status.success());
    assert_eq!(trials(&out).len(), 3);
}

#[test]
fn worlds_that_cannot_be_used_are_bad_input_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let cases: [(String, &str, &[&str]); 6] = [
        ("nowhere-to-be-found --now".into(), "heuristic", &["nowhere-to-be-found", "cannot be started"]),
        ("tcp://10.1.2.3:5555".into(), "heuristic", &["tcp://10.1.2.3:5555", "loopback"]),
        (misbehaving("hello-version"), "heuristic", &["`hello`", "`protocol`", "expected 1, found 2"]),
        (misbehaving("hello-robot"), "heuristic", &["`hello`", "`robot`", "expected jaco, found panda"]),
        (misbehaving("hello-name"), "heuristic", &["`hello`", "`world`"]),
        (misbehaving("good"), "heuristic,oracle", &["oracle", "true state"]),
    ];
    for (world, methods, parts) in cases {
        let output = eval(&world, &format!("--methods {methods} --trials 1"), &out);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{world}: {message}");
        for part in parts {
            assert!(message.contains(part), "{world}: expected `{part}` in: {message}");
        }
        assert!(!out.exists(), "{world}");
    }
}

#[test]
fn how_far_a_belief_can_be_trusted_is_measured_in_a_world_that_says_what_it_has_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = |world: &[&str], out: &str| {
        let task = "calibration --domain obstacle --robot jaco --set task.horizon=3 --worlds 2 --seed 9";
        let mut command = program("bench");
        command.args(task.split_whitespace()).args(world).arg("--out").arg(folder.path().join(out));
        command.output().unwrap()
    };
    let output = calibration(&["--world", &misbehaving("reset-drawn")], "drawn");
    assert!(output.status.success(), "{}", stderr(&output));
    let read = |name: &str| std::fs::read_to_string(folder.path().join("drawn").join(name)).unwrap();
    let summary: Value = serde_json::from_str(&read("calibration.json")).unwrap();
    let (provenance, last) = (&summary["provenance"], &summary["steps"]["last"]["filter"]);
    assert_eq!((&provenance["world"]["name"], &provenance["failed"]), (&Value::from("misbehaving"), &Value::from(0)));
    assert_eq!(last["mass_coverage_90"]["n"], 2, "{last}");
    assert!(read("calibration.md").contains("played in misbehaving 1.0, where 0 failed"));
    // Another world does not go on with it, here the simulated one; one that says nothing is refused before anything is played.
    let other = calibration(&[], "drawn");
    assert!(
        !other.status.success() && stderr(&other).contains("(world {\"name\":\"misbehaving\""),
        "{}",
        stderr(&other)
    );
    let silent = calibration(&["--world", &misbehaving("good")], "silent");
    assert!(!silent.status.success() && stderr(&silent).contains("`drawn`"), "{}", stderr(&silent));
    assert!(!folder.path().join("silent").exists());
    // What fails is no world, and is tried again.
    let failing = calibration(&["--world", &misbehaving("reset-drawn-far")], "failing");
    let sentence = stderr(&failing);
    assert!(!failing.status.success() && sentence.contains("every world failed"), "{sentence}");
    assert!(sentence.contains("world 1: the world's answer to `reset`: `drawn.object`"), "{sentence}");
    assert_eq!(std::fs::read_dir(folder.path().join("failing/worlds")).unwrap().count(), 0);
    let again = calibration(&["--world", &misbehaving("reset-drawn")], "failing");
    assert!(again.status.success(), "{}", stderr(&again));
}
