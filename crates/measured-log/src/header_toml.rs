//! `log.toml` to a [`Header`] and back, with a comment above each key.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;
use toml::Value;

use crate::error::Problem;
use crate::header::{Header, Noise, Object, Robot, Shape, SplitConfig, Table};
use crate::{Error, Number, VERSION};

/// Characters of a parser's message that are quoted.
const MESSAGE: usize = 300;

/// Comments for `log.toml` by dotted key, such as `object.mass_kg`: where a number is from. The key "" stands for the head of the file,
/// `object.[]` for the table `[object]`.
pub type Notes = BTreeMap<&'static str, String>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(rename = "version")]
    _version: u32,
    robot: Robot,
    period_secs: f64,
    tool_radius_m: Option<f64>,
    tool_friction: Option<Number>,
    gravity_mps2: f64,
    table: RawTable,
    object: RawObject,
    #[serde(default)]
    noise: Noise,
    split: SplitConfig,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTable {
    height_m: Number,
    friction: Number,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Box,
    Cylinder,
    Sphere,
    Prism,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawObject {
    shape: Kind,
    size_m: Option<Vec<Number>>,
    outline_m: Option<Vec<[f64; 2]>>,
    height_m: Option<Number>,
    feet_m: Option<Vec<[f64; 2]>>,
    mass_kg: Number,
    com_m: [Number; 3],
    inertia_kgm2: Option<[Number; 3]>,
    restitution: Option<Number>,
}

impl RawObject {
    fn shape(&mut self) -> Result<Shape, Problem> {
        let missing =
            |key: &str, shape: &str| Problem::key(key, format!("expected for shape = \"{shape}\", found none"));
        if let Kind::Prism = self.shape {
            if self.size_m.is_some() {
                return Err(Problem::key("object.size_m", "expected outline_m and height_m for shape = \"prism\""));
            }
            return Ok(Shape::Prism {
                outline_m: self.outline_m.take().ok_or_else(|| missing("object.outline_m", "prism"))?,
                height_m: self.height_m.ok_or_else(|| missing("object.height_m", "prism"))?,
                feet_m: self.feet_m.take().unwrap_or_default(),
            });
        }
        for (key, given) in [
            ("object.outline_m", self.outline_m.is_some()),
            ("object.height_m", self.height_m.is_some()),
            ("object.feet_m", self.feet_m.is_some()),
        ] {
            if given {
                return Err(Problem::key(key, "expected only for shape = \"prism\""));
            }
        }
        let (name, expected) = match self.shape {
            Kind::Box => ("box", "[x, y, z]"),
            Kind::Cylinder => ("cylinder", "[radius, height]"),
            _ => ("sphere", "[radius]"),
        };
        let size = self.size_m.take().ok_or_else(|| missing("object.size_m", name))?;
        match (&self.shape, size.as_slice()) {
            (Kind::Box, [x, y, z]) => Ok(Shape::Box { size_m: [*x, *y, *z] }),
            (Kind::Cylinder, [radius, height]) => Ok(Shape::Cylinder { radius_m: *radius, height_m: *height }),
            (Kind::Sphere, [radius]) => Ok(Shape::Sphere { radius_m: *radius }),
            _ => Err(Problem::key(
                "object.size_m",
                format!("expected {expected} for shape = \"{name}\", found {} numbers", size.len()),
            )),
        }
    }
}

/// Parses `text`, the content of the `log.toml` at `path`.
///
/// # Errors
///
/// [`Error`] with the line or the key, and what was expected.
pub fn parse(path: &Path, text: &str) -> Result<Header, Error> {
    let value: toml::Table = toml::from_str(text).map_err(|e| {
        let line = whole_file::line_of(text, e.span().map_or(0, |span| span.start));
        Error::Syntax {
            path: path.to_owned(),
            reason: format!("line {line}: {}", whole_file::one_line(&whole_file::plain(e.message()), MESSAGE)),
        }
    })?;
    header(path, value)
}

/// The header that a table of `log.toml` is, which stands in the file `path`.
///
/// # Errors
///
/// [`Error`] with the key and what was expected.
pub fn header(path: &Path, value: toml::Table) -> Result<Header, Error> {
    // The version alone comes first, so that an old file says so instead of listing unknown keys.
    if let Some(found) = value.get("version")
        && found.as_integer() != Some(i64::from(VERSION))
    {
        return Err(Error::Version { path: path.to_owned(), found: crate::error::excerpt(&found.to_string()) });
    }
    let mut raw: Raw = serde_path_to_error::deserialize(Value::Table(value)).map_err(|error| {
        let key = whole_file::one_line(&error.path().to_string(), 200);
        let reason = whole_file::one_line(error.into_inner().message(), MESSAGE);
        let key = whole_file::key_of(&key, &reason);
        Error::Key { path: path.to_owned(), key, reason: whole_file::plain(&reason) }
    })?;
    let mut checked = || -> Result<Header, Problem> {
        let header = Header {
            robot: raw.robot,
            period_secs: raw.period_secs,
            tool_radius_m: raw.tool_radius_m,
            tool_friction: raw.tool_friction,
            gravity_mps2: raw.gravity_mps2,
            table: Table { height_m: raw.table.height_m, friction: raw.table.friction },
            object: Object {
                shape: raw.object.shape()?,
                mass_kg: raw.object.mass_kg,
                com_m: raw.object.com_m,
                inertia_kgm2: raw.object.inertia_kgm2,
                restitution: raw.object.restitution,
            },
            noise: raw.noise,
            split: raw.split,
        };
        header.check()?;
        Ok(header)
    };
    checked().map_err(|problem| problem.at(path, path))
}

/// TOML text that [`parse`] reads back to the same header, with `notes` as comments.
#[must_use]
pub fn print(header: &Header, notes: &Notes) -> String {
    let mut text = String::new();
    comment(&mut text, notes, "");
    let mut line = |key: &str, value: String| {
        if let Some(table) = key.strip_suffix(".[]") {
            text.push('\n');
            comment(&mut text, notes, key);
            let _ = writeln!(text, "[{table}]");
        } else {
            comment(&mut text, notes, key);
            let name = key.rsplit('.').next().unwrap_or(key);
            let _ = writeln!(text, "{name} = {value}");
        }
    };
    line("version", VERSION.to_string());
    line("robot", format!("\"{}\"", header.robot.name()));
    line("period_secs", format!("{:?}", header.period_secs));
    if let Some(radius) = header.tool_radius_m {
        line("tool_radius_m", format!("{radius:?}"));
    }
    if let Some(friction) = header.tool_friction {
        line("tool_friction", friction.to_toml());
    }
    line("gravity_mps2", format!("{:?}", header.gravity_mps2));
    line("table.[]", String::new());
    line("table.height_m", header.table.height_m.to_toml());
    line("table.friction", header.table.friction.to_toml());
    line("object.[]", String::new());
    let object = &header.object;
    match &object.shape {
        Shape::Box { size_m } => {
            line("object.shape", "\"box\"".into());
            line("object.size_m", list(size_m));
        }
        Shape::Cylinder { radius_m, height_m } => {
            line("object.shape", "\"cylinder\"".into());
            line("object.size_m", list(&[*radius_m, *height_m]));
        }
        Shape::Sphere { radius_m } => {
            line("object.shape", "\"sphere\"".into());
            line("object.size_m", list(&[*radius_m]));
        }
        Shape::Prism { outline_m, height_m, feet_m } => {
            line("object.shape", "\"prism\"".into());
            line("object.outline_m", format!("{outline_m:?}"));
            line("object.height_m", height_m.to_toml());
            if !feet_m.is_empty() {
                line("object.feet_m", format!("{feet_m:?}"));
            }
        }
    }
    line("object.mass_kg", object.mass_kg.to_toml());
    line("object.com_m", list(&object.com_m));
    if let Some(inertia) = &object.inertia_kgm2 {
        line("object.inertia_kgm2", list(inertia));
    }
    if let Some(restitution) = object.restitution {
        line("object.restitution", restitution.to_toml());
    }
    line("noise.[]", String::new());
    for (key, stddev) in header.noise.entries() {
        if let Some(stddev) = stddev {
            line(&format!("noise.{key}"), format!("{stddev:?}"));
        }
    }
    line("split.[]", String::new());
    line("split.holdout_fraction", format!("{:?}", header.split.holdout_fraction));
    text
}

fn comment(text: &mut String, notes: &Notes, key: &str) {
    for line in notes.get(key).into_iter().flat_map(|note| note.lines()) {
        // A control character would end the comment, or the file's being TOML.
        let clean: String = line.chars().filter(|c| !c.is_control()).collect();
        let _ = writeln!(text, "# {clean}");
    }
}

fn list(numbers: &[Number]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|n| n.to_toml()).collect();
    format!("[{}]", numbers.join(", "))
}
