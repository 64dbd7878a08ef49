//! Definitions of messages in the text that ROS writes (`ros2msg`, `ros1msg`), parsed.
//!
//! The format: [ROS 2 interfaces](https://docs.ros.org/en/jazzy/Concepts/Basic/About-Interfaces.html); several definitions follow each other,
//! separated by a line of `=` and one that begins with `MSG:`, as the [MCAP registry](https://mcap.dev/spec/registry) says.

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::error::excerpt;

/// Size of a definition at most, and of its parts.
const MAX_BYTES: usize = 1 << 20;
const MOST_FIELDS: usize = 4096;

/// What a field holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Bool,
    Unsigned(u8),
    Signed(u8),
    Float(u8),
    Text,
    WideText,
    /// Two numbers of 32 bits, as ROS 1 has it. In ROS 2 they are messages, with the same bytes.
    Time,
    Duration,
    /// An index of [`Schema::types`].
    Message(usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Count {
    One,
    Fixed(usize),
    Any,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    pub(crate) name: Rc<str>,
    pub(crate) kind: Kind,
    pub(crate) count: Count,
}

/// A message type with all that it is made of; the first is the message itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Schema {
    pub(crate) types: Vec<Vec<Field>>,
}

/// A field before the names of messages are looked up.
struct Parsed {
    name: String,
    kind: String,
    count: Count,
}

/// What ROS 2 knows without a definition, if an old writer left it out.
const KNOWN: [(&str, &str); 2] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec"),
];

impl Schema {
    /// Parses the definition of the message `name`, such as `geometry_msgs/msg/PoseStamped`.
    pub(crate) fn parse(name: &str, text: &str) -> Result<Self, String> {
        if text.len() > MAX_BYTES {
            return Err(format!("expected a definition of at most {MAX_BYTES} bytes, found {}", text.len()));
        }
        let mut parsed: Vec<(String, Vec<Parsed>)> = vec![(short(name), Vec::new())];
        let mut fields = 0;
        for line in text.lines() {
            let trimmed = line.trim();
            if trimmed.len() >= 8 && trimmed.bytes().all(|byte| byte == b'=') {
                continue;
            }
            if let Some(name) = trimmed.strip_prefix("MSG:") {
                parsed.push((short(name.trim()), Vec::new()));
            } else if trimmed.starts_with("IDL:") || trimmed.starts_with("module ") {
                return Err("expected definitions in the format ros2msg, found IDL".into());
            } else if let Some(field) = field(trimmed)? {
                fields += 1;
                if fields > MOST_FIELDS {
                    return Err(format!("expected at most {MOST_FIELDS} fields, found more"));
                }
                if let Some((_, list)) = parsed.last_mut() {
                    list.push(field);
                }
            }
        }
        for (name, text) in KNOWN {
            if !parsed.iter().any(|(other, _)| other == name) {
                let fields = text.lines().filter_map(|line| field(line).ok().flatten()).collect();
                parsed.push((name.into(), fields));
            }
        }
        link(&parsed)
    }
}

/// `geometry_msgs/msg/Pose` as `geometry_msgs/Pose`.
fn short(name: &str) -> String {
    name.replace("/msg/", "/")
}

fn link(parsed: &[(String, Vec<Parsed>)]) -> Result<Schema, String> {
    let mut index = BTreeMap::new();
    for (i, (name, _)) in parsed.iter().enumerate() {
        index.entry(name.as_str()).or_insert(i);
    }
    let mut types = Vec::new();
    for (owner, fields) in parsed {
        let package = owner.split('/').next().unwrap_or_default();
        let link = |field: &Parsed| {
            let kind = match primitive(&field.kind) {
                Some(kind) => kind,
                None => {
                    let full = short(&field.kind);
                    let local = format!("{package}/{full}");
                    let header = full == "Header";
                    let found = index.get(full.as_str()).or_else(|| index.get(local.as_str()));
                    let found = found.or_else(|| index.get("std_msgs/Header").filter(|_| header));
                    let place =
                        found.ok_or_else(|| format!("expected a definition of {}, found none", excerpt(&full)))?;
                    Kind::Message(*place)
                }
            };
            Ok(Field { name: field.name.as_str().into(), kind, count: field.count })
        };
        types.push(fields.iter().map(link).collect::<Result<Vec<Field>, String>>()?);
    }
    Ok(Schema { types })
}

fn primitive(kind: &str) -> Option<Kind> {
    Some(match kind {
        "bool" | "boolean" => Kind::Bool,
        "uint8" | "byte" | "octet" => Kind::Unsigned(1),
        "char" => Kind::Unsigned(1),
        "uint16" => Kind::Unsigned(2),
        "uint32" => Kind::Unsigned(4),
        "uint64" => Kind::Unsigned(8),
        "int8" => Kind::Signed(1),
        "int16" => Kind::Signed(2),
        "int32" => Kind::Signed(4),
        "int64" => Kind::Signed(8),
        "float32" | "float" => Kind::Float(4),
        "float64" | "double" => Kind::Float(8),
        "string" => Kind::Text,
        "wstring" => Kind::WideText,
        "time" => Kind::Time,
        "duration" => Kind::Duration,
        _ => return None,
    })
}

/// A field of a line; none in a line without one, and none for a constant.
fn field(line: &str) -> Result<Option<Parsed>, String> {
    let code = line.split('#').next().unwrap_or_default().trim();
    if code.is_empty() {
        return Ok(None);
    }
    let wrong = || format!("expected a type and a name, found {}", excerpt(code));
    let (kind, rest) = code.split_once(char::is_whitespace).ok_or_else(wrong)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    if name.is_empty() {
        return Err(wrong());
    }
    if after.trim_start().starts_with('=') {
        return Ok(None);
    }
    let (kind, count) = match kind.strip_suffix(']').and_then(|k| k.rsplit_once('[')) {
        None => (kind, Count::One),
        Some((kind, "")) => (kind, Count::Any),
        Some((kind, bound)) if bound.starts_with("<=") => (kind, Count::Any),
        Some((kind, number)) => (kind, Count::Fixed(number.parse().map_err(|_| wrong())?)),
    };
    // A bound of a text says nothing of how it is written.
    let kind = kind.split("<=").next().unwrap_or_default();
    Ok(Some(Parsed { name: name.into(), kind: kind.into(), count }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
# A comment.
int32 MODE=1          # a constant
string<=10 name \"x\"
float64[<=3] some     # bounded
uint8[4] four
Header header
Point[] points
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: pkg/Point
float64 x 1.5
";

    #[test]
    fn fields_constants_bounds_and_other_messages_are_told_apart() {
        let schema = Schema::parse("pkg/msg/Thing", TEXT).unwrap();
        let of = |i: usize| -> Vec<(&str, &Kind, Count)> {
            schema.types[i].iter().map(|f| (&*f.name, &f.kind, f.count)).collect()
        };
        assert_eq!(
            of(0),
            [
                ("name", &Kind::Text, Count::One),
                ("some", &Kind::Float(8), Count::Any),
                ("four", &Kind::Unsigned(1), Count::Fixed(4)),
                ("header", &Kind::Message(1), Count::One),
                ("points", &Kind::Message(2), Count::Any),
            ]
        );
        assert_eq!(of(1)[0], ("stamp", &Kind::Message(3), Count::One));
        assert_eq!(of(3), [("sec", &Kind::Signed(4), Count::One), ("nanosec", &Kind::Unsigned(4), Count::One)]);
    }

    #[test]
    fn what_is_missing_or_no_definition_is_said() {
        let message = Schema::parse("a/B", "Pose pose").unwrap_err();
        assert_eq!(message, "expected a definition of `Pose`, found none");
        assert!(Schema::parse("a/B", "float64").unwrap_err().contains("a type and a name"));
        assert!(Schema::parse("a/B", "uint8[x] y").is_err());
        assert!(Schema::parse("a/B", "module a {").unwrap_err().contains("found IDL"));
    }
}
