//! What every key of a resolved scenario is, and which layer says so.

use serde::Serialize;
use serde_json::Value as Schema;
use toml::Value;

use crate::format::{QUANTITY, UNIT, resolved, target, variants};
use crate::layers::Source;
use crate::{Error, Scenario, Selection};

/// One key of a resolved scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// Path, with dots and places in lists.
    pub key: String,
    /// Value.
    pub value: Value,
    /// Unit. Empty for a number without one and for other values.
    pub unit: String,
    /// What it is.
    pub meaning: String,
    /// Where the value comes from.
    pub from: Source,
}

impl Selection {
    /// Reads, merges and checks the layers. For every key of the result it gives meaning, unit and source.
    ///
    /// # Errors
    ///
    /// As [`Selection::load`].
    ///
    /// # Panics
    ///
    /// Never for values that were loaded: all of them have a TOML form.
    pub fn explain(&self) -> Result<(Scenario, Vec<Explanation>), Error> {
        let layers = self.layers()?;
        let scenario = layers.resolve()?;
        let table = Value::try_from(&scenario).expect("a scenario holds only what TOML can express");
        let schema = resolved();
        let mut found = Vec::new();
        let root = Place {
            schema: &schema,
            node: &schema,
            meaning: String::new(),
            context: String::new(),
            unit: String::new(),
        };
        leaves(&root, "", &table, &mut |key, value, place| {
            found.push(Explanation {
                from: layers.source(key, &self.root),
                key: key.into(),
                value: value.clone(),
                unit: if is_number(value) { place.unit.clone() } else { String::new() },
                meaning: place.said_of(value),
            });
        });
        Ok((scenario, found))
    }
}

/// Paths of all keys that tables may hold, lists and choices apart.
pub(crate) fn known_keys() -> Vec<String> {
    fn collect(schema: &Schema, node: &Schema, path: &str, found: &mut Vec<String>) {
        for (key, property) in target(schema, node).get("properties").and_then(Schema::as_object).into_iter().flatten()
        {
            let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            collect(schema, property, &path, found);
            found.push(path);
        }
    }
    let schema = resolved();
    let mut found = Vec::new();
    collect(&schema, &schema, "", &mut found);
    found
}

/// A place in the schema on the way to a value.
#[derive(Clone)]
struct Place<'a> {
    schema: &'a Schema,
    node: &'a Schema,
    meaning: String,
    /// Meaning of the quantity that the keys below give a distribution.
    context: String,
    unit: String,
}

impl Place<'_> {
    fn below(&self, property: Option<&str>) -> Self {
        let node = target(self.schema, self.node);
        let (child, description) = match property {
            Some(name) => self.property(node, name),
            None => (node.get("items").map(|items| items.get(0).unwrap_or(items)), None),
        };
        let Some(child) = child else { return self.clone() };
        let of = |key: &str| child.get(key).or_else(|| target(self.schema, child).get(key)).and_then(Schema::as_str);
        let meaning =
            match child.get("description").and_then(Schema::as_str).or(description).or_else(|| of("description")) {
                // What a list holds is explained by the key of the list.
                Some(meaning) if property.is_some() => meaning.to_string(),
                _ => self.meaning.clone(),
            };
        let quantity = node.get(QUANTITY).is_some();
        let context = if quantity { self.meaning.clone() } else { String::new() };
        let unit = of(UNIT).map_or_else(|| self.unit.clone(), String::from);
        Self { schema: self.schema, node: child, meaning, context, unit }
    }

    /// Schema of a key, and the description of the alternative that it stands for.
    fn property<'b>(&self, node: &'b Schema, name: &str) -> (Option<&'b Schema>, Option<&'b str>) {
        if let Some(child) = node["properties"].get(name) {
            return (Some(child), None);
        }
        let variant = variants(node).find_map(|variant| Some((variant["properties"].get(name)?, variant)));
        match variant {
            Some((child, variant)) => (Some(child), variant["description"].as_str()),
            None => (node.get("additionalProperties").filter(|values| values.is_object()), None),
        }
    }

    /// The meaning, and the meaning of the alternative that `value` names.
    fn said_of(&self, value: &Value) -> String {
        let mut said = [self.context.as_str(), self.meaning.as_str()].join(" ").trim().to_string();
        let node = target(self.schema, self.node);
        let named = value.as_str().and_then(|name| variants(node).find(|variant| variant["const"] == name));
        if let (Some(name), Some(about)) = (value.as_str(), named.and_then(|variant| variant["description"].as_str())) {
            said = format!("{said} {name}: {about}");
        }
        said
    }
}

/// Calls `leaf` for every value except tables and lists of tables or lists.
fn leaves(place: &Place<'_>, path: &str, value: &Value, leaf: &mut impl FnMut(&str, &Value, &Place<'_>)) {
    match value {
        Value::Table(table) if !table.is_empty() => {
            for (key, value) in table {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                leaves(&place.below(Some(key)), &path, value, leaf);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_table) => {
            for (index, value) in list.iter().enumerate() {
                leaves(&place.below(None), &format!("{path}[{index}]"), value, leaf);
            }
        }
        _ => leaf(path, value, place),
    }
}

fn is_number(value: &Value) -> bool {
    match value {
        Value::Array(list) => list.iter().all(is_number),
        value => value.is_integer() || value.is_float(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::layers::LayerKind;

    fn explain(set: &[&str]) -> Vec<Explanation> {
        let root = crate::find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let set = set.iter().map(ToString::to_string).collect();
        Selection { domain: "D4".into(), set, ..Selection::new(root) }.explain().unwrap().1
    }

    fn of<'a>(all: &'a [Explanation], key: &str) -> &'a Explanation {
        all.iter().find(|e| e.key == key).unwrap_or_else(|| panic!("{key}"))
    }

    #[test]
    fn every_key_names_its_layer() {
        let all = explain(&["task.horizon=7"]);
        let from = |key: &str| (of(&all, key).from.layer, of(&all, key).from.name.clone());
        assert_eq!(from("world.control_steps"), (LayerKind::Base, "scenarios/base.toml".into()));
        assert_eq!(from("robot.name"), (LayerKind::Robot, "scenarios/robots/sawyer.toml".into()));
        assert_eq!(from("planner.budget.transitions"), (LayerKind::Preset, "scenarios/presets/paper.toml".into()));
        assert_eq!(from("world.obstacle_mobility"), (LayerKind::Domain, "scenarios/d4.toml".into()));
        assert_eq!(from("task.horizon"), (LayerKind::Set, "--set task.horizon=7".into()));
        // Lists replace as a whole.
        assert_eq!(from("effects.truth[0].rolling_resistance.lever_m").0, LayerKind::Base);
        assert_eq!(from("distribution.object.size_m.box[2].stddev").0, LayerKind::Base);
        // No file has to say it.
        assert_eq!(from("planner.backup").0, LayerKind::Format);
    }

    #[test]
    fn every_key_has_a_meaning_and_quantities_have_units() {
        let all = explain(&[
            "distribution.effects.rolling_resistance.lever_m={ mean = 0.002, stddev = 0.001, low = 0.0, high = 0.005 }",
        ]);
        assert!(all.len() > 150, "{}", all.len());
        for explanation in &all {
            assert!(explanation.meaning.len() > 2, "{explanation:?}");
        }
        let unit = |key: &str| of(&all, key).unit.as_str();
        assert_eq!(unit("world.gravity_mps2"), "m/s²");
        assert_eq!(unit("distribution.object.size_m.box[1].low"), "m");
        assert_eq!(unit("distribution.object.mass_kg.mean"), "kg");
        assert_eq!(unit("distribution.object.mass_kg.shape"), "");
        assert_eq!(unit("distribution.effects.rolling_resistance.lever_m.mean"), "m");
        assert_eq!(unit("robot.locked_joints.head_pan"), "rad or m");
        assert_eq!(unit("sensor.large_force_limit"), "N or N·m");
        assert_eq!(unit("robot.name"), "");
        let meaning = |key: &str| of(&all, key).meaning.as_str();
        assert_eq!(meaning("task.horizon"), "Most actions in an episode.");
        assert_eq!(meaning("distribution.object.size_m.box[1].low"), "Box: full lengths x, y, z. Smallest value.");
        assert!(meaning("belief.filter").contains("rejection: As published"), "{}", meaning("belief.filter"));
        assert!(meaning("planner.budget.transitions").starts_with("At most this many transitions"));
        assert!(meaning("effects.model[0].rolling_resistance.lever_m").contains("Plausible"));
    }
}
