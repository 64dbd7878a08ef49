//! Training data: randomised worlds, the heuristic policy, recorded transitions.
//!
//! Episode e of a dataset is a function of the scenario, the seed and e alone. So shards can be made in any order and
//! on any number of workers, with the same bytes.
//!
//! # Example
//!
//! ```
//! use scenario::{Selection, find_root};
//!
//! let root = find_root(env!("CARGO_MANIFEST_DIR").as_ref())?;
//! let scenario = Selection { domain: "training".into(), ..Selection::new(&root) }.load()?;
//! // Episode 17 is what it is, whoever makes it, and whatever was made before.
//! let (rows, _) = datagen::Generator::new(&scenario, &root, 1)?.shard(17, 1)?;
//! assert!(!rows.is_empty() && rows.iter().all(|row| row.episode == 17));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod generate;
mod plan;

pub use generate::{EpisodeData, Generator};
pub use plan::{episodes, plan, schema};
