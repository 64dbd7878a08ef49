//! The benchmark with a solver that always says "none".

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use diagnose_benchmark::draw;
use diagnose_benchmark::folder::{Folder, Identity};
use diagnose_benchmark::generate::{Actions, generate_part};
use diagnose_benchmark::plan::{Options, Plan, VERSION};
use measured_log::{Format, Notes};
use physics_model::EffectKind;

fn options(sets: u32, none: u32, unknown: u32, pairs: u32, actions: Actions) -> Options {
    Options {
        version: VERSION,
        seed: 3,
        sets,
        none,
        unknown,
        pairs,
        arms: sets.min(3),
        actions: vec![actions],
        only: Vec::new(),
    }
}

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap().to_path_buf()
}

#[test]
fn every_kind_of_set_is_a_log_that_can_be_read() {
    let dir = tempfile::tempdir().unwrap();
    for (actions, [sets, none, unknown, pairs]) in
        [(Actions::Designed, [34, 3, 8, 2]), (Actions::Passive, [0, 1, 1, 1])]
    {
        let plan = Plan::new(options(sets, none, unknown, pairs, actions));
        let mut seen = Vec::new();
        for set in 0..plan.len() {
            // A world that diverges is drawn again.
            let drawn = (0..5).find_map(|attempt| {
                let truth = plan.draw(set, attempt);
                let log = generate_part(&truth.spec, Some(&project()), 5)
                    .inspect_err(|e| eprintln!("{:?}: {e}", truth.names()));
                Some((truth, log.ok()?))
            });
            let (truth, log) = drawn.unwrap();
            let to = dir.path().join(format!("{actions:?}-{set}"));
            measured_log::write(&to, &log, Format::Parquet, &Notes::new()).unwrap();
            let read = measured_log::read(&to).unwrap();
            assert_eq!(read.header, truth.spec.header());
            assert!(truth.spec.scripts().len() >= 38 && read.episodes.len() >= 5, "{:?}", truth.names());
            let rows: usize = read.episodes.iter().map(measured_log::Episode::rows).sum();
            assert!(rows > 500, "{:?}: {rows} rows", truth.names());
            seen.extend(truth.names());
        }
        for kind in EffectKind::ALL {
            let expected = actions == Actions::Designed && draw::identifiable(*kind, actions);
            let missing = expected && !seen.contains(&kind.name().to_owned());
            assert!(!missing, "{}", kind.name());
        }
    }
}

#[test]
fn what_is_no_benchmark_is_not_scored_and_no_folder_is_made() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("nothing");
    let identity =
        Identity { options: options(0, 1, 0, 0, Actions::Passive), project: "0".into(), solver: String::new() };
    let error = Folder::open(&root, &identity, true).unwrap_err().to_string();
    assert!(error.contains("expected the plan.json of a benchmark") && !root.exists(), "{error}");
}

#[test]
fn the_solver_is_told_nothing_of_the_truth() {
    let dir = tempfile::tempdir().unwrap();
    let identity =
        Identity { options: options(0, 1, 0, 0, Actions::Passive), project: "0".into(), solver: String::new() };
    let folder = Folder::open(dir.path(), &identity, false).unwrap();
    let command = folder.command(Path::new("diagnose"), 0, None);
    let given: Vec<PathBuf> = command.get_args().map(PathBuf::from).collect();
    assert!(given.contains(&folder.log(0)) && given.contains(&folder.answer(0)), "{given:?}");
    // Neither the truth nor a folder that it is in.
    assert!(given.iter().all(|path| !folder.truth(0).starts_with(path)), "{given:?}");
}

/// A solver that says "none" of everything.
#[cfg(unix)]
fn solver(dir: &Path) -> PathBuf {
    use std::os::unix::fs::PermissionsExt as _;
    let path = dir.join("solver");
    let text = r#"#!/bin/sh
mkdir -p "$4"
printf 'version = 1\n[effects]\nmodel = []\n' > "$4/model.toml"
printf '{"verdict": "none", "effects": [], "confusion_set": [], "located": [], "heldout": {"before": 1.5, "after": 1.5}, "rollouts": 7, "seconds": 0.5}' > "$4/report.json"
"#;
    std::fs::write(&path, text).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

#[cfg(unix)]
fn benchmark(solver: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_diagnose-benchmark"));
    command.args([
        "--sets",
        "1",
        "--none",
        "1",
        "--unknown",
        "1",
        "--pairs",
        "0",
        "--arms",
        "0",
        "--actions",
        "passive",
        "--only",
    ]);
    command.args(["table_tilt", "--diagnose"]).arg(solver).arg("--out").arg(out).args(more);
    command.output().unwrap()
}

/// All files below a folder.
fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![dir.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.insert(path.strip_prefix(dir).unwrap().to_path_buf(), std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[cfg(unix)]
#[test]
fn a_benchmark_resumes_and_does_not_depend_on_threads() {
    let dir = tempfile::tempdir().unwrap();
    let solver = solver(dir.path());
    let (one, two) = (dir.path().join("one"), dir.path().join("two"));
    let run = |out: &Path, more: &[&str]| {
        let output = benchmark(&solver, out, more);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output
    };
    let said = run(&one, &["--threads", "1", "--baselines"]);
    let table = String::from_utf8(said.stdout).unwrap();
    assert!(table.contains("| hidden effect named first | – | ≥ 92 % | 0 % (0/1; 0–79) | ≥ 85 % |"), "{table}");
    assert!(table.contains("| false alarm with no effect | – | ≤ 3 % | 0 % (0/1; 0–79) | ≤ 5 % |"), "{table}");
    run(&two, &["--threads", "2", "--baselines"]);
    assert_eq!(files(&one), files(&two));

    // From here on without baselines, which are computed anew by every run.
    run(&one, &[]);
    let all = files(&one);

    // A lost answer is given again, and nothing else is touched.
    let log = one.join("logs/set-0001/log.toml");
    let before = std::fs::metadata(&log).unwrap().modified().unwrap();
    std::fs::remove_dir_all(one.join("answers/set-0001")).unwrap();
    let said = run(&one, &[]);
    assert!(String::from_utf8_lossy(&said.stderr).contains("2 sets are finished already"));
    assert_eq!(files(&one), all);
    assert_eq!(std::fs::metadata(&log).unwrap().modified().unwrap(), before);

    // A lost truth comes back with the same log.
    std::fs::remove_file(one.join("truth/set-0002.json")).unwrap();
    run(&one, &[]);
    assert_eq!(files(&one), all);

    let output = benchmark(&solver, &one, &["--seed", "2"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("other options"));
    std::fs::write(&solver, "#!/bin/sh\nexit 3\n").unwrap();
    let output = benchmark(&solver, &one, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("another version of diagnose"));
    assert!(benchmark(&solver, &one, &["--score-only"]).status.success());
}
