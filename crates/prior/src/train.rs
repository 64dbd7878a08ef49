//! The training loop: seeded, resumable, with early stopping on held-out episodes.

mod adam;
mod rescale;
mod split;
mod state;
mod step;

pub use split::is_held_out;

use crate::calibrate::Baseline;
use crate::checkpoint::{Checkpoint, TrainingFacts};
use crate::fused::{Batch, Workspace};
use crate::normalise::Normalisation;
use crate::parameters::{Dimensions, Parameters};
use crate::settings::{EpochReport, Schedule, TrainConfig};
use crate::{Error, Layout, Sequence};
use adam::Adam;
use pomdp::{Purpose, Seed};
use rand::seq::SliceRandom as _;
use rayon::prelude::*;
use std::collections::BTreeMap;

impl Schedule {
    /// Share of the first learning rate in `epoch`, counted from 1.
    fn share(self, epoch: usize, max_epochs: usize) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Cosine => {
                let done = (epoch as f64 - 0.5) / max_epochs.max(1) as f64;
                0.5 * (1.0 + (std::f64::consts::PI * done).cos())
            }
        }
    }
}

/// A training run.
pub struct Trainer {
    config: TrainConfig,
    layout: Layout,
    seed: Seed,
    dimensions: Dimensions,
    normalisation: Normalisation,
    baseline: Baseline,
    data_blake3: String,
    /// Normalised.
    training: Vec<Sequence>,
    /// Normalised.
    held_out: Vec<Sequence>,
    /// What turns the training likelihood into original units.
    training_offset: f64,
    held_out_offset: f64,
    adam: Adam,
    parameters: Parameters<f32>,
    best: Parameters<f32>,
    steps: u64,
    curve: Vec<EpochReport>,
    spaces: Vec<Workspace<f32>>,
}

impl Trainer {
    /// Splits and normalises `data` (one sequence an episode) and draws the first weights.
    ///
    /// # Errors
    ///
    /// [`Error::Config`], [`Error::Size`], [`Error::Value`] or [`Error::Split`] for settings or data that cannot be used.
    pub fn new(config: TrainConfig, layout: Layout, data: &[Sequence], seed: Seed) -> Result<Self, Error> {
        config.check()?;
        let dimensions = Dimensions::new(&config.network, &layout)?;
        data.iter().enumerate().try_for_each(|(index, sequence)| sequence.check(&layout, index))?;
        let part = |held_out: bool| -> Vec<&Sequence> {
            let indices = 0..data.len();
            indices.filter(|&i| is_held_out(seed, i, config.held_out) == held_out).map(|i| &data[i]).collect()
        };
        let (training, held_out) = (part(false), part(true));
        if training.is_empty() || held_out.is_empty() {
            return Err(Error::Split { training: training.len(), held_out: held_out.len() });
        }
        let normalisation = Normalisation::fit(&layout, &training);
        let parameters = Parameters::initial(&dimensions, seed);
        Ok(Self {
            baseline: Baseline::fit(&layout, &normalisation, &training),
            data_blake3: split::data_hash(data),
            training_offset: normalisation.mean_log_scale(&training),
            held_out_offset: normalisation.mean_log_scale(&held_out),
            training: training.iter().map(|sequence| normalisation.apply(sequence)).collect(),
            held_out: held_out.iter().map(|sequence| normalisation.apply(sequence)).collect(),
            adam: Adam::new(&dimensions),
            best: parameters.clone(),
            parameters,
            steps: 0,
            curve: Vec::new(),
            spaces: vec![Workspace::new(&dimensions); config.chunks],
            config,
            layout,
            seed,
            dimensions,
            normalisation,
        })
    }

    /// One pass over the training episodes in an order of its own, then the held-out likelihood.
    ///
    /// # Errors
    ///
    /// [`Error::Diverged`] if a gradient is not finite. Drop the trainer then; its saved checkpoint is still good.
    pub fn epoch(&mut self) -> Result<EpochReport, Error> {
        let epoch = self.curve.len() + 1;
        let mut order: Vec<usize> = (0..self.training.len()).collect();
        order.shuffle(&mut self.seed.stream(Purpose::Shuffle, epoch as u64));
        let (mut loss, mut transitions, mut norms, mut batches) = (0.0, 0, 0.0, 0);
        for batch in order.chunks(self.config.batch) {
            let done = self.step(batch)?;
            (loss, transitions) = (loss + done.loss, transitions + done.transitions);
            (norms, batches) = (norms + done.norm, batches + 1);
        }
        let held_out_nll = self.held_out_nll();
        if !held_out_nll.is_finite() {
            return Err(Error::Diverged { epoch, step: self.steps as usize, norm: held_out_nll });
        }
        let best = self.curve.last().map(|last| (last.best_epoch, last.best_held_out_nll));
        let (best_epoch, best_held_out_nll) = match best {
            Some((best_epoch, best_nll)) if best_nll <= held_out_nll => (best_epoch, best_nll),
            _ => {
                self.best.clone_from(&self.parameters);
                (epoch, held_out_nll)
            }
        };
        let report = EpochReport {
            epoch,
            steps: self.steps,
            training_nll: loss / transitions as f64 + self.training_offset,
            held_out_nll,
            gradient_norm: norms / f64::from(batches),
            best_epoch,
            best_held_out_nll,
            finished: epoch >= self.config.max_epochs || epoch - best_epoch >= self.config.patience,
        };
        self.curve.push(report.clone());
        Ok(report)
    }

    /// Held-out negative log-likelihood of the present weights, nats a step in original units.
    #[must_use]
    pub fn held_out_nll(&self) -> f64 {
        self.nll_of(&self.parameters)
    }

    fn nll_of(&self, parameters: &Parameters<f32>) -> f64 {
        let loss = |batch: Batch<f32>| (Workspace::new(&self.dimensions).loss(parameters, &batch), batch.rows);
        // Not a parallel sum: its order would depend on the threads.
        let sums: Vec<(f64, usize)> = self.held_out_batches().map(loss).collect();
        let (loss, rows) = sums.iter().fold((0.0, 0), |(loss, rows), part| (loss + part.0, rows + part.1));
        loss / rows as f64 + self.held_out_offset
    }

    /// The best weights so far as a prior, their spreads [rescaled](TrainConfig::rescale) if asked for; `provenance` is what the program knows
    /// about the run.
    #[must_use]
    pub fn checkpoint(&self, provenance: BTreeMap<String, String>) -> Checkpoint {
        let transitions = |sequences: &[Sequence]| sequences.iter().map(|sequence| sequence.steps).sum();
        let parameters = if self.config.rescale { self.rescaled(&self.best) } else { self.best.clone() };
        let facts = TrainingFacts {
            config: self.config.clone(),
            seed: self.seed.0,
            data_blake3: self.data_blake3.clone(),
            training_episodes: self.training.len(),
            training_transitions: transitions(&self.training),
            held_out_episodes: self.held_out.len(),
            held_out_transitions: transitions(&self.held_out),
            best_epoch: self.curve.last().map_or(0, |last| last.best_epoch),
            held_out_nll: self.curve.last().map(|_| self.nll_of(&parameters)),
            curve: self.curve.clone(),
        };
        Checkpoint {
            layout: self.layout.clone(),
            network: self.config.network.clone(),
            normalisation: self.normalisation.clone(),
            baseline: self.baseline.clone(),
            facts,
            provenance,
            parameters,
        }
    }

    /// Present weights (not the best ones).
    #[must_use]
    pub fn parameters(&self) -> &Parameters<f32> {
        &self.parameters
    }

    /// Learning curve so far.
    #[must_use]
    pub fn curve(&self) -> &[EpochReport] {
        &self.curve
    }

    /// Whether patience or the most epochs are reached.
    #[must_use]
    pub fn finished(&self) -> bool {
        self.curve.last().map_or(self.config.max_epochs == 0, |last| last.finished)
    }

    /// Settings and root seed of the run.
    #[must_use]
    pub fn identity(&self) -> (&TrainConfig, Seed) {
        (&self.config, self.seed)
    }

    /// Sizes of the network.
    #[must_use]
    pub fn dimensions(&self) -> &Dimensions {
        &self.dimensions
    }
}

/// The learning curve as CSV with a header.
#[must_use]
#[expect(clippy::missing_panics_doc, reason = "memory takes all that is written")]
pub fn curve_csv(curve: &[EpochReport]) -> String {
    let mut csv = csv::Writer::from_writer(Vec::new());
    let mut write = |row: [String; 6]| csv.write_record(row).expect("memory takes all, and all rows are as long");
    write(["epoch", "steps", "training_nll", "held_out_nll", "gradient_norm", "best_epoch"].map(String::from));
    for row in curve {
        let [training, held_out, norm] = [row.training_nll, row.held_out_nll, row.gradient_norm].map(|v| v.to_string());
        write([row.epoch.to_string(), row.steps.to_string(), training, held_out, norm, row.best_epoch.to_string()]);
    }
    String::from_utf8(csv.into_inner().expect("memory takes all")).expect("made of text")
}

impl TrainConfig {
    fn check(&self) -> Result<(), Error> {
        let positive = "above 0 and finite";
        let tests = [
            ("learning_rate", self.learning_rate, self.learning_rate > 0.0 && self.learning_rate.is_finite(), positive),
            ("batch", self.batch as f64, self.batch > 0, "at least 1"),
            ("chunks", self.chunks as f64, (1..=64).contains(&self.chunks), "1 to 64"),
            ("held_out", self.held_out, self.held_out > 0.0 && self.held_out < 1.0, "in (0, 1)"),
            ("patience", self.patience as f64, self.patience > 0, "at least 1"),
            (
                "clip_norm",
                self.clip_norm.unwrap_or(1.0),
                self.clip_norm.is_none_or(|norm| norm > 0.0),
                "above 0, or none",
            ),
            ("weight_decay", self.weight_decay, self.weight_decay >= 0.0 && self.weight_decay.is_finite(), "0 or more"),
            ("dropout", self.dropout, (0.0..1.0).contains(&self.dropout), "in [0, 1)"),
        ];
        match tests.into_iter().find(|(_, _, fits, _)| !fits) {
            Some((setting, found, _, expected)) => Err(Error::Config { setting, found: found.to_string(), expected }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
