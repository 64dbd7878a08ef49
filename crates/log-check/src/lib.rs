//! What a measured log's own readings say against its units, frames, sizes and sensors, before anything is simulated.
//!
//! Rules of rest and contact hold in every log, whatever effect it hides: an object at rest lies on a face on the table; where it sets out
//! the tool touches it; tool and object are never in each other; the object pushes the tool away; a ball's torque about its own centre is small. A log that
//! breaks such a rule may be meant in another way than the format says. Each way that such logs are commonly meant in is a [`Reading`]: quaternions as w, x, y, z, a
//! tracker's frame turned by a quarter, half lengths for full ones, a wrench with its sign reversed. A log is suspected only where another reading keeps the rules much
//! better than the log's own ([`Suspicion`]), so that an effect, which no such reading mends, is no reason. What no reading can change in a log is told as
//! well ([`Check::not_told`]).
//!
//! # Example
//!
//! ```
//! # fn main() -> Result<(), measured_log::Error> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mujoco-logs/logs/set-003");
//! let log = measured_log::read(folder.as_ref())?;
//! let check = log_check::check(&log, None);
//! assert!(check.suspicions.is_empty(), "{:?}", check.suspicions);
//! # Ok(())
//! # }
//! ```

mod align;
mod arm;
mod arrival;
mod check;
mod clipped;
mod geometry;
mod motion;
mod reading;
mod sensors;
mod shape;
mod suspicion;
mod wrench;

pub use align::{Alignment, Correction, Estimate, align};
pub use arrival::Followed;
pub use check::{Check, check};
pub use geometry::{Fit, Rest, Touch};
pub use reading::Reading;
pub use sensors::{Clock, Sensor, without_dead};
pub use suspicion::{Kind, Suspicion, capital};
pub use wrench::{Forces, Lever};
