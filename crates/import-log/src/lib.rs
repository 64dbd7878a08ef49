//! Recordings of others as measured logs: tables, MCAP files, ROS 2 bags, LeRobot folders, and two published data sets.
//!
//! ```text
//! source ──(one reader a kind)──> readings of each track ──(cut, sample, turn)──> measured_log::Log
//!             mapping ── plan ──────────┘
//! ```
//!
//! `docs/src/guides/import.md` is the way in; `docs/src/reference/import-mapping.md` has the keys of a mapping.
//!
//! Invariants:
//!
//! - Whatever stands in source and mapping, the answer is a valid log or an [`Error`] of one sentence: never a panic.
//! - Of a source only the numbers that the mapping asks for are kept, and a bounded count of them: 16 Mi for messages. Above it, readings
//!   that follow each other within a quarter of the period are left out.
//! - Nothing is smoothed or guessed. A row has a reading only where one was made near enough.
//!
//! # Example
//!
//! ```
//! use import_log::{Mapping, Source};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let dir = folder.path();
//! let map = dir.join("map.toml");
//! std::fs::write(&map, r#"
//!     version = 1
//!     clock = { stamp = "t", unit = "ms" }
//!     episodes = { change = { value = "trial" } }
//!     [log]
//!     robot = "none"
//!     period_secs = 0.01
//!     gravity_mps2 = 9.81
//!     table = { height_m = 0.0, friction = { mean = 0.4, stddev = 0.04 } }
//!     object = { shape = "sphere", size_m = [0.03], mass_kg = 0.2, com_m = [0.0, 0.0, 0.0] }
//!     split = { holdout_fraction = 0.5 }
//!     [object]
//!     position = ["x", "y", "z"]
//!     unit = "mm"
//!     orientation = ["w", "i", "j", "k"]
//!     order = "wxyz"
//! "#)?;
//! let table = dir.join("balls.csv");
//! std::fs::write(&table, "trial;t;x;y;z;w;i;j;k\n1;500;100;0;30;1;0;0;0\n1;510;;;;;;;\n2;900;110;0;30;1;0;0;0\n")?;
//! let log = Source::Table.import(&[table], &Mapping::read(&map)?)?;
//! assert_eq!(log.episodes[0].time_secs, [0.0, 0.01]);
//! assert_eq!(log.episodes[1].vector(measured_log::Channel::ObjectPosition, 0), Some([0.11, 0.0, 0.03]));
//! # Ok(())
//! # }
//! ```

mod assemble;
mod bag;
mod builder;
mod builtin;
mod cdr;
mod columns;
mod cut;
mod decode;
mod draft;
mod error;
mod import;
mod lerobot;
mod mapping;
mod mcap_file;
mod messages;
mod parquet_file;
mod plan;
pub mod published;
mod rigid;
mod rows;
mod sample;
mod schema;
mod store;
mod survey;
mod table;
mod units;
mod value;

pub use draft::draft;
pub use error::Error;
pub use import::{Source, summary};
pub use mapping::Mapping;
