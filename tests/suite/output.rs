//! Where output cannot go: closed pipes, full disks, folders that nobody may write.

use std::fs::OpenOptions;
use std::process::{Command, Output, Stdio};

use end_to_end::{program, short_log, skipped, stderr};

use crate::pipeline::trained;

/// Programs that write into `--out`, with what they work on for some seconds.
fn writers() -> Vec<(&'static str, String)> {
    let search = "--domain D4 --preset paper --quick --trials 2 --threads 2 --set planner.budget={transitions=120} \
                  --set belief.rejection.particles=30 --set belief.rejection.max_attempts=90 --methods no-rnn,heuristic";
    let log = format!("--measured {} --threads 2", short_log().display());
    vec![
        ("datagen", "--transitions 4000 --shards 4 --set data.episode_actions=10".into()),
        ("train", format!("--epochs 2 --data {}", trained().data.display())),
        ("eval", search.into()),
        ("demo", "--quick --method heuristic".into()),
        ("diagnose", log),
        ("record-log", "--actions passive".into()),
    ]
}

/// Programs that print and write nothing.
const PRINTERS: [(&str, &str); 5] = [
    ("scenario", "check D4"),
    ("scenario", "schema"),
    ("xtask", "doctor"),
    ("xtask", "completions bash"),
    ("bench", "accuracy"),
];

fn command(binary: &str, arguments: &str) -> Command {
    let mut command = program(binary);
    command.args(arguments.split_whitespace()).stdin(Stdio::null());
    command
}

/// Refused or stopped with a sentence, and not by a panic.
fn stopped(what: &str, output: &Output) {
    let message = stderr(output);
    assert!(matches!(output.status.code(), Some(1 | 2)), "{what}: {:?}: {message}", output.status);
    let errors = message.lines().filter(|line| line.starts_with("error: ")).count();
    assert!(errors == 1 && !message.contains("panicked"), "{what}: {message}");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let small = "--domain D1 --quick --trials 1 --methods heuristic";
    let finished = folder.path().join("finished").display().to_string();
    assert!(command("eval", &format!("{small} --out {finished}")).output().unwrap().status.success());
    let out = |name: &str| folder.path().join(name).display().to_string();
    let mut cases: Vec<(&str, String)> = PRINTERS.map(|(binary, arguments)| (binary, arguments.to_owned())).to_vec();
    cases.extend([
        ("eval", format!("{small} --out {}", out("eval"))),
        ("eval", format!("{small} --json --out {finished}")),
        ("report", finished.clone()),
        ("demo", format!("--quick --method heuristic --out {}", out("demo"))),
        ("datagen", format!("--transitions 500 --shards 2 --out {}", out("data"))),
        ("record-log", format!("--actions passive --out {}", out("log"))),
    ]);
    for (binary, arguments) in cases {
        let mut child = command(binary, &arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        let code = child.wait().unwrap().code();
        // A doctor may find something missing.
        assert!(code == Some(0) || (arguments == "doctor" && code == Some(1)), "{binary} {arguments}: {code:?}");
    }
}

#[test]
fn what_cannot_be_printed_is_said() {
    for (binary, arguments) in PRINTERS {
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = command(binary, arguments).stdout(full).stderr(Stdio::piped()).output().unwrap();
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{binary} {arguments}: {message}");
        assert!(message.contains("error: cannot print: "), "{binary} {arguments}: {message}");
    }
}

#[test]
fn where_nobody_may_write_programs_say_so() {
    let benchmark = ("diagnose-benchmark", String::from("--sets 1 --none 0 --unknown 0 --pairs 0 --arms 0"));
    for (binary, arguments) in writers().into_iter().chain([benchmark]) {
        // Not even root makes a folder there.
        let output = command(binary, &arguments).args(["--out", "/proc/nobody/out"]).output().unwrap();
        stopped(binary, &output);
        assert!(stderr(&output).contains("/proc/nobody"), "{binary}: {}", stderr(&output));
    }
}

#[test]
fn on_a_full_disk_programs_stop_with_a_sentence_and_go_on_when_there_is_room() {
    // A disk of its own, which needs a kernel that lets us mount one.
    let mount = |size: &str| format!("mount -t tmpfs -o size={size} none \"$0\"");
    let folder = tempfile::tempdir().unwrap();
    let shell = |script: &str| {
        let mut command = Command::new("unshare");
        command.current_dir(end_to_end::root()).args(["--mount", "sh", "-c", script]).arg(folder.path());
        command.stdin(Stdio::null());
        command
    };
    if !shell(&mount("64k")).output().is_ok_and(|output| output.status.success()) {
        skipped("a small disk cannot be mounted here");
        return;
    }
    for (binary, arguments) in writers() {
        let program = program(binary).get_program().to_string_lossy().into_owned();
        let run = format!("\"{program}\" {arguments} --out \"$0/out\"");
        // Both ends are told apart by what the first one prints.
        let script = format!(
            "{} && {{ {run} >/dev/null 2>\"$1\"; echo $? >\"$2\"; mount -o remount,size=200m \"$0\" && {run} >/dev/null; }}",
            mount("16k")
        );
        let (log, code) = (folder.path().with_extension("log"), folder.path().with_extension("code"));
        let second = shell(&script).args([&log, &code]).output().unwrap();
        let message = std::fs::read_to_string(&log).unwrap();
        let code_of_first = std::fs::read_to_string(&code).unwrap();
        assert!(matches!(code_of_first.trim(), "1" | "2"), "{binary}: {code_of_first}: {message}");
        let errors = message.lines().filter(|line| line.starts_with("error: ")).count();
        assert!(errors == 1 && !message.contains("panicked"), "{binary}: {message}");
        assert!(second.status.success(), "{binary} with room: {}", stderr(&second));
        let _ = (std::fs::remove_file(&log), std::fs::remove_file(&code));
    }
}
