//! Trials of methods on domains, to tables with intervals.
//!
//! A run directory holds `run.json` (what the run is), `scenario.toml` (resolved), `trials.jsonl` (one line a trial) and, when all
//! trials are done, `table.json`, `table.md` and `table.csv`. Finished trials are never redone. While workers of an engine play, `shards/` holds
//! their logs.
//!
//! An [`Evaluation`] is one run, a [`Player`] plays what it lacks, a [`Suite`] is all runs of a [`Plan`] and puts them side by side
//! ([`Combined`]). What depends on the clock stands at the end of a trial's line and in files of its own.

mod archive;
mod clock;
mod combined;
mod differences;
mod error;
mod evaluation;
mod failure;
mod files;
mod learning;
mod log;
mod pace;
mod paired;
mod pictures;
mod plan;
mod player;
mod run;
mod shards;
mod spreadsheet;
mod suite;
mod table;
mod trial;
mod worlds;

pub use archive::Archive;
pub use combined::{Arm, Combined, CombinedRow, Common, Comparison, Source, Sources, Total};
pub use error::Error;
pub use evaluation::{Evaluation, Request};
pub use failure::{Failure, world_failures};
pub use pace::Pace;
pub use paired::Pair;
pub use plan::{Include, Item, Plan, Pool, RunPlan, TablePlan};
pub use player::Player;
pub use run::{Provenance, Run, RunIdentity};
pub use shards::Shard;
pub use suite::{Suite, SuiteRequest};
pub use table::{Row, Table};
pub use trial::{TrialRecord, play, play_external, play_watched};
pub use worlds::Worlds;
