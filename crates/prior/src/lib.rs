//! LSTM with a mixture density head that suggests (state, theta) from observations.
//!
//! A [`Layout`] names what goes in and comes out. A [`Trainer`](train::Trainer) turns [`Sequence`]s into a
//! [`Checkpoint`](checkpoint::Checkpoint), one folder on disk; [`Inference`](inference::Inference) reads it, takes one
//! observation at a time and returns a [`Mixture`](mixture::Mixture) that can be sampled and evaluated.
//!
//! One set of weights, three ways to run it, held to each other by tests: [`network`] in burn with autodiff, the reference;
//! [`fused`] by hand on packed batches, for training; [`inference`] on plain slices, one step at a time.
//!
//! # What was decided, and why
//!
//! The paper gives the network (LSTM 2 × 128, tanh, ten diagonal components, Adam with 0.001, batches of 128) and the loss. The rest:
//!
//! - **Targets** ([`features`], [`Transform`]): what is measured as the difference from the measurement, masses as logarithms, sizes as extents, states
//!   down to a resolution. With plain targets the likelihood was spent on velocities that are 0 and on positions that were measured
//!   anyway: the right shape at the end of 58 % of the held-out episodes, positions 3 cm off. Now 90 % and 3 mm.
//! - **Inputs**: median and quartiles, then asinh. Scaled by the standard deviation, a blocked push of 100 N hides the 2 N of a free one.
//! - **The obstacle** is felt through the object alone: the shipped Sawyer's prior finds it in 84.6 ± 0.8 % of the episodes that touched it and denies it in
//!   64.6 % of those without one; an LSTM trained for nothing else reached 82 to 90 % and 75 to 55 % on the same kind of data. The Jaco, whose hand
//!   holds the object, does better.
//! - **The action** is an optional input (`train --action-input`), off as published: with it the Sawyer's prior gains 0.2 nats a step and finds 85.1 % of
//!   the obstacles touched, denies 68.3 % of those that are not there. The shipped ones do without, for both presets share them.
//! - **Dropout** 0.1 on the output of each layer, by held-out likelihood at epoch 100: −117.85, −118.29, −118.20 nats a step for 0, 0.1, 0.2.
//!   A cosine schedule instead of a constant rate.
//! - **One factor a target** on the stated spread, fitted on the held-out part ([`TrainConfig::rescale`]): early stopping leaves a network too sure of what it
//!   has learnt by heart. Calibration is measured on other data, of another seed.
//! - **Suggestions as proposals** ([`density`]): their density in the coordinates of the belief filter.
//!
//! # Example
//!
//! ```
//! use pomdp::{Purpose, Seed};
//! use prior::{GradientPath, Layout, NetworkConfig, Schedule, Sequence, TrainConfig, Trainer, Transform};
//!
//! let layout = Layout {
//!     robot: "sawyer".into(),
//!     observation: vec!["force".into()],
//!     continuous: vec!["mass".into()],
//!     transforms: vec![Transform::Identity],
//!     classes: vec![],
//! };
//! // Twenty episodes of one step, in which the mass is twice the force.
//! let episode = |i: usize| {
//!     let (observations, targets) = (vec![i as f32], vec![2.0 * i as f32]);
//!     Sequence { observations, targets, mask: vec![1.0], classes: vec![], steps: 1 }
//! };
//! let data: Vec<Sequence> = (0..20).map(episode).collect();
//! let config = TrainConfig {
//!     network: NetworkConfig { hidden: vec![8], components: 2, memory: true },
//!     learning_rate: 0.01,
//!     schedule: Schedule::Constant,
//!     batch: 8,
//!     chunks: 2,
//!     held_out: 0.2,
//!     max_epochs: 20,
//!     patience: 5,
//!     clip_norm: None,
//!     weight_decay: 0.0,
//!     dropout: 0.0,
//!     rescale: true,
//!     gradient: GradientPath::Fused,
//! };
//! let mut trainer = Trainer::new(config, layout, &data, Seed(1))?;
//! while !trainer.finished() {
//!     let report = trainer.epoch()?;
//!     assert!(report.held_out_nll.is_finite());
//! }
//! let mut inference = trainer.checkpoint(Default::default()).inference()?;
//! let mixture = inference.step(&[10.0]);
//! let draw = mixture.sample(&mut Seed(1).stream(Purpose::Suggestion, 0));
//! assert!(mixture.log_density_masked(&draw.values, &[true], &draw.classes).is_finite());
//! # Ok::<(), prior::Error>(())
//! ```

pub mod calibrate;
pub mod checkpoint;
pub mod density;
pub mod error;
pub mod features;
mod files;
pub mod fused;
pub mod inference;
pub mod layout;
pub mod mixture;
#[cfg(feature = "training")]
pub mod network;
pub mod normalise;
pub mod parameters;
pub mod pictures;
pub mod settings;
pub mod suggest;
#[cfg(feature = "training")]
pub mod train;

pub use calibrate::{Baseline, Calibration, Episode, Models, calibrate};
pub use checkpoint::{Checkpoint, TrainingFacts};
pub use error::Error;
pub use files::{FileRef, write_atomically};
pub use inference::Inference;
pub use layout::{ClassTarget, Layout, Sequence, Transform};
pub use mixture::{Draw, Mixture};
pub use normalise::Normalisation;
pub use parameters::{Dimensions, NetworkConfig, Parameters};
pub use settings::{EpochReport, GradientPath, Schedule, TrainConfig};
pub use suggest::Suggester;

#[cfg(feature = "training")]
pub use train::{Trainer, curve_csv, is_held_out};

/// The prior that a program takes for `robot` unless told otherwise: the one trained here (with `quick` one of a quick training first), else
/// the shipped one.
#[must_use]
pub fn default_folder(root: &std::path::Path, robot: &str, quick: bool) -> std::path::PathBuf {
    let at = |folder: &str| root.join(folder).join(robot);
    let quick = quick.then(|| at("runs/quick/priors"));
    let candidates = quick.into_iter().chain([at("runs/priors")]);
    candidates.into_iter().find(|folder| folder.join(checkpoint::FILE).is_file()).unwrap_or_else(|| at("assets/priors"))
}

/// The nearest folder at or above `start` with scenarios, else `start`: the programs of this crate need no scenario, only a place for
/// their default folders.
#[must_use]
pub fn project_root(start: &std::path::Path) -> std::path::PathBuf {
    let found = start.ancestors().find(|folder| folder.join("scenarios/base.toml").is_file());
    found.unwrap_or(start).to_path_buf()
}
