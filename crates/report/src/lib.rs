//! Pictures and pages of episodes and runs, for people.
//!
//! An [`Observer`] looks on at an episode, of which an [`EpisodeTrace`](recording::EpisodeTrace) is kept; [`episode_figure`] draws that from above, [`episode_film`] as a moving picture.
//! [`episode_page`], [`run_page`] and [`suite_page`] are self-contained HTML. Programs `demo` and `report`.
//!
//! # Example
//!
//! ```no_run
//! let trace = recording::read("runs/demo/D4-sawyer-surmise-mixture/trace.json".as_ref())?;
//! report::episode_figure(&trace).save("episode".as_ref())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod above;
pub mod describe;
mod error;
mod film;
mod observer;
mod page;

pub use crate::page::{Suite, episode_page, run_page, suite_page};
pub use above::episode_figure;
pub use error::Error;
pub use film::episode_film;
pub use observer::{Observer, tool_parts};
