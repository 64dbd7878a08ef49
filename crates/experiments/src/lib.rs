//! Trials of methods on domains, to tables with intervals.
//!
//! A run directory holds `run.json` (what the run is), `scenario.toml` (resolved), `trials.jsonl` (one line a trial) and, when all
//! trials are done, `table.json`, `table.md` and `table.csv`. Finished trials are never redone.

mod clock;
mod error;
mod evaluation;
mod failure;
mod files;
mod interval;
mod paired;
mod plan;
mod player;
mod run;
mod table;
mod trial;
mod worlds;

pub use error::Error;
pub use evaluation::{Evaluation, Request};
pub use failure::Failure;
pub use interval::wilson95;
pub use paired::Pair;
pub use plan::{Include, Item, Plan, Pool, RunPlan, TablePlan};
pub use player::Player;
pub use run::{Provenance, Run, RunIdentity};
pub use table::{Row, Table};
pub use trial::{TrialRecord, play, play_external};
pub use worlds::Worlds;
