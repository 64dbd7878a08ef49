//! Logs of real or simulated rigs: read, checked, written.
//!
//! ```text
//! DIR/log.toml           the rig and the nominal model: Header
//! DIR/samples.csv        one row a control tick, one column a channel; or
//! DIR/samples.parquet    the same columns
//! ```
//!
//! `docs/src/reference/measured-log.md` describes the format, its units and limits. The crate `import-log` makes such logs of other recordings.
//!
//! Invariants:
//!
//! - What [`read`] returns has passed every check of the format; so has what [`write`] writes. Numbers survive bit for bit.
//! - Whatever stands in the files, the answer is a log or an [`Error`] that names file, row and column, or key: never a panic.
//! - Memory is bounded: by [`MAX_ROWS`] rows of at most 40 channels, 9 bytes each, and by [`MAX_FILE_BYTES`] for a Parquet file.
//! - Readings are never NaN; a missing one is `None`. Nothing is smoothed, resampled or corrected here.
//! - The crate knows columns and units, no physics.
//!
//! # Example
//!
//! ```
//! use measured_log::{Channel, Format, Log, Notes};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let dir = folder.path();
//! std::fs::write(dir.join("log.toml"), r#"
//!     version = 1
//!     robot = "none"
//!     period_secs = 0.01
//!     gravity_mps2 = 9.81
//!     table = { height_m = 0.0, friction = { mean = 0.4, stddev = 0.04 } }
//!     object = { shape = "sphere", size_m = [0.03], mass_kg = 0.2, com_m = [0.0, 0.0, 0.0] }
//!     split = { holdout_fraction = 0.5 }
//! "#)?;
//! std::fs::write(dir.join("samples.csv"), "\
//! episode,time_secs,object_x_m,object_y_m,object_z_m,object_qx,object_qy,object_qz,object_qw
//! 0,0.00,0.1,0,0.5,0,0,0,1
//! 0,0.01,,,,,,,
//! 1,0.00,0.1,0,0.6,0,0,0,1
//! ")?;
//! let log: Log = measured_log::read(dir)?;
//! assert_eq!(log.episodes[1].vector(Channel::ObjectPosition, 0), Some([0.1, 0.0, 0.6]));
//! assert_eq!(log.episodes[0].orientation(1), None, "not measured");
//! assert_eq!(log.split(1).holdout.len(), 1);
//!
//! let copy = dir.join("copy");
//! measured_log::write(&copy, &log, Format::Parquet, &Notes::new())?;
//! assert_eq!(measured_log::read(&copy)?, log);
//! # Ok(())
//! # }
//! ```

mod channel;
mod columns;
mod error;
mod folder;
mod frame;
mod header;
mod header_toml;
mod log;
mod number;
mod outline;
mod readings;
mod samples_csv;
mod samples_parquet;
mod split;

pub use channel::{Axis, Channel, Component};
pub use error::Error;
pub use folder::{Format, read, write};
pub use header::{Header, Noise, Object, Robot, Shape, SplitConfig, Table};
pub use header_toml::{Notes, header, parse as parse_header, print as print_header};
pub use log::{Episode, Log};
pub use number::Number;
pub use readings::Readings;
pub use split::Split;

/// Version of the format.
pub const VERSION: u32 = 1;

/// Rows of a log at most: 2 hours 46 minutes at 100 Hz.
pub const MAX_ROWS: usize = 1_000_000;

/// Size of `samples.csv` or `samples.parquet` at most.
pub const MAX_FILE_BYTES: u64 = 512 << 20;

/// How far the norm of a quaternion may be from 1: rounding and noise pass, a wrong column or unit does not.
pub const UNIT_TOLERANCE: f64 = 0.01;
