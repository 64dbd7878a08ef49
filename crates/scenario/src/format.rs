//! JSON Schema of a scenario file. It is made from the types and their doc comments, the limits of effects from
//! [`physics_model::effect::Parameter`], units from the names of the keys: there is no second list of keys.

use physics_model::effect::{EffectKind, Parameter};
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use crate::Scenario;

/// Where schemas hold the types that they refer to.
pub(crate) const DEFINITIONS: &str = "definitions";

/// A key's unit, where its name does not say it or a type knows better.
pub(crate) const UNIT: &str = "x-unit";

/// Types whose keys give the distribution of one quantity. The key above names the quantity.
pub(crate) const QUANTITY: &str = "x-quantity";

/// Every quantity carries its unit at the end of its name. Longer ends come first.
const UNITS: [(&str, &str); 13] = [
    ("_nmprad", "N·m/rad"),
    ("_mps2", "m/s²"),
    ("_mps", "m/s"),
    ("_rps", "rad/s"),
    ("_npm", "N/m"),
    ("_secs", "s"),
    ("_rad", "rad"),
    ("_nm", "N·m"),
    ("_kg", "kg"),
    ("_hz", "Hz"),
    ("_n", "N"),
    ("_m", "m"),
    ("milliseconds", "ms"),
];

/// Schema of a resolved scenario: draft 7, as editors of TOML know it.
pub(crate) fn resolved() -> Value {
    let generator = SchemaSettings::draft07().into_generator();
    let mut schema = generator.into_root_schema_for::<Scenario>().to_value();
    add_effects(&mut schema);
    add_unknown_effects(&mut schema);
    tidy(&mut schema);
    schema
}

/// The schema that `node` refers to, or itself.
pub(crate) fn target<'a>(root: &'a Value, node: &'a Value) -> &'a Value {
    // Draft 7 ignores what stands beside a reference, so that a described one is wrapped.
    let wrapped = node.get("allOf").and_then(|all| all.get(0)).unwrap_or(node);
    let name = wrapped.get("$ref").and_then(Value::as_str).and_then(|path| path.rsplit('/').next());
    name.map_or(node, |name| &root[DEFINITIONS][name])
}

/// Alternatives of an enum.
pub(crate) fn variants(node: &Value) -> impl Iterator<Item = &Value> {
    ["oneOf", "anyOf"].into_iter().filter_map(|key| node.get(key)?.as_array()).flatten()
}

/// Limits and units of the parameters of effects, which their types do not say.
fn add_effects(schema: &mut Value) {
    for kind in EffectKind::ALL {
        let effects = &schema[DEFINITIONS]["EffectConfig"];
        let Some(reference) = variants(effects).find_map(|variant| variant["properties"].get(kind.name())) else {
            continue;
        };
        let name = reference["$ref"].as_str().and_then(|path| path.rsplit('/').next()).unwrap_or_default().to_string();
        for parameter in kind.parameters() {
            // Not there: an element of a list.
            if let Some(Value::Object(property)) = schema[DEFINITIONS][&name]["properties"].get_mut(parameter.name) {
                let own = property.get("description").and_then(Value::as_str).unwrap_or_default();
                let description = format!("{} {own} {}", kind.description(), ranges(parameter));
                property.insert("description".into(), description.into());
                property.insert(UNIT.into(), parameter.unit.into());
                let [low, high] = parameter.limits;
                // JSON has no infinity, and an infinite limit is no limit.
                let limits = [("minimum", low), ("maximum", high)];
                for (keyword, limit) in limits.into_iter().filter(|(_, limit)| limit.is_finite()) {
                    property.insert(keyword.into(), limit.into());
                }
            }
        }
    }
}

fn ranges(parameter: &Parameter) -> String {
    let ([a, b], [low, high], unit) = (parameter.plausible, parameter.limits, parameter.unit);
    let space = if unit.is_empty() { "" } else { " " };
    format!("Plausible {a} to {b}{space}{unit}, allowed {low} to {high}{space}{unit}.")
}

/// `distribution.effects` is a map of maps: its keys are the effects and their parameters.
fn add_unknown_effects(schema: &mut Value) {
    let closed = |properties: Map<String, Value>| json!({ "type": "object", "properties": properties, "additionalProperties": false });
    let effects = EffectKind::ALL.iter().map(|kind| {
        let parameters = kind.parameters().iter().map(|parameter| {
            let description = format!("{} {}", kind.description(), ranges(parameter));
            let reference = json!([{ "$ref": format!("#/{DEFINITIONS}/TruncatedNormal") }]);
            let value = json!({ "description": description, "allOf": reference, UNIT: parameter.unit });
            (parameter.name.to_string(), value)
        });
        let mut effect = closed(parameters.collect());
        effect["description"] = kind.description().into();
        (kind.name().to_string(), effect)
    });
    let closed = closed(effects.collect());
    let property = &mut schema[DEFINITIONS]["WorldDistribution"]["properties"]["effects"];
    for key in ["type", "properties", "additionalProperties"] {
        property[key] = closed[key].clone();
    }
}

/// Descriptions as prose, and the unit of every property.
fn tidy(node: &mut Value) {
    match node {
        Value::Object(object) => {
            if let Some(Value::String(description)) = object.get_mut("description") {
                *description = prose(description);
            }
            if let Some(Value::Object(properties)) = object.get_mut("properties") {
                for (name, property) in properties {
                    if let (Some(unit), Some(property)) = (unit(name), property.as_object_mut()) {
                        property.entry(UNIT).or_insert_with(|| unit.into());
                    }
                }
            }
            object.values_mut().for_each(tidy);
        }
        Value::Array(list) => list.iter_mut().for_each(tidy),
        _ => (),
    }
}

fn unit(key: &str) -> Option<&'static str> {
    UNITS.iter().find(|(end, _)| key.ends_with(end)).map(|(_, unit)| *unit)
}

/// A doc comment without line breaks inside paragraphs and without the links of rustdoc.
fn prose(comment: &str) -> String {
    let paragraphs = comment.split("\n\n").map(|p| p.split_whitespace().collect::<Vec<_>>().join(" "));
    let text = paragraphs.collect::<Vec<_>>().join("\n\n");
    let mut plain = String::new();
    let mut rest = text.as_str();
    while let Some((before, after)) = rest.split_once("[`") {
        let (name, mut tail) = after.split_once("`]").unwrap_or((after, ""));
        // The target of [`name`](target).
        if let Some((_, behind)) = tail.strip_prefix('(').and_then(|target| target.split_once(')')) {
            tail = behind;
        }
        let name = name.strip_prefix("crate::").unwrap_or(name);
        plain.extend([before, "`", name, "`"]);
        rest = tail;
    }
    without_paths(&(plain + rest))
}

/// Of [words](crate::path), the words.
fn without_paths(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("](") {
        let target = after.split_once(')').filter(|(target, _)| target.contains("::"));
        match (target, before.rsplit_once('[')) {
            (Some((_, behind)), Some((earlier, words))) => {
                plain.extend([earlier, words]);
                rest = behind;
            }
            _ => {
                plain.extend([before, "]("]);
                rest = after;
            }
        }
    }
    plain + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every property in `node`, with its path.
    fn properties<'a>(node: &'a Value, path: &str, found: &mut Vec<(String, &'a Value)>) {
        match node {
            Value::Object(object) => {
                for (name, property) in object.get("properties").and_then(Value::as_object).into_iter().flatten() {
                    found.push((format!("{path}.{name}"), property));
                }
                object.iter().for_each(|(key, value)| properties(value, &format!("{path}.{key}"), found));
            }
            Value::Array(list) => list.iter().for_each(|value| properties(value, path, found)),
            _ => (),
        }
    }

    #[test]
    fn links_of_rustdoc_are_words() {
        let doc = "They [are counted](crate::Report::unexpanded), as [`Tree`](crate::Tree) and [`Node`] say; see [this](page.md).";
        assert_eq!(prose(doc), "They are counted, as `Tree` and `Node` say; see [this](page.md).");
    }

    #[test]
    fn every_key_has_an_explanation() {
        let schema = resolved();
        let mut found = Vec::new();
        properties(&schema, "", &mut found);
        assert!(found.len() > 300, "{}", found.len());
        for (path, property) in found {
            // A variant of an enum is explained by the alternative, not by its only property.
            let described = |node: &Value| node["description"].as_str().is_some_and(|text| text.len() > 1);
            let variant = path.contains(".oneOf.");
            assert!(variant || described(property) || described(target(&schema, property)), "{path}");
        }
    }

    #[test]
    fn variants_of_enums_have_explanations() {
        let schema = resolved();
        for (name, definition) in schema[DEFINITIONS].as_object().unwrap() {
            for variant in variants(definition) {
                assert!(variant["description"].is_string(), "{name}: {variant}");
            }
        }
    }

    #[test]
    fn units_at_the_end_of_names_are_those_of_the_catalogue_of_effects() {
        for parameter in EffectKind::ALL.iter().flat_map(|kind| kind.parameters()) {
            if let Some(unit) = unit(parameter.name) {
                assert_eq!(unit, parameter.unit, "{}", parameter.name);
            }
        }
        assert_eq!(unit("control_period_secs"), Some("s"));
        assert_eq!(unit("horizon"), None);
    }

    #[test]
    fn doc_comments_become_prose() {
        assert_eq!(prose("One [`crate::Pomcp`]\nline."), "One `Pomcp` line.");
        assert_eq!(prose("As [`Robot::load`](super::Robot::load) does.\n\nMore."), "As `Robot::load` does.\n\nMore.");
        assert_eq!(prose("A range [0, 1)."), "A range [0, 1).");
    }
}
