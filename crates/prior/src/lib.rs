//! LSTM with a mixture density head that suggests (state, theta) from observations.
//!
//! A [`Layout`] names what goes in and comes out. A [`Trainer`](train::Trainer) turns [`Sequence`]s into a
//! [`Checkpoint`](checkpoint::Checkpoint), one folder on disk; [`Inference`](inference::Inference) reads it, takes one
//! observation at a time and returns a [`Mixture`](mixture::Mixture) that can be sampled and evaluated.
//!
//! One set of weights runs in two ways, and tests compare them. [`fused`] computes gradients by hand on packed batches, for training;
//! PyTorch is its reference. [`inference`] takes plain slices, one step at a time.
//!
//! # What was decided, and why
//!
//! The paper gives the network (LSTM 2 × 128, tanh, ten diagonal components, Adam with 0.001, batches of 128) and the loss. The rest:
//!
//! - **Targets** ([`features`], [`Transform`]): measured values as the difference from the measurement, masses as
//!   logarithms, sizes as extents, states down to a resolution. With plain targets the likelihood is dominated by
//!   velocities that are 0 and by positions that are measured anyway. The right shape at the end of a held-out episode
//!   rises from 58 to 90 %; the position error falls from 3 cm to 3 mm.
//! - **Inputs**: median and quartiles, then asinh. Scaled by the standard deviation, a blocked push of 100 N hides the 2 N of a free one.
//! - **The obstacle** is felt through the object alone. The shipped Sawyer prior finds it in 84.6 ± 0.8 % of the
//!   episodes that touched it, and denies it in 64.6 % of those without one. An LSTM trained only for this reached 82
//!   to 90 % and 75 to 55 %. The Jaco does better, as its hand holds the object.
//! - **The action** is an optional input (`train --action-input`), off as published. With it the Sawyer prior gains 0.2
//!   nats per step. The shipped networks do without; [`posterior`] always has it.
//! - **Dropout** 0.1 on the output of each layer, by held-out likelihood at epoch 100: −117.85, −118.29, −118.20 nats a step for 0, 0.1, 0.2.
//!   A cosine schedule instead of a constant rate.
//! - **One factor per target** scales the stated spread, fitted on the held-out part ([`TrainConfig::rescale`]): a
//!   network that fits its training data well is overconfident. Calibration is measured on other data, from another
//!   seed.
//! - **What an episode began with** ([`posterior`]) is another question, and another network's.
//!
//! # Example
//!
//! ```
//! use pomdp::{Purpose, Seed};
//! use prior::{Layout, NetworkConfig, Schedule, Sequence, TrainConfig, Trainer, Transform};
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
pub mod error;
pub mod features;
mod files;
pub mod fused;
pub mod inference;
pub mod layout;
pub mod mixture;
pub mod normalise;
pub mod parameters;
pub mod pictures;
pub mod posterior;
pub mod settings;
pub mod suggest;
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
pub use posterior::PosteriorNetwork;
pub use settings::{EpochReport, Schedule, TrainConfig};
pub use suggest::Suggester;

pub use train::{Trainer, curve_csv, is_held_out};

/// The default network of a program, in a folder `name` that holds `file`. With `quick`, what was trained quickly comes first, then what was trained
/// here, then what is shipped.
#[must_use]
pub fn default_folder(root: &std::path::Path, name: &str, file: &str, quick: bool) -> std::path::PathBuf {
    let shipped = root.join("assets/priors").join(name);
    let own = [("runs/quick/priors", quick), ("runs/priors", true)];
    let mut own = own.into_iter().filter(|(_, asked)| *asked).map(|(place, _)| root.join(place).join(name));
    own.find(|folder| folder.join(file).is_file()).unwrap_or(shipped)
}

/// The name of the arm that a command line names by itself or by its file: folders of data and networks are called by it.
///
/// ```
/// assert_eq!([prior::robot_name("jaco"), prior::robot_name("../my-arm.toml")], ["jaco", "my-arm"]);
/// ```
#[must_use]
pub fn robot_name(robot: &str) -> &str {
    let stem = std::path::Path::new(robot).file_stem().and_then(|stem| stem.to_str());
    stem.filter(|_| robot.ends_with(".toml")).unwrap_or(robot)
}

/// The project folder that a command line names, or the nearest one at or above `start`, else `start`. The programs that train need no
/// scenario, only a place for their default folders.
///
/// # Errors
///
/// Where the folder that is named is no project.
pub fn project_root(
    given: Option<&std::path::Path>,
    start: &std::path::Path,
) -> Result<std::path::PathBuf, physics_model::robot::RobotError> {
    if let Some(root) = given {
        physics_model::robot::check_root(root)?;
        return Ok(root.to_path_buf());
    }
    let found = start.ancestors().find(|folder| folder.join("scenarios/base.toml").is_file());
    Ok(found.unwrap_or(start).to_path_buf())
}
