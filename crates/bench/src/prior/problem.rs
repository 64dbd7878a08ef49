//! What both sides train on: sequences, the split, the first weights and the order of every epoch.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use dataset::Reader;
use pomdp::{Purpose, Rng, Seed};
use prior::features::ActionInput;
use prior::{
    ClassTarget, Layout, NetworkConfig, Normalisation, Parameters, Schedule, Sequence, TrainConfig, Trainer, Transform,
    is_held_out,
};
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use serde_json::json;

use super::tensors::Tensors;

/// Sequences of an optimiser step.
pub(crate) const BATCH: usize = 128;
/// Time steps of a synthetic sequence.
pub(crate) const STEPS: usize = 30;
/// Optimiser steps of an epoch on the synthetic sequences.
pub(crate) const BATCHES: usize = 4;
/// Root seed.
const SEED: Seed = Seed(1);

/// A training problem in original units.
pub(crate) struct Problem {
    pub(crate) layout: Layout,
    pub(crate) data: Vec<Sequence>,
    pub(crate) config: TrainConfig,
}

/// The network of the paper, trained as `train` does.
fn published(held_out: f64, clip_norm: Option<f64>) -> TrainConfig {
    TrainConfig {
        network: NetworkConfig { hidden: vec![128, 128], components: 10, memory: true },
        learning_rate: 0.001,
        schedule: Schedule::Constant,
        batch: BATCH,
        chunks: 4,
        held_out,
        max_epochs: 100_000,
        patience: 100_000,
        clip_norm,
        weight_decay: 0.0,
        dropout: 0.0,
        rescale: false,
    }
}

impl Problem {
    /// Random numbers of the published sizes: 20 observations, 45 continuous targets, a fifth of them masked, shapes of 3 and 4 kinds.
    /// An epoch is [`BATCHES`] whole batches; two sequences or so are held out, as the trainer wants at least one.
    pub(crate) fn synthetic() -> Self {
        let names = |prefix: &str, count: usize| (0..count).map(|i| format!("{prefix}_{i}")).collect::<Vec<_>>();
        let kinds = [("object_shape", 3), ("obstacle_shape", 4)];
        let layout = Layout {
            robot: "sawyer".into(),
            observation: names("observation", 20),
            continuous: names("target", 45),
            transforms: vec![Transform::Identity; 45],
            classes: kinds
                .map(|(name, labels)| ClassTarget { name: name.into(), labels: names("label", labels) })
                .into(),
        };
        let config = published(0.004, None);
        let mut rng = SEED.stream(Purpose::Test, 0);
        let (mut data, mut training) = (Vec::new(), 0);
        while training < BATCH * BATCHES || training == data.len() {
            training += usize::from(!is_held_out(SEED, data.len(), config.held_out));
            data.push(random_sequence(&mut rng));
        }
        Self { layout, data, config }
    }

    /// The dataset in `dir`.
    pub(crate) fn recorded(dir: &Path) -> Result<Self> {
        let reader = Reader::open(dir).with_context(|| format!("{}: no usable dataset", dir.display()))?;
        let layout = prior_training::layout_of_dataset(&reader.manifest().schema, ActionInput::Off)?;
        let data = reader
            .episodes()?
            .iter()
            .map(|episode| prior_training::sequence(&layout, episode))
            .collect::<Result<_, _>>()?;
        Ok(Self { layout, data, config: published(0.1, Some(10.0)) })
    }

    pub(crate) fn trainer(&self, chunks: usize) -> Result<Trainer> {
        let config = TrainConfig { chunks, ..self.config.clone() };
        Ok(Trainer::new(config, self.layout.clone(), &self.data, SEED)?)
    }

    pub(crate) fn part(&self, held_out: bool) -> Vec<&Sequence> {
        let indices = 0..self.data.len();
        indices.filter(|&i| is_held_out(SEED, i, self.config.held_out) == held_out).map(|i| &self.data[i]).collect()
    }

    /// Scales of the training part.
    pub(crate) fn normalisation(&self) -> Normalisation {
        Normalisation::fit(&self.layout, &self.part(false))
    }

    /// Writes everything for the Python side: normalised sequences (training first, then held out), weights, the order of `epochs` epochs.
    pub(crate) fn write(&self, dir: &Path, weights: &Parameters<f32>, epochs: usize) -> Result<()> {
        std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        let sizes = prior::Dimensions::new(&self.config.network, &self.layout)?;
        let (training, held_out, normalisation) = (self.part(false), self.part(true), self.normalisation());
        ensure!(!training.is_empty() && !held_out.is_empty(), "too few sequences: {}", self.data.len());
        let sequences: Vec<Sequence> = training.iter().chain(&held_out).map(|s| normalisation.apply(s)).collect();
        let rows: usize = sequences.iter().map(|sequence| sequence.steps).sum();
        let mut tensors = Tensors::default();
        let mut add = |name: &str, width: usize, read: fn(&Sequence) -> &[f32]| {
            let values = sequences.iter().flat_map(read).flat_map(|value| value.to_le_bytes());
            tensors.add(name, "F32", &[rows, width], values);
        };
        add("observations", sizes.observations, |sequence| &sequence.observations);
        add("targets", sizes.continuous, |sequence| &sequence.targets);
        add("mask", sizes.continuous, |sequence| &sequence.mask);
        let classes = sequences.iter().flat_map(|sequence| sequence.classes.iter().copied());
        tensors.add("classes", "U8", &[rows, sizes.classes.len()], classes);
        let steps = sequences.iter().flat_map(|sequence| (sequence.steps as i64).to_le_bytes());
        tensors.add("steps", "I64", &[sequences.len()], steps);
        // The trainer's own rule: one stream an epoch, counted from 1.
        let orders = (1..=epochs as u64).flat_map(|epoch| {
            let mut order: Vec<i64> = (0..training.len() as i64).collect();
            order.shuffle(&mut SEED.stream(Purpose::Shuffle, epoch));
            order
        });
        tensors.add("orders", "I64", &[epochs, training.len()], orders.flat_map(i64::to_le_bytes));
        tensors.write(&dir.join("data.safetensors"))?;
        Tensors::weights_f32(weights, &sizes).write(&dir.join("weights.safetensors"))?;
        let scales = |scales: &[prior::normalise::Scale]| -> Vec<[f64; 2]> {
            scales.iter().map(|scale| [scale.mean, scale.stddev]).collect()
        };
        let problem = json!({
            "observations": sizes.observations,
            "continuous": sizes.continuous,
            "classes": sizes.classes,
            "hidden": sizes.hidden,
            "components": sizes.components,
            "batch": self.config.batch,
            "learning_rate": self.config.learning_rate,
            "clip_norm": self.config.clip_norm,
            "training": training.len(),
            "training_offset": normalisation.mean_log_scale(&training),
            "held_out_offset": normalisation.mean_log_scale(&held_out),
            "observation_scales": scales(&normalisation.observation),
            "continuous_scales": scales(&normalisation.continuous),
        });
        std::fs::write(dir.join("problem.json"), problem.to_string()).with_context(|| dir.display().to_string())
    }
}

fn random_sequence(rng: &mut Rng) -> Sequence {
    let mut uniform = |count: usize| (0..count).map(|_| 2.0 * rng.random::<f32>() - 1.0).collect::<Vec<f32>>();
    Sequence {
        observations: uniform(STEPS * 20),
        targets: uniform(STEPS * 45),
        mask: uniform(STEPS * 45).iter().map(|&value| if value > -0.6 { 1.0 } else { 0.0 }).collect(),
        classes: (0..STEPS).flat_map(|_| [rng.random_range(0..3_u8), rng.random_range(0..4_u8)]).collect(),
        steps: STEPS,
    }
}
