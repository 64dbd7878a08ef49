//! Standard problems of planning and filtering under partial observability, with known answers.
//!
//! Tests and benchmarks of `planner` and `belief` run on these. States are small `Copy` values, a step takes some ten nanoseconds, and
//! every transition and observation function is tested against its published definition.

pub mod bits;
pub mod episode;
pub mod light_dark;
pub mod rock_sample;
pub mod tag;
pub mod tiger;

pub use episode::{Episode, InitialState, Particles};
pub use light_dark::LightDark;
pub use rock_sample::RockSample;
pub use tag::Tag;
pub use tiger::Tiger;
