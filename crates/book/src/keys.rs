//! The pages of keys: what scenario and robot files may hold, from their schemas, with the values that a scenario gets.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use scenario::{Explanation, FileKind, LayerKind, Selection, file_schema};
use serde_json::Value;

use crate::Page;
use crate::markdown::{MADE, cell, code, escaped, table};

/// Whose values the page of scenario keys shows.
const SHOWN: (&str, &str, &str) = ("D4", "sawyer", "surmise");
/// Tables that are lists of effects or maps of them: the page of effects has their keys.
const EFFECTS: [&str; 3] = ["effects.truth", "effects.model", "distribution.effects"];

/// One key of a file.
#[derive(Debug)]
struct Key {
    path: String,
    values: String,
    unit: String,
    meaning: String,
}

pub(crate) fn scenario_page(root: &Path) -> Result<Page> {
    let (domain, robot, preset) = SHOWN;
    let schema = file_schema(FileKind::Scenario);
    let selection =
        Selection { domain: domain.into(), robot: robot.into(), preset: preset.into(), ..Selection::new(root) };
    let (_, explained) = selection.explain()?;
    let mut tables: BTreeMap<String, Vec<Vec<String>>> = BTreeMap::new();
    for key in keys(&schema).iter().filter(|key| !key.path.starts_with("robot.")) {
        let first = key.path.split('.').next().unwrap_or_default();
        let group = if first == key.path { "At the top" } else { first };
        let (value, layer) = value(&explained, &key.path);
        let row = [code(&key.path), cell(&key.values), cell(&key.unit), cell(&key.meaning), cell(&value), layer];
        tables.entry(group.into()).or_default().push(row.to_vec());
    }
    let mut text = format!(
        "{MADE}\n# Scenario keys\n\nThis page lists every key that a scenario file may hold: what it may be, and what it means.\n\n\
         A scenario is made of layers. Later layers win, key by key: `scenarios/base.toml`, then the robot, the preset, the domain, and what \
         `--set KEY=VALUE` says. The last two columns show one scenario: the value of each key in domain {domain} with the robot `{robot}` and the preset \
         `{preset}`, and the layer that it comes from. `cargo xtask scenario check DOMAIN` prints the same of any scenario. \
         Keys of the arm stand on [their own page](robot-keys.md), parameters of effects on the [page of effects](effects.md).\n"
    );
    for (group, rows) in &tables {
        let about = schema["properties"][group]["description"].as_str().unwrap_or("Keys outside of tables.");
        text += &format!("\n## {group}\n\n{}\n\n", escaped(about));
        text += &table(&["key", "values", "unit", "meaning", "value", "layer"], rows);
    }
    text += &distributions(&schema);
    Ok(Page::new("reference/scenario-keys.md", text))
}

pub(crate) fn robot_page(root: &Path) -> Result<Page> {
    let schema = file_schema(FileKind::Robot);
    let explain = |robot: &str| {
        let selection = Selection { domain: "D1".into(), robot: robot.into(), ..Selection::new(root) };
        selection.explain().map(|(_, explained)| explained)
    };
    let (sawyer, jaco) = (explain("sawyer")?, explain("jaco")?);
    let mut rows = Vec::new();
    for key in keys(&schema).iter().filter(|key| key.path.starts_with("robot.")) {
        let [sawyer, jaco] = [&sawyer, &jaco].map(|explained| cell(&value(explained, &key.path).0));
        rows.push(vec![code(&key.path), cell(&key.values), cell(&key.unit), cell(&key.meaning), sawyer, jaco]);
    }
    let text = format!(
        "{MADE}\n# Robot keys\n\nThis page lists the keys of a robot file in `scenarios/robots/`, which describes an arm.\n\n\
         All of them are needed: an arm is described by one file. The file may also hold keys of a scenario, such as `world.table_height_m` and \
         `task.tool_start_m`: they say where the table is and where the task takes place. They stand on the page of \
         [scenario keys](scenario-keys.md).\n\n## robot\n\n{}",
        table(&["key", "values", "unit", "meaning", "sawyer", "jaco"], &rows)
    );
    Ok(Page::new("reference/robot-keys.md", text))
}

/// Keys of one quantity that is drawn at random.
fn distributions(schema: &Value) -> String {
    let mut text =
        "\n## Distributions\n\nWhere a key takes a distribution, it is a table with these keys.\n".to_owned();
    for (name, definition) in schema["definitions"].as_object().into_iter().flatten() {
        if definition.get("x-quantity").is_none() || !name.ends_with("Part") {
            continue;
        }
        let keys = definition["properties"].as_object().into_iter().flatten();
        let rows: Vec<Vec<String>> =
            keys.map(|(key, node)| vec![code(key), cell(node["description"].as_str().unwrap_or_default())]).collect();
        let about = definition["description"].as_str().unwrap_or_default();
        text += &format!("\n{}\n\n{}", escaped(about), table(&["key", "meaning"], &rows));
    }
    text
}

/// Value of a key in an explained scenario, and its layer.
fn value(explained: &[Explanation], key: &str) -> (String, String) {
    let below: Vec<&Explanation> = explained
        .iter()
        .filter(|one| one.key.strip_prefix(key).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '['])))
        .collect();
    let Some(first) = below.first() else { return (String::new(), String::new()) };
    let layer = match first.from.layer {
        LayerKind::Format => "format",
        LayerKind::Base => "base",
        LayerKind::Robot => "robot",
        LayerKind::Preset => "preset",
        LayerKind::Domain => "domain",
        _ => "",
    };
    let shown = match below[..] {
        [one] if one.key == key => shown(&one.value),
        // A distribution or another table: its keys, unless there are more than a line holds.
        _ if below.len() <= 5 => {
            let name = |one: &Explanation| one.key[key.len()..].trim_start_matches('.').to_owned();
            below.iter().map(|one| format!("{} = {}", name(one), shown(&one.value))).collect::<Vec<_>>().join(", ")
        }
        _ => format!("{} values", below.len()),
    };
    (shown, layer.into())
}

fn shown(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), ToOwned::to_owned)
}

/// All keys of a schema, those of nested tables with dots.
fn keys(schema: &Value) -> Vec<Key> {
    let mut found = Vec::new();
    collect(schema, schema, "", "", &mut found);
    found
}

/// The node that `node` refers to, or itself. A table that may be left out is `anyOf` of it and null.
fn target<'a>(schema: &'a Value, node: &'a Value) -> &'a Value {
    let optional = match node["anyOf"].as_array().map(Vec::as_slice) {
        Some([table, null]) if null["type"] == "null" => Some(table),
        _ => None,
    };
    let wrapped = node.get("allOf").and_then(|all| all.get(0)).or(optional).unwrap_or(node);
    let name = wrapped.get("$ref").and_then(Value::as_str).and_then(|path| path.rsplit('/').next());
    name.map_or(node, |name| &schema["definitions"][name])
}

fn alternatives(node: &Value) -> Vec<&Value> {
    ["oneOf", "anyOf"].iter().filter_map(|key| node.get(*key)?.as_array()).flatten().collect()
}

fn collect(schema: &Value, node: &Value, path: &str, about: &str, found: &mut Vec<Key>) {
    let about_of = |node: &Value| node["description"].as_str().map(str::to_owned);
    let inner = target(schema, node);
    let about = about_of(node).or_else(|| (!about.is_empty()).then(|| about.to_owned())).or_else(|| about_of(inner));
    let about = about.unwrap_or_default();
    let unit = [node, inner].iter().find_map(|node| node["x-unit"].as_str()).unwrap_or_default().to_owned();
    let mut leaf = |values: String| {
        found.push(Key { path: path.into(), values, unit: unit.clone(), meaning: about.clone() });
    };
    if EFFECTS.contains(&path) {
        return leaf("effects".into());
    }
    if inner.get("x-quantity").is_some() {
        return leaf("distribution".into());
    }
    let choices = alternatives(inner);
    let names: Vec<&str> = choices.iter().filter_map(|choice| choice["const"].as_str()).collect();
    if !names.is_empty() {
        leaf(format!("`{}`{}", names.join("`, `"), if names.len() < choices.len() { ", or a table" } else { "" }));
    }
    let tables = choices.iter().filter(|choice| choice.get("properties").is_some());
    let holders: Vec<&Value> =
        std::iter::once(inner).filter(|node| node.get("properties").is_some()).chain(tables.copied()).collect();
    if holders.is_empty() && names.is_empty() {
        return leaf(kind(inner));
    }
    for holder in holders {
        let about = if std::ptr::eq(holder, inner) { String::new() } else { about_of(holder).unwrap_or_default() };
        for (key, child) in holder["properties"].as_object().into_iter().flatten() {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            collect(schema, child, &path, &about, found);
        }
    }
}

/// What a value may be, in words.
fn kind(node: &Value) -> String {
    let limits = match (node["minimum"].as_f64(), node["maximum"].as_f64()) {
        (Some(low), Some(high)) => format!(", {low} to {high}"),
        (Some(low), None) => format!(", from {low}"),
        (None, Some(high)) => format!(", up to {high}"),
        (None, None) => String::new(),
    };
    let name = match node["type"].as_str() {
        Some("integer") => "whole number",
        Some("number") => "number",
        Some("string") => "text",
        Some("boolean") => "true or false",
        Some("array") => "list",
        Some("object") => "table",
        _ => "number or text",
    };
    format!("{name}{limits}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> std::path::PathBuf {
        scenario::find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    #[test]
    fn every_key_of_a_resolved_scenario_stands_on_a_page() {
        let (pages, root) = ([scenario_page(&root()).unwrap(), robot_page(&root()).unwrap()], root());
        for robot in ["sawyer", "jaco"] {
            let selection =
                Selection { domain: "D4".into(), robot: robot.into(), preset: "paper".into(), ..Selection::new(&root) };
            for one in selection.explain().unwrap().1 {
                // The key itself, or the table or list that it is a part of.
                let plain = one.key.split('[').next().unwrap();
                let mut whole: Vec<&str> = plain.split('.').collect();
                let stands = std::iter::from_fn(|| {
                    let key = (!whole.is_empty()).then(|| whole.join("."));
                    whole.pop();
                    key
                });
                let found = |key: String| pages.iter().any(|page| page.text.contains(&format!("| `{key}` |")));
                assert!(stands.into_iter().any(found), "{}", one.key);
            }
        }
    }

    #[test]
    fn a_row_says_values_unit_meaning_and_layer() {
        let text = scenario_page(&root()).unwrap().text;
        let row = |key: &str| {
            text.lines().find(|line| line.starts_with(&format!("| `{key}` |"))).unwrap_or_else(|| panic!("{key}"))
        };
        assert!(
            row("world.gravity_mps2").contains("| m/s² |") && row("world.gravity_mps2").ends_with("| 9.81 | base |")
        );
        assert!(row("task.horizon").contains("whole number"));
        assert!(row("belief.filter").contains("`rejection`"));
        assert!(row("distribution.object.mass_kg").contains("distribution"));
        assert!(row("planner.budget.transitions").contains("At most this many transitions"));
        assert!(!text.contains("viscous"), "effects have their own page");
    }
}
