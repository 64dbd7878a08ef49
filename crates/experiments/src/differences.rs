//! How the scenario of a run in a folder differs from that of the run that was asked for.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::Error;

/// Keys that a message names.
const MOST: usize = 3;
/// Length of a value in it.
const MOST_CHARS: usize = 300;

/// Names the keys in which the scenario of another run differs, where all that is known is that it does.
pub(crate) fn named_keys(error: Error, folder: &Path, scenario_toml: &str) -> Error {
    let Error::OtherRun { file, key, .. } = &error else { return error };
    let scenario_file = folder.join("scenario.toml");
    let there = std::fs::read_to_string(&scenario_file).ok().and_then(|text| text.parse().ok());
    let (true, Some(there), Ok(here)) = (key == "scenario_hash", there, scenario_toml.parse()) else { return error };
    let [there, here] = [there, here].map(|table| {
        let mut values = BTreeMap::new();
        flatten("", &toml::Value::Table(table), &mut values);
        values
    });
    let keys: BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    let told = |values: &BTreeMap<String, String>, key| {
        values.get(key).map_or("missing".into(), |value| whole_file::one_line(value, MOST_CHARS))
    };
    let mut differences: Vec<String> = keys
        .into_iter()
        .filter(|key| there.get(*key) != here.get(*key))
        .map(|key| format!("`{key}` is {} there and {} here", told(&there, key), told(&here, key)))
        .collect();
    if differences.is_empty() {
        return error;
    }
    let more = differences.len().saturating_sub(MOST);
    differences.truncate(MOST);
    if more > 0 {
        differences.push(format!("{more} more"));
    }
    Error::OtherScenario { file: file.clone(), differences: differences.join(", ") }
}

/// The values of a table by their paths.
fn flatten(path: &str, value: &toml::Value, values: &mut BTreeMap<String, String>) {
    match value.as_table() {
        Some(table) => {
            for (key, value) in table {
                flatten(&if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, value, values);
            }
        }
        None => {
            values.insert(path.into(), value.to_string());
        }
    }
}
