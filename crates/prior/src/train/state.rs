//! A training run on disk, complete enough to go on as if it had never stopped.

use super::{EpochReport, TrainConfig, Trainer};
use crate::files::{self, FileRef};
use crate::{Error, Layout, Sequence};
use pomdp::Seed;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Version of `training.json`.
const VERSION: u64 = 3;

/// File that makes a folder a training state.
const FILE: &str = "training.json";

/// `training.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    version: u64,
    layout: Layout,
    config: TrainConfig,
    seed: Seed,
    data_blake3: String,
    steps: u64,
    curve: Vec<EpochReport>,
    current: FileRef,
    best: FileRef,
    /// Adam's mean of the gradient.
    first: FileRef,
    /// Adam's mean of its square.
    second: FileRef,
}

impl Trainer {
    /// Writes present and best weights, optimiser state and curve; a program killed in between leaves the old state or the
    /// new one.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the disk refuses.
    pub fn save(&self, dir: &Path) -> Result<(), Error> {
        let specs = self.dimensions.tensors();
        let weights = |prefix, parameters| {
            files::write_blob(dir, prefix, "safetensors", &files::to_safetensors(parameters, &specs))
        };
        let manifest = Manifest {
            version: VERSION,
            layout: self.layout.clone(),
            config: self.config.clone(),
            seed: self.seed,
            data_blake3: self.data_blake3.clone(),
            steps: self.steps,
            curve: self.curve.clone(),
            current: weights("current", &self.parameters)?,
            best: weights("best", &self.best)?,
            first: weights("first", &self.adam.first)?,
            second: weights("second", &self.adam.second)?,
        };
        let Manifest { current, best, first, second, .. } = &manifest;
        let sets = [("current", current), ("best", best), ("first", first), ("second", second)];
        files::commit(dir, FILE, &manifest, &sets)
    }

    /// Continues the run saved in `dir`, on the same data. The weights become the same as without the stop.
    ///
    /// # Errors
    ///
    /// One sentence for each of: missing, truncated or changed file, unknown version, another robot or layout, other data.
    pub fn resume(dir: &Path, expected: &Layout, data: &[Sequence]) -> Result<Self, Error> {
        let path = dir.join(FILE);
        let manifest: Manifest = files::read_json(&path, "training state", VERSION)?;
        manifest.layout.check(expected, &path)?;
        let mut trainer = Self::new(manifest.config, manifest.layout, data, manifest.seed)?;
        if trainer.data_blake3 != manifest.data_blake3 {
            return Err(Error::OtherData { path, found: manifest.data_blake3, expected: trainer.data_blake3 });
        }
        let specs = trainer.dimensions.tensors();
        let weights =
            |file: &FileRef| files::from_safetensors(&files::read_blob(dir, file)?, &specs, &dir.join(&file.name));
        trainer.parameters = weights(&manifest.current)?;
        trainer.best = weights(&manifest.best)?;
        trainer.adam.first = weights(&manifest.first)?;
        trainer.adam.second = weights(&manifest.second)?;
        trainer.steps = manifest.steps;
        trainer.curve = manifest.curve;
        Ok(trainer)
    }
}
