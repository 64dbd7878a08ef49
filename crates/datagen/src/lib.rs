//! Training data: randomised worlds, the heuristic policy, recorded transitions.
//!
//! Episode e of a dataset is a function of the scenario, the seed and e alone, so shards can be made in any order, on any number of
//! workers, and give the same bytes.

mod generate;
mod plan;

pub use generate::{EpisodeData, Generator};
pub use plan::{plan, schema};
