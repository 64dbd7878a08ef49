//! What topics a source holds, and what they may be.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path as FilePath;

use crate::Error;
use crate::columns::role;
use crate::draft::median_step;
use crate::messages::{Message, Sink};
use crate::value::{Value, join};

/// Messages of a topic that are looked at, and topics.
const LOOKED_AT: usize = 20;
const MOST_TOPICS: usize = 1000;

#[derive(Debug, Default)]
pub(crate) struct Topic {
    pub(crate) kind: String,
    pub(crate) problem: Option<String>,
    value: Option<Value>,
    log_secs: Vec<f64>,
}

/// Looks at the first messages of each topic.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    pub(crate) topics: BTreeMap<String, Topic>,
}

impl Sink for Survey {
    fn channel(&mut self, _path: &FilePath, topic: &str, kind: &str, problem: Option<&str>) -> Result<(), Error> {
        if self.topics.len() < MOST_TOPICS {
            let entry = self.topics.entry(topic.into()).or_default();
            (entry.kind, entry.problem) = (kind.into(), problem.map(String::from));
        }
        Ok(())
    }

    fn wants(&self, topic: &str) -> bool {
        self.topics.get(topic).is_some_and(|topic| topic.log_secs.len() < LOOKED_AT)
    }

    #[expect(clippy::cast_precision_loss, reason = "differences of a few messages")]
    fn message(&mut self, message: &Message<'_>) -> Result<(), Error> {
        if let Some(topic) = self.topics.get_mut(message.topic) {
            topic.log_secs.push(message.log_nanos as f64 / 1e9);
            // The fullest: some parts are not there in every message.
            if topic.value.as_ref().is_none_or(|value| size(value) < size(&message.value)) {
                topic.value = Some(message.value.clone());
            }
        }
        Ok(())
    }
}

/// A quantity that a topic may hold.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) role: &'static str,
    pub(crate) topic: String,
    pub(crate) at: String,
    /// Keys and paths.
    keys: Vec<(&'static str, String)>,
}

impl Found {
    /// Its table in a mapping.
    pub(crate) fn section(&self, other_clock: bool) -> String {
        let quoted = |text: &str| toml::Value::String(text.into()).to_string();
        let mut text = format!("[{}]\ntopic = {}  # GUESS\n", self.role, quoted(&self.topic));
        if !self.at.is_empty() {
            let _ = writeln!(text, "at = {}", quoted(&self.at));
        }
        for (key, path) in &self.keys {
            let _ = writeln!(text, "{key} = {}", quoted(path));
        }
        if self.role == "wrench" {
            text.push_str(
                "of = \"world\"                    # GUESS: the force of the world on the tool, or of the tool\n",
            );
            text.push_str("axes = \"world\"                  # GUESS: world, tool, or sensor with its mount\n");
        } else {
            text.push_str("unit = \"m\"                      # GUESS\n");
        }
        if other_clock {
            text.push_str("stamp = \"log\"                   # GUESS: its messages have no header\n");
        }
        text
    }
}

impl Survey {
    /// The first candidate for each quantity.
    pub(crate) fn chosen(&self) -> Vec<Found> {
        let mut all: Vec<Found> = Vec::new();
        for (name, topic) in &self.topics {
            let Some(value) = &topic.value else { continue };
            walk(name, "", "", value, &mut all);
        }
        let mut chosen: Vec<Found> = Vec::new();
        for found in all {
            if !chosen.iter().any(|other| other.role == found.role) {
                chosen.push(found);
            }
        }
        chosen
    }

    /// A topic whose name says that it counts episodes, and its field.
    pub(crate) fn episode(&self) -> Option<(&str, String)> {
        self.topics.iter().find_map(|(name, topic)| {
            let words = ["episode", "trial"];
            let field =
                topic.fields().into_iter().find(|field| ["data", "value", "episode", "id"].contains(&field.as_str()));
            words.iter().any(|word| name.to_lowercase().contains(word)).then_some(())?;
            Some((name.as_str(), field?))
        })
    }
}

/// Numbers and texts in a value.
fn size(value: &Value) -> usize {
    match value {
        Value::Missing => 0,
        Value::Struct(fields) => fields.iter().map(|(_, value)| size(value)).sum(),
        Value::List(list) => list.iter().map(size).sum(),
        _ => 1,
    }
}

/// Whether a value has numbers under all of these names.
fn has(value: &Value, names: &[&str]) -> bool {
    names.iter().all(|name| value.part(usize::MAX, name).and_then(Value::number).is_some())
}

/// Finds poses and wrenches by their structure.
fn walk(topic: &str, at: &str, prefix: &str, value: &Value, found: &mut Vec<Found>) {
    match value {
        Value::Struct(fields) => {
            let child = value.part(usize::MAX, "child_frame_id").and_then(Value::words).unwrap_or_default();
            let part = |names: [&'static str; 2]| {
                names.into_iter().find_map(|name| Some((join(prefix, name), value.part(usize::MAX, name)?)))
            };
            let keys =
                |keys: &[(&'static str, &str)]| keys.iter().map(|(key, path)| (*key, (*path).to_string())).collect();
            if let Some((position, inner)) = part(["position", "translation"])
                && has(inner, &["x", "y", "z"])
                && let Some(role) = role(&format!("{topic} {at} {prefix} {child}"))
            {
                let turned = part(["orientation", "rotation"]).filter(|(_, inner)| has(inner, &["x", "y", "z", "w"]));
                let mut all = vec![("position", position)];
                // Of a command only the position is used, and of a ball as tool; but a wrench in its axes needs the orientation.
                all.extend(turned.filter(|_| role != "command").map(|(path, _)| ("orientation", path)));
                found.push(Found { role, topic: topic.into(), at: at.into(), keys: all });
            }
            if let (Some((force, f)), Some((torque, t))) = (part(["force", "force"]), part(["torque", "torque"]))
                && has(f, &["x", "y", "z"])
                && has(t, &["x", "y", "z"])
            {
                let keys = keys(&[("force", &force), ("torque", &torque)]);
                found.push(Found { role: "wrench", topic: topic.into(), at: at.into(), keys });
            }
            for (name, inner) in fields {
                walk(topic, at, &join(prefix, name), inner, found);
            }
        }
        // A list of transforms or bodies: each is told by its name. Lists within it are left out.
        Value::List(list) if at.is_empty() => {
            for one in list.iter().take(LOOKED_AT) {
                for key in ["child_frame_id", "name"] {
                    let child = one.part(usize::MAX, key).and_then(Value::words);
                    if let Some(child) = child.filter(|child| !child.contains([']', '='])) {
                        walk(topic, &format!("{prefix}[{key}={child}]"), "", one, found);
                    }
                }
            }
        }
        _ => {}
    }
}

impl Topic {
    /// Whether the part of its messages has a stamp in a header.
    pub(crate) fn stamped(&self, at: &str) -> bool {
        let follow = |text: &str| {
            let value = self.value.as_ref()?;
            crate::value::Path::parse(text).ok()?.follow(value)
        };
        follow(&join(at, "header.stamp")).is_some() || follow("header.stamp").is_some()
    }

    /// The usual time between messages.
    pub(crate) fn step_secs(&self) -> Option<f64> {
        // Stamps of a recorder are late by a little now and then.
        median_step(&self.log_secs).map(|step| (step * 1e4).round() / 1e4).filter(|step| *step > 0.0)
    }

    /// Paths to the numbers and texts of its fullest message.
    pub(crate) fn fields(&self) -> Vec<String> {
        self.value.as_ref().map(Value::fields).unwrap_or_default()
    }
}
