//! Layers of TOML, later values winning: base, robot, preset, domain, quick, effects of a model, `--set`. A resolved scenario is a layer that holds everything: it
//! replaces all before it.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Table, Value};

use crate::{Error, Scenario, VERSION};

/// Which scenario to load.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Folder that holds `scenarios/` and `assets/`.
    pub root: PathBuf,
    /// Domain: `D1` … `D5`, `obstacle`, or a path to a TOML file (a resolved scenario among them).
    pub domain: String,
    /// Robot: `sawyer`, `jaco`, or a path.
    pub robot: String,
    /// Preset: `paper`, or a path.
    pub preset: String,
    /// A run of a minute or two.
    pub quick: bool,
    /// Overrides `key=value`, with dotted keys and TOML values.
    pub set: Vec<String>,
    /// A `model.toml` of `diagnose`: its effects become `effects.model`, before the overrides.
    pub effects: Option<PathBuf>,
}

impl Selection {
    /// D1 for the Sawyer with preset `paper`.
    #[must_use]
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self {
            root: root.into(),
            domain: "D1".into(),
            robot: "sawyer".into(),
            preset: "paper".into(),
            quick: false,
            set: Vec::new(),
            effects: None,
        }
    }

    /// Reads the layers, merges and checks them.
    ///
    /// # Errors
    ///
    /// [`Error`] with file, key and expectation.
    pub fn load(&self) -> Result<Scenario, Error> {
        let scenarios = self.root.join("scenarios");
        let paths = [
            scenarios.join("base.toml"),
            locate("robot", &self.robot, &scenarios.join("robots"))?,
            locate("preset", &self.preset, &scenarios.join("presets"))?,
            locate("domain", &self.domain, &scenarios)?,
        ];
        let quick = self.quick.then(|| scenarios.join("presets/quick.toml"));
        let mut layers = Vec::new();
        for path in paths.into_iter().chain(quick) {
            let table = read(&path)?;
            if RESOLVED_KEYS.iter().all(|key| table.contains_key(*key)) {
                layers.clear();
            }
            layers.push(Layer { name: path.display().to_string(), table });
        }
        if let Some(path) = &self.effects {
            layers.push(Layer { name: path.display().to_string(), table: read_effects(path)? });
        }
        for text in &self.set {
            layers.push(Layer { name: format!("--set {text}"), table: parse_override(text)? });
        }
        let mut merged = Table::new();
        for layer in &layers {
            merge(&mut merged, &layer.table);
        }
        let scenario: Scenario = serde_path_to_error::deserialize(Value::Table(merged)).map_err(|error| {
            let mut key = error.path().to_string();
            let message = error.into_inner().to_string();
            let message = message.trim();
            // serde reports an unknown key on its table: the key itself stands in the message.
            if let Some(unknown) = message.strip_prefix("unknown field `").and_then(|m| m.split('`').next())
                && !key.ends_with(unknown)
            {
                key = if key == "." { unknown.to_string() } else { format!("{key}.{unknown}") };
            }
            Error::Key { file: origin(&layers, &key), key, message: message.replace('\n', " ") }
        })?;
        let problem = scenario
            .problem()
            .or_else(|| scenario.planner.validate().err().map(|e| e.to_string()))
            .or_else(|| scenario.belief.rejection.validate().err().map(|e| e.to_string()))
            .or_else(|| scenario.belief.weighted.validate().err().map(|e| e.to_string()))
            .or_else(|| {
                // Else a restart late in an episode would be left out without a word.
                let w = &scenario.belief.weighted;
                let needed = w.history_limit * w.particles_min;
                let short = w.restart_transitions > 0 && w.restart_transitions < needed;
                short.then(|| {
                    let found = w.restart_transitions;
                    format!("belief.weighted.restart_transitions: expected 0 or history_limit × particles_min = {needed}, found {found}")
                })
            })
            .or_else(|| {
                let classes = scenario.planner.observations == planner::Observations::Classes;
                (!classes).then(|| {
                    "planner.observations: expected \"classes\", which is all that the agent searches with".into()
                })
            });
        match problem {
            Some(problem) => {
                let key = problem.split(':').next().unwrap_or_default();
                Err(Error::Value { file: origin(&layers, key), problem })
            }
            None => Ok(scenario),
        }
    }
}

/// A file with these keys is a resolved scenario, not a layer.
const RESOLVED_KEYS: [&str; 4] = ["name", "preset", "robot", "version"];

struct Layer {
    name: String,
    table: Table,
}

/// The nearest folder at or above `start` that holds `scenarios/base.toml`.
///
/// # Errors
///
/// [`Error::Root`] where there is none.
pub fn find_root(start: &Path) -> Result<PathBuf, Error> {
    let absolute = std::path::absolute(start).unwrap_or_else(|_| start.to_path_buf());
    absolute
        .ancestors()
        .find(|folder| folder.join("scenarios/base.toml").is_file())
        .map(Path::to_path_buf)
        .ok_or(Error::Root { start: absolute.clone() })
}

fn locate(kind: &'static str, name: &str, folder: &Path) -> Result<PathBuf, Error> {
    if name.contains('/') || Path::new(name).extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Ok(PathBuf::from(name));
    }
    let path = folder.join(format!("{}.toml", name.to_lowercase()));
    // `base` and `quick` are layers of their own.
    if path.is_file() && !["base", "quick"].contains(&name) {
        return Ok(path);
    }
    let mut known: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.path().file_name()?.to_str()?.strip_suffix(".toml").map(String::from))
        .filter(|stem| !["base", "quick"].contains(&stem.as_str()))
        .collect();
    known.sort();
    Err(Error::Unknown { kind, name: name.into(), known: known.join(", ") })
}

fn read(path: &Path) -> Result<Table, Error> {
    #[derive(Deserialize)]
    struct Head {
        version: Option<Value>,
    }
    let text = std::fs::read_to_string(path).map_err(|source| Error::Read { file: path.to_path_buf(), source })?;
    let syntax = |message: String| Error::Syntax {
        file: path.to_path_buf(),
        message: message.lines().collect::<Vec<_>>().join(" "),
    };
    // The version alone comes first, so that an old file says so instead of listing unknown keys.
    let head: Head = toml::from_str(&text).map_err(|e| syntax(e.to_string()))?;
    if let Some(found) = head.version
        && found.as_integer() != Some(i64::from(VERSION))
    {
        return Err(Error::Version { file: path.to_path_buf(), found: found.to_string(), expected: VERSION });
    }
    toml::from_str(&text).map_err(|e| syntax(e.to_string()))
}

/// What a model that `diagnose` wrote says to a scenario: the effects. The rest is about the object of its log.
fn read_effects(path: &Path) -> Result<Table, Error> {
    let mut table = read(path)?;
    let missing = || Error::Key {
        file: path.display().to_string(),
        key: "effects.model".into(),
        message: "expected a list of effects, as `diagnose` writes it".into(),
    };
    match table.remove("effects") {
        Some(Value::Table(mut effects)) => match effects.remove("model") {
            Some(model @ Value::Array(_)) => Ok(nested(["effects", "model"], model)),
            _ => Err(missing()),
        },
        _ => Err(missing()),
    }
}

/// A value below two keys.
fn nested([outer, inner]: [&str; 2], value: Value) -> Table {
    let inner = Table::from_iter([(inner.to_string(), value)]);
    Table::from_iter([(outer.to_string(), Value::Table(inner))])
}

fn parse_override(text: &str) -> Result<Table, Error> {
    let error = || Error::Override { text: text.into() };
    let (key, value) = text.split_once('=').ok_or_else(error)?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || key.contains(['\n', '#', '[']) || value.contains('\n') {
        return Err(error());
    }
    // A bare word is a string: `--set preset=paper` needs no quotes.
    toml::from_str(&format!("{key} = {value}"))
        .or_else(|_| toml::from_str(&format!("{key} = \"{}\"", value.escape_default())))
        .map_err(|_| error())
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

fn is_choice(key: &str) -> bool {
    ["budget", "exploration", "rollout_depth"].contains(&key)
}

/// The last layer that says anything on `key` or, failing that, on the nearest table above it.
fn origin(layers: &[Layer], key: &str) -> String {
    let parts: Vec<&str> = key.split(['.', '[']).map(|p| p.trim_end_matches(']')).collect();
    for length in (1..=parts.len()).rev() {
        let found = layers.iter().rev().find(|layer| {
            let mut value = None;
            let mut table = Some(&layer.table);
            for part in &parts[..length] {
                value = table.and_then(|t| t.get(*part));
                table = value.and_then(Value::as_table);
            }
            value.is_some()
        });
        if let Some(layer) = found {
            return layer.name.clone();
        }
    }
    layers.iter().map(|layer| layer.name.as_str()).collect::<Vec<_>>().join(" + ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    fn load(change: impl FnOnce(&mut Selection)) -> Result<Scenario, Error> {
        let mut selection = Selection::new(root());
        change(&mut selection);
        selection.load()
    }

    #[test]
    fn every_domain_loads_for_every_robot() {
        for domain in ["D1", "D2", "D3", "D4", "D5", "obstacle", "tilted", "training"] {
            for robot in ["sawyer", "jaco"] {
                for quick in [false, true] {
                    let scenario = load(|s| {
                        s.domain = domain.into();
                        s.robot = robot.into();
                        s.quick = quick;
                    })
                    .unwrap_or_else(|e| panic!("{domain} {robot}: {e}"));
                    assert_eq!(scenario.name, domain);
                    assert_eq!(scenario.robot.name, robot);
                }
            }
        }
    }

    #[test]
    fn a_resolved_scenario_loads_again_to_the_same_values() {
        let scenario = load(|s| {
            s.domain = "D4".into();
            // Not the arm that is laid under it when it is loaded again.
            s.robot = "jaco".into();
            s.set = vec!["planner.depth=7".into(), "planner.budget={ simulations = 9 }".into()];
        })
        .unwrap();
        assert_eq!(scenario.planner.depth, 7);
        let file = std::env::temp_dir().join(format!("surmise-resolved-{}.toml", std::process::id()));
        std::fs::write(&file, scenario.to_toml()).unwrap();
        let again = load(|s| s.domain = file.display().to_string());
        std::fs::remove_file(&file).unwrap();
        assert_eq!(again.unwrap(), scenario);
    }

    #[test]
    fn a_model_of_diagnose_gives_its_effects_to_the_planner_alone() {
        let file = std::env::temp_dir().join(format!("surmise-model-{}.toml", std::process::id()));
        let load_with = |text: &str| {
            std::fs::write(&file, text).unwrap();
            let scenario = load(|s| s.effects = Some(file.clone()));
            std::fs::remove_file(&file).unwrap();
            scenario
        };
        let tilt = "{ table_tilt = { slope_x_rad = 0.01, slope_y_rad = 0.0 } }";
        let text = format!("version = 1\n[nominal]\n\"table.friction\" = 0.3\n[effects]\nmodel = [{tilt}]\n");
        let (plain, scenario) = (load(|_| ()).unwrap(), load_with(&text).unwrap());
        assert_eq!(scenario.effects.model.iter().map(|e| e.kind().name()).collect::<Vec<_>>(), ["table_tilt"]);
        assert_eq!(scenario.effects.truth, plain.effects.truth);
        assert_eq!(scenario.distribution, plain.distribution);
        let missing = load_with("version = 1\n[effects]\n").unwrap_err().to_string();
        assert!(missing.contains("effects.model"), "{missing}");
    }

    #[test]
    fn the_true_arm_can_be_dynamic_while_the_model_stays_kinematic() {
        use physics_model::config::{ArmConfig, ServoConfig};
        let set = |text: &str| load(|s| s.set = vec![text.into()]);
        let arm = set("arm.truth={ dynamic = { stiffness_nmprad = 3000.0, damping_ratio = 0.7 } }").unwrap().arm;
        assert_eq!(arm.truth, ArmConfig::Dynamic(ServoConfig { stiffness_nmprad: 3000.0, damping_ratio: 0.7 }));
        assert_eq!(arm.model, ArmConfig::Kinematic);
        let soft =
            set("arm.truth={ dynamic = { stiffness_nmprad = 0.0, damping_ratio = 0.7 } }").unwrap_err().to_string();
        assert!(soft.contains("arm.truth.dynamic.stiffness_nmprad") && soft.contains("N·m/rad"), "{soft}");
        let unknown = set("arm.truth={ dynamic = { stiffness = 1.0 } }").unwrap_err().to_string();
        assert!(unknown.contains("stiffness_nmprad"), "{unknown}");
    }

    #[test]
    fn effects_and_their_unknown_parameters_are_checked() {
        let set = |texts: &[&str]| load(|s| s.set = texts.iter().map(ToString::to_string).collect());
        let message = |texts: &[&str]| set(texts).unwrap_err().to_string();
        let tilt = "effects.model=[{ table_tilt = { slope_x_rad = 0.0, slope_y_rad = 0.0 } }]";
        let slope =
            "distribution.effects.table_tilt.slope_x_rad={ mean = 0.0, stddev = 0.02, low = -0.05, high = 0.05 }";
        let scenario = set(&[tilt, slope]).unwrap();
        assert_eq!(scenario.distribution.effects.len(), 1);
        let again: Scenario = toml::from_str(&scenario.to_toml()).unwrap();
        assert_eq!(again, scenario);
        let unlisted = message(&[slope]);
        assert!(
            unlisted.contains("distribution.effects.table_tilt: expected table_tilt in effects.truth"),
            "{unlisted}"
        );
        let wide = message(&[tilt, &slope.replace("high = 0.05", "high = 5.0")]);
        assert!(wide.contains("distribution.effects.table_tilt.slope_x_rad") && wide.contains("rad"), "{wide}");
        let unknown = message(&[tilt, &slope.replace("slope_x_rad", "slope_rad")]);
        assert!(unknown.contains("slope_x_rad, slope_y_rad exist"), "{unknown}");
        let steep = message(&["effects.truth=[{ table_tilt = { slope_x_rad = 0.0, slope_y_rad = 1.0 } }]"]);
        assert!(steep.contains("table_tilt.slope_y_rad: expected -0.7 to 0.7 rad, found 1"), "{steep}");
        let misspelt = message(&["effects.truth=[{ teher = { stiffness_npm = 1.0 } }]"]);
        assert!(misspelt.contains("teher") && misspelt.contains("tether"), "{misspelt}");
        // Nothing is written of what is not there: old runs keep their hashes.
        assert!(!set(&[]).unwrap().to_toml().contains("distribution.effects"));
    }

    #[test]
    fn errors_name_file_key_and_expectation() {
        let message = |set: &str| load(|s| s.set = vec![set.into()]).unwrap_err().to_string();
        let unknown = message("task.horizn=3");
        assert!(unknown.contains("--set task.horizn=3") && unknown.contains("`task.horizn`"), "{unknown}");
        assert!(unknown.contains("horizon"), "{unknown}");
        let wrong_type = message("task.horizon=\"far\"");
        assert!(wrong_type.contains("task.horizon") && wrong_type.contains("expected"), "{wrong_type}");
        let wrong_unit = message("task.goal.radius_cm=4");
        assert!(wrong_unit.contains("radius_cm") && wrong_unit.contains("radius_m"), "{wrong_unit}");
        let range = message("task.discount=1.5");
        assert!(range.contains("task.discount") && range.contains("0 to 1"), "{range}");
        let version = message("version=9");
        assert!(version.contains("version"), "{version}");
        assert!(message("nonsense").contains("key=value"));
    }

    #[test]
    fn unknown_names_list_what_exists() {
        let message = load(|s| s.domain = "D9".into()).unwrap_err().to_string();
        assert!(
            message.contains("unknown domain `D9`")
                && message.contains("d1, d2, d3, d4, d5, obstacle, tilted, training"),
            "{message}"
        );
        let message = load(|s| s.robot = "panda".into()).unwrap_err().to_string();
        assert!(message.contains("jaco, sawyer"), "{message}");
    }
}
