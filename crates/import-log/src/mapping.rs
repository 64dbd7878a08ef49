//! A mapping: what each channel of a log is made of. `docs/src/reference/import-mapping.md` has its keys.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use measured_log::{Header, Notes};
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use toml::Value;

use crate::Error;
use crate::error::{excerpt, read_text};
use crate::rigid::RawRigid;

/// Version of the format of mappings.
pub(crate) const VERSION: u32 = 1;

/// Size of a mapping at most.
const MAX_BYTES: u64 = 1 << 20;
/// Characters of a parser's message that are quoted.
const MESSAGE: usize = 300;

/// A mapping that was read.
#[derive(Clone, Debug)]
pub struct Mapping {
    /// Its file.
    pub(crate) path: PathBuf,
    pub(crate) header: Header,
    pub(crate) raw: Raw,
    /// Places that a draft left to be filled.
    pub(crate) unfilled: usize,
}

/// What a draft writes beside a number that somebody must fill in.
pub(crate) const FILL: &str = "# FILL";

impl Mapping {
    /// Reads a mapping.
    ///
    /// # Errors
    ///
    /// [`Error`] with the key and what was expected.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::parse(path, &read_text(path, MAX_BYTES)?)
    }

    /// The mapping in `text`, which stands in the file `path`.
    ///
    /// # Errors
    ///
    /// [`Error`] with the key and what was expected.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Error> {
        let value: toml::Table = toml::from_str(text).map_err(|e| {
            let line = whole_file::line_of(text, e.span().map_or(0, |span| span.start));
            let reason = whole_file::one_line(&whole_file::plain(e.message()), MESSAGE);
            Error::Syntax { path: path.to_owned(), reason: format!("line {line}: {reason}") }
        })?;
        // The version alone comes first, so that an old file says so instead of listing unknown keys.
        if let Some(found) = value.get("version")
            && found.as_integer() != Some(i64::from(VERSION))
        {
            let reason = format!("expected {VERSION}, found {}", excerpt(&found.to_string()));
            return Err(Error::Key { path: path.to_owned(), key: "version".into(), reason });
        }
        let raw: Raw = serde_path_to_error::deserialize(Value::Table(value)).map_err(|error| key_error(path, error))?;
        let header = header(path, raw.log.clone())?;
        let unfilled = text.lines().filter(|line| line.contains(FILL)).count();
        Ok(Self { path: path.to_owned(), header, raw, unfilled })
    }

    /// An error of a key.
    pub(crate) fn wrong(&self, key: impl Into<String>, reason: impl Into<String>) -> Error {
        Error::Key { path: self.path.clone(), key: key.into(), reason: reason.into() }
    }

    /// Comments for the `log.toml` of a log that `sources` gave by this mapping.
    #[must_use]
    pub fn notes(&self, verb: &str, sources: &[PathBuf]) -> Notes {
        let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let some: Vec<String> = sources.iter().take(5).map(name).collect();
        let more = if sources.len() > 5 { format!(" and {} more", sources.len() - 5) } else { String::new() };
        let mut note =
            format!("Imported by `import-log {verb}` from {}{more} with {}.", some.join(", "), name(&self.path));
        if self.unfilled > 0 {
            note.push_str(&format!("\n{} numbers below are placeholders of a draft, not measured.", self.unfilled));
        }
        Notes::from([("", note)])
    }

    /// Number of places that a draft marked, and that are marked still.
    #[must_use]
    pub fn unfilled(&self) -> usize {
        self.unfilled
    }
}

fn key_error(path: &Path, error: serde_path_to_error::Error<toml::de::Error>) -> Error {
    let key = whole_file::one_line(&error.path().to_string(), 200);
    let reason = whole_file::one_line(error.into_inner().message(), MESSAGE);
    Error::Key { path: path.to_owned(), key: whole_file::key_of(&key, &reason), reason: whole_file::plain(&reason) }
}

/// The header of the log: a `log.toml` in a table of the mapping.
fn header(path: &Path, mut log: toml::Table) -> Result<Header, Error> {
    log.entry("version").or_insert(Value::Integer(i64::from(measured_log::VERSION)));
    measured_log::header(path, log).map_err(|error| match error {
        measured_log::Error::Key { path, key, reason } => Error::Key { path, key: format!("log.{key}"), reason },
        other => other.into(),
    })
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Raw {
    #[serde(rename = "version")]
    _version: u32,
    pub(crate) log: toml::Table,
    #[serde(default)]
    pub(crate) table: RawTable,
    #[serde(default)]
    pub(crate) clock: RawClock,
    pub(crate) grid: Option<RawGrid>,
    pub(crate) episodes: RawEpisodes,
    #[serde(default)]
    pub(crate) frames: BTreeMap<String, RawRigid>,
    pub(crate) command: Option<RawPose>,
    pub(crate) tool: Option<RawPose>,
    pub(crate) object: Option<RawPose>,
    pub(crate) joints: Option<RawJoints>,
    pub(crate) joint_torques: Option<RawJoints>,
    pub(crate) wrench: Option<RawWrench>,
    pub(crate) object_velocity: Option<RawRate>,
    pub(crate) object_spin: Option<RawRate>,
    pub(crate) added_mass: Option<RawScalar>,
    pub(crate) action: Option<RawScalar>,
}

/// How a CSV table is written.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawTable {
    pub(crate) separator: Option<char>,
    pub(crate) decimal: Option<char>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawClock {
    pub(crate) stamp: Option<String>,
    pub(crate) unit: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

/// How readings come to rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Sampling {
    /// A row of a table is a row of the log.
    Rows,
    /// Between the readings before and after; rotations on the shorter arc.
    Linear,
    /// The last reading.
    Hold,
    /// The nearest reading.
    Nearest,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawGrid {
    pub(crate) sample: Sampling,
    pub(crate) near_secs: Option<f64>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum RawEpisodes {
    /// Each source file is one.
    Source,
    /// Where a value changes.
    Change(RawChange),
    /// Where nothing was read for a while.
    Gap(RawGap),
    /// Where nothing moves for a while.
    Still(RawStill),
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawChange {
    pub(crate) topic: Option<String>,
    #[serde(default)]
    pub(crate) at: String,
    pub(crate) value: String,
    #[serde(default)]
    pub(crate) skip: Vec<Label>,
    pub(crate) stamp: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

/// A value that names an episode, or none.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Label(pub(crate) String);

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawGap {
    pub(crate) longer_than_secs: f64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawStill {
    pub(crate) of: Moving,
    pub(crate) within_m: f64,
    pub(crate) longer_than_secs: f64,
}

/// What is watched for being still.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Moving {
    Command,
    Tool,
    Object,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPose {
    pub(crate) topic: Option<String>,
    #[serde(default)]
    pub(crate) at: String,
    pub(crate) position: Vector,
    pub(crate) unit: Option<String>,
    pub(crate) orientation: Option<Vector>,
    pub(crate) order: Option<Order>,
    #[serde(default)]
    pub(crate) conjugate: bool,
    pub(crate) rpy: Option<Vector>,
    pub(crate) angle_unit: Option<String>,
    pub(crate) frame: Option<String>,
    pub(crate) mount: Option<RawRigid>,
    pub(crate) stamp: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Order {
    Xyzw,
    Wxyz,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawJoints {
    pub(crate) topic: Option<String>,
    #[serde(default)]
    pub(crate) at: String,
    pub(crate) values: Vector,
    pub(crate) names: Option<String>,
    pub(crate) order: Option<Vec<String>>,
    pub(crate) unit: Option<String>,
    pub(crate) stamp: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawWrench {
    pub(crate) topic: Option<String>,
    #[serde(default)]
    pub(crate) at: String,
    pub(crate) force: Vector,
    pub(crate) unit: Option<String>,
    pub(crate) torque: Option<Vector>,
    pub(crate) torque_unit: Option<String>,
    /// Whose force it is.
    pub(crate) of: Actor,
    pub(crate) axes: Axes,
    pub(crate) frame: Option<String>,
    pub(crate) mount: Option<RawRigid>,
    pub(crate) stamp: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

/// Who exerts a wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Actor {
    /// On the tool, as in a log.
    World,
    /// On the world: the reaction.
    Tool,
}

/// Axes in which a wrench is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Axes {
    World,
    Tool,
    Sensor,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRate {
    pub(crate) topic: Option<String>,
    #[serde(default)]
    pub(crate) at: String,
    pub(crate) value: Vector,
    pub(crate) unit: Option<String>,
    pub(crate) axes: RateAxes,
    pub(crate) frame: Option<String>,
    pub(crate) stamp: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

/// Axes in which a velocity is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum RateAxes {
    World,
    Object,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawScalar {
    pub(crate) topic: Option<String>,
    #[serde(default)]
    pub(crate) at: String,
    pub(crate) value: Scalar,
    pub(crate) unit: Option<String>,
    pub(crate) stamp: Option<String>,
    #[serde(default)]
    pub(crate) offset_secs: f64,
}

/// A column or path, or a number that never changes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Scalar {
    Path(String),
    Constant(f64),
}

/// One column or path that holds all, or one entry a component.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Vector {
    Whole(String),
    Parts(Vec<Scalar>),
}

// By hand, because serde's untagged enums answer a wrong entry with "no variant matches".
struct ScalarVisitor;

impl Visitor<'_> for ScalarVisitor {
    type Value = Scalar;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the name of a column, a path into a message, or a number")
    }

    fn visit_str<E>(self, text: &str) -> Result<Scalar, E> {
        Ok(Scalar::Path(text.into()))
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Scalar, E> {
        if value.is_finite() { Ok(Scalar::Constant(value)) } else { Err(E::custom("expected a finite number")) }
    }

    #[expect(clippy::cast_precision_loss, reason = "a reading that never changes, such as 0")]
    fn visit_i64<E>(self, value: i64) -> Result<Scalar, E> {
        Ok(Scalar::Constant(value as f64))
    }
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ScalarVisitor)
    }
}

impl<'de> Deserialize<'de> for Vector {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Vector;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("one column or path, or a list of columns, paths and numbers")
            }

            fn visit_str<E>(self, text: &str) -> Result<Vector, E> {
                Ok(Vector::Whole(text.into()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vector, A::Error> {
                let mut parts = Vec::new();
                while let Some(part) = list.next_element()? {
                    parts.push(part);
                }
                Ok(Vector::Parts(parts))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

impl<'de> Deserialize<'de> for Label {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match deserializer.deserialize_any(ScalarVisitor)? {
            Scalar::Path(text) => Ok(Self(text)),
            Scalar::Constant(value) => Ok(Self(value.to_string())),
        }
    }
}
