//! The shipped JSON Schemas are those of the types, and all scenario files are valid by them.

use std::path::{Path, PathBuf};

use scenario::{FileKind, file_schema, find_root};
use serde_json::Value;

fn root() -> PathBuf {
    find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

#[test]
fn the_shipped_schemas_are_up_to_date() {
    for (kind, name) in [(FileKind::Scenario, "scenario.json"), (FileKind::Robot, "robot.json")] {
        let path = root().join("assets/schemas").join(name);
        let text = format!("{:#}\n", file_schema(kind));
        if std::env::var_os("UPDATE_SCHEMAS").is_some() {
            std::fs::write(&path, &text).unwrap();
        }
        let shipped = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            shipped == text,
            "{name} is not that of the types: run this test with UPDATE_SCHEMAS=1 and review the difference"
        );
    }
}

#[test]
fn all_scenario_files_are_valid() {
    let (scenario, robot) = (file_schema(FileKind::Scenario), file_schema(FileKind::Robot));
    let scenarios = root().join("scenarios");
    let layers =
        [scenarios.clone(), scenarios.join("presets")].iter().flat_map(|folder| toml_files(folder)).collect::<Vec<_>>();
    assert!(layers.len() > 8, "{layers:?}");
    // Resolved scenarios of runs are layers too; those of versions that had a filter of their own stay as they were.
    let results = std::fs::read_dir(root().join("assets/results")).unwrap().map(|entry| entry.unwrap().path());
    let resolved = results
        .map(|folder| folder.join("scenario.toml"))
        .filter(|file| std::fs::read_to_string(file).is_ok_and(|text| !text.contains("[belief.weighted]")));
    for file in layers.into_iter().chain(resolved) {
        assert_eq!(problem(&scenario, &scenario, &read(&file), ""), None, "{}", file.display());
    }
    for file in toml_files(&scenarios.join("robots")) {
        assert_eq!(problem(&robot, &robot, &read(&file), ""), None, "{}", file.display());
        assert_eq!(problem(&scenario, &scenario, &read(&file), ""), None, "{}", file.display());
    }
}

#[test]
fn mistakes_are_found() {
    let (scenario, robot) = (file_schema(FileKind::Scenario), file_schema(FileKind::Robot));
    let check = |schema: &Value, text: &str| {
        let value = toml::from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        problem(schema, schema, &value, "").unwrap_or_default()
    };
    let cases = [
        ("[task]\nhorizn = 3", "task.horizn"),
        ("[task]\nhorizon = \"far\"", "task.horizon"),
        ("[task]\nhorizon = -1", "task.horizon"),
        ("[belief]\nfilter = \"kalman\"", "belief.filter"),
        // Whole or not at all: lists, effects and choices.
        ("[distribution.object]\nshape = [1.0]", "distribution.object.shape"),
        (
            "[distribution.object]\ncom_m = [{ mean = 0.0 }, { mean = 0.0 }, { mean = 0.0 }]",
            "distribution.object.com_m",
        ),
        ("[planner]\nbudget = { transitions = 1, simulations = 1 }", "planner.budget"),
        ("[effects]\ntruth = [{ table_tilt = { slope_x_rad = 0.0 } }]", "effects.truth"),
        ("[effects]\ntruth = [{ table_tilt = { slope_x_rad = 0.0, slope_y_rad = 1.0 } }]", "effects.truth"),
        ("[distribution.effects.table_tilt]\nslope_rad = { mean = 0.0 }", "distribution.effects.table_tilt.slope_rad"),
    ];
    for (text, key) in cases {
        let problem = check(&scenario, text);
        assert!(
            problem.starts_with(&format!("{key}:")) || problem.starts_with(&format!("{key}[0]")),
            "{text}: {problem}"
        );
    }
    // A part of a table that merges is a layer.
    assert_eq!(check(&scenario, "[distribution.object]\nfriction = { mean = 0.3 }"), "");
    assert_eq!(check(&scenario, "[distribution.effects.table_tilt]\nslope_x_rad = { mean = 0.0 }"), "");
    assert_eq!(check(&scenario, "[robot]\nname = \"mine\""), "");
    assert!(check(&robot, "[robot]\nname = \"mine\"").starts_with("robot:"));
    assert!(check(&robot, "[world]\ntable_height_m = 0.0").contains("`robot`"));
}

/// First violation of `schema`, with its key. Knows the keywords that our schemas use and refuses others. (The crate `jsonschema` would switch
/// on features of num-traits and ahash, for which rapier and parquet would be compiled a second time.)
fn problem(root: &Value, schema: &Value, value: &Value, key: &str) -> Option<String> {
    let schema = match schema {
        Value::Bool(true) => return None,
        Value::Bool(false) => return Some(format!("{key}: not allowed")),
        Value::Object(schema) => schema,
        _ => panic!("{key}: no schema: {schema}"),
    };
    let below = |name: &str| if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
    schema.iter().find_map(|(keyword, rule)| {
        let list = || rule.as_array().unwrap_or_else(|| panic!("{key}: {keyword} is no list"));
        let fits = |rule: &Value| problem(root, rule, value, key).is_none();
        let fail = |good: bool| (!good).then(|| format!("{key}: {keyword} {rule}, found {value}"));
        match keyword.as_str() {
            "$ref" => problem(root, root.pointer(&rule.as_str().unwrap()[1..]).unwrap(), value, key),
            "allOf" => list().iter().find_map(|rule| problem(root, rule, value, key)),
            "anyOf" => fail(list().iter().any(fits)),
            "oneOf" => fail(list().iter().filter(|rule| fits(rule)).count() == 1),
            "type" => fail(match rule.as_str().unwrap() {
                "object" => value.is_object(),
                "array" => value.is_array(),
                "string" => value.is_string(),
                "boolean" => value.is_boolean(),
                "integer" => value.is_i64() || value.is_u64(),
                "number" => value.is_number(),
                "null" => value.is_null(),
                other => panic!("{key}: type {other}"),
            }),
            "const" => fail(rule == value),
            "enum" => fail(list().contains(value)),
            "minimum" => fail(value.as_f64() >= rule.as_f64()),
            "maximum" => fail(value.as_f64() <= rule.as_f64()),
            "minItems" => fail(value.as_array().unwrap().len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => fail(value.as_array().unwrap().len() as u64 <= rule.as_u64().unwrap()),
            "items" => value.as_array().unwrap().iter().enumerate().find_map(|(index, value)| {
                let rule = rule.get(index).unwrap_or(rule);
                problem(root, rule, value, &format!("{key}[{index}]"))
            }),
            "required" => {
                let missing = list().iter().find(|name| value.get(name.as_str().unwrap()).is_none());
                missing.map(|name| format!("{key}: expected `{}`", name.as_str().unwrap()))
            }
            "properties" => rule
                .as_object()
                .unwrap()
                .iter()
                .find_map(|(name, rule)| value.get(name).and_then(|value| problem(root, rule, value, &below(name)))),
            "additionalProperties" => {
                let known = schema.get("properties");
                let mut others =
                    value.as_object()?.iter().filter(|(name, _)| known.and_then(|k| k.get(name)).is_none());
                others.find_map(|(name, value)| problem(root, rule, value, &below(name)))
            }
            "$schema" | "title" | "description" | "definitions" | "format" | "default" | "x-unit" | "x-quantity" => {
                None
            }
            other => panic!("{key}: keyword {other}"),
        }
    })
}
