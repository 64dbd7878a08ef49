//! Bad input ends with exit code 2 and one sentence that names file, key and expectation; nothing is written.

use std::path::Path;
use std::process::Output;

use end_to_end::{files, root, run, stderr};
use serde_json::Value;

use crate::pipeline::trained;

/// Words of decoders and of Rust, which say nothing to who writes a file.
const RUST: [&str; 25] = [
    "usize",
    "u32",
    "u64",
    "i64",
    "f64",
    "custom:",
    "missing field",
    "unknown field",
    "unknown variant",
    "invalid type",
    "invalid length",
    "struct ",
    "untagged",
    "Some(",
    "None",
    "visitor",
    "EOF while",
    "expected value",
    "expected ident",
    "No elements",
    "string only",
    "invalid digit",
    "invalid float literal",
    "trailing characters",
    "key must be a string",
];

/// Runs, expects exit code 2 and one line that holds all `parts`.
pub(crate) fn refused(binary: &str, arguments: &str, parts: &[&str]) {
    is_refusal(&format!("{binary} {arguments}"), &run(binary, arguments), parts);
}

fn is_refusal(command: &str, output: &Output, parts: &[&str]) {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{command}: {message}");
    assert_eq!(message.trim().lines().count(), 1, "{command}: {message}");
    for part in parts {
        assert!(message.contains(part), "{command}: expected `{part}` in: {message}");
    }
    for word in RUST {
        assert!(!message.contains(word), "{command}: `{word}` in: {message}");
    }
    assert!(output.stdout.is_empty(), "{command}");
}

fn copy(from: &Path, to: &Path) {
    for (path, bytes) in files(from) {
        let target = to.join(path);
        std::fs::create_dir_all(target.parent().unwrap()).unwrap();
        std::fs::write(target, bytes).unwrap();
    }
}

#[test]
fn bad_scenarios_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let file = folder.path().join("mine.toml");
    let eval = |rest: &str| format!("--methods no-rnn --out {} {rest}", out.display());
    let cases: [(&str, &[&str]); 7] = [
        ("--domain D9", &["unknown domain `D9`", "d1, d2, d3, d4, d5"]),
        ("--domain D4 --robot panda", &["unknown robot `panda`", "jaco, sawyer"]),
        ("--domain D4 --preset best", &["unknown preset `best`", "paper"]),
        ("--domain D4 --set task.horizn=3", &["--set task.horizn=3", "`task.horizn`", "horizon"]),
        ("--domain D4 --set task.goal.radius_cm=4", &["radius_cm", "radius_m"]),
        ("--domain D4 --set task.goal.radius_m=\"4cm\"", &["task.goal.radius_m", "expected"]),
        ("--domain D4 --set robot.urdf=assets/robots/none.urdf", &["none.urdf"]),
    ];
    for (arguments, parts) in cases {
        refused("eval", &eval(arguments), parts);
    }
    let text = |rest: &str| format!("name = \"mine\"\n{rest}\n[evaluation]\ntrials = 1\n");
    let contents: [(&str, &[&str]); 4] = [
        ("[world]\nobstacle_mobilty = \"fixed\"", &["mine.toml", "`world.obstacle_mobilty`", "obstacle_mobility"]),
        ("[task]\ndiscount = 2.0", &["mine.toml", "task.discount", "0 to 1"]),
        ("version = 7", &["mine.toml", "version is 7", "reads version 1"]),
        ("[task\n", &["mine.toml", "not valid TOML"]),
    ];
    for (content, parts) in contents {
        std::fs::write(&file, text(content)).unwrap();
        refused("eval", &eval(&format!("--domain {}", file.display())), parts);
    }
    refused("eval", &eval("--domain nowhere.toml"), &["nowhere.toml", "cannot be read"]);
    let large =
        "--domain D1 --set belief.rejection.particles=4000000000 --set belief.rejection.max_attempts=4000000000";
    refused("eval", &eval(large), &["`particles` is 4000000000", "at most 1000000"]);
    // Names with line breaks and colours: one line, without them.
    let output =
        end_to_end::program("eval").args(["--domain", "a\nb\x1b[31m", "--methods", "no-rnn"]).output().unwrap();
    let message = stderr(&output);
    assert!(output.status.code() == Some(2) && message.contains("`a b [31m`"), "{message:?}");
    assert!(message.trim().lines().count() == 1 && !message.contains('\x1b'), "{message:?}");
    assert!(!out.exists(), "a refused run leaves nothing behind");
}

#[test]
fn what_is_wrong_in_a_file_is_said_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let check = |rest: &str| format!("check D4 {rest}");
    let scenarios: [(&str, &[&str]); 8] = [
        ("--set task.horizon=far", &["`task.horizon`", "expected a whole number, 0 or more, found the text \"far\""]),
        ("--set task.horizon=2.5", &["expected a whole number, 0 or more, found 2.5"]),
        ("--set task.discount=true", &["`task.discount`", "expected a number, found true"]),
        ("--set task.tool_start_m=[0.1,0.2]", &["task.tool_start_m", "expected a list of 3, found 2"]),
        ("--set task=3", &["`task`", "expected a table, found 3"]),
        ("--set task.goal.radius_cm=4", &["there is no key `radius_cm`", "nearest is `radius_m`"]),
        ("--set belief.filter=best", &["`belief.filter`", "there is no choice `best`"]),
        ("--set effects.model=[{table_tilt={slope_x_rad=0.0}}]", &["`slope_y_rad` is missing"]),
    ];
    for (arguments, parts) in scenarios {
        refused("scenario", &check(arguments), parts);
    }
    let urdf = folder.path().join("arm.urdf");
    let robots: [(&str, &[&str]); 4] = [
        ("<mujoco model='arm'/>", &["arm.urdf", "expected a URDF file", "MJCF"]),
        ("<sdf version='1.7'/>", &["arm.urdf", "SDF"]),
        ("<robot name='r'><xacro:arm/></robot>", &["arm.urdf", "xacro"]),
        ("<robot name='r'><link name='base'/></robot>", &["no such joint in", "which has none at all"]),
    ];
    for (text, parts) in robots {
        std::fs::write(&urdf, text).unwrap();
        refused("scenario", &check(&format!("--set robot.urdf={}", urdf.display())), parts);
    }
    let log = folder.path().join("log");
    copy(&root().join("tests/data/mujoco-logs/logs/set-003"), &log);
    let header = std::fs::read_to_string(log.join("log.toml")).unwrap();
    let period = header.lines().find(|line| line.starts_with("period_secs")).unwrap();
    let headers: [(&str, &[&str]); 3] = [
        ("", &["log.toml", "`period_secs` is missing"]),
        ("period_secs = \"fast\"", &["log.toml", "`period_secs`", "expected a number, found the text \"fast\""]),
        ("period_secs = 0.02\nperiod_s = 0.02", &["log.toml", "there is no key `period_s`"]),
    ];
    for (line, parts) in headers {
        std::fs::write(log.join("log.toml"), header.replace(period, line)).unwrap();
        refused(
            "diagnose",
            &format!("--measured {} --out {}", log.display(), folder.path().join("out").display()),
            parts,
        );
    }
}

#[test]
fn priors_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let eval = |robot: &str, prior: &Path| {
        let (prior, out) = (prior.display(), out.display());
        format!("--domain D4 --preset paper --robot {robot} --quick --methods rnn-max --prior {prior} --out {out}")
    };
    let trained = &trained().prior;
    refused("eval", &eval("jaco", trained), &["prior.json", "sawyer", "jaco"]);
    let missing = folder.path().join("missing");
    refused("eval", &eval("sawyer", &missing), &["missing"]);
    let broken = folder.path().join("broken");
    copy(trained, &broken);
    let weights = files(&broken).into_iter().find(|(path, _)| path.display().to_string().starts_with("weights"));
    let (name, bytes) = weights.expect("a prior has a weights file");
    std::fs::write(broken.join(&name), &bytes[..bytes.len() / 2]).unwrap();
    refused("eval", &eval("sawyer", &broken), &[&name.display().to_string()]);
    assert!(!out.exists());
}

#[test]
fn damaged_and_foreign_datasets_are_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken");
    copy(&trained().data, &broken);
    let shard = broken.join("data/chunk-000/file-003.parquet");
    let bytes = std::fs::read(&shard).unwrap();
    std::fs::write(&shard, &bytes[..bytes.len() / 2]).unwrap();
    let out = folder.path().join("prior");
    let train = |robot: &str, data: &Path| {
        format!("--robot {robot} --epochs 1 --data {} --out {}", data.display(), out.display())
    };
    refused("train", &train("sawyer", &broken), &["file-003.parquet"]);
    refused("train", &train("jaco", &trained().data), &["info.json", "sawyer", "expected jaco"]);
    refused("train", &train("sawyer", &folder.path().join("none")), &["none"]);
    assert!(!out.exists());

    // Another seed into a finished dataset.
    let before = files(&trained().data);
    let arguments = format!("--transitions 2000 --shards 10 --seed 2 --out {}", trained().data.display());
    refused("datagen", &arguments, &["plan.json", "seed"]);
    assert!(files(&trained().data) == before);
}

#[test]
fn a_run_folder_of_another_run_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let eval = |seed: u64| {
        let out = folder.path().display();
        format!("--domain D1 --quick --trials 1 --methods heuristic --seed {seed} --out {out}")
    };
    assert!(run("eval", &eval(1)).status.success());
    let before = files(folder.path());
    refused("eval", &eval(2), &["run.json", "`seed` is 1", "has 2"]);
    let out = folder.path().display();
    let others = [
        ("demo", "--quick --method heuristic".to_owned()),
        ("record-log", "--actions passive".into()),
        ("datagen", "--transitions 500".into()),
        ("train", format!("--epochs 1 --data {}", trained().data.display())),
        ("diagnose", "--measured tests/data/mujoco-logs/logs/set-003".into()),
    ];
    for (binary, arguments) in others {
        refused(binary, &format!("{arguments} --out {out}"), &["holds an evaluation (run.json)", "choose another"]);
    }
    refused("report", &format!("{out} --out {out}/trials.jsonl"), &["trials.jsonl", "not a page of this program"]);
    assert!(files(folder.path()) == before);
    // Files of somebody else, by the names of results.
    let mine = tempfile::tempdir().unwrap();
    for (binary, file, arguments) in [
        ("demo", "episode.html", "--quick --method heuristic"),
        ("diagnose", "model.toml", "--measured tests/data/mujoco-logs/logs/set-003"),
        ("record-log", "model.toml", "--actions passive"),
    ] {
        std::fs::write(mine.path().join(file), "mine").unwrap();
        refused(binary, &format!("{arguments} --out {}", mine.path().display()), &[file]);
        assert_eq!(files(mine.path()).len(), 1, "{binary}");
        std::fs::remove_file(mine.path().join(file)).unwrap();
    }
    // A page is replaced by a newer one.
    for _ in 0..2 {
        assert!(run("report", &out.to_string()).status.success());
    }
}

#[test]
fn programs_outside_the_project_say_so() {
    let elsewhere = tempfile::tempdir().unwrap();
    let output = end_to_end::program("eval")
        .current_dir(elsewhere.path())
        .args(["--domain", "D1", "--methods", "heuristic"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("scenarios/base.toml"), "{}", stderr(&output));
    assert!(root().join("scenarios/base.toml").is_file());
}

/// What the menu does with a command. The programs are built as this suite has built them, all together: one by one, cargo would choose other
/// features for what they share, and compile that anew for minutes.
fn menu(arguments: &str) -> Output {
    let mut menu = end_to_end::program("xtask");
    menu.env(end_to_end::BUILT, "1").args(arguments.split_whitespace()).output().unwrap()
}

#[test]
fn the_menu_hands_on_arguments_and_exit_codes() {
    let help = menu("datagen --help");
    assert!(help.status.success(), "{}", stderr(&help));
    assert!(String::from_utf8_lossy(&help.stdout).contains("--transitions"), "the program's own help");
    let output = menu("eval --domain D9");
    is_refusal("xtask eval --domain D9", &output, &["unknown domain `D9`"]);
    assert_eq!(menu("nonsense").status.code(), Some(2));
    // Before the viewer's library is built.
    for arguments in ["rerun nothere", "rerun"] {
        is_refusal(arguments, &menu(arguments), &["expected", "demo"]);
    }
}

/// Options of a command that take a value, with the commands that lead to it.
fn options_with_values(command: &Value, path: &[String], found: &mut Vec<(Vec<String>, String)>) {
    for option in command["options"].as_array().unwrap() {
        let usage = option["usage"].as_str().unwrap();
        let mut words = usage.split([' ', ',', '=']).filter(|word| !word.is_empty());
        if let (Some(name), true) = (words.find(|word| word.starts_with("--")), usage.contains('<')) {
            found.push((path.to_vec(), name.to_owned()));
        }
    }
    for inner in command["commands"].as_array().unwrap() {
        let name = inner["name"].as_str().unwrap().to_owned();
        options_with_values(inner, &[path, &[name]].concat(), found);
    }
}

#[test]
fn a_value_of_any_option_that_is_none_is_answered_in_words() {
    // Programs with a command line of their own kind: the menu's own verbs, and one that measures.
    const ELSEWHERE: [&str; 5] = ["doctor", "completions", "ci", "bench", "rerun"];
    let described = run("xtask", "describe");
    let verbs: Value = serde_json::from_slice(&described.stdout).unwrap();
    let (mut options, mut numbers) = (Vec::new(), 0);
    for verb in verbs.as_array().unwrap() {
        let name = verb["name"].as_str().unwrap();
        if !ELSEWHERE.contains(&name) {
            options_with_values(verb, &[name.to_owned()], &mut options);
        }
    }
    assert!(options.len() > 80, "{} options", options.len());
    for (path, option) in options {
        for value in ["-1", "x", "1e400", "99999999999999999999999"] {
            // A value that is good is not used: help is all that is asked for then.
            let mut program = end_to_end::program(&path[0]);
            let output = program.args(&path[1..]).args([&option, value, "--help"]).output().unwrap();
            let message = stderr(&output);
            let name = format!("{} {option} {value}", path.join(" "));
            if message.starts_with(&format!("error: {option}")) {
                is_refusal(&name, &output, &["expected", value]);
                numbers += 1;
            } else {
                assert!(output.status.success() || message.contains("possible values"), "{name}: {message}");
            }
        }
    }
    assert!(numbers > 60, "{numbers} values are refused");
    refused("demo", "--trial -1", &["--trial", "expected a whole number, 0 or more, found `-1`"]);
}

/// Texts that are no file of any kind.
const NO_FILE: [&str; 6] = ["", "\n", "{", "[1, 2", "mine", "{\"a\": 1,"];

#[test]
fn json_that_is_empty_or_cut_off_is_answered_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let published = root().join("assets/results/table1-surmise-D4");
    copy(&published, &path("run"));
    copy(&trained().data, &path("data"));
    copy(&trained().prior, &path("prior"));
    copy(&trained().data, &path("plan"));
    std::fs::create_dir(path("episode")).unwrap();
    std::fs::create_dir(path("benchmark")).unwrap();
    let out = path("out");
    let cases = [
        ("report", "run/run.json", format!("{}", path("run").display())),
        ("report", "episode/trace.json", format!("{}", path("episode").display())),
        (
            "train",
            "data/meta/info.json",
            format!("--epochs 1 --data {} --out {}", path("data").display(), out.display()),
        ),
        ("eval", "prior/prior.json", {
            let prior = path("prior");
            format!(
                "--domain D1 --quick --preset paper --methods rnn-sampling --prior {} --out {}",
                prior.display(),
                out.display()
            )
        }),
        ("datagen", "plan/plan.json", format!("--transitions 2000 --out {}", path("plan").display())),
        ("diagnose-benchmark", "benchmark/plan.json", format!("--sets 0 --out {}", path("benchmark").display())),
    ];
    for (binary, file, arguments) in cases {
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        let whole = std::fs::read_to_string(path(file)).unwrap_or_else(|_| "{\"version\": 1, \"title\": \"a".into());
        let half: String = whole.chars().take(whole.chars().count() / 2).collect();
        for text in NO_FILE.into_iter().chain([half.as_str()]) {
            std::fs::write(path(file), text).unwrap();
            refused(binary, &arguments, &[name]);
            assert_eq!(std::fs::read_to_string(path(file)).unwrap(), text, "{binary}");
        }
    }
    assert!(!out.exists(), "a refused run leaves nothing behind");
}

#[test]
fn toml_and_urdf_that_are_empty_or_cut_off_are_answered_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let out = path("out");
    copy(&root().join("tests/data/mujoco-logs/logs/set-003"), &path("log"));
    let diagnose = |rest: &str| format!("{rest} --out {}", out.display());
    let log = diagnose(&format!("--measured {}", path("log").display()));
    let model = format!("--measured tests/data/mujoco-logs/logs/set-003 --model {}", path("model.toml").display());
    let check = |rest: &str, name: &str| format!("check {rest}{}", path(name).display());
    let cases = [
        ("scenario", "domain.toml", check("", "domain.toml")),
        ("scenario", "arm.toml", check("D1 --robot ", "arm.toml")),
        ("scenario", "preset.toml", check("D1 --preset ", "preset.toml")),
        ("scenario", "model.toml", check("D1 --model ", "model.toml")),
        ("scenario", "arm.urdf", check("D1 --set robot.urdf=", "arm.urdf")),
        ("diagnose", "log/log.toml", log),
        ("diagnose", "model.toml", diagnose(&model)),
    ];
    for (binary, file, arguments) in cases {
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        let unfinished = ["a = ", "a = \"b", "[a", "a = { b = 1", "<robot", "<robot name='r'><link name='base'>"];
        for text in NO_FILE.into_iter().chain(unfinished) {
            std::fs::write(path(file), text).unwrap();
            // The layers of a scenario make one: what no layer says may be asked of another.
            let layer = binary == "scenario" && text.trim().is_empty();
            let named = if layer { Vec::new() } else { vec![name] };
            refused(binary, &arguments, &named);
        }
    }
    // A scenario without a name: its own file is asked for it, and no other.
    std::fs::write(path("domain.toml"), "version = 1\n").unwrap();
    let message = stderr(&run("scenario", &check("", "domain.toml")));
    assert_eq!(message.trim(), format!("error: {}: key `name`: `name` is missing", path("domain.toml").display()));
    // A name where a table is expected.
    refused(
        "scenario",
        "check D1 --set planner.budget=5",
        &["`planner.budget`", "expected one of { simulations = … }, { transitions = … }"],
    );
    assert!(!out.exists(), "a refused run leaves nothing behind");
}
