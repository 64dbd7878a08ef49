//! A world as a child process: what it starts ends with it, what it writes to standard error never stops it.

use std::io::Read;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::WorldError;
use super::error::one_line;

const POLL: Duration = Duration::from_millis(5);
/// How long a dead world's last words may take through the pipe; that long only where a child of its own keeps the pipe open.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// What is kept of standard error: bytes, and of those lines and characters for a message.
const STDERR_BYTES: usize = 4096;
const STDERR_LINES: usize = 5;
const STDERR_CHARS: usize = 600;

/// A running child, ended and reaped when dropped.
pub(super) struct Process {
    child: Child,
    /// Reaped already: its number may be another's.
    ended: bool,
    status: Option<ExitStatus>,
    stderr: Arc<Mutex<Vec<u8>>>,
    stderr_ended: Receiver<()>,
}

impl Process {
    /// Starts `program` with its pipes; returns the two that are for talking.
    pub(super) fn spawn(program: &str, arguments: &[String]) -> Result<(Self, ChildStdout, ChildStdin), WorldError> {
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A group of its own: what the world starts is ended with it, and an interrupt at the keyboard does not reach it in the middle
        // of a trial.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let failed = |source| WorldError::Start { program: program.to_string(), source };
        let mut child = command.spawn().map_err(failed)?;
        let (Some(input), Some(output), Some(errors)) = (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            unreachable!("all three are piped")
        };
        let stderr = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&stderr);
        let (sender, stderr_ended) = sync_channel(1);
        thread::spawn(move || {
            drain(errors, &kept);
            // Nobody may be waiting.
            let _ = sender.send(());
        });
        Ok((Self { child, ended: false, status: None, stderr, stderr_ended }, output, input))
    }

    /// Whether it has exited, within `patience`. Leaves it unreaped, so that its group keeps its number until it is ended.
    pub(super) fn exited_within(&mut self, patience: Duration) -> bool {
        let mut waited = Duration::ZERO;
        while !self.ended && !has_exited(&mut self.child) {
            if waited >= patience {
                return false;
            }
            thread::sleep(POLL);
            waited += POLL;
        }
        true
    }

    /// Kills it and what it has started, reaps it and returns how it ended.
    pub(super) fn end(&mut self) -> Option<ExitStatus> {
        if !self.ended {
            self.ended = true;
            kill_group(&mut self.child);
            self.status = self.child.wait().ok();
        }
        self.status
    }

    /// Its last lines on standard error, introduced; empty where it wrote none.
    pub(super) fn last_words(&mut self) -> String {
        if self.exited_within(Duration::ZERO) {
            // Whether it has come to its end or not, what is there is kept.
            let _ = self.stderr_ended.recv_timeout(LAST_WORDS);
        }
        let kept = self.stderr.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&kept);
        let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        if lines.is_empty() {
            return String::new();
        }
        let last = lines[lines.len().saturating_sub(STDERR_LINES)..].join(" | ");
        let skip = last.chars().count().saturating_sub(STDERR_CHARS);
        let last: String = last.chars().skip(skip).collect();
        format!("; its last words on standard error: {}", one_line(&last, STDERR_CHARS))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(unix)]
fn has_exited(child: &mut Child) -> bool {
    use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    !matches!(waitid(WaitId::Pid(Pid::from_child(child)), options), Ok(None))
}

#[cfg(not(unix))]
fn has_exited(child: &mut Child) -> bool {
    !matches!(child.try_wait(), Ok(None))
}

/// Ignores failures: they mean that nothing is left to kill.
fn kill_group(child: &mut Child) {
    #[cfg(unix)]
    let _ = rustix::process::kill_process_group(rustix::process::Pid::from_child(child), rustix::process::Signal::KILL);
    let _ = child.kill();
}

/// Reads standard error to its end and keeps its tail.
fn drain(mut errors: impl Read, kept: &Mutex<Vec<u8>>) {
    let mut buffer = [0; 4096];
    loop {
        match errors.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&buffer[..count]);
                let excess = kept.len().saturating_sub(STDERR_BYTES);
                kept.drain(..excess);
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}
