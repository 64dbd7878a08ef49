//! Standard problems of planning and filtering under partial observability, with known answers.
//!
//! Tests and benchmarks of `planner` run on these. States are small `Copy` values, a step takes some ten nanoseconds, and
//! every transition and observation function is tested against its published definition.
//!
//! # Example
//!
//! ```
//! use pomdp::{GenerativeModel as _, Purpose, Seed};
//! use problems::tiger::{Action, Tiger};
//!
//! let tiger = Tiger { ends_on_open: true };
//! let mut tiger_is_left = true;
//! let step = tiger.step(&mut tiger_is_left, &Action::OpenLeft, &mut Seed(1).stream(Purpose::Test, 0));
//! assert_eq!(step.reward, -100.0);
//! ```

pub mod beams;
pub mod bits;
pub mod episode;
pub mod finite;
pub mod laser_tag;
pub mod light_dark;
pub mod rock_sample;
pub mod sub_hunt;
pub mod tag;
pub mod tiger;
pub mod vdp_tag;

pub use episode::{Episode, InitialState, Particles};
pub use laser_tag::LaserTag;
pub use light_dark::LightDark;
pub use rock_sample::RockSample;
pub use sub_hunt::SubHunt;
pub use tag::Tag;
pub use tiger::Tiger;
pub use vdp_tag::VdpTag;
