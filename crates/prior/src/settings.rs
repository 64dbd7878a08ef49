//! What decides a training run, and a row of its learning curve: plain data, which a checkpoint carries.

use serde::{Deserialize, Serialize};

use crate::parameters::NetworkConfig;

/// Course of the learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// The same in every epoch, as published.
    Constant,
    /// Half a cosine over `max_epochs`, down to nearly 0 (Loshchilov and Hutter 2017, without restarts).
    Cosine,
}

/// Settings of a training run; every one of them changes the weights. Keys that it does not know are those of older versions, as `gradient`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainConfig {
    /// Shape of the network.
    pub network: NetworkConfig,
    /// Adam's step size, at the beginning.
    pub learning_rate: f64,
    /// How it goes on.
    pub schedule: Schedule,
    /// Sequences per optimiser step.
    pub batch: usize,
    /// Parts of a batch for the fused gradient, at least the number of cores to use. Their sums are added in order, so
    /// this number changes the rounding of the result. The number of threads does not.
    pub chunks: usize,
    /// Share of the episodes held out, in (0, 1).
    pub held_out: f64,
    /// Most epochs.
    pub max_epochs: usize,
    /// Stop after this many epochs without a better held-out likelihood.
    pub patience: usize,
    /// Largest norm of the whole gradient. `None` does not clip.
    pub clip_norm: Option<f64>,
    /// Decoupled weight decay (Loshchilov and Hutter 2019); 0 gives Adam itself.
    pub weight_decay: f64,
    /// Probability that an output of an LSTM layer is dropped on its way up, in steps of 1/256; 0 for none.
    pub dropout: f64,
    /// Whether the stated spread of each target is multiplied by one factor, fitted on the held-out episodes, in the end.
    pub rescale: bool,
}

/// One row of the learning curve; likelihoods in nats a step and original units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochReport {
    /// Counted from 1.
    pub epoch: usize,
    /// Optimiser steps since the start.
    pub steps: u64,
    /// Mean over the epoch, while the weights changed and with dropout.
    pub training_nll: f64,
    /// After the epoch, without dropout.
    pub held_out_nll: f64,
    /// Mean norm of the gradient, before clipping.
    pub gradient_norm: f64,
    /// Epoch with the best held-out likelihood so far.
    pub best_epoch: usize,
    /// Its held-out negative log-likelihood.
    pub best_held_out_nll: f64,
    /// Whether patience or the most epochs are reached.
    pub finished: bool,
}
