//! What the documents tell people to type works: every option exists, and what takes seconds is played, with small budgets and in a folder
//! of its own.

mod links;
mod made;
mod prose;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use end_to_end::{files, program, root, stderr};
use serde_json::Value;

/// Verbs whose work takes minutes and is done by other tests: here they only have to accept their options.
const PLAYED_ELSEWHERE: [&str; 5] = ["bench", "calibrate", "diagnose", "diagnose-benchmark", "docs"];
/// Verbs of `cargo xtask` that are no programs of ours, or need what a machine need not have.
const NOT_HERE: [&str; 2] = ["ci", "rerun"];

/// Lines of a document's code blocks that begin with `cargo xtask`, without their comments.
fn commands(document: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(document).unwrap_or_else(|e| panic!("{}: {e}", document.display()));
    let mut inside = false;
    let mut found = Vec::new();
    for line in text.lines().map(str::trim) {
        if line.starts_with("```") {
            inside = !inside;
        } else if let Some(command) = line.strip_prefix("cargo xtask ").filter(|_| inside) {
            found.push(command.split(" #").next().unwrap_or(command).trim().to_owned());
        }
    }
    found
}

/// The same within sentences, between backticks.
fn mentioned(document: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(document).unwrap_or_else(|e| panic!("{}: {e}", document.display()));
    let spans = text.split('`').skip(1).step_by(2);
    spans.filter_map(|span| span.strip_prefix("cargo xtask ")).map(|command| command.replace('\n', " ")).collect()
}

/// Words as a shell splits them.
fn words(command: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let (mut word, mut quote, mut any) = (String::new(), None, false);
    for c in command.chars() {
        match (quote, c) {
            (None, '\'' | '"') => (quote, any) = (Some(c), true),
            (Some(q), c) if c == q => quote = None,
            (None, ' ') => {
                if any || !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
                any = false;
            }
            (_, c) => word.push(c),
        }
    }
    if any || !word.is_empty() {
        words.push(word);
    }
    words
}

/// Whether a line lists what may be typed rather than what to type.
fn is_synopsis(command: &str) -> bool {
    ["[--", "…", "|"].iter().any(|part| command.contains(part))
        || words(command).iter().any(|word| word.len() > 2 && word.chars().all(|c| c.is_ascii_uppercase() || c == '.'))
}

/// All documents, relative to the project: those at its root, and every page below `docs/`.
fn documents() -> Vec<PathBuf> {
    let at_root = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md"].map(PathBuf::from);
    let mut documents: Vec<PathBuf> = at_root.into_iter().filter(|path| root().join(path).exists()).collect();
    let pages = files(&root().join("docs")).into_iter().map(|(path, _)| Path::new("docs").join(path));
    documents.extend(pages.filter(|path| path.extension().is_some_and(|end| end == "md")));
    documents
}

#[test]
fn every_option_in_the_documents_exists() {
    let options = options();
    let mut checked = 0;
    for document in documents() {
        for command in commands(&root().join(&document)).into_iter().chain(mentioned(&root().join(&document))) {
            let verb = words(&command)[0].clone();
            if NOT_HERE.contains(&verb.as_str()) || verb.chars().all(|c| c.is_ascii_uppercase()) {
                continue;
            }
            let known = options.get(&verb).unwrap_or_else(|| panic!("{}: there is no {verb}", document.display()));
            for option in command.split([' ', '[', ']', '|']).filter(|word| word.starts_with("--")) {
                let option = option.split('=').next().unwrap_or(option);
                assert!(known.contains(option), "{}: {verb} has no {option}", document.display());
                checked += 1;
            }
        }
    }
    assert!(checked > 50, "{checked} options");
}

/// Verbs that a verb has of its own.
fn verbs_of(verb: &str) -> &'static [&'static str] {
    match verb {
        "bench" => {
            &["physics", "calibration", "nudge", "policy", "decision", "planner", "prior", "accuracy", "log-check"]
        }
        "import-log" => &["table", "mcap", "ros2", "lerobot", "contactnets", "cmu-push"],
        "log" => &["check", "align"],
        "robot" => &["check", "excite"],
        "scenario" => &["check", "schema"],
        _ => &[],
    }
}

fn one_help(verb: &str, own: Option<&str>) -> String {
    let output = tool(verb).args(own).arg("--help").output().unwrap();
    assert!(output.status.success(), "{verb}: {}", stderr(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What the menu lists, without what this machine need not have.
const VERBS: [&str; 20] = [
    "doctor",
    "eval",
    "demo",
    "report",
    "scenario",
    "import-log",
    "record-log",
    "log",
    "diagnose",
    "robot",
    "datagen",
    "posterior-data",
    "train",
    "calibrate",
    "bench",
    "diagnose-benchmark",
    "diagnose-learn",
    "arm-learn",
    "completions",
    "docs",
];

/// Commands under the last heading of a help.
fn examples(help: &str) -> Vec<String> {
    let (_, examples) = help.rsplit_once("\nExamples:\n").unwrap_or_default();
    // Long ones go on in the next line.
    let whole = examples.lines().map(str::trim).collect::<Vec<_>>().join(" ");
    let commands = whole.split("cargo xtask ").skip(1);
    commands.map(|command| command.split(" #").next().unwrap_or(command).trim().to_owned()).collect()
}

#[test]
fn the_menu_lists_every_verb_and_the_versions_are_said() {
    let menu = end_to_end::run("xtask", "");
    let text = String::from_utf8_lossy(&menu.stdout).into_owned();
    assert!(menu.status.success() && menu.stderr.is_empty(), "{menu:?}");
    for verb in VERBS.iter().chain(&["ci", "rerun"]) {
        assert!(text.contains(&format!("\n  {verb:<18}  ")), "{verb} in {text}");
    }
    assert_eq!(text.trim_end(), String::from_utf8_lossy(&end_to_end::run("xtask", "--help").stdout).trim_end());
    for verb in VERBS.iter().filter(|verb| !["doctor", "completions"].contains(verb)) {
        let output = tool(verb).arg("--version").output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(said, format!("{verb} {}\n", env!("CARGO_PKG_VERSION")), "{output:?}");
    }
}

#[test]
fn every_help_ends_with_examples_whose_options_exist() {
    for verb in VERBS {
        for own in std::iter::once(None).chain(verbs_of(verb).iter().copied().map(Some)) {
            let help = one_help(verb, own);
            let examples = examples(&help);
            assert!(!examples.is_empty(), "{verb} {own:?}: no example in {help}");
            let name = [Some(verb), own].into_iter().flatten().collect::<Vec<_>>().join(" ");
            assert!(examples.iter().any(|command| command.starts_with(&name)), "{name}: {examples:?}");
            for command in examples {
                let words = words(&command);
                let inner = words.get(1).map(String::as_str).filter(|word| verbs_of(&words[0]).contains(word));
                let text = one_help(&words[0], inner);
                let known: BTreeSet<&str> = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '-').collect();
                for option in words.iter().filter(|word| word.starts_with("--")) {
                    assert!(known.contains(option.as_str()), "{name}: {command} has no {option}");
                }
            }
        }
    }
}

#[test]
fn examples_that_take_seconds_work() {
    let verbs = [
        "doctor",
        "completions",
        "scenario",
        "eval",
        "demo",
        "report",
        "record-log",
        "diagnose",
        "import-log",
        "log",
        "robot",
    ];
    let mut commands = Vec::new();
    for verb in verbs {
        for own in std::iter::once(None).chain(verbs_of(verb).iter().copied().map(Some)) {
            commands.extend(examples(&one_help(verb, own)));
        }
    }
    commands.dedup();
    // Tables take minutes; a doctor may find something missing.
    play_commands("examples", commands, &["doctor"], &["--all"]);
}

/// The options of every verb and of its own verbs.
fn options() -> BTreeMap<String, BTreeSet<String>> {
    fn collect(command: &Value, found: &mut BTreeSet<String>) {
        for option in command["options"].as_array().unwrap() {
            let usage = option["usage"].as_str().unwrap();
            let words = usage.split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
            found.extend(words.filter(|word| word.starts_with("--")).map(String::from));
        }
        command["commands"].as_array().unwrap().iter().for_each(|inner| collect(inner, found));
    }
    let output = program("xtask").arg("describe").output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let menu: Value = serde_json::from_slice(&output.stdout).unwrap();
    let verb = |verb: &Value| {
        let mut found = BTreeSet::from(["--help", "--version"].map(String::from));
        collect(verb, &mut found);
        (verb["name"].as_str().unwrap().to_owned(), found)
    };
    menu.as_array().unwrap().iter().map(verb).collect()
}

/// The program behind a verb.
fn tool(verb: &str) -> std::process::Command {
    match verb {
        "doctor" | "completions" => {
            let mut menu = program("xtask");
            menu.arg(verb);
            menu
        }
        _ => program(verb),
    }
}

/// A copy of the project that shares all but its results, to play in.
fn copy_of_the_project() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(root()).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name();
        if !["runs", "target", ".git"].iter().any(|own| name == *own) {
            std::os::unix::fs::symlink(entry.path(), folder.path().join(name)).unwrap();
        }
    }
    let arm = std::fs::read_to_string(root().join("scenarios/robots/jaco.toml")).unwrap();
    std::fs::write(folder.path().join("my-arm.toml"), arm.replace("name = \"jaco\"", "name = \"my-arm\"")).unwrap();
    let log = folder.path().join("runs/my-log");
    std::fs::create_dir_all(&log).unwrap();
    for (file, bytes) in files(&root().join("tests/data/mujoco-logs/logs/set-003")) {
        std::fs::write(log.join(file), bytes).unwrap();
    }
    folder
}

fn play(document: &str) {
    // Models that only `diagnose` leaves.
    play_with(document, &PLAYED_ELSEWHERE, &["model.toml"]);
}

/// Plays commands in order, so that one finds what those above it left, but for some verbs and for what has `lacking` in it. The folder that it
/// happened in.
pub(crate) fn play_with(document: &str, but: &[&str], lacking: &[&str]) -> tempfile::TempDir {
    play_commands(document, commands(&root().join(document)), but, lacking)
}

fn play_commands(document: &str, commands: Vec<String>, but: &[&str], lacking: &[&str]) -> tempfile::TempDir {
    let project = copy_of_the_project();
    let mut played = 0;
    for command in commands {
        let all = words(&command);
        let (verb, rest) = (all[0].as_str(), &all[1..]);
        if let ("rerun", Some(episode)) = (verb, rest.first()) {
            // What makes recordings is not built here; the episode has to be one that a command above has left.
            let trace = project.path().join(episode.replace("runs/", "runs/quick/")).join("trace.json");
            assert!(is_synopsis(&command) || trace.is_file(), "{document}: {command}: no {}", trace.display());
        }
        let left_out = but.contains(&verb) || NOT_HERE.contains(&verb);
        // An engine, another simulator, a robot behind a socket, data that are not shipped.
        let absent = ["slurm", "hq", "mujoco_jaco.py", "tcp://127.0.0.1:5555", "record.txt.gz"];
        let lacks = absent.iter().chain(lacking).any(|part| command.contains(part));
        if left_out || is_synopsis(&command) || lacks {
            continue;
        }
        let mut program = tool(verb);
        // Results of --quick lie apart from those of the documents.
        let quick = |word: &String| match verb {
            "report" => word.replace("runs/", "runs/quick/"),
            _ => word.clone(),
        };
        program.current_dir(project.path()).args(rest.iter().map(quick));
        if matches!(verb, "datagen" | "train" | "eval" | "demo") && !rest.contains(&"--quick".into()) {
            program.arg("--quick");
        }
        if verb == "eval" && !rest.contains(&"--trials".into()) {
            program.args(["--trials", "1"]);
        }
        let output = program.output().unwrap();
        assert!(output.status.success(), "{document}: {command}: {}", stderr(&output));
        played += 1;
    }
    assert!(played > 0, "{document}: nothing was played");
    project
}

#[test]
fn the_readme_works() {
    play("README.md");
}

#[test]
fn the_first_steps_work() {
    play("docs/src/first-steps.md");
}

#[test]
fn the_guide_to_planning_works() {
    play("docs/src/guides/plan.md");
}

#[test]
fn the_guide_to_your_own_arm_works() {
    play("docs/src/guides/arm.md");
}

#[test]
fn the_guide_to_your_own_logs_works() {
    play("docs/src/guides/diagnose.md");
}

#[test]
fn the_guide_to_an_arm_and_its_joints_works() {
    play("docs/src/guides/joints.md");
}

#[test]
fn the_guide_to_your_own_effect_works() {
    play("docs/src/guides/effect.md");
}

#[test]
fn the_guide_to_recordings_works() {
    play("docs/src/guides/import.md");
}

#[test]
fn the_guide_to_checking_a_log_works() {
    play("docs/src/guides/check.md");
}

/// Guides whose commands other tests play: a scheduler of one's own (`cluster`), the answers of `diagnose` (`closing`), another workspace (`library`), and
/// a virtual environment (`python`).
const GUIDES_ELSEWHERE: [&str; 4] = ["cluster.md", "library.md", "python.md", "simulators.md"];

#[test]
fn every_guide_is_played() {
    let text = include_str!("docs.rs");
    for (guide, _) in files(&root().join("docs/src/guides")) {
        let name = guide.to_str().unwrap();
        let played = text.contains(&format!("play(\"docs/src/guides/{name}\")"));
        let elsewhere = GUIDES_ELSEWHERE.contains(&name) || !name.ends_with(".md");
        assert!(played != elsewhere, "{name}: it is played {}", if played { "twice" } else { "nowhere" });
    }
}

#[test]
fn the_guide_to_other_worlds_works() {
    play("docs/src/guides/world.md");
}
