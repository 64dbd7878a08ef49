//! Independent shards on an engine that somebody else runs: Slurm job arrays, HyperQueue task arrays. No scheduler of our own.
//!
//! A program that can make shard K alone (`--worker K`) becomes an array: [`Array::run`] submits itself once with the missing shards as
//! indices, waits, and looks at what is there. Nothing but files passes between the program and its workers, so the folder has to be
//! the same on all nodes.
//!
//! Invariants:
//!
//! - What counts is what lies in the folder, never what the engine says of a task. A task that was killed, lost or played twice changes
//!   only what is missing afterwards.
//! - At most one array per folder is queued. Its name is made from the folder's path, so a program that is started
//!   again finds the earlier array and waits for it.
//! - [`Lock`] keeps two programs from submitting or merging in one folder at the same time. Workers take no lock.
//!
//! # Example
//!
//! ```no_run
//! use std::sync::atomic::AtomicBool;
//!
//! # fn main() -> Result<(), cluster::Error> {
//! let folder = std::path::Path::new("runs/data/sawyer");
//! let engine = cluster::Engine::Slurm;
//! engine.check()?;
//! let array = cluster::Array { engine, label: "datagen", folder, processors: 1 };
//! let missing = || Ok((0..20).filter(|shard| !folder.join(format!("{shard}.parquet")).exists()).collect());
//! let mut events = Vec::new();
//! let outcome = array.run(missing, &AtomicBool::new(false), &mut |event| events.push(event))?;
//! assert_eq!(outcome, cluster::Outcome::Finished);
//! # Ok(())
//! # }
//! ```

mod array;
mod command;
mod engine;
mod error;
mod hq;
mod job;
mod lock;
mod slurm;

pub use array::{Array, Event, Outcome, tidy};
pub use engine::{Engine, Executor};
pub use error::Error;
pub use lock::Lock;
