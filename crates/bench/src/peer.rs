//! Peers: Python scripts of `tests/peers` that time another program and print one JSON object.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

/// Exit status of a script whose package is not installed.
const MISSING: i32 = 3;

/// An installed peer.
#[derive(Debug)]
pub struct Peer {
    python: String,
    script: PathBuf,
    arguments: Vec<String>,
    version: OnceLock<String>,
}

impl Peer {
    /// The peer of `tests/peers/SCRIPT`, if it is installed for the Python of the variable `PYTHON`, or `python3`. Where it is not, the script says
    /// what is missing, which goes to `note`.
    ///
    /// # Errors
    ///
    /// The peer is installed, but fails.
    pub fn find(root: &Path, script: &str, arguments: &[&str], note: &mut impl FnMut(&str)) -> Result<Option<Self>> {
        let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
        let peer = Self {
            python,
            script: root.join("tests/peers").join(script),
            arguments: arguments.iter().map(ToString::to_string).collect(),
            version: OnceLock::new(),
        };
        match peer.call(1) {
            Ok(_) => Ok(Some(peer)),
            Err(error) if error.to_string().starts_with("missing:") => {
                note(&format!("{error:#}"));
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Version of the peer's library.
    #[must_use]
    pub fn version(&self) -> Option<&str> {
        self.version.get().map(String::as_str)
    }

    /// Adds the times of one batch to `times`, by obstacle/tool/what/substeps.
    ///
    /// # Errors
    ///
    /// The script fails, or prints something else than expected.
    pub fn round(&self, actions: usize, times: &mut BTreeMap<String, Vec<f64>>) -> Result<()> {
        let result = self.call(actions)?;
        for (obstacle, tools) in result.as_object().into_iter().flatten() {
            for (tool, entry) in tools.as_object().into_iter().flatten() {
                for (what, substeps) in entry.as_object().into_iter().flatten().filter(|(k, _)| k.ends_with("_us")) {
                    for (count, batches) in substeps.as_object().into_iter().flatten() {
                        let us = batches.as_array().and_then(|b| b.first()?.as_f64());
                        let us = us.with_context(|| format!("{}: expected a time", self.script.display()))?;
                        times.entry(format!("{obstacle}/{tool}/{what}/{count}")).or_default().push(us);
                    }
                }
            }
        }
        Ok(())
    }

    fn call(&self, actions: usize) -> Result<Value> {
        let actions = actions.to_string();
        let output = Command::new(&self.python)
            .arg(&self.script)
            .args(["--batches", "1", "--actions", &actions])
            .args(&self.arguments)
            .stdin(Stdio::null())
            .output()
            .with_context(|| format!("missing: {}", self.python))?;
        let says = String::from_utf8_lossy(&output.stderr);
        match output.status.code() {
            Some(0) => {}
            Some(MISSING) => bail!("{}", says.trim()),
            _ => bail!("{} failed: {}", self.script.display(), says.trim()),
        }
        let result: Value = serde_json::from_slice(&output.stdout)
            .with_context(|| format!("{}: expected one JSON object", self.script.display()))?;
        if let Some(version) = ["mujoco", "pybullet"].iter().find_map(|key| result.get(key)?.as_str()) {
            let _ = self.version.set(version.into());
        }
        Ok(result)
    }
}
