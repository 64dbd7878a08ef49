//! A decoded message, whatever its type was, and paths into it.

use std::rc::Rc;

/// Numbers and texts that a message may hold; more is no message that is mapped.
pub(crate) const MOST_VALUES: usize = 200_000;
/// Elements of a list of numbers from which on it is not looked at: pictures and point clouds.
pub(crate) const LONGEST_LIST: usize = 65_536;

/// Fields that are listed of a message.
const MOST_FIELDS: usize = 24;

/// A part of a message, or a cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    /// No reading, or a list that is too long to be one.
    Missing,
    Number(f64),
    Whole(i128),
    Text(String),
    List(Vec<Value>),
    Struct(Vec<(Rc<str>, Value)>),
}

impl Value {
    /// As a number; a text counts where it is one, as in tables and in JSON of some writers. Never NaN or infinite.
    #[expect(
        clippy::cast_precision_loss,
        reason = "readings have fewer than 53 bits; stamps are taken as whole numbers"
    )]
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            Self::Whole(value) => Some(*value as f64),
            Self::Text(text) => text.trim().parse().ok(),
            Self::Missing | Self::List(_) | Self::Struct(_) => None,
        }
        .filter(|value| value.is_finite())
    }

    fn field(&self, name: &str) -> Option<&Self> {
        match self {
            Self::Struct(fields) => fields.iter().find(|(field, _)| **field == *name).map(|(_, value)| value),
            _ => None,
        }
    }

    /// Part `index` of a vector: an element of a list, or the field called `name` of a message.
    pub(crate) fn part(&self, index: usize, name: &str) -> Option<&Self> {
        match self {
            Self::List(list) => list.get(index),
            other => other.field(name),
        }
    }

    /// The words of a text or a number, by which an element is chosen or an episode is named.
    pub(crate) fn words(&self) -> Option<String> {
        match self {
            Self::Text(text) => Some(text.clone()),
            Self::Whole(value) => Some(value.to_string()),
            Self::Number(value) => Some(value.to_string()),
            _ => None,
        }
    }

    /// Paths to its numbers and texts, the first ones of many; of a list of messages those of the first one.
    pub(crate) fn fields(&self) -> Vec<String> {
        let mut fields = Vec::new();
        self.list("", &mut fields);
        fields
    }

    fn list(&self, prefix: &str, fields: &mut Vec<String>) {
        if fields.len() >= MOST_FIELDS {
            return;
        }
        match self {
            Self::Struct(inner) => {
                for (name, value) in inner {
                    value.list(&join(prefix, name), fields);
                }
            }
            Self::List(inner) => match inner.first() {
                Some(first @ Self::Struct(_)) => first.list(&format!("{prefix}[0]"), fields),
                _ => fields.push(format!("{prefix}[{}]", inner.len())),
            },
            _ => fields.push(prefix.into()),
        }
    }
}

/// A path one field longer.
pub(crate) fn join(prefix: &str, name: &str) -> String {
    if prefix.is_empty() { name.to_string() } else { format!("{prefix}.{name}") }
}

#[derive(Clone, Debug, PartialEq)]
enum Step {
    Field(String),
    Index(usize),
    /// The first element whose field has this value.
    Where(Path, String),
}

/// The way to a part of a message: `pose.position`, `data[3]`, `transforms[child_frame_id=box].transform`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Path(Vec<Step>);

impl Path {
    /// Parses a path; says what was expected where it is none.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let wrong = || {
            let found = crate::error::excerpt(text);
            format!("expected a path such as pose.position, data[3] or transforms[child_frame_id=box], found {found}")
        };
        let mut steps = Vec::new();
        let mut rest = text;
        while !rest.is_empty() {
            if let Some(inside) = rest.strip_prefix('[') {
                let (inside, after) = inside.split_once(']').ok_or_else(wrong)?;
                steps.push(match inside.split_once('=') {
                    Some((field, value)) if !field.contains('[') => Step::Where(Self::parse(field)?, value.into()),
                    _ => Step::Index(inside.parse().map_err(|_| wrong())?),
                });
                rest = after;
                continue;
            }
            let name = if steps.is_empty() { rest } else { rest.strip_prefix('.').ok_or_else(wrong)? };
            let end = name.find(['.', '[']).unwrap_or(name.len());
            let word = &name[..end];
            if word.is_empty() || !word.chars().all(|c| c.is_alphanumeric() || c == '_') {
                return Err(wrong());
            }
            steps.push(Step::Field(word.into()));
            rest = &name[end..];
        }
        Ok(Self(steps))
    }

    /// What it leads to.
    pub(crate) fn follow<'a>(&self, value: &'a Value) -> Option<&'a Value> {
        self.0.iter().try_fold(value, |value, step| match (step, value) {
            (Step::Field(name), value) => value.field(name),
            (Step::Index(index), Value::List(list)) => list.get(*index),
            (Step::Where(path, expected), Value::List(list)) => {
                list.iter().find(|one| path.follow(one).and_then(Value::words).as_ref() == Some(expected))
            }
            _ => None,
        })
    }

    /// Where no element of a list has the value that the path asks for: those that there are, as the path would name them.
    pub(crate) fn others(&self, value: &Value) -> Vec<String> {
        let failing = (0..self.0.len()).find(|steps| Self(self.0[..=*steps].to_vec()).follow(value).is_none());
        let Some((Step::Where(path, _), before)) = failing.map(|at| (&self.0[at], Self(self.0[..at].to_vec()))) else {
            return Vec::new();
        };
        match before.follow(value) {
            Some(Value::List(list)) => list.iter().filter_map(|one| path.follow(one)?.words()).collect(),
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Value {
        let one = |name: &str, x: f64| {
            let fields = [("frame", Value::Text(name.into())), ("x", Value::Number(x))];
            Value::Struct(fields.map(|(name, value)| (name.into(), value)).into())
        };
        Value::Struct(vec![("list".into(), Value::List(vec![one("a", 1.0), one("b/c", 2.0)]))])
    }

    #[test]
    fn paths_lead_to_fields_elements_and_the_element_of_a_name() {
        for (path, expected) in [("list[0].x", Some(1.0)), ("list[frame=b/c].x", Some(2.0)), ("list[2].x", None)] {
            let value = sample();
            let found = Path::parse(path).unwrap().follow(&value).and_then(Value::number);
            assert_eq!(found, expected, "{path}");
        }
        assert_eq!(Path::parse("").unwrap().follow(&sample()), Some(&sample()));
    }

    #[test]
    fn an_element_of_a_name_that_is_not_there_is_told_with_those_that_are() {
        let others = |path: &str| Path::parse(path).unwrap().others(&sample());
        assert_eq!(others("list[frame=c].x"), ["a", "b/c"]);
        for path in ["list[frame=a].y", "list[7]", "lost[frame=a]", "list[frame=a].x"] {
            assert!(others(path).is_empty(), "{path}");
        }
    }

    #[test]
    fn what_is_no_path_is_refused() {
        for text in ["a..b", "a[", "a[x]", ".a", "a.b c", "a]", "a[-1]"] {
            assert!(Path::parse(text).unwrap_err().contains("expected a path"), "{text}");
        }
    }
}
