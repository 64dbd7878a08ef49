//! The vocabulary of online planning under partial observability, without algorithms.
//!
//! `belief` and `planner` meet only through these traits: a [`GenerativeModel`] simulates, an [`Updater`] turns a
//! [`Belief`] and an observation into the next belief, a [`Policy`] picks actions in rollouts, a [`Density`] is what a
//! learned prior suggests. [`Seed`] hands out every random stream of the project.
//!
//! # Example
//!
//! ```
//! use pomdp::{Purpose, Seed, discounted_return};
//! use rand::RngExt as _;
//!
//! // A stream is a function of its seed, purpose and number alone: whoever draws from it, and when.
//! let draw = |number| Seed(7).stream(Purpose::World, number).random::<u64>();
//! assert_eq!(draw(3), draw(3));
//! assert_ne!(draw(3), draw(4));
//! // 1 + 0.95 · (−2).
//! assert!((discounted_return([1.0, -2.0], 0.95) - -0.9).abs() < 1e-12);
//! ```

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
