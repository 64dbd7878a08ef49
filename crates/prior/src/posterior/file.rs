//! `posterior.json` and the weights beside it.

use std::collections::BTreeMap;
use std::path::Path;

use physics_model::config::ObstacleMobility;
use push_task::coordinates::START;
use push_task::sampling::WorldDistribution;
use serde::Deserialize;
use serde_json::Value;

use super::features::{Features, INPUTS};
use super::head::Head;
use super::lstm::{Layer, Lstm};
use super::{PAIRS, Weights};
use crate::parameters::{Parameters, TensorSpec};
use crate::{Error, FileRef, files};

/// Name of the file that names the weights.
pub const FILE: &str = "posterior.json";
/// Version of the format.
const VERSION: u64 = 1;
/// Widest LSTM, most hidden units and components of a coordinate.
const MOST: usize = 4096;
/// No training makes larger weights or divides by less, and with these no sum of a layer overflows.
const MOST_WEIGHT: f32 = 1e6;
const LEAST_STDDEV: f32 = 1e-6;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(rename = "version")]
    _version: u64,
    robot: String,
    mobility: ObstacleMobility,
    /// Widths of the LSTM's layers.
    hidden: Vec<usize>,
    units: usize,
    components: usize,
    order: Vec<usize>,
    force_scale: [f64; 6],
    distribution: WorldDistribution,
    weights: FileRef,
    /// How it was made: for readers of the file.
    #[serde(rename = "provenance")]
    _provenance: BTreeMap<String, Value>,
}

impl Manifest {
    fn problem(&self) -> Option<String> {
        let sizes = self.hidden.iter().chain([&self.units, &self.components]);
        if self.hidden.is_empty() || sizes.clone().any(|size| !(1..=MOST).contains(size)) {
            return Some(format!("hidden, units and components: expected 1 to {MOST} each"));
        }
        let mut sorted = self.order.clone();
        sorted.sort_unstable();
        if sorted != (0..START).collect::<Vec<_>>() {
            return Some(format!("order: expected each of 0 to {} once, found {:?}", START - 1, self.order));
        }
        if self.force_scale.iter().any(|scale| !(scale.is_finite() && *scale > 0.0)) {
            return Some(format!("force_scale: expected values above 0, found {:?}", self.force_scale));
        }
        self.distribution.problem().map(|problem| format!("distribution.{problem}"))
    }

    /// Names and shapes of the tensors.
    fn tensors(&self) -> Vec<TensorSpec> {
        let top = self.hidden[self.hidden.len() - 1];
        let (all, out) = (START * self.units, 3 * self.components);
        let mut specs: Vec<(String, Vec<usize>)> =
            vec![("input.mean".into(), vec![INPUTS]), ("input.stddev".into(), vec![INPUTS])];
        let mut below = INPUTS;
        for (layer, &width) in self.hidden.iter().enumerate() {
            specs.push((format!("layers.{layer}.weights"), vec![below + width, 4 * width]));
            specs.push((format!("layers.{layer}.bias"), vec![4 * width]));
            below = width;
        }
        let head: [(&str, Vec<usize>); 8] = [
            ("pairs.weights", vec![top, PAIRS]),
            ("pairs.bias", vec![PAIRS]),
            ("context.weights", vec![top, all]),
            ("context.bias", vec![all]),
            ("of_pair", vec![PAIRS, all]),
            ("of_coordinate", vec![START, all]),
            ("out.weights", vec![START, self.units, out]),
            ("out.bias", vec![START, out]),
        ];
        specs.extend(head.map(|(name, shape)| (name.to_string(), shape)));
        specs.into_iter().map(|(name, shape)| TensorSpec { name, shape }).collect()
    }
}

/// Reads a network.
pub(super) fn load(folder: &Path) -> Result<Weights, Error> {
    let path = folder.join(FILE);
    let manifest: Manifest = files::read_json(&path, "posterior network", VERSION)?;
    let refuse = |reason: String| Error::Format { path: path.clone(), reason };
    if let Some(problem) = manifest.problem() {
        return Err(refuse(whole_file::one_line(&problem, 400)));
    }
    let bytes = files::read_blob(folder, &manifest.weights)?;
    let Parameters { tensors } =
        files::from_safetensors(&bytes, &manifest.tensors(), &folder.join(&manifest.weights.name))?;
    if let Some(weight) = tensors.iter().flatten().find(|weight| weight.is_nan() || weight.abs() > MOST_WEIGHT) {
        return Err(refuse(format!("weights: expected at most {MOST_WEIGHT} in size, found {weight}")));
    }
    let mut tensors = tensors.into_iter();
    let mut next = || tensors.next().unwrap_or_default();
    let normalisation: Vec<(f32, f32)> = next().into_iter().zip(next()).collect();
    if let Some((_, stddev)) = normalisation.iter().find(|(_, stddev)| *stddev < LEAST_STDDEV) {
        return Err(refuse(format!("input.stddev: expected at least {LEAST_STDDEV}, found {stddev}")));
    }
    let layers = manifest.hidden.iter().map(|_| Layer { weights: next(), bias: next() }).collect();
    let head = Head {
        order: manifest.order,
        units: manifest.units,
        components: manifest.components,
        pairs: (next(), next()),
        context: (next(), next()),
        of_pair: next(),
        of_coordinate: next(),
        out: (next(), next()),
    };
    Ok(Weights {
        robot: manifest.robot,
        mobility: manifest.mobility,
        distribution: manifest.distribution,
        features: Features { force_scale: manifest.force_scale, normalisation },
        lstm: Lstm(layers),
        head,
        hash: manifest.weights.blake3,
    })
}
