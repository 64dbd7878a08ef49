//! JSON Schema of scenario files for editors. A file is a layer: it holds only what it changes.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use crate::format::{DEFINITIONS, resolved};
use crate::layers::is_choice;

/// Which files a schema is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Any layer: a domain, a preset, the base, a resolved scenario.
    Scenario,
    /// A robot: a layer that describes an arm, whole.
    Robot,
}

/// JSON Schema (draft 7) of scenario files. Layers merge table by table, so no key of a table is required. Elements of
/// lists and choices such as `planner.budget` replace as a whole, so they must be complete.
#[must_use]
pub fn file_schema(kind: FileKind) -> Value {
    let whole = resolved();
    let mut partial =
        Partial { whole: &whole, open: Vec::new(), seen: BTreeSet::new(), robot: kind == FileKind::Robot };
    let mut schema = whole.clone();
    if let Value::Object(root) = &mut schema {
        root.remove(DEFINITIONS);
        partial.relax_table(root);
        if partial.robot {
            root.insert("required".into(), json!(["robot"]));
        }
    }
    let (title, about) = match kind {
        FileKind::Scenario => {
            ("Surmise scenario", "A layer of a scenario: base, preset or domain. Later layers win, key by key.")
        }
        FileKind::Robot => {
            ("Surmise robot", "The layer of a scenario that describes an arm, and the task where it stands.")
        }
    };
    schema["title"] = title.into();
    schema["description"] = about.into();
    schema[DEFINITIONS] = Value::Object(partial.definitions(&mut schema));
    schema
}

/// Tables as a layer may hold them, with what they refer to.
struct Partial<'a> {
    whole: &'a Value,
    /// Types that are referred to as parts and not yet relaxed.
    open: Vec<String>,
    seen: BTreeSet<String>,
    robot: bool,
}

impl Partial<'_> {
    /// A table that merges: no key of it is required, and its tables merge too.
    fn relax_table(&mut self, table: &mut Map<String, Value>) {
        table.remove("required");
        if let Some(Value::Object(properties)) = table.get_mut("properties") {
            for (key, property) in properties {
                // An arm is described by one file.
                if !(is_choice(key) || self.robot && key == "robot") {
                    self.relax(property);
                }
            }
        }
        if let Some(values) = table.get_mut("additionalProperties") {
            self.relax(values);
        }
    }

    fn relax(&mut self, node: &mut Value) {
        let Value::Object(node) = node else { return };
        if let Some(Value::String(reference)) = node.get_mut("$ref") {
            let name = reference.rsplit('/').next().unwrap_or_default().to_string();
            *reference = format!("#/{DEFINITIONS}/{}", part(&name));
            if self.seen.insert(name.clone()) {
                self.open.push(name);
            }
            return;
        }
        for key in ["allOf", "oneOf", "anyOf"] {
            for alternative in node.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten() {
                // Which alternative it is has to be said; what stands in it merges.
                let which = alternative.get("required").cloned();
                self.relax(alternative);
                if let Some(which) = which {
                    alternative["required"] = which;
                }
            }
        }
        self.relax_table(node);
    }

    /// All types that `schema` refers to, as parts or whole.
    fn definitions(&mut self, schema: &mut Value) -> Map<String, Value> {
        let mut definitions = Map::new();
        while let Some(name) = self.open.pop() {
            let mut definition = self.whole[DEFINITIONS][&name].clone();
            self.relax(&mut definition);
            definitions.insert(part(&name), definition);
        }
        let mut open = references(schema);
        definitions.values().for_each(|definition| open.extend(references(definition)));
        while let Some(name) = open.pop_first() {
            if !definitions.contains_key(&name) {
                let definition = self.whole[DEFINITIONS][&name].clone();
                open.extend(references(&definition));
                definitions.insert(name, definition);
            }
        }
        definitions
    }
}

/// Name of a type that a layer may hold in part.
fn part(name: &str) -> String {
    format!("{name}Part")
}

fn references(node: &Value) -> BTreeSet<String> {
    match node {
        Value::Object(object) => {
            let own = object.get("$ref").and_then(Value::as_str).and_then(|path| path.rsplit('/').next());
            object.values().flat_map(references).chain(own.map(String::from)).collect()
        }
        Value::Array(list) => list.iter().flat_map(references).collect(),
        _ => BTreeSet::new(),
    }
}
