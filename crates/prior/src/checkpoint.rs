//! The trained prior as one folder: `prior.json` and the weights that it names.

use crate::calibrate::Baseline;
use crate::files::{self, FileRef};
use crate::inference::Inference;
use crate::normalise::Normalisation;
use crate::parameters::{Dimensions, NetworkConfig, Parameters};
use crate::settings::{EpochReport, TrainConfig};
use crate::{Error, Layout};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Version of `prior.json`.
pub const VERSION: u64 = 2;

/// File that makes a folder a prior.
pub const FILE: &str = "prior.json";

/// How the weights came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingFacts {
    /// Settings of the training.
    pub config: TrainConfig,
    /// Root seed.
    pub seed: u64,
    /// blake3 of the data, training and held-out.
    pub data_blake3: String,
    /// Episodes trained on.
    pub training_episodes: usize,
    /// Transitions trained on.
    pub training_transitions: usize,
    /// Episodes held out.
    pub held_out_episodes: usize,
    /// Transitions held out.
    pub held_out_transitions: usize,
    /// Epoch of the stored weights, counted from 1; 0 before any.
    pub best_epoch: usize,
    /// Held-out negative log-likelihood of the stored weights, nats a step in original units; none before the first epoch.
    pub held_out_nll: Option<f64>,
    /// Learning curve.
    pub curve: Vec<EpochReport>,
}

/// A trained prior.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Meaning of inputs and outputs.
    pub layout: Layout,
    /// Shape of the network.
    pub network: NetworkConfig,
    /// Scales of inputs and targets.
    pub normalisation: Normalisation,
    /// Marginals of the training data, the yardstick of the calibration.
    pub baseline: Baseline,
    /// How the weights came about.
    pub facts: TrainingFacts,
    /// What the program adds: scenario, commit, dataset.
    pub provenance: BTreeMap<String, String>,
    /// Weights.
    pub parameters: Parameters<f32>,
}

/// `prior.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    version: u64,
    layout: Layout,
    network: NetworkConfig,
    normalisation: Normalisation,
    baseline: Baseline,
    training: TrainingFacts,
    provenance: BTreeMap<String, String>,
    weights: FileRef,
}

impl Checkpoint {
    /// Writes the folder; a program killed in between leaves the old prior or the new one.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if network and layout do not fit, [`Error::Io`] if the disk refuses.
    pub fn save(&self, dir: &Path) -> Result<(), Error> {
        let specs = Dimensions::new(&self.network, &self.layout)?.tensors();
        let weights =
            files::write_blob(dir, "weights", "safetensors", &files::to_safetensors(&self.parameters, &specs))?;
        let manifest = Manifest {
            version: VERSION,
            layout: self.layout.clone(),
            network: self.network.clone(),
            normalisation: self.normalisation.clone(),
            baseline: self.baseline.clone(),
            training: self.facts.clone(),
            provenance: self.provenance.clone(),
            weights,
        };
        files::commit(dir, FILE, &manifest, &[("weights", &manifest.weights)])
    }

    /// Reads the folder; with `expected`, only a prior of that robot and layout.
    ///
    /// # Errors
    ///
    /// One sentence for each of: missing or truncated file, changed content, unknown version, another robot or layout,
    /// weights that do not fit the network.
    pub fn load(dir: &Path, expected: Option<&Layout>) -> Result<Self, Error> {
        let path = dir.join(FILE);
        let manifest: Manifest = files::read_json(&path, "prior", VERSION)?;
        if let Some(expected) = expected {
            manifest.layout.check(expected, &path)?;
        }
        let dimensions = Dimensions::new(&manifest.network, &manifest.layout).map_err(|error| Error::Format {
            path: path.clone(),
            reason: whole_file::one_line(&error.to_string(), 400),
        })?;
        let scales = (manifest.normalisation.observation.len(), manifest.normalisation.continuous.len());
        if scales != (dimensions.observations, dimensions.continuous) {
            let reason = format!("{} and {} scales do not fit the layout", scales.0, scales.1);
            return Err(Error::Format { path, reason });
        }
        let refuse = |reason: String| Err(Error::Format { path: path.clone(), reason });
        if let Some(reason) = manifest.layout.problem() {
            return refuse(reason);
        }
        let normalisation = &manifest.normalisation;
        let mut scales = normalisation.observation.iter().chain(&normalisation.continuous);
        if let Some(scale) = scales.find(|scale| !scale.is_usable()) {
            return refuse(format!(
                "normalisation holds {scale:?}, expected a finite mean and a finite stddev above 0"
            ));
        }
        if let Err(reason) = manifest.baseline.check(&manifest.layout) {
            return refuse(reason);
        }
        let bytes = files::read_blob(dir, &manifest.weights)?;
        let weights = dir.join(&manifest.weights.name);
        let parameters = files::from_safetensors(&bytes, &dimensions.tensors(), &weights)?;
        if parameters.tensors.iter().flatten().any(|weight| !weight.is_finite()) {
            return Err(Error::Format { path: weights, reason: "holds a weight that is not finite".into() });
        }
        Ok(Self {
            parameters,
            layout: manifest.layout,
            network: manifest.network,
            normalisation: manifest.normalisation,
            baseline: manifest.baseline,
            facts: manifest.training,
            provenance: manifest.provenance,
        })
    }

    /// blake3 of the weights file, in hexadecimal.
    #[must_use]
    pub fn weights_hash(&self) -> String {
        let specs = Dimensions::unchecked(&self.network, &self.layout).tensors();
        blake3::hash(&files::to_safetensors(&self.parameters, &specs)).to_hex().to_string()
    }

    /// The network ready to run.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if network and layout do not fit.
    pub fn inference(&self) -> Result<Inference, Error> {
        let dimensions = Dimensions::new(&self.network, &self.layout)?;
        Ok(Inference::new(&dimensions, &self.normalisation, &self.parameters).with_memory(self.network.memory))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Trainer;
    use crate::train::tests::small_problem;
    use pomdp::Seed;
    use std::fs;

    fn saved() -> (tempfile::TempDir, Checkpoint) {
        let (config, layout, data) = small_problem();
        let mut trainer = Trainer::new(config, layout, &data, Seed(1)).unwrap();
        trainer.epoch().unwrap();
        let checkpoint = trainer.checkpoint(BTreeMap::from([("commit".into(), "abc".into())]));
        let dir = tempfile::tempdir().unwrap();
        checkpoint.save(dir.path()).unwrap();
        (dir, checkpoint)
    }

    #[test]
    fn a_prior_reads_back_as_it_was_written() {
        let (dir, checkpoint) = saved();
        assert_eq!(Checkpoint::load(dir.path(), Some(&checkpoint.layout)).unwrap(), checkpoint);
        assert!(checkpoint.facts.held_out_nll.is_some_and(f64::is_finite));
        let manifest: Manifest = files::read_json(&dir.path().join(FILE), "prior", VERSION).unwrap();
        assert_eq!(manifest.weights.blake3, checkpoint.weights_hash());
    }

    #[test]
    fn damage_is_refused_with_one_sentence() {
        let (dir, checkpoint) = saved();
        let load = || Checkpoint::load(dir.path(), Some(&checkpoint.layout)).unwrap_err().to_string();
        let names = fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().path());
        let weights = names.into_iter().find(|path| path.extension().is_some_and(|e| e == "safetensors")).unwrap();
        let (json, bytes) = (dir.path().join(FILE), fs::read(&weights).unwrap());
        let text = fs::read_to_string(&json).unwrap();

        fs::write(&weights, &bytes[..bytes.len() - 5]).unwrap();
        let message = load();
        assert!(message.contains(&format!("{} bytes, but {} were written", bytes.len() - 5, bytes.len())), "{message}");
        let mut flipped = bytes.clone();
        flipped[bytes.len() - 5] ^= 1;
        fs::write(&weights, flipped).unwrap();
        let message = load();
        assert!(message.contains("blake3 is") && message.contains("damaged or replaced"), "{message}");
        fs::write(&weights, bytes).unwrap();

        // Numbers that JSON can hold and a network cannot use.
        let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
        type Case = (&'static str, serde_json::Value, &'static str);
        let edits: [Case; 10] = [
            ("/normalisation/continuous/0/stddev", 0.0.into(), "stddev above 0"),
            ("/normalisation/observation/1/stddev", (-1.0).into(), "stddev above 0"),
            ("/baseline/structures", serde_json::json!([0.5]), "structures and the targets of the layout"),
            ("/baseline/continuous", serde_json::json!([]), "structures and the targets of the layout"),
            ("/baseline/labels", serde_json::json!([3, 99]), "structures and the targets of the layout"),
            ("/network/hidden/0", (1_u64 << 62).into(), "at most 65536 each"),
            ("/layout/transforms", serde_json::json!(["identity"]), "1 transforms for 2 continuous targets"),
            (
                "/layout/transforms/0",
                serde_json::json!({"minus_observation": 3}),
                "observation 3, expected one of 0 to 2",
            ),
            ("/weights/name", "../weights".into(), "names the file `../weights`"),
            ("/weights/name", "/dev/zero".into(), "names the file `/dev/zero`"),
        ];
        for (pointer, value, expected) in edits {
            let mut edited = manifest.clone();
            *edited.pointer_mut(pointer).unwrap() = value;
            fs::write(&json, edited.to_string()).unwrap();
            // A layout of its own is compared with no other.
            let message = Checkpoint::load(dir.path(), None).unwrap_err().to_string();
            assert!(message.contains(expected), "{pointer}: {message}");
        }

        fs::write(&json, text.replacen("\"layout\"", "\"lay\\nout\"", 1)).unwrap();
        let error = Checkpoint::load(dir.path(), None).unwrap_err();
        let cause = std::error::Error::source(&error).unwrap().to_string();
        assert!(cause.contains("lay out") && !cause.contains(char::is_control), "{cause}");
        fs::write(&json, &text[..text.len() / 2]).unwrap();
        let message = load();
        assert!(message.ends_with("prior.json: not a readable prior file (truncated or edited?)"), "{message}");
        fs::write(&json, r#"{"version": 7, "unheard_of": 1}"#).unwrap();
        let message = load();
        assert!(message.ends_with("format version 7, but this program reads version 2"), "{message}");
        fs::write(&json, text).unwrap();

        let mut other = checkpoint.layout.clone();
        other.robot = "jaco".into();
        let message = Inference::load(dir.path(), &other).unwrap_err().to_string();
        assert!(message.ends_with("trained for the robot `sawyer`, but this problem uses `jaco`"), "{message}");
        fs::remove_file(json).unwrap();
        let message = load();
        assert!(message.ends_with("prior.json: cannot read this path"), "{message}");
    }
}
