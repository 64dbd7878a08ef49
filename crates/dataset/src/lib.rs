//! Recorded transitions: Parquet shards with a manifest.
//!
//! ```text
//! DIR/plan.json                          what is to be generated; written first, never changed
//! DIR/data/chunk-000/file-000.parquet    one shard; published whole or not at all
//! DIR/meta/info.json                     the manifest; written last, by `finish`
//! ```
//!
//! Invariants:
//!
//! - A shard is a function of its rows and its plan: the same rows give the same bytes. Nothing here reads a clock, a
//!   random number or the machine. So the merged dataset does not depend on how many workers made it, or how often they
//!   died.
//! - A published shard is never written again. Writers work on a hidden temporary file in the same folder and sync it.
//!   They give it its name only if no file has that name yet. What a killed writer leaves behind is never read.
//! - Numbers survive bit for bit: observations and rewards as `f32`, states and Θ as `f64`. None of them is NaN or infinite.
//! - The crate knows columns and names, no physics.
//!
//! # Example
//!
//! ```
//! use dataset::{Counts, Plan, Reader, Row, Schema, ShardState};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let dir = folder.path();
//! let plan = Plan {
//!     version: dataset::VERSION,
//!     schema: Schema {
//!         robot: "sawyer".into(),
//!         observation: vec!["joint_0_rad".into()],
//!         action_count: 10,
//!         state: vec!["object_x_m".into()],
//!         theta: vec!["object_mass_kg".into()],
//!         classes: vec!["object_shape".into()],
//!         events: vec!["tool_touched".into()],
//!     },
//!     scenario_hash: "0f3a".into(),
//!     config: serde_json::json!({"horizon": 30}),
//!     seed: 1,
//!     commit: "unknown".into(),
//!     shards: 1,
//!     episodes_per_shard: 1,
//! };
//! plan.open(dir)?;
//! for index in 0..plan.shards {
//!     if let ShardState::Missing = dataset::shard_state(dir, index, &plan.hash())? {
//!         let first = Row {
//!             episode: u64::from(index), step: 0, action: -1, reward: 0.0, outcome: 0,
//!             observation: vec![0.1], state: vec![0.5], theta: vec![0.3], classes: vec![2], events: vec![0],
//!         };
//!         let last = Row { step: 1, action: 4, reward: 100.0, outcome: 1, ..first.clone() };
//!         dataset::write_shard(dir, index, &plan.schema, &plan.provenance(), &Counts::new(), &[first, last])?;
//!     }
//! }
//! dataset::finish(dir, &plan)?;
//! let episodes = Reader::open(dir)?.episodes()?;
//! assert_eq!(episodes[0].action, [-1, 4]);
//! # Ok(())
//! # }
//! ```

mod columns;
mod decode;
mod encode;
mod error;
mod manifest;
mod plan;
mod publish;
mod reader;
mod schema;
mod seal;
mod shard;

pub use error::Error;
pub use manifest::{Manifest, finish};
pub use plan::Plan;
pub use reader::{Episode, Reader};
pub use schema::{Counts, Provenance, Row, Schema};
pub use shard::{ShardInfo, ShardState, shard_path, shard_state, write_shard};

/// Version of the layout: of `plan.json`, of the shards and of the manifest.
pub const VERSION: u32 = 2;
