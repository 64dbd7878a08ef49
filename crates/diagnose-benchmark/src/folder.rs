//! The folder of a benchmark: logs, answers, and apart from them the truth.
//!
//! ```text
//! OUT/plan.json                      options and solver; another run is refused
//! OUT/logs/set-0000/                 what the solver reads
//! OUT/answers/set-0000/report.json   what it says
//! OUT/truth/set-0000.json            what it never sees
//! OUT/reference/set-0000.json        held-out errors of the true model
//! OUT/table.{json,csv,md}, confusion.{csv,md}, sets.csv
//! ```

use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail};
use measured_log::{Format, Notes};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use whole_file::Existing;

use crate::generate::generate;
use crate::plan::{Options, Plan, Truth};
use crate::recording::RecordError;

/// Draws of a set whose true world goes where no log does, at most.
const ATTEMPTS: u64 = 20;

/// What is written last, from all answers.
pub const TABLES: [&str; 6] = ["table.json", "table.md", "table.csv", "confusion.md", "confusion.csv", "sets.csv"];

/// What a folder belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Options.
    pub options: Options,
    /// Version of the project.
    pub project: String,
    /// BLAKE3 of the solver: answers of two never meet in a table.
    pub solver: String,
}

/// A folder that is held by this process.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    _lock: File,
}

impl Folder {
    /// Opens or makes one for this identity; `any_solver`: whoever has answered.
    ///
    /// # Errors
    ///
    /// A folder of other options, or one that another process holds.
    pub fn open(root: &Path, identity: &Identity, any_solver: bool) -> Result<Self> {
        let parts = ["logs", "answers", "truth", "reference"];
        let path = root.join("plan.json");
        whole_file::check_owner(root, "plan.json")?;
        // What is half made there is made anew, and tables are replaced: they must not be somebody else's.
        if !path.exists()
            && let Some(part) = parts.iter().chain(&TABLES).find(|part| root.join(part).exists())
        {
            bail!("{}: holds {part} without plan.json: give another --out", root.display());
        }
        if any_solver && !path.exists() {
            bail!("{}: nothing to score: expected the plan.json of a benchmark", root.display());
        }
        if path.exists() {
            // Another program's plan is no place for a lock.
            read::<Identity>(&path)?;
        }
        std::fs::create_dir_all(root).with_context(|| format!("cannot create {}", root.display()))?;
        let lock =
            File::options().create(true).append(true).open(root.join(".lock")).context("cannot hold the folder")?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!("{}: another benchmark is at work there", root.display()),
            Err(TryLockError::Error(error)) => return Err(error).context("cannot hold the folder"),
        }
        if path.exists() {
            let found: Identity = read(&path)?;
            let solver = if any_solver { found.solver.clone() } else { identity.solver.clone() };
            let same = Identity { solver, ..identity.clone() };
            if found.options != same.options {
                bail!("{}: holds a benchmark of other options: give another --out", root.display());
            }
            if found != same {
                bail!("{}: holds answers of another version of diagnose: give another --out", root.display());
            }
        } else {
            save(&path, identity)?;
        }
        for part in parts {
            let path = root.join(part);
            std::fs::create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
        }
        Ok(Self { root: root.to_path_buf(), _lock: lock })
    }

    /// Its path.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Log of a set.
    #[must_use]
    pub fn log(&self, set: usize) -> PathBuf {
        self.root.join("logs").join(name(set))
    }

    /// Folder of an answer.
    #[must_use]
    pub fn answer(&self, set: usize) -> PathBuf {
        self.root.join("answers").join(name(set))
    }

    /// What the solver must not see.
    #[must_use]
    pub fn truth(&self, set: usize) -> PathBuf {
        self.root.join("truth").join(name(set)).with_extension("json")
    }

    /// Held-out errors of the true model.
    #[must_use]
    pub fn reference(&self, set: usize) -> PathBuf {
        self.root.join("reference").join(name(set)).with_extension("json")
    }

    /// Whether a set is answered.
    #[must_use]
    pub fn is_answered(&self, set: usize) -> bool {
        self.answer(set).join("report.json").exists()
    }

    /// Writes log and truth of a set, unless they lie there.
    ///
    /// # Errors
    ///
    /// A set that cannot be, or a disk that refuses.
    pub fn generate(&self, plan: &Plan, set: usize, arms: Option<&Path>) -> Result<()> {
        let (dir, truth_path) = (self.log(set), self.truth(set));
        // The truth comes last: with it all is there.
        if truth_path.exists() {
            return Ok(());
        }
        if dir.exists() {
            std::fs::remove_dir_all(&dir).with_context(|| format!("cannot make {} anew", dir.display()))?;
        }
        for attempt in 0..ATTEMPTS {
            let truth: Truth = plan.draw(set, attempt);
            let log = match generate(&truth.spec, arms) {
                Ok(log) => log,
                Err(RecordError::World { .. }) => continue,
                Err(error) => return Err(error.into()),
            };
            use measured_log::Error as E;
            match measured_log::write(&dir, &log, Format::Parquet, &Notes::new()) {
                Ok(()) => return save(&truth_path, &truth),
                Err(error @ (E::Io { .. } | E::Write { .. } | E::Exists { .. } | E::Parquet { .. })) => {
                    return Err(error.into());
                }
                // A world that no log can hold.
                Err(_) => {}
            }
        }
        bail!("{}: no world of {ATTEMPTS} draws could be simulated", name(set))
    }

    /// How the solver is called: it gets the log and a place for its answer, and nothing else of the folder.
    #[must_use]
    pub fn command(&self, diagnose: &Path, set: usize, arms: Option<&Path>) -> Command {
        let mut command = Command::new(diagnose);
        let mut arguments: Vec<OsString> =
            vec!["--measured".into(), self.log(set).into(), "--out".into(), self.answer(set).into()];
        arguments.extend(["--threads".into(), "1".into()]);
        if let Some(arms) = arms {
            arguments.extend(["--root".into(), arms.into()]);
        }
        command.args(arguments);
        command
    }

    /// Has a set answered, unless it is.
    ///
    /// # Errors
    ///
    /// A solver that does not start or fails.
    pub fn solve(&self, diagnose: &Path, set: usize, arms: Option<&Path>) -> Result<()> {
        if self.is_answered(set) {
            return Ok(());
        }
        let output = self.command(diagnose, set, arms).output();
        let output = output.with_context(|| format!("cannot run {}", diagnose.display()))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            // What it says last is why; before it stands how far it was.
            let last = said.trim().lines().last().unwrap_or_default();
            bail!("{}: diagnose ended with {}: {last}", name(set), output.status);
        }
        Ok(())
    }
}

/// Name of a set.
#[must_use]
pub fn name(set: usize) -> String {
    format!("set-{set:04}")
}

/// Reads JSON.
///
/// # Errors
///
/// A file that is not there or says something else.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text)
        .map_err(|error| anyhow::anyhow!("{}: {}", path.display(), whole_file::plain(&error.to_string())))
}

/// Writes JSON whole.
///
/// # Errors
///
/// A disk that refuses.
pub fn save<T: Serialize>(path: &Path, value: &T) -> Result<()> {
    let text = serde_json::to_string_pretty(value)? + "\n";
    whole_file::write(path, text.as_bytes(), Existing::Replace)?;
    Ok(())
}
