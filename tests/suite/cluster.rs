//! Shards on engines: the same bytes as a local run, whoever is killed, and whenever.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use end_to_end::slurm::{OneNode, signal, workers};
use end_to_end::{files, program, run, skipped, stderr};
use tempfile::TempDir;

const DATA: &str = "--transitions 48000 --shards 12";
const TRIALS: &str = "--domain D4 --preset paper --quick --trials 8 --shards 6 --methods heuristic,no-rnn --set task.horizon=20 \
                      --set planner.budget={transitions=200} --set belief.rejection.particles=30 \
                      --set belief.rejection.max_attempts=90";

/// A program, its arguments without a folder, and how its files look without wall-clock times.
struct Work {
    binary: &'static str,
    arguments: &'static str,
}

const WORK: [Work; 2] = [Work { binary: "datagen", arguments: DATA }, Work { binary: "eval", arguments: TRIALS }];

impl Work {
    fn command(&self, rest: &str, out: &Path) -> Command {
        let mut command = program(self.binary);
        command.args(self.arguments.split_whitespace()).args(rest.split_whitespace()).arg("--out").arg(out);
        command.stdin(Stdio::null());
        command
    }

    /// Made in one go by threads: what everything else has to be.
    fn expected(&self, folder: &Path) -> Vec<(PathBuf, String)> {
        let out = folder.join(format!("{}-local", self.binary));
        let output = self.command("--threads 2", &out).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        results(&out)
    }

    /// Shards, or trials, that are finished: what a test waits for before it kills.
    fn progress(&self, out: &Path) -> usize {
        if !out.exists() {
            return 0;
        }
        let found = files(out).into_iter().filter(|(path, _)| match self.binary {
            "datagen" => path.extension().is_some_and(|end| end == "parquet"),
            _ => path.starts_with("shards"),
        });
        found.map(|(_, bytes)| if self.binary == "eval" { lines(&bytes) } else { 1 }).sum()
    }
}

fn lines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| **byte == b'\n').count()
}

/// All files of a folder, hidden ones included, without the wall-clock times of trials.
fn results(folder: &Path) -> Vec<(PathBuf, String)> {
    let text = |(path, bytes): (PathBuf, Vec<u8>)| {
        if path.ends_with("trials.jsonl") {
            let text = String::from_utf8(bytes).unwrap();
            let lines: Vec<&str> = text.lines().map(|line| line.split(",\"seconds\":").next().unwrap()).collect();
            return (path, lines.join("\n"));
        }
        // Bytes as they are, in letters.
        (path, bytes.iter().map(|byte| char::from(*byte)).collect())
    };
    files(folder).into_iter().map(text).collect()
}

fn same(folder: &Path, expected: &[(PathBuf, String)], what: &str) {
    let found = results(folder);
    let names = |files: &[(PathBuf, String)]| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
    assert_eq!(names(&found), names(expected), "{what}");
    for (one, other) in found.iter().zip(expected) {
        assert!(one.1 == other.1, "{what}: {} differs", one.0.display());
    }
}

/// Waits as long as a busy machine may need: only what never happens ends a test.
fn wait_until(what: &str, mut reached: impl FnMut() -> bool) {
    for _ in 0..60_000 {
        if reached() {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{what} does not happen within ten minutes");
}

fn ended(child: &mut Child) -> bool {
    child.try_wait().unwrap().is_some()
}

#[test]
fn local_workers_killed_at_any_time_lose_nothing_and_count_nothing_twice() {
    let folder = tempfile::tempdir().unwrap();
    for work in &WORK {
        let expected = work.expected(folder.path());
        let out = folder.path().join(work.binary);
        // The folder of a run that was killed as it began: workers do not make one.
        let mut holder = work.command("--threads 1", &out).stderr(Stdio::null()).spawn().unwrap();
        wait_until("the folder", || out.join("plan.json").exists() || out.join("scenario.toml").exists());
        holder.kill().unwrap();
        holder.wait().unwrap();
        let mut killed = 0;
        for round in 0..10_u64 {
            // Two attempts at each of two shards at once, killed at moments spread over what a shard takes.
            let shards = [0, 0, 1, 1].map(|next| (round + next) % 6);
            let mut attempts = shards.map(|shard| {
                let mut command = work.command(&format!("--worker {shard}"), &out);
                command.stdout(Stdio::null()).stderr(Stdio::null());
                command
            });
            let mut attempts = attempts.each_mut().map(|command| command.spawn().unwrap());
            std::thread::sleep(Duration::from_millis(20 + 97 * round % 500));
            for child in &mut attempts {
                killed += usize::from(!ended(child));
                child.kill().unwrap();
                child.wait().unwrap();
            }
        }
        assert!(killed >= 5, "{}: only {killed} of 40 were still at work when killed", work.binary);
        // One that lives to its end leaves its shard finished.
        let output = work.command("--worker 0", &out).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let output = work.command("--threads 2", &out).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        same(&out, &expected, work.binary);
    }
}

#[test]
fn slurm_makes_the_same_bytes_whoever_is_killed() {
    let cluster = match OneNode::start() {
        Ok(cluster) => cluster,
        Err(reason) => return skipped(&reason),
    };
    let folder = tempfile::tempdir().unwrap();
    for work in &WORK {
        let expected = work.expected(folder.path());
        let out = folder.path().join(work.binary);
        let mut command = work.command("--executor slurm", &out);
        command.env("SLURM_CONF", cluster.configuration());

        // A worker, the node's daemon and the program that submitted, one after the other.
        let mut first = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_until("the first result", || work.progress(&out) > 0 || ended(&mut first));
        wait_until("a worker", || !workers(&out).is_empty() || ended(&mut first));
        assert!(!ended(&mut first), "{}: it ended before anything could be killed", work.binary);
        let killed = workers(&out).iter().filter(|pid| signal("KILL", pid)).count();
        assert!(killed > 0, "{}: no worker was killed", work.binary);
        cluster.kill("slurmd");
        first.kill().unwrap();
        first.wait().unwrap();
        cluster.restart();

        // What is still queued is waited for, what is missing then is submitted; a second kill makes it go wrong once.
        let mut ends = Vec::new();
        for attempt in 0..5 {
            let log = folder.path().join(format!("{}-{attempt}.log", work.binary));
            let mut child = command.stderr(std::fs::File::create(&log).unwrap()).spawn().unwrap();
            if attempt == 0 {
                wait_until("a worker", || !workers(&out).is_empty() || ended(&mut child));
                let _ = workers(&out).first().map(|pid| signal("KILL", pid));
            }
            let code = child.wait().unwrap().code();
            ends.push((code, std::fs::read_to_string(&log).unwrap()));
            if code == Some(0) {
                break;
            }
        }
        let codes: Vec<_> = ends.iter().map(|(code, _)| *code).collect();
        assert!(codes.iter().all(|code| matches!(code, Some(0 | 1))) && codes.ends_with(&[Some(0)]), "{ends:?}");
        assert!(ends[0].1.contains("from an earlier start"), "the array outlives its program: {ends:?}");
        same(&out, &expected, work.binary);
    }
}

#[test]
fn an_interrupt_cancels_the_array_and_keeps_what_is_finished() {
    let cluster = match OneNode::start() {
        Ok(cluster) => cluster,
        Err(reason) => return skipped(&reason),
    };
    let folder = tempfile::tempdir().unwrap();
    let work = &WORK[1];
    let expected = work.expected(folder.path());
    let out = folder.path().join("out");
    let mut command = work.command("--executor slurm", &out);
    command.env("SLURM_CONF", cluster.configuration()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    wait_until("the first trial", || work.progress(&out) > 0 || ended(&mut child));
    assert!(signal("INT", &child.id().to_string()));
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(stderr(&output).contains("cancelling slurm job"), "{}", stderr(&output));
    let queue = Command::new("squeue").arg("--noheader").env("SLURM_CONF", cluster.configuration()).output().unwrap();
    assert!(queue.stdout.is_empty(), "{}", String::from_utf8_lossy(&queue.stdout));
    let kept = work.progress(&out);
    assert!(kept > 0 && !out.join("table.md").exists(), "{kept}");
    // Threads of one's own go on where the array ended.
    let output = work.command("--threads 2", &out).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains(&format!("{kept} trials are finished already")), "{}", stderr(&output));
    same(&out, &expected, "after an interrupt");
}

/// A server of HyperQueue with one worker, ended when dropped.
struct HyperQueue {
    folder: TempDir,
    processes: Vec<Child>,
}

impl HyperQueue {
    fn start() -> Result<Self, String> {
        let folder = tempfile::Builder::new().prefix("hq").tempdir_in("/tmp").unwrap();
        let mut cluster = Self { folder, processes: Vec::new() };
        cluster.spawn(&["server", "start"])?;
        let access = cluster.folder.path().join("hq-current");
        wait_until("the server of hq", || access.exists());
        cluster.spawn(&["worker", "start", "--cpus=2"])?;
        Ok(cluster)
    }

    fn spawn(&mut self, arguments: &[&str]) -> Result<(), String> {
        let mut command = Command::new("hq");
        command.args(arguments).env("HQ_SERVER_DIR", self.folder.path());
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        self.processes.push(child.map_err(|e| format!("hq: {e}"))?);
        Ok(())
    }
}

impl Drop for HyperQueue {
    fn drop(&mut self) {
        for child in self.processes.iter_mut().rev() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[test]
fn hyperqueue_makes_the_same_bytes_though_its_worker_is_killed() {
    let mut cluster = match HyperQueue::start() {
        Ok(cluster) => cluster,
        Err(reason) => return skipped(&reason),
    };
    let folder = tempfile::tempdir().unwrap();
    for work in &WORK {
        let expected = work.expected(folder.path());
        let out = folder.path().join(work.binary);
        let mut command = work.command("--executor hq", &out);
        command.env("HQ_SERVER_DIR", cluster.folder.path()).stdout(Stdio::null());
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        wait_until("the first result", || work.progress(&out) > 0 || ended(&mut child));
        let worker = cluster.processes.last_mut().unwrap();
        worker.kill().unwrap();
        worker.wait().unwrap();
        cluster.spawn(&["worker", "start", "--cpus=2"]).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        same(&out, &expected, work.binary);
    }
}

#[test]
fn two_commands_in_one_folder_refuse_each_other() {
    let folder = tempfile::tempdir().unwrap();
    for work in &WORK {
        let out = folder.path().join(work.binary);
        let mut first = work.command("--threads 1", &out).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_until("the folder", || out.join("data").exists() || out.join("trials.jsonl").exists());
        let output = work.command("--threads 1", &out).output().unwrap();
        assert!(!ended(&mut first), "{}: the first was done before the second began", work.binary);
        first.kill().unwrap();
        first.wait().unwrap();
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        let expected = format!("{}: another program is at work in this folder", out.display());
        assert!(message.contains(&expected) && message.lines().count() == 1, "{message}");
    }
}

#[test]
fn engines_that_are_not_there_are_bad_input_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for work in &WORK {
        for (executor, asked) in [("slurm", "squeue"), ("hq", "hq")] {
            let mut command = work.command(&format!("--executor {executor}"), &out);
            let output = command.env("PATH", folder.path()).output().unwrap();
            let message = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{message}");
            let expected = format!("--executor {executor}: `{asked}` cannot be started here");
            assert!(message.contains(&expected) && message.lines().count() == 1, "{message}");
            assert!(!out.exists());
        }
        let output = work.command("--worker 12", &out).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains("--worker: expected a shard below"), "{}", stderr(&output));
        assert!(!out.exists());
    }
    let output = run("datagen", "--executor pbs");
    assert!(stderr(&output).contains("expected local, slurm or hq, found `pbs`"), "{}", stderr(&output));
}
