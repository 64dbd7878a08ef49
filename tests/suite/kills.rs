//! SIGKILL at any moment: what was finished is kept, the same command goes on, and the end is as if nothing had happened.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use end_to_end::{files, program, short_log, stderr};

use crate::pipeline::trained;

/// Kills that meet each program at work that goes on where it was. Moments are spread over the time that a whole run takes; which of them hit
/// depends on the machine, the result must not.
const HITS: u32 = 13;
/// The same of a program that begins anew: what it leaves is the same at most moments.
const HITS_ANEW: u32 = 3;

/// A program with its arguments, and what of its folder must be the same in the end.
struct Work<'a> {
    binary: &'a str,
    arguments: String,
    hits: u32,
    kept: fn(&Path) -> Vec<(PathBuf, String)>,
}

impl Work<'_> {
    fn command(&self, out: &Path) -> Command {
        let mut command = program(self.binary);
        command.args(self.arguments.split_whitespace()).arg("--out").arg(out);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    }

    fn finish(&self, out: &Path) {
        let output = self.command(out).output().unwrap();
        assert!(output.status.success(), "{}: {}", self.binary, stderr(&output));
    }

    /// Kills it, has it finish, and compares; as often as it takes for all moments.
    #[expect(
        clippy::disallowed_methods,
        reason = "the time of a whole run chooses the moments of the kills, never a result"
    )]
    fn survives(&self) {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole");
        let started = Instant::now();
        self.finish(&whole);
        let time = started.elapsed();
        let expected = (self.kept)(&whole);
        assert!(!expected.is_empty(), "{}", self.binary);
        let (mut hits, mut kill, mut rounds) = (0, 0, 0);
        // Kills at most, for a machine on which hardly any hits.
        let (enough, most) = (self.hits, 4 * self.hits);
        while hits < enough && kill < most {
            rounds += 1;
            let out = folder.path().join(format!("killed-{rounds}"));
            // Until it has ended by itself: a run that goes on has less and less to do.
            while hits < enough && kill < most {
                let mut child = self.command(&out).spawn().unwrap();
                // Another order than along the time, so that late moments meet fresh folders too.
                let moment = Instant::now() + time.mul_f64((f64::from(kill * 7 % enough) + 0.5) / f64::from(enough));
                while Instant::now() < moment && child.try_wait().unwrap().is_none() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                kill += 1;
                child.kill().unwrap();
                if child.wait().unwrap().success() {
                    break;
                }
                hits += 1;
            }
            self.finish(&out);
            let found = (self.kept)(&out);
            let names = |files: &[(PathBuf, String)]| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
            assert_eq!(names(&found), names(&expected), "{}: round {rounds}", self.binary);
            for ((path, found), (_, expected)) in found.iter().zip(&expected) {
                assert!(found == expected, "{}: round {rounds}: {} differs", self.binary, path.display());
            }
        }
        eprintln!("{}: {hits} of {kill} kills met it at work, {rounds} runs ended the same", self.binary);
        assert!(2 * hits > enough, "{}: only {hits} of {kill} kills met it at work", self.binary);
    }
}

/// All files but those whose names say that they are in the making.
fn all(folder: &Path) -> Vec<(PathBuf, String)> {
    let visible = |path: &Path| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    let files = files(folder).into_iter().filter(|(path, _)| visible(path));
    // Bytes as they are: equal ones give equal texts.
    files.map(|(path, bytes)| (path, bytes.iter().map(|byte| char::from(*byte)).collect())).collect()
}

/// Without the state of a training, which is there to go on from.
fn prior(folder: &Path) -> Vec<(PathBuf, String)> {
    all(folder).into_iter().filter(|(path, _)| !path.starts_with("training")).collect()
}

/// Without the clock's part of each trial.
fn trials(folder: &Path) -> Vec<(PathBuf, String)> {
    let timeless = |text: &str| -> Vec<String> {
        text.lines().map(|line| line.split(",\"seconds\":").next().unwrap_or(line).to_owned()).collect()
    };
    all(folder).into_iter().map(|(path, text)| (path, timeless(&text).join("\n"))).collect()
}

/// Without the seconds that the page and the report name.
fn diagnosis(folder: &Path) -> Vec<(PathBuf, String)> {
    let json = |text: &str| {
        let bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let mut report: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
        report.as_object_mut().unwrap().remove("seconds");
        report.to_string()
    };
    let of = |(path, text): (PathBuf, String)| match path.extension().and_then(|e| e.to_str()) {
        Some("json") => Some((path, json(&text))),
        Some("html") => Some((path, String::new())),
        _ => Some((path, text)),
    };
    all(folder).into_iter().filter_map(of).collect()
}

#[test]
fn datagen_survives_kills() {
    let arguments = "--transitions 4000 --shards 12 --threads 1 --set data.episode_actions=10".into();
    Work { binary: "datagen", arguments, hits: HITS, kept: all }.survives();
}

#[test]
fn train_survives_kills() {
    let arguments = format!("--epochs 8 --threads 1 --data {}", trained().data.display());
    Work { binary: "train", arguments, hits: HITS, kept: prior }.survives();
}

#[test]
fn eval_survives_kills() {
    let search = "--domain D4 --preset paper --quick --trials 3 --threads 1 --set planner.budget={transitions=120} --set belief.rejection.particles=30 \
                  --set belief.rejection.max_attempts=90";
    let arguments = format!("{search} --prior {}", trained().prior.display());
    Work { binary: "eval", arguments, hits: HITS, kept: trials }.survives();
}

#[test]
fn diagnose_survives_kills() {
    let arguments = format!("--measured {} --threads 1", short_log().display());
    Work { binary: "diagnose", arguments, hits: HITS_ANEW, kept: diagnosis }.survives();
}

#[test]
fn two_evaluations_in_one_folder_refuse_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let start = || {
        let mut command = program("eval");
        command
            .args([
                "--domain",
                "D4",
                "--preset",
                "paper",
                "--methods",
                "no-rnn",
                "--trials",
                "2",
                "--threads",
                "1",
                "--out",
            ])
            .arg(&out);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    // Both at once: whichever comes second is refused while the other one plays on, for seconds.
    let mut both = [start(), start()];
    let refused = loop {
        if let Some(refused) = both.iter_mut().position(|child| child.try_wait().unwrap().is_some()) {
            break refused;
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let [first, second] = both;
    let (refused, mut other) = if refused == 0 { (first, second) } else { (second, first) };
    let alive = other.try_wait().unwrap().is_none();
    other.kill().unwrap();
    other.wait().unwrap();
    let output = refused.wait_with_output().unwrap();
    let message = stderr(&output);
    assert!(alive, "both ended: {message}");
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{message}");
    assert!(message.contains("another program is at work in this folder"), "{message}");
}
