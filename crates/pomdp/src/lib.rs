#![doc = include_str!("../README.md")]
//!
//! # API boundary
//!
//! Everything that is re-exported here, and [`conformance`]. The crate is made to be published, so breaking changes
//! follow semantic versioning. A new [`Purpose`] or a new method with a default body does not count as one.

mod belief;
pub mod conformance;
mod episode;
mod model;
mod policy;
mod prior;
mod replay;
mod seed;

pub use belief::{Belief, Proposals, UpdateReport, Updater};
pub use episode::{Transition, discounted_return};
pub use model::{Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Step};
pub use policy::{ActionPrior, Policy, UniformPolicy};
pub use prior::{Density, Prior};
/// Of the version that [`Rng`] belongs to.
pub use rand;
pub use replay::{Factor, Replay, Teacher};
pub use seed::{Purpose, Rng, Seed};
