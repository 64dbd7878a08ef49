//! Layers of TOML, later values winning: base, robot, preset, domain, quick, effects of a model, `--set`. A resolved scenario is a layer
//! that holds everything: it replaces all before it.

use std::path::Path;

use serde::Serialize;
use toml::{Table, Value};
use whole_file::{key_of, one_line, plain};

use crate::load::{QUOTED, SENTENCE};
use crate::suggest::{with_choices, with_nearest};
use crate::{Error, Scenario};

/// A file with these keys is a resolved scenario, not a layer.
const RESOLVED_KEYS: [&str; 4] = ["name", "preset", "robot", "version"];

/// Which part of a scenario a layer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LayerKind {
    /// No layer: the format has a value where files say nothing.
    Format,
    /// What every domain, robot and method shares.
    Base,
    /// The arm.
    Robot,
    /// Belief, planner and agent.
    Preset,
    /// The domain, or a resolved scenario.
    Domain,
    /// What `--quick` lays over the others.
    Quick,
    /// Effects of a model that `diagnose` wrote.
    Effects,
    /// `--set`.
    Set,
}

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Source {
    /// Layer.
    pub layer: LayerKind,
    /// File, relative to the project where it lies in it, or the override as it was given.
    pub name: String,
}

struct Layer {
    source: Source,
    table: Table,
}

/// The layers of a scenario, in order.
#[derive(Default)]
pub(crate) struct Layers(Vec<Layer>);

impl Layers {
    /// Adds a layer over all others.
    pub(crate) fn push(&mut self, layer: LayerKind, name: String, table: Table) {
        if RESOLVED_KEYS.iter().all(|key| table.contains_key(*key)) {
            self.0.clear();
        }
        self.0.push(Layer { source: Source { layer, name }, table });
    }

    /// Merges and checks the layers.
    pub(crate) fn resolve(&self) -> Result<Scenario, Error> {
        let mut merged = Table::new();
        for layer in &self.0 {
            merge(&mut merged, &layer.table);
        }
        let scenario: Scenario = serde_path_to_error::deserialize(Value::Table(merged)).map_err(|error| {
            let path = error.path().to_string();
            let message = error.into_inner().message().to_owned();
            let message = message.trim();
            let key = key_of(&path, message);
            let message = plain(&with_nearest(&message.replace('\n', " ")));
            let message = one_line(&with_choices(message, &key), SENTENCE);
            Error::Key { file: self.origin(&key), key: one_line(&key, QUOTED), message }
        })?;
        match problem(&scenario) {
            Some(problem) => {
                let key = problem.split(':').next().unwrap_or_default();
                Err(Error::Value { file: self.origin(key), problem: one_line(&problem, SENTENCE) })
            }
            None => Ok(scenario),
        }
    }

    /// The last layer that says anything on `key` or, failing that, on the nearest table above it.
    fn origin(&self, key: &str) -> String {
        let parts: Vec<&str> = key.split(['.', '[']).map(|p| p.trim_end_matches(']')).collect();
        let found = (1..=parts.len()).rev().find_map(|length| Some((self.last_with(&parts[..length])?, length)));
        match found {
            // No file says it: the robot's may have to, wherever else its table stands.
            Some((source, length)) if length < parts.len() && !key.contains('[') => {
                let robot = self.0.iter().map(|layer| &layer.source).find(|s| s.layer == LayerKind::Robot);
                let robot = robot.filter(|robot| *robot != source).map(|robot| format!("{} + ", robot.name));
                robot.unwrap_or_default() + &source.name
            }
            Some((source, _)) => source.name.clone(),
            None => {
                // Whose it is to say; all layers where it is nobody's.
                let whose = match parts[0] {
                    "name" => Some(LayerKind::Domain),
                    "preset" => Some(LayerKind::Preset),
                    "robot" => Some(LayerKind::Robot),
                    _ => None,
                };
                let asked =
                    self.0.iter().map(|layer| &layer.source).filter(|s| whose.is_none_or(|kind| s.layer == kind));
                asked.map(|source| source.name.as_str()).collect::<Vec<_>>().join(" + ")
            }
        }
    }

    /// Where the value of a key of the resolved scenario comes from; names are relative to `root`.
    pub(crate) fn source(&self, key: &str, root: &Path) -> Source {
        // A list replaces as a whole.
        let list = key.split('[').next().unwrap_or(key);
        let parts: Vec<&str> = list.split('.').collect();
        let default = || Source { layer: LayerKind::Format, name: "default of the format".into() };
        let Source { layer, name } = self.last_with(&parts).cloned().unwrap_or_else(default);
        let name = Path::new(&name).strip_prefix(root).map_or_else(|_| name.clone(), |path| path.display().to_string());
        Source { layer, name }
    }

    fn last_with(&self, parts: &[&str]) -> Option<&Source> {
        self.0.iter().rev().find(|layer| holds(&layer.table, parts)).map(|layer| &layer.source)
    }
}

fn holds(table: &Table, parts: &[&str]) -> bool {
    let Some((last, above)) = parts.split_last() else { return false };
    let inner = above.iter().try_fold(table, |table, part| table.get(*part)?.as_table());
    inner.is_some_and(|table| table.contains_key(*last))
}

/// What is wrong with the values of a scenario, if anything: key and expectation.
fn problem(scenario: &Scenario) -> Option<String> {
    scenario
        .problem()
        .or_else(|| scenario.planner.validate().err().map(|e| e.to_string()))
        .or_else(|| scenario.belief.rejection.validate().err().map(|e| e.to_string()))
        .or_else(|| scenario.belief.bridge.validate().err().map(|e| e.to_string()))
        .or_else(|| {
            let classes = scenario.planner.observations == planner::Observations::Classes;
            (!classes)
                .then(|| "planner.observations: expected \"classes\", which is all that the agent searches with".into())
        })
}

/// Tables merge key by key, except one-variant enums (`budget = { transitions = … }`), which replace as a whole; everything else
/// replaces.
fn merge(into: &mut Table, from: &Table) {
    for (key, value) in from {
        match (into.get_mut(key), value) {
            (Some(Value::Table(old)), Value::Table(new)) if !is_choice(key) => merge(old, new),
            _ => {
                into.insert(key.clone(), value.clone());
            }
        }
    }
}

pub(crate) fn is_choice(key: &str) -> bool {
    ["budget", "exploration", "rollout_depth"].contains(&key)
}

#[cfg(test)]
mod tests {
    use crate::{Error, Scenario, Selection, find_root};

    fn load(set: &[&str]) -> Result<Scenario, Error> {
        let root = find_root(env!("CARGO_MANIFEST_DIR").as_ref()).unwrap();
        Selection { set: set.iter().map(ToString::to_string).collect(), ..Selection::new(root) }.load()
    }

    #[test]
    fn errors_name_file_key_and_expectation() {
        let message = |set: &str| load(&[set]).unwrap_err().to_string();
        let unknown = message("task.horizn=3");
        assert!(unknown.contains("--set task.horizn=3") && unknown.contains("`task.horizn`"), "{unknown}");
        assert!(unknown.contains("horizon"), "{unknown}");
        let wrong_type = message("task.horizon=\"far\"");
        assert!(wrong_type.contains("task.horizon") && wrong_type.contains("expected"), "{wrong_type}");
        let wrong_unit = message("task.goal.radius_cm=4");
        assert!(wrong_unit.contains("radius_cm") && wrong_unit.contains("radius_m"), "{wrong_unit}");
        assert!(wrong_type.ends_with("expected a whole number, 0 or more, found the text \"far\""), "{wrong_type}");
        let range = message("task.discount=1.5");
        assert!(range.contains("task.discount") && range.contains("0 to 1"), "{range}");
        let version = message("version=9");
        assert!(version.contains("version"), "{version}");
        assert!(message("nonsense").contains("key=value"));
    }

    #[test]
    fn a_key_that_is_missing_is_asked_of_the_file_that_has_to_say_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        let mine = file.display().to_string();
        let root = find_root(env!("CARGO_MANIFEST_DIR").as_ref()).unwrap();
        let nominal = Selection::new(&root);
        let cases = [
            ("name", "d1", Selection { domain: mine.clone(), ..nominal.clone() }),
            ("preset", "presets/surmise", Selection { preset: mine.clone(), ..nominal.clone() }),
            ("robot", "robots/sawyer", Selection { robot: mine.clone(), ..nominal }),
        ];
        for (key, original, selection) in cases {
            let text = std::fs::read_to_string(root.join("scenarios").join(original).with_extension("toml")).unwrap();
            let mut table: toml::Table = toml::from_str(&text).unwrap();
            table.remove(key).unwrap();
            std::fs::write(&file, table.to_string()).unwrap();
            let message = selection.load().unwrap_err().to_string();
            let missing = match key {
                "robot" => "expected the table [robot] of an arm, as in scenarios/robots/sawyer.toml",
                _ => &format!("`{key}` is missing"),
            };
            assert_eq!(message, format!("{mine}: key `{key}`: {missing}"));
        }
        // An arm alone, without the task where it stands.
        let text = std::fs::read_to_string(root.join("scenarios/robots/sawyer.toml")).unwrap();
        let mut table: toml::Table = toml::from_str(&text).unwrap();
        table.retain(|key, _| key == "robot");
        std::fs::write(&file, table.to_string()).unwrap();
        let message = Selection { robot: mine.clone(), ..Selection::new(&root) }.load().unwrap_err().to_string();
        assert!(message.starts_with(&format!("{mine} + ")) && message.contains("is missing"), "{message}");
        // A file of another kind, whose keys would only be missed elsewhere.
        let other = root.join("scenarios/d4.toml").display().to_string();
        let message = Selection { robot: other.clone(), ..Selection::new(&root) }.load().unwrap_err().to_string();
        assert!(message.starts_with(&format!("{other}: key `robot`: expected the table [robot]")), "{message}");
    }

    #[test]
    fn unknown_keys_are_answered_with_what_may_be_meant() {
        let message = |set: &str| load(&[set]).unwrap_err().to_string();
        assert!(message("task.horizn=3").contains("nearest is `horizon`"), "{}", message("task.horizn=3"));
        assert!(message("horizon=3").contains("there is `task.horizon`"), "{}", message("horizon=3"));
        assert!(message("belief.filter=\"brigde\"").contains("nearest is `bridge`"));
    }
}
