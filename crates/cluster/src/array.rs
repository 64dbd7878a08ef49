//! From missing shards to finished ones: submit, wait, look.

use std::ffi::OsString;
use std::fmt;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use whole_file::Existing;

use crate::Error;
use crate::engine::Engine;
use crate::job::{Active, Submission};

/// Between two looks at the queue: short for short runs, long for what controllers have to bear.
const FIRST_LOOK: Duration = Duration::from_millis(500);
const LAST_LOOK: Duration = Duration::from_secs(10);
/// How often an interrupt is noticed.
const TICK: Duration = Duration::from_millis(100);
/// How long a cancelled job may take to end: engines let tasks finish what they are at, Slurm for half a minute.
const CANCEL: Duration = Duration::from_secs(60);

/// The shards of a folder, made by workers of an engine.
#[derive(Clone, Copy, Debug)]
pub struct Array<'a> {
    /// Engine.
    pub engine: Engine,
    /// What its jobs are called, followed by a number made of the folder's path.
    pub label: &'a str,
    /// Folder of the results, which exists and is the same on all nodes.
    pub folder: &'a Path,
    /// Processors of a worker.
    pub processors: u32,
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// No shard is missing.
    Finished,
    /// Interrupted: what was queued is cancelled, what was finished stays.
    Interrupted,
}

/// What happens meanwhile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// Something to tell, in words.
    News(String),
    /// The queue was looked at: a good time to count results.
    Looked,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::News(text) => f.write_str(text),
            Self::Looked => f.write_str("at work"),
        }
    }
}

impl Array<'_> {
    /// Makes the shards that `missing` names, sorted: waits for a job of before, submits what is missing then, waits for that. A worker is
    /// this program with its own arguments and `--worker K`, in the present working directory.
    ///
    /// # Errors
    ///
    /// [`Error::Unfinished`] where shards are missing in the end. What `missing` refuses, and what the engine or the file system does.
    pub fn run<E: From<Error>>(
        &self,
        mut missing: impl FnMut() -> Result<Vec<u32>, E>,
        interrupted: &AtomicBool,
        report: &mut dyn FnMut(Event),
    ) -> Result<Outcome, E> {
        let name = self.name()?;
        if let Some(active) = self.engine.active(&name)? {
            report(Event::News(format!("{} {active}, from an earlier start: waiting for it", self.engine.name())));
            if self.wait(&name, interrupted, report)? == Outcome::Interrupted {
                return Ok(Outcome::Interrupted);
            }
        }
        let shards = missing()?;
        if shards.is_empty() {
            return Ok(Outcome::Finished);
        }
        if interrupted.load(Ordering::Relaxed) {
            return Ok(Outcome::Interrupted);
        }
        let job = self.submit(&name, &shards)?;
        let count = shards.len();
        report(Event::News(format!("{} job {job}: {count} shards submitted as {name}", self.engine.name())));
        if self.wait(&name, interrupted, report)? == Outcome::Interrupted {
            return Ok(Outcome::Interrupted);
        }
        let left = missing()?;
        match left.first() {
            None => Ok(Outcome::Finished),
            // The job was gone before it could be cancelled.
            Some(_) if interrupted.load(Ordering::Relaxed) => Ok(Outcome::Interrupted),
            Some(first) => Err(Error::Unfinished {
                executor: self.engine.name(),
                log: last_words(&logs(self.folder).join(format!("{job}_{first}.log"))),
                job,
                missing: left.len(),
                submitted: count,
            }
            .into()),
        }
    }

    /// The same for the same folder, wherever the program was started.
    fn name(&self) -> Result<String, Error> {
        let folder = std::fs::canonicalize(self.folder).map_err(Error::file("find", self.folder))?;
        let hash = blake3::hash(folder.as_os_str().as_encoded_bytes()).to_hex();
        Ok(format!("surmise-{}-{}", self.label, &hash[..12]))
    }

    fn submit(&self, name: &str, shards: &[u32]) -> Result<String, Error> {
        let logs = logs(self.folder);
        std::fs::create_dir_all(&logs).map_err(Error::file("create the folder", &logs))?;
        // Workers may have another working directory until the script sets theirs.
        let logs = std::fs::canonicalize(&logs).map_err(Error::file("find", &logs))?;
        let program = std::env::current_exe().map_err(Error::file("find", Path::new("this program")))?;
        let here = std::env::current_dir().map_err(Error::file("find", Path::new("the working directory")))?;
        let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
        let script = logs.join("worker.sh");
        let text = script_text(&here, &program, &arguments, self.engine.index_variable())?;
        whole_file::write(&script, &text, Existing::Replace).map_err(|e| Error::file(e.action, &e.path)(e.source))?;
        let processors = self.processors;
        self.engine.submit(&Submission { name, script: &script, logs: &logs, shards, processors })
    }

    /// Until the job is gone. An engine that does not answer, because its controller starts anew for example, is asked again.
    fn wait(&self, name: &str, interrupted: &AtomicBool, report: &mut dyn FnMut(Event)) -> Result<Outcome, Error> {
        let mut told = String::new();
        let mut pause = FIRST_LOOK;
        loop {
            let news = match self.engine.active(name) {
                Ok(None) => return Ok(Outcome::Finished),
                Ok(Some(active)) if interrupted.load(Ordering::Relaxed) => {
                    report(Event::News(format!("cancelling {} job {}", self.engine.name(), active.job)));
                    self.cancel(name, &active)?;
                    return Ok(Outcome::Interrupted);
                }
                Ok(Some(active)) => format!("{} {active}", self.engine.name()),
                Err(error) if interrupted.load(Ordering::Relaxed) => return Err(error),
                Err(error) => format!("{error}; asking again"),
            };
            if news != told {
                report(Event::News(news.clone()));
                told = news;
            }
            report(Event::Looked);
            sleep(pause, || interrupted.load(Ordering::Relaxed));
            pause = pause.mul_f64(1.5).min(LAST_LOOK);
        }
    }

    /// Cancels and waits a while for the end, so that nobody writes in the folder any more.
    fn cancel(&self, name: &str, active: &Active) -> Result<(), Error> {
        self.engine.cancel(&active.job)?;
        for _ in 0..CANCEL.as_millis() / FIRST_LOOK.as_millis() {
            if self.engine.active(name)?.is_none() {
                break;
            }
            std::thread::sleep(FIRST_LOOK);
        }
        Ok(())
    }
}

/// Removes the script and the logs that arrays have left in `folder`: for one whose shards are all there, which then looks as if they had
/// been made here.
///
/// # Errors
///
/// Where a file cannot be removed.
pub fn tidy(folder: &Path) -> Result<(), Error> {
    let logs = logs(folder);
    let Ok(entries) = std::fs::read_dir(&logs) else { return Ok(()) };
    for entry in entries {
        let path = entry.map_err(Error::file("list", &logs))?.path();
        let ours = path.extension().is_some_and(|end| end == "log" || end == "sh");
        if ours && let Err(e) = std::fs::remove_file(&path) {
            return Err(Error::file("remove", &path)(e));
        }
    }
    // It stays where somebody has put a file of his own.
    let _ = std::fs::remove_dir(&logs);
    Ok(())
}

fn logs(folder: &Path) -> PathBuf {
    folder.join("cluster")
}

/// Sleeps in short pieces until `enough`.
fn sleep(whole: Duration, enough: impl Fn() -> bool) {
    let mut slept = Duration::ZERO;
    while slept < whole && !enough() {
        std::thread::sleep(TICK);
        slept += TICK;
    }
}

/// A shell script that becomes the worker of the index in `variable`.
fn script_text(here: &Path, program: &Path, arguments: &[OsString], variable: &str) -> Result<Vec<u8>, Error> {
    let quoted = |index: usize, word: &[u8]| {
        shlex::bytes::try_quote(word).map(std::borrow::Cow::into_owned).map_err(|_| Error::Argument { index })
    };
    let mut text = b"#!/bin/sh\ncd ".to_vec();
    text.extend(quoted(0, here.as_os_str().as_encoded_bytes())?);
    text.extend(b" || exit\nexec ");
    text.extend(quoted(0, program.as_os_str().as_encoded_bytes())?);
    for (index, argument) in arguments.iter().enumerate() {
        text.push(b' ');
        text.extend(quoted(index + 1, argument.as_encoded_bytes())?);
    }
    writeln!(text, " --worker \"${variable}\" 2>&1").expect("memory takes everything");
    Ok(text)
}

/// Where a worker's log lies and what it ends with.
fn last_words(log: &Path) -> String {
    let Ok(bytes) = std::fs::read(log) else { return String::new() };
    let text = String::from_utf8_lossy(&bytes);
    let last = text.lines().map(str::trim).rfind(|line| !line.is_empty());
    let words =
        last.map_or_else(|| "nothing".into(), |line| format!("`{}`", line.chars().take(300).collect::<String>()));
    format!(": {} ends with {words}", log.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_hands_every_argument_on_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path().join("two words; $HOME 'quoted'");
        std::fs::create_dir(&here).unwrap();
        let arguments: Vec<OsString> =
            ["%s|", "a b", "it's", "$HOME", "--set=x={ y = \"z\" }", ""].map(OsString::from).into();
        let text = script_text(&here, Path::new("printf"), &arguments, "INDEX").unwrap();
        let script = folder.path().join("worker.sh");
        std::fs::write(&script, text).unwrap();
        let output = std::process::Command::new("sh").arg(&script).env("INDEX", "7").output().unwrap();
        assert_eq!(String::from_utf8_lossy(&output.stdout), "a b|it's|$HOME|--set=x={ y = \"z\" }||--worker|7|");
        assert!(output.status.success());
    }

    #[test]
    fn the_job_has_the_same_name_from_everywhere_and_another_for_another_folder() {
        let folder = tempfile::tempdir().unwrap();
        let name =
            |path: &Path| Array { engine: Engine::Slurm, label: "eval", folder: path, processors: 1 }.name().unwrap();
        std::fs::create_dir(folder.path().join("inner")).unwrap();
        assert_eq!(name(folder.path()), name(&folder.path().join("inner/..")));
        assert_ne!(name(folder.path()), name(&folder.path().join("inner")));
        // HyperQueue takes at most 40 characters.
        assert!(name(folder.path()).len() <= 40, "{}", name(folder.path()));
    }

    #[test]
    fn tidying_removes_what_is_ours_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        tidy(folder.path()).unwrap();
        let logs = logs(folder.path());
        std::fs::create_dir(&logs).unwrap();
        for name in ["worker.sh", "1_0.log", "1_1.log", "mine.txt"] {
            std::fs::write(logs.join(name), "x\n\n").unwrap();
        }
        assert_eq!(last_words(&logs.join("1_1.log")), format!(": {} ends with `x`", logs.join("1_1.log").display()));
        tidy(folder.path()).unwrap();
        assert!(!logs.join("worker.sh").exists() && logs.join("mine.txt").exists());
        std::fs::remove_file(logs.join("mine.txt")).unwrap();
        tidy(folder.path()).unwrap();
        assert!(!logs.exists());
        assert_eq!(last_words(&logs.join("1_1.log")), "");
    }
}
