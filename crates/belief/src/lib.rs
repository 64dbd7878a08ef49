#![doc = include_str!("../README.md")]
//!
//! # API boundary
//!
//! Everything that is re-exported here; there are no public modules. The crate is made to be published: breaking changes follow semantic
//! versioning. The belief that a seed leads to may change with any version.
//!
//! # Which test sees which fault
//!
//! Faults planted into the weighted filter one at a time, and the tests that turned red (further ones may, where not all were run).
//!
//! | fault | red |
//! |---|---|
//! | weights not reset after resampling | `the_expected_weight_of_every_particle_stays`, `draws_follow_the_exact_posterior_and_evidence_is_unbiased` and 15 more |
//! | quota without weight correction | `the_expected_weight_of_every_particle_stays`, `counts_weights_and_quotas_hold` |
//! | one offset shared by all strata | `alternating_particles_are_drawn_independently_of_each_other` |
//! | log-sum-exp without the maximum | `logarithms_far_from_zero_are_summed` |
//! | tempering exponent applied twice | `tempering_changes_neither`, `kalman_is_met_with_tempering_where_the_sensor_is_sharp` |
//! | Liu–West without shrinkage | `smoothing_keeps_moments_and_makes_no_copies` |
//! | kernel width 1 − a² instead of its root | `shrinkage_keeps_the_variance` |
//! | proposals without their density | `good_proposals_…`, `confident_and_wrong_proposals_leave_the_belief_calibrated` |
//! | the belief's particles keep their weight beside proposals | `good_proposals_…`, `confident_and_wrong_proposals_leave_the_belief_calibrated` |
//! | first draws of a tempered update summed instead of averaged | `tempering_changes_neither`, `kalman_is_met_with_tempering_…` |
//! | guided draws without their weight | `tempering_changes_neither`, `kalman_is_met_with_tempering_…` |
//! | moves accept everything | `tempering_changes_neither`, `kalman_is_met_with_tempering_…` |
//! | moves judged at the whole likelihood | `tempering_changes_neither`, `kalman_is_met_with_tempering_…` |
//! | terminal particles explain an observation | `terminal_particles_explain_nothing_while_the_episode_goes_on` |
//! | one random stream for all particles | `draws_follow_the_exact_posterior_and_evidence_is_unbiased` |
//! | a restart replays only the latest step | `a_kidnapped_belief_is_drawn_anew_and_explains_the_whole_history` |

mod config;
mod diagnostics;
mod error;
mod particles;
mod reinvigorate;
mod rejection;
mod resample;
mod weighted;

pub use config::RejectionConfig;
pub use diagnostics::effective_sample_size;
pub use error::Error;
pub use particles::Particles;
pub use rejection::RejectionFilter;
pub use weighted::{Trackable, WeightedConfig, WeightedFilter};
