//! Where results go: files of others are never touched, and a place where no result can be is refused before any work.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use end_to_end::{files, root, run, short_log, stderr};
use tempfile::TempDir;

use crate::bad_input::refused;
use crate::pipeline::trained;

/// A program with arguments to which `--out FOLDER` is added.
struct Work {
    binary: &'static str,
    arguments: String,
    /// Whether it replaces its own results, or leaves them as they are.
    again: bool,
}

impl Work {
    fn to(&self, out: &Path) -> String {
        format!("{} --out {}", self.arguments, out.display())
    }

    fn succeed(&self, out: &Path) {
        let output = run(self.binary, &self.to(out));
        assert!(output.status.success(), "{} {}: {}", self.binary, self.to(out), stderr(&output));
    }
}

const TOSSES: &str = "\
toss,t_s,x_m,y_m,z_m,qw,qx,qy,qz,vx_mps,vy_mps,vz_mps,wx_body_rps,wy_body_rps,wz_body_rps
0,0.000000,0.1,0.2,0.5,0.8,0,0,0.6,1,2,3,4,5,6
0,0.006757,0.1,0.2,0.5,0.8,0,0,0.6,1,2,3,4,5,6
1,0.000000,0.1,0.2,0.5,1,0,0,0,1,2,3,4,5,6
";

/// What programs read in these tests: tosses, and a dataset that the prior has not seen.
fn sources() -> &'static [PathBuf; 2] {
    static MADE: OnceLock<(TempDir, [PathBuf; 2])> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let (tosses, data) = (folder.path().join("tosses_1.csv"), folder.path().join("held-out"));
        std::fs::write(&tosses, TOSSES).unwrap();
        let output = run("datagen", &format!("--transitions 200 --shards 2 --seed 2 --out {}", data.display()));
        assert!(output.status.success(), "{}", stderr(&output));
        (folder, [tosses, data])
    });
    &made.1
}

/// Every program that writes a folder.
fn works() -> Vec<Work> {
    let [tosses, held_out] = sources();
    let (data, prior) = (trained().data.display(), trained().prior.display());
    let work = |binary, arguments: &str| Work { binary, arguments: arguments.into(), again: true };
    let once = |binary, arguments: &str| Work { again: false, ..work(binary, arguments) };
    vec![
        work("demo", "--domain D1 --quick --method heuristic"),
        work("diagnose", &format!("--measured {}", short_log().display())),
        work("datagen", "--transitions 200 --shards 2"),
        work("train", &format!("--epochs 1 --data {data}")),
        work("calibrate", &format!("--prior {prior} --data {}", held_out.display())),
        work("eval", "--domain D1 --quick --trials 1 --methods heuristic"),
        work("eval", "--all --quick --only table1-surmise-D1 --trials 1"),
        work("diagnose-benchmark", "--sets 0 --none 0 --unknown 0 --pairs 0 --arms 0"),
        work("docs", "--no-api"),
        once("record-log", "--actions passive"),
        once("import-log", &format!("contactnets {}", tosses.display())),
    ]
}

/// Names of results that a program left, but for its marks and for what it needs to go on.
fn results(folder: &Path) -> Vec<PathBuf> {
    let all = files(folder).into_iter().map(|(path, _)| path);
    let hidden = |path: &Path| path.iter().any(|part| part.to_string_lossy().starts_with('.'));
    // A first save of a training that was killed leaves files there that nothing tells from others.
    all.filter(|path| !hidden(path) && !path.starts_with("training")).collect()
}

/// Files at most that are tried of a program; a book has hundreds, and all are refused for one reason.
const MOST: usize = 40;

#[test]
fn a_file_of_somebody_else_by_the_name_of_any_result_is_refused_and_stays() {
    let mut tried = BTreeSet::new();
    for work in works() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole");
        work.succeed(&whole);
        let results = results(&whole);
        assert!(!results.is_empty(), "{} {}", work.binary, work.arguments);
        for (number, name) in results.iter().take(MOST).enumerate() {
            let out = folder.path().join(format!("mine-{number}"));
            std::fs::create_dir_all(out.join(name).parent().unwrap()).unwrap();
            std::fs::write(out.join(name), "mine\n").unwrap();
            refused(work.binary, &work.to(&out), &[&format!("mine-{number}")]);
            let there = files(&out);
            assert!(there == [(name.clone(), b"mine\n".to_vec())], "{}: {}: {there:?}", work.binary, name.display());
            tried.insert(name.clone());
        }
        // Its own results are no reason to refuse.
        if work.again {
            work.succeed(&whole);
        } else {
            refused(work.binary, &work.to(&whole), &["whole"]);
        }
    }
    for name in ["calibration.json", "table.md", "ranks.svg", "model.toml", "episode.html", "curve.png"] {
        assert!(tried.contains(Path::new(name)), "{name} of {tried:?}");
    }
}

#[test]
fn a_folder_with_results_of_another_kind_is_refused_and_stays() {
    let evaluation = tempfile::tempdir().unwrap();
    std::fs::write(evaluation.path().join("run.json"), "{}").unwrap();
    for work in works() {
        let evaluates = work.binary == "eval";
        if evaluates {
            continue;
        }
        let words: &[&str] = if work.binary == "docs" { &["other files"] } else { &["holds an evaluation (run.json)"] };
        refused(work.binary, &work.to(evaluation.path()), words);
        assert_eq!(files(evaluation.path()).len(), 1, "{}", work.binary);
    }
}

#[test]
fn a_place_where_no_folder_can_be_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "mine\n").unwrap();
    for work in works() {
        for (out, found) in [
            (file.clone(), "found a file"),
            (file.join("below"), "found the file"),
            (file.join("a/b"), "found the file"),
        ] {
            refused(work.binary, &work.to(&out), &[&out.display().to_string(), "expected a folder", found]);
            system_is_silent(work.binary, &work.to(&out));
        }
    }
    assert_eq!(files(folder.path()), [("file".into(), b"mine\n".to_vec())]);
}

#[test]
fn a_place_where_no_file_can_be_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "mine\n").unwrap();
    let run = root().join("assets/results/table1-surmise-D4");
    for (out, words) in [
        (folder.path().join("none/page.html"), "expected a folder that is there"),
        (file.join("page.html"), "expected a folder above it"),
        (folder.path().to_path_buf(), "expected a file or nothing there"),
        (file.clone(), "not a page of this program"),
    ] {
        let arguments = format!("{} --out {}", run.display(), out.display());
        refused("report", &arguments, &[&out.display().to_string(), words]);
        system_is_silent("report", &arguments);
    }
    assert_eq!(files(folder.path()), [("file".into(), b"mine\n".to_vec())]);
}

/// The operating system's words say nothing of what was expected.
fn system_is_silent(binary: &str, arguments: &str) {
    let message = stderr(&run(binary, arguments));
    assert!(!message.contains("os error"), "{binary} {arguments}: {message}");
}

#[test]
fn a_project_folder_that_is_none_is_refused_by_every_program_that_takes_one() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("nowhere");
    let mut commands: Vec<(&str, String)> =
        works().iter().map(|work| (work.binary, work.to(&folder.path().join("out")))).collect();
    commands.retain(|(binary, _)| *binary != "import-log");
    commands.push(("scenario", "check D1".into()));
    for (binary, arguments) in commands {
        let arguments = format!("{arguments} --root {}", nowhere.display());
        refused(binary, &arguments, &["--root", &nowhere.display().to_string(), "scenarios/base.toml"]);
    }
    assert!(files(folder.path()).is_empty());
}

#[test]
fn published_results_that_the_help_of_report_names_have_pages() {
    let help = run("report", "--help");
    let help = String::from_utf8_lossy(&help.stdout).replace(['\n', ','], " ");
    let named: BTreeSet<&str> = help
        .split_whitespace()
        .filter(|word| word.starts_with("assets/results"))
        .map(|word| word.trim_end_matches(['.', ',']))
        .collect();
    assert!(named.len() >= 2, "{help}");
    let folder = tempfile::tempdir().unwrap();
    for run_folder in named {
        let page = folder.path().join("page.html");
        let output = run("report", &format!("{run_folder} --out {}", page.display()));
        assert!(output.status.success(), "{run_folder}: {}", stderr(&output));
    }
}

#[test]
fn what_a_log_hides_is_written_once_and_outside_of_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let record = |log: &str, truth: &str| {
        let [log, truth] = [log, truth].map(|name| folder.path().join(name));
        run("record-log", &format!("--actions passive --out {} --truth {}", log.display(), truth.display()))
    };
    let output = record("log", "truth.json");
    assert!(output.status.success(), "{}", stderr(&output));
    let truth = std::fs::read_to_string(folder.path().join("truth.json")).unwrap();
    assert!(truth.contains("table_tilt") && !truth.contains("rolling_resistance"), "{truth}");
    for (log, truth) in [("second", "truth.json"), ("second", "second/truth.json")] {
        let output = record(log, truth);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(
            stderr(&output).contains("expected a file that is not there, outside of the log"),
            "{}",
            stderr(&output)
        );
        assert!(!folder.path().join("second").exists());
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("truth.json")).unwrap(), truth);
}

#[test]
fn what_logs_teach_is_learnt_again_from_one_file_and_each_log_counts_once() {
    let examples = root().join("assets/results/diagnose-worlds/seeds-51-52-91.jsonl");
    let judge = |logs: &str| run("diagnose-learn", logs);
    let output = judge(&examples.display().to_string());
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.lines().any(|line| line.starts_with("| all | 167 | ") && line.contains(" of 59 (")), "{table}");
    let output = judge(&format!("{0} {0}", examples.display()));
    assert!(output.status.code() == Some(2) && stderr(&output).contains("is there twice"), "{}", stderr(&output));
}
