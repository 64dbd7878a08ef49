//! PyTorch, kept running: a Python program that answers one JSON object a line.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

/// Exit status of the script where PyTorch is not installed.
const MISSING: i32 = 3;

/// The running program.
#[derive(Debug)]
pub(crate) struct PyTorch {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    errors: std::path::PathBuf,
    /// Versions that it reports.
    pub(crate) versions: Value,
}

impl PyTorch {
    /// Starts `tests/peers/pytorch_prior.py` by the Python of the variable `PYTHON`, or `python3`; what it complains of goes to a file in `folder`.
    /// Without Python or PyTorch, none, and what is missing goes to `note`.
    pub(crate) fn start(root: &Path, folder: &Path, note: &mut impl FnMut(&str)) -> Result<Option<Self>> {
        let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
        let errors = folder.join("errors.txt");
        let file = std::fs::File::create(&errors).with_context(|| errors.display().to_string())?;
        let spawned = Command::new(&python)
            .arg(root.join("tests/peers/pytorch_prior.py"))
            .current_dir(folder)
            // Threads that spin while they wait for one another stand still on a shared machine: a batch took seconds.
            .env("OMP_WAIT_POLICY", "PASSIVE")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(file)
            .spawn();
        let mut child = match spawned {
            Ok(child) => child,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                note(&format!("missing: {python}"));
                return Ok(None);
            }
            Err(error) => return Err(error).context(python),
        };
        let requests = child.stdin.take().context("no pipe to Python")?;
        let answers = BufReader::new(child.stdout.take().context("no pipe from Python")?);
        let mut peer = Self { child, requests, answers, errors, versions: Value::Null };
        let mut line = String::new();
        peer.answers.read_line(&mut line)?;
        if line.is_empty() && peer.child.wait()?.code() == Some(MISSING) {
            note(std::fs::read_to_string(&peer.errors)?.trim());
            return Ok(None);
        }
        peer.versions = peer.parse(&line)?;
        Ok(Some(peer))
    }

    /// Sends a request and waits for the answer.
    pub(crate) fn ask(&mut self, request: &Value) -> Result<Value> {
        let sent = writeln!(self.requests, "{request}").and_then(|()| self.requests.flush());
        let mut line = String::new();
        if sent.is_ok() {
            self.answers.read_line(&mut line)?;
        }
        self.parse(&line)
    }

    fn parse(&self, line: &str) -> Result<Value> {
        if line.is_empty() {
            let says = std::fs::read_to_string(&self.errors).unwrap_or_default();
            let tail: Vec<&str> = says.lines().rev().take(20).collect();
            bail!("pytorch_prior.py failed: {}", tail.into_iter().rev().collect::<Vec<_>>().join("\n"));
        }
        serde_json::from_str(line).with_context(|| format!("pytorch_prior.py: expected one JSON object, found {line}"))
    }
}

impl Drop for PyTorch {
    fn drop(&mut self) {
        // It holds nothing that has to be saved; without a child left there is nothing to kill or to wait for.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
