//! LSTM with a mixture density head that suggests (state, theta) from observations.
//!
//! A [`Layout`] names what goes in and comes out. A [`Trainer`](train::Trainer) turns [`Sequence`]s into a
//! [`Checkpoint`](checkpoint::Checkpoint), one folder on disk; [`Inference`](inference::Inference) reads it, takes one
//! observation at a time and returns a [`Mixture`](mixture::Mixture) that can be sampled and evaluated.
//!
//! One set of weights, three ways to run it, held to each other by tests: [`network`] in burn with autodiff, the reference;
//! [`fused`] by hand on packed batches, for training; [`inference`] on plain slices, one step at a time.

pub mod calibrate;
pub mod checkpoint;
pub mod error;
mod files;
pub mod features;
pub mod fused;
pub mod inference;
pub mod layout;
pub mod mixture;
pub mod network;
pub mod normalise;
pub mod parameters;
pub mod suggest;
pub mod train;

pub use calibrate::{Baseline, Calibration, Episode, calibrate};
pub use checkpoint::{Checkpoint, TrainingFacts};
pub use error::Error;
pub use files::FileRef;
pub use inference::Inference;
pub use layout::{ClassTarget, Layout, Sequence};
pub use mixture::{Draw, Mixture};
pub use normalise::Normalisation;
pub use parameters::{Dimensions, NetworkConfig, Parameters};
pub use suggest::Suggester;
pub use train::{EpochReport, GradientPath, TrainConfig, Trainer, curve_csv, is_held_out};
