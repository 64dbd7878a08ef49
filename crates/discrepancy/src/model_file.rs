//! `model.toml`: the nominal model, re-tuned, with the effects that were accepted.
//!
//! ```toml
//! version = 1
//! [nominal]                       # keys of log.toml
//! "table.friction" = 0.36
//! [effects]                       # as in a scenario
//! model = [{ table_tilt = { slope_x_rad = 0.021, slope_y_rad = 0.0 } }]
//! [[interval]]                    # of what was fitted, for the reader
//! effect = "table_tilt"
//! key = "slope_x_rad"
//! value = 0.021
//! interval90 = [0.019, 0.023]
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use physics_model::EffectConfig;
use serde::{Deserialize, Serialize};
use whole_file::{one_line, plain};

use crate::diagnosis::Diagnosis;
use crate::error::Error;
use crate::nominal::{Nominal, Tunable};
use crate::report::{NamedEffect, Report};

/// Version of the format.
const VERSION: u32 = 1;

/// Key of the cone of friction, which is not re-tuned for balls.
const CONE: &str = "contact.cone_exponent";

/// Size of a file.
const MOST_BYTES: u64 = 4 << 20;
/// Largest value of the nominal model, in units of its key.
const LARGEST: f64 = 1e6;

/// Content of the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    version: u32,
    #[serde(default)]
    nominal: BTreeMap<String, f64>,
    #[serde(default)]
    effects: Effects,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    interval: Vec<Interval>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Effects {
    model: Vec<EffectConfig>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Interval {
    effect: String,
    key: String,
    value: f64,
    interval90: [f64; 2],
}

fn intervals(effect: &NamedEffect) -> impl Iterator<Item = Interval> + '_ {
    effect.parameters.iter().map(|value| Interval {
        effect: effect.name.into(),
        key: value.key.clone(),
        value: value.value,
        interval90: value.interval90,
    })
}

impl ModelFile {
    /// Of a diagnosis that began with `nominal`, which is what the file `begun` made of it.
    #[must_use]
    pub fn new(nominal: &Nominal, diagnosis: &Diagnosis, report: &Report, begun: Option<&Self>) -> Self {
        let found = diagnosis.effects(&diagnosis.model.x);
        let known = begun.map_or(&[][..], |begun| &begun.interval);
        Self {
            version: VERSION,
            nominal: report.retuned.iter().map(|value| (value.key.clone(), value.value)).collect(),
            effects: Effects { model: nominal.effects.iter().cloned().chain(found).collect() },
            interval: known.iter().cloned().chain(report.effects.iter().flat_map(intervals)).collect(),
        }
    }

    /// The effects beyond rigid bodies with Coulomb friction.
    #[must_use]
    pub fn effects(&self) -> &[EffectConfig] {
        &self.effects.model
    }

    /// A model that has these effects, and re-tunes nothing.
    #[must_use]
    pub fn of_effects(model: Vec<EffectConfig>) -> Self {
        Self { version: VERSION, nominal: BTreeMap::new(), effects: Effects { model }, interval: Vec::new() }
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`Error::Model`] with file and key.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let refuse =
            |reason: String| Error::Model { reason: format!("{}: {}", path.display(), one_line(&reason, 400)) };
        let bytes = whole_file::read(path, MOST_BYTES).map_err(|error| refuse(error.source.to_string()))?;
        let text = std::str::from_utf8(&bytes).map_err(|error| refuse(error.to_string()))?;
        // Its own display quotes the text over several lines.
        let file: Self = toml::from_str(text).map_err(|error| {
            let line = whole_file::line_of(text, error.span().map_or(0, |span| span.start));
            refuse(format!("line {line}: {}", plain(error.message())))
        })?;
        if file.version != VERSION {
            return Err(refuse(format!("key `version`: expected {VERSION}, found {}", file.version)));
        }
        for (key, value) in &file.nominal {
            if value.is_nan() || value.abs() > LARGEST {
                return Err(refuse(format!("key `nominal.{key}`: expected -{LARGEST} to {LARGEST}, found {value}")));
            }
        }
        for part in &file.interval {
            if ![part.value, part.interval90[0], part.interval90[1]].iter().all(|v| v.is_finite()) {
                return Err(refuse(format!("key `interval`: expected finite numbers for {}", part.key)));
            }
        }
        for effect in &file.effects.model {
            effect.check().map_err(|error| refuse(format!("key `effects.model`: {error}")))?;
        }
        Ok(file)
    }

    /// Of the nominal model alone, as it was re-tuned before effects were looked for.
    #[must_use]
    pub fn retuned(nominal: &Nominal, diagnosis: &Diagnosis) -> Self {
        let value = |(tunable, z): (&Tunable, &f64)| (tunable.key.clone(), tunable.value(*z));
        Self {
            nominal: diagnosis.tunables.iter().zip(&diagnosis.nominal.x).map(value).collect(),
            ..Self::of_effects(nominal.effects.clone())
        }
    }

    /// Coordinates of what may be re-tuned at the values of the file; 0 where it says nothing.
    ///
    /// # Errors
    ///
    /// As [`Self::apply`].
    pub fn coordinates(&self, nominal: &Nominal) -> Result<Vec<f64>, Error> {
        // The values of a model are looked at in one place.
        let mut applied = nominal.clone();
        self.apply(&mut applied)?;
        let pairs = nominal.tunables.iter().zip(&applied.tunables);
        Ok(pairs.map(|(nominal, applied)| nominal.coordinate(applied.mean)).collect())
    }

    /// `nominal` with the values and effects of the file, which was made of a diagnosis of it.
    pub(crate) fn applied(&self, nominal: &Nominal) -> Nominal {
        let mut applied = nominal.clone();
        applied.effects.clone_from(&self.effects.model);
        for tunable in &mut applied.tunables {
            tunable.set(self.nominal.get(&tunable.key).copied().unwrap_or(tunable.mean));
        }
        applied
    }

    /// Gives a nominal model what the file says: values become the means of what may be re-tuned, effects are switched on.
    ///
    /// # Errors
    ///
    /// [`Error::Model`] for a key that is nothing to re-tune in this log, or a value that it cannot have.
    pub fn apply(&self, nominal: &mut Nominal) -> Result<(), Error> {
        for (key, value) in &self.nominal {
            let known: Vec<String> = nominal.tunables.iter().map(|tunable| tunable.key.clone()).collect();
            let Some(tunable) = nominal.tunables.iter_mut().find(|tunable| tunable.key == *key) else {
                // Of another object on the same table: a ball has no cone of friction that is re-tuned.
                if key == CONE && nominal.has_tool() {
                    continue;
                }
                let key = one_line(key, 100);
                let reason = format!("key `nominal.{key}`: expected one of {}", known.join(", "));
                return Err(Error::Model { reason });
            };
            if !tunable.takes(*value) {
                let reason = format!("key `nominal.{key}`: expected {}, found {value}", tunable.expected());
                return Err(Error::Model { reason });
            }
            tunable.set(*value);
        }
        nominal.effects.extend(self.effects.model.iter().cloned());
        Ok(())
    }

    /// The same of a model called `name`, which an error begins with.
    ///
    /// # Errors
    ///
    /// As [`Self::apply`].
    pub fn apply_as(&self, name: &str, nominal: &mut Nominal) -> Result<(), Error> {
        self.apply(nominal).map_err(|error| match error {
            Error::Model { reason } => Error::Model { reason: format!("{name}: {reason}") },
            other => other,
        })
    }

    /// As TOML.
    ///
    /// # Errors
    ///
    /// [`Error::Model`] for a value that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string(self).map_err(|error| Error::Model { reason: error.to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_model_is_refused_in_one_line_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("model.toml");
        let long = format!("version = 1\n{} = 1", "a".repeat(100_000));
        let cases: [(&[u8], &str); 7] = [
            (b"version = 1\n[nominal]\na = = 2\n", "line 3"),
            (b"version = 1\n\"a\\nb\" = 1", "a b"),
            (long.as_bytes(), "there is no key"),
            (b"\xff", "utf-8"),
            (b"version = 1\n[nominal]\na = nan\n", "`nominal.a`: expected -1000000 to 1000000, found NaN"),
            (b"version = 1\n[nominal]\na = 1e308\n", "`nominal.a`"),
            (b"version = 1\n[[interval]]\neffect = 'a'\nkey = 'b'\nvalue = inf\ninterval90 = [0, 1]\n", "finite"),
        ];
        for (bytes, expected) in cases {
            std::fs::write(&file, bytes).unwrap();
            let message = ModelFile::read(&file).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("model.toml"), "{message}");
            assert!(!message.contains(char::is_control) && message.len() < 1000, "{message:?}");
        }
        let device = ModelFile::read(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(device.contains("not a plain file"), "{device}");
    }

    #[test]
    fn a_mass_of_nothing_is_no_nominal_model() {
        let text = |mass: f64| format!("version = 1\n[nominal]\n\"object.mass_kg\" = {mass:?}\n");
        let mut nominal = crate::nominal::tests::uncertain_mass();
        for (mass, good) in [(0.3, true), (0.0, false), (-1.0, false)] {
            let file: ModelFile = toml::from_str(&text(mass)).unwrap();
            assert_eq!(file.apply(&mut nominal).is_ok(), good, "{mass}");
        }
        assert_eq!(nominal.tunables[0].mean, 0.3);
    }
}
