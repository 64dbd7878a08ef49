//! What is to be generated: fixed before the first shard, the same for all workers.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::publish::{self, Existing};
use crate::{Error, Provenance, Schema, VERSION};

/// Everything that the data depend on. Saved as `plan.json`; its hash is stored in each shard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// [`VERSION`].
    pub version: u32,
    /// The columns.
    pub schema: Schema,
    /// Hash of the scenario's text.
    pub scenario_hash: String,
    /// The caller's resolved configuration.
    pub config: Value,
    /// Root seed.
    pub seed: u64,
    /// Commit of the program that makes the data: rows of different programs do not belong in one dataset.
    pub commit: String,
    /// Number of shards.
    pub shards: u32,
    /// Shard i holds episodes with numbers from i · `episodes_per_shard` to below (i + 1) · `episodes_per_shard`; some
    /// may be left out.
    pub episodes_per_shard: u64,
}

impl Plan {
    /// Hash of the plan, 64 hexadecimal digits; independent of the order of keys.
    #[must_use]
    pub fn hash(&self) -> String {
        blake3::hash(self.value().to_string().as_bytes()).to_hex().to_string()
    }

    /// What each shard records about its origin.
    #[must_use]
    pub fn provenance(&self) -> Provenance {
        Provenance {
            plan_hash: self.hash(),
            scenario_hash: self.scenario_hash.clone(),
            seed: self.seed,
            commit: self.commit.clone(),
        }
    }

    /// Saves the plan in `dir`, or checks that it is the one saved there.
    ///
    /// # Errors
    ///
    /// If `dir` holds another plan: [`Error::PlanDiffers`] lists the differing keys, and nothing is written. If the plan is
    /// invalid, or the folder cannot be written.
    pub fn open(&self, dir: &Path) -> Result<(), Error> {
        self.check()?;
        let path = plan_path(dir);
        if publish::read(&path)?.is_none() {
            let text = format!("{:#}\n", self.value());
            publish::publish(&path, text.as_bytes(), Existing::Keep)?;
        }
        self.compare(dir)
    }

    /// The plan saved in `dir`: what a worker that only knows the folder starts from.
    ///
    /// # Errors
    ///
    /// If there is none, if it is of another version, or if a key is unknown, missing or invalid.
    pub fn read(dir: &Path) -> Result<Self, Error> {
        let path = plan_path(dir);
        let bytes = std::fs::read(&path).map_err(Error::io("read the plan", &path))?;
        let plan: Self = publish::parse(&path, &bytes)?;
        plan.check()?;
        Ok(plan)
    }

    /// Checks that `dir` holds this plan.
    pub(crate) fn compare(&self, dir: &Path) -> Result<(), Error> {
        let path = plan_path(dir);
        let bytes = std::fs::read(&path).map_err(Error::io("read the plan", &path))?;
        let saved: Value = publish::parse(&path, &bytes)?;
        let mut differences = Vec::new();
        compare("", Some(&saved), Some(&self.value()), &mut differences);
        if differences.is_empty() {
            return Ok(());
        }
        Err(Error::PlanDiffers { path, differences: differences.join(", ") })
    }

    fn check(&self) -> Result<(), Error> {
        if self.version != VERSION {
            return Err(Error::plan("version", format!("expected {VERSION}, found {}", self.version)));
        }
        if self.shards == 0 {
            return Err(Error::plan("shards", "expected at least 1, found 0"));
        }
        if self.episodes_per_shard == 0 {
            return Err(Error::plan("episodes_per_shard", "expected at least 1, found 0"));
        }
        if u64::from(self.shards).checked_mul(self.episodes_per_shard).is_none() {
            let reason = format!("{} times {} shards exceeds 64 bits", self.episodes_per_shard, self.shards);
            return Err(Error::plan("episodes_per_shard", reason));
        }
        self.schema.check()
    }

    /// The plan as JSON with sorted keys.
    fn value(&self) -> Value {
        let value = serde_json::to_value(self).expect("names, numbers and JSON are always JSON");
        sorted(value)
    }
}

fn plan_path(dir: &Path) -> PathBuf {
    dir.join("plan.json")
}

/// Sorts keys, whichever map serde_json was built with.
fn sorted(value: Value) -> Value {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<_> = map.into_iter().map(|(k, v)| (k, sorted(v))).collect();
            entries.sort_by(|a, b| a.0.cmp(&b.0));
            Value::Object(entries.into_iter().collect())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(sorted).collect()),
        other => other,
    }
}

/// Lists the keys below `key` in which the values differ.
fn compare(key: &str, saved: Option<&Value>, given: Option<&Value>, differences: &mut Vec<String>) {
    if saved == given {
        return;
    }
    if let (Some(Value::Object(saved)), Some(Value::Object(given))) = (saved, given) {
        for name in saved.keys().chain(given.keys()).collect::<BTreeSet<_>>() {
            let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
            compare(&key, saved.get(name), given.get(name), differences);
        }
        return;
    }
    let text = |value: Option<&Value>| value.map_or_else(|| "nothing".to_owned(), ToString::to_string);
    differences.push(format!("`{key}` (saved: {}, given: {})", text(saved), text(given)));
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn differences_are_named_by_their_whole_key() {
        let mut found = Vec::new();
        let saved = json!({"a": {"b": 1, "c": [1, 2]}, "d": "x", "e": 0.1});
        let given = json!({"e": 0.1, "a": {"b": 2, "c": [1, 2]}, "f": null});
        compare("", Some(&saved), Some(&given), &mut found);
        assert_eq!(
            found,
            ["`a.b` (saved: 1, given: 2)", "`d` (saved: \"x\", given: nothing)", "`f` (saved: nothing, given: null)"]
        );
    }
}
