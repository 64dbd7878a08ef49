//! One optimiser step.

use super::Trainer;
use crate::fused::{Batch, Dropout, Workspace};
use crate::parameters::{Dimensions, Parameters};
use crate::{Error, Sequence};
use pomdp::{Purpose, Rng};
use rand::Rng as _;
use rayon::prelude::*;
use std::borrow::Cow;

/// What a step reports.
pub(super) struct Done {
    /// Σ over time steps of the negative log-likelihood before the step, in normalised units.
    pub(super) loss: f64,
    /// Number of time steps.
    pub(super) transitions: usize,
    /// Norm of the gradient before clipping.
    pub(super) norm: f64,
}

impl Trainer {
    /// One step on the training sequences `indices`.
    pub(super) fn step(&mut self, indices: &[usize]) -> Result<Done, Error> {
        let transitions = indices.iter().map(|&index| self.training[index].steps).sum();
        let (loss, mut gradient) = self.gradient(indices, transitions);
        let norm = gradient.norm();
        if !norm.is_finite() {
            return Err(Error::Diverged { epoch: self.curve.len() + 1, step: self.steps as usize, norm });
        }
        if let Some(limit) = self.config.clip_norm.filter(|&limit| norm > limit) {
            let factor = (limit / norm) as f32;
            gradient.tensors.iter_mut().flatten().for_each(|value| *value *= factor);
        }
        self.steps += 1;
        let rate = self.learning_rate();
        self.adam.step(&mut self.parameters, &gradient, self.steps, rate, self.config.weight_decay);
        Ok(Done { loss, transitions, norm })
    }

    /// What the network takes for episodes: `sequences`, or without memory every step of them as a sequence of its own.
    pub(super) fn remembered<'s>(&self, sequences: impl Iterator<Item = &'s Sequence>) -> Vec<Cow<'s, Sequence>> {
        if self.config.network.memory {
            sequences.map(Cow::Borrowed).collect()
        } else {
            sequences.flat_map(Sequence::single_steps).map(Cow::Owned).collect()
        }
    }

    /// Packed batches of the held-out episodes.
    pub(super) fn held_out_batches(&self) -> impl ParallelIterator<Item = Batch<f32>> + '_ {
        self.held_out.par_chunks(64).map(|episodes| {
            let sequences = self.remembered(episodes.iter());
            let sequences: Vec<&Sequence> = sequences.iter().map(AsRef::as_ref).collect();
            Batch::pack(&sequences, &self.dimensions)
        })
    }

    fn learning_rate(&self) -> f64 {
        self.config.learning_rate * self.config.schedule.share(self.curve.len() + 1, self.config.max_epochs)
    }

    /// Deals the batch into a fixed number of chunks, so that the sums do not depend on the number of threads.
    fn gradient(&mut self, indices: &[usize], transitions: usize) -> (f64, Parameters<f32>) {
        let (sizes, parameters, chunks) = (&self.dimensions, &self.parameters, self.config.chunks);
        let sequences = self.remembered(indices.iter().map(|&index| &self.training[index]));
        let mut sequences: Vec<&Sequence> = sequences.iter().map(AsRef::as_ref).collect();
        sequences.sort_by_key(|sequence| std::cmp::Reverse(sequence.steps));
        let (seed, steps, dropout) = (self.seed, self.steps, self.config.dropout);
        let scale = 1.0 / transitions as f32;
        let losses: Vec<f64> = self
            .spaces
            .par_iter_mut()
            .enumerate()
            .map(|(chunk, space)| {
                let part: Vec<&Sequence> = sequences.iter().skip(chunk).step_by(chunks).copied().collect();
                let batch = Batch::pack(&part, sizes);
                let mut rng = seed.stream(Purpose::Regularisation, steps * chunks as u64 + chunk as u64);
                let factors = dropout_factors(dropout, sizes, batch.rows, &mut rng);
                space.loss_and_gradient(parameters, &batch, factors.as_ref(), scale)
            })
            .collect();
        (losses.iter().sum(), sum(&self.spaces))
    }
}

/// Σ of the gradients in the order of the chunks.
fn sum(spaces: &[Workspace<f32>]) -> Parameters<f32> {
    let mut total = spaces[0].gradient.clone();
    for space in &spaces[1..] {
        for (total, part) in total.tensors.iter_mut().zip(&space.gradient.tensors) {
            total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
        }
    }
    total
}

impl Parameters<f32> {
    /// Euclidean norm of all values together.
    fn norm(&self) -> f64 {
        let squares = self.tensors.iter().map(|tensor| {
            let mut lanes = [0.0_f64; 8];
            for chunk in tensor.chunks(8) {
                lanes.iter_mut().zip(chunk).for_each(|(lane, &value)| *lane += f64::from(value) * f64::from(value));
            }
            lanes.iter().sum::<f64>()
        });
        squares.sum::<f64>().sqrt()
    }
}

/// Factors 0 with probability `share` (rounded to 1/256), else such that the mean is 1.
fn dropout_factors(share: f64, sizes: &Dimensions, rows: usize, rng: &mut Rng) -> Option<Dropout<f32>> {
    let threshold = (share * 256.0).round() as u8;
    if threshold == 0 {
        return None;
    }
    let kept = 256.0 / (256.0 - f32::from(threshold));
    let mut draw = |width: usize| {
        let mut bytes = vec![0_u8; rows * width];
        rng.fill_bytes(&mut bytes);
        bytes.iter().map(|&byte| if byte < threshold { 0.0 } else { kept }).collect()
    };
    Some(sizes.hidden.iter().map(|&width| draw(width)).collect())
}
