#![doc = include_str!("../README.md")]
//!
//! # API boundary
//!
//! Everything that is re-exported here; there are no public modules. The crate is made to be published: breaking changes follow semantic
//! versioning. The belief that a seed leads to may change with any version.
//!
//! # Which test sees which fault
//!
//! Faults planted one at a time, and the tests that turned red (further ones may, where not all were run).
//!
//! | fault | red |
//! |---|---|
//! | bridge: draws not weighed by the mixture of the teachers | `kept_draws_count_as_much_as_new_ones`, `what_the_latest_teacher_excludes_stays_possible` |
//! | bridge: the ratio of a forgotten teacher kept | the same |
//! | bridge: a kept draw not weighed by the new step | the same |
//! | bridge: no weight for what the latest teacher excludes | `what_the_latest_teacher_excludes_stays_possible` |
//! | bridge: exponent always 0 | `an_exact_teacher_leads_to_the_exact_posterior` and 6 more |
//! | bridge: exponent always 1 | `too_few_draws_show_as_width` |
//! | a broken likelihood wins | `depletion_is_an_error_and_no_belief` |
//! | one random stream for all particles | `an_exact_teacher_leads_to_the_exact_posterior` and 7 more |
//! | resample–move: weights kept after resampling | `slope_and_second_body_have_their_exact_posterior` |
//! | resample–move: every move accepted | the same |
//! | resample–move: moves along differences without their prior | the same |
//! | resample–move: only the last step's likelihood counts | the same |
//! | reference: draws from the teacher accepted without their ratio | `a_wrong_teacher_leads_to_the_exact_posterior` |
//! | reference: weights without the teacher's ratio; evidence not averaged; a teacher's density not mixed with the prior's | the same |
//! | log-sum-exp without the maximum | `logarithms_far_from_zero_are_summed` |

mod bridge;
mod config;
mod diagnostics;
mod error;
mod parallel;
mod particles;
mod reference;
mod reinvigorate;
mod rejection;
mod resample_move;

pub use bridge::{BridgeConfig, BridgeFilter};
pub use config::RejectionConfig;
pub use diagnostics::effective_sample_size;
pub use error::Error;
pub use particles::Particles;
pub use reference::{Reference, ReferenceConfig, reference};
pub use rejection::RejectionFilter;
pub use resample_move::{ResampleMoveConfig, ResampleMoveFilter};
