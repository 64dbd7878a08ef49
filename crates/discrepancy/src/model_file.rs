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

use crate::diagnosis::Diagnosis;
use crate::error::Error;
use crate::nominal::Nominal;
use crate::report::Report;

/// Version of the format.
const VERSION: u32 = 1;

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

impl ModelFile {
    /// Of a diagnosis that began with `nominal`.
    #[must_use]
    pub fn new(nominal: &Nominal, diagnosis: &Diagnosis, report: &Report) -> Self {
        let found = diagnosis.model.model.hypothesis(&diagnosis.model.x).effects;
        Self {
            version: VERSION,
            nominal: report.retuned.iter().map(|value| (value.key.clone(), value.value)).collect(),
            effects: Effects { model: nominal.effects.iter().cloned().chain(found).collect() },
            interval: (report.effects.iter())
                .flat_map(|effect| {
                    effect.parameters.iter().map(|value| Interval {
                        effect: effect.name.into(),
                        key: value.key.clone(),
                        value: value.value,
                        interval90: value.interval90,
                    })
                })
                .collect(),
        }
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
        let refuse = |reason: String| Error::Model { reason: format!("{}: {reason}", path.display()) };
        let text = std::fs::read_to_string(path).map_err(|error| refuse(error.to_string()))?;
        let file: Self = toml::from_str(&text).map_err(|error| refuse(error.to_string()))?;
        if file.version != VERSION {
            return Err(refuse(format!("key `version`: expected {VERSION}, found {}", file.version)));
        }
        for effect in &file.effects.model {
            effect.check().map_err(|error| refuse(format!("key `effects.model`: {error}")))?;
        }
        Ok(file)
    }

    /// Gives a nominal model what the file says: values become the means of what may be re-tuned, effects are switched on.
    ///
    /// # Errors
    ///
    /// [`Error::Model`] for a key that is nothing to re-tune in this log.
    pub fn apply(&self, nominal: &mut Nominal) -> Result<(), Error> {
        for (key, value) in &self.nominal {
            let known: Vec<String> = nominal.tunables.iter().map(|tunable| tunable.key.clone()).collect();
            let Some(tunable) = nominal.tunables.iter_mut().find(|tunable| tunable.key == *key) else {
                let reason = format!("key `nominal.{key}`: expected one of {}", known.join(", "));
                return Err(Error::Model { reason });
            };
            tunable.mean = *value;
        }
        nominal.effects.extend(self.effects.model.iter().cloned());
        Ok(())
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
