//! The vocabulary of online planning under partial observability, without algorithms.
//!
//! `belief` and `planner` meet only through these traits: a [`GenerativeModel`] simulates, an [`Updater`] turns a
//! [`Belief`] and an observation into the next belief, a [`Policy`] picks actions in rollouts, a [`Density`] is what a
//! learned prior suggests. [`Seed`] hands out every random stream of the project.

pub mod belief;
pub mod conformance;
pub mod episode;
pub mod model;
pub mod policy;
pub mod prior;
pub mod seed;

pub use belief::{Belief, Proposals, StructureReport, UpdateReport, Updater};
pub use episode::{Transition, discounted_return};
pub use model::{Discretise, GenerativeModel, ObservationModel, Outcome, Partition, Perturb, StaticParameters, Step};
pub use policy::{ActionPrior, Policy, UniformPolicy};
pub use prior::{Density, Prior};
pub use seed::{Purpose, Rng, Seed};
