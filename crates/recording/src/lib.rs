//! A recorded episode, step by step: the truth, the belief and the search.
//!
//! An [`EpisodeTrace`] is plain data, independent of the program that made it. [`read`] and [`write()`] store it as
//! JSON. With the feature `rerun`, the program `to-rerun` makes a recording of it for the [Rerun](https://rerun.io)
//! viewer.
//!
//! # Example
//! ```
//! use recording::{EpisodeTrace, read, write};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("trace.json");
//! let trace = EpisodeTrace { title: "D4, trial 3".into(), ..EpisodeTrace::default() };
//! write(&trace, &path)?;
//! assert_eq!(read(&path)?, trace);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod file;
mod trace;

#[cfg(feature = "rerun")]
pub mod viewer;

pub use error::Error;
pub use file::{LARGEST_BYTES, read, write};
pub use trace::{
    Body, BodyShape, EpisodeTrace, Ghost, Goal, Moment, Pose, RootAction, Scene, SeenBelief, SeenParameter, SeenSearch,
    ToolPart, VERSION,
};
