//! The folder of results: one file a row, so that a run that was stopped goes on where it was, and the table of all of them.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::{Map, Value, json};
use whole_file::Existing;

use super::contest::Row;
use super::table::table;

/// Name of the table and of the object of all rows, without the ending.
pub const NAME: &str = "planner";

/// Most bytes of a row's file.
const MOST_BYTES: u64 = 1 << 24;

/// A folder of results.
#[derive(Clone, Debug)]
pub struct Results {
    folder: PathBuf,
    commit: String,
}

impl Results {
    /// Makes the folder where it is missing. `commit` is noted beside each row.
    ///
    /// # Errors
    ///
    /// Where the folder cannot be made, and for a file in it that is no result of this command.
    pub fn open(folder: &Path, commit: String) -> Result<Self> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        // A table is never without the numbers that it is of.
        let [numbers, table] = ["json", "md"].map(|extension| folder.join(NAME).with_extension(extension));
        ensure!(
            numbers.exists() || !table.exists(),
            "{}: exists without {NAME}.json beside it: choose another folder",
            table.display()
        );
        let results = Self { folder: folder.to_path_buf(), commit };
        // Before anything is played: rows are added to these.
        results.whole()?;
        Ok(results)
    }

    /// All rows so far.
    fn whole(&self) -> Result<Map<String, Value>> {
        let path = self.path(NAME);
        if path.exists() { object(&path) } else { Ok(Map::new()) }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.json"))
    }

    /// What the folder has of a row.
    ///
    /// # Errors
    ///
    /// A file that is no result of this command, and a row of another task.
    pub(super) fn of(&self, row: &Row) -> Result<Option<Value>> {
        let path = self.path(row.name());
        if !path.exists() {
            return Ok(None);
        }
        let value = Value::Object(object(&path)?);
        let same = value["task"] == row.task();
        ensure!(same, "{} has a row of other options, episodes or seed: choose another folder", path.display());
        Ok(Some(value))
    }

    /// Writes a row.
    ///
    /// # Errors
    ///
    /// Where the file cannot be written.
    pub(super) fn add(&self, row: &Row, value: &Value) -> Result<()> {
        let mut value = value.clone();
        value["commit"] = json!(self.commit);
        whole_file::write(&self.path(row.name()), &pretty(&value)?, Existing::Replace)?;
        Ok(())
    }

    /// Writes all rows as one object and as a table.
    ///
    /// # Errors
    ///
    /// Where a file cannot be written.
    pub(super) fn finish(&self, result: &Value) -> Result<()> {
        let mut all: Map<String, Value> = result.as_object().cloned().unwrap_or_default();
        let whole = self.path(NAME);
        for (name, row) in self.whole()? {
            all.entry(name).or_insert(row);
        }
        let all = Value::Object(all);
        whole_file::write(&whole, &pretty(&all)?, Existing::Replace)?;
        whole_file::write(&whole.with_extension("md"), table(&all).as_bytes(), Existing::Replace)?;
        Ok(())
    }
}

/// A file of this command.
fn object(path: &Path) -> Result<Map<String, Value>> {
    match serde_json::from_slice(&whole_file::read(path, MOST_BYTES)?) {
        Ok(Value::Object(found)) => Ok(found),
        _ => bail!("{} is no result of this benchmark: move it away", path.display()),
    }
}

fn pretty(value: &Value) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(value)?;
    bytes.push(b'\n');
    Ok(bytes)
}
