//! Particle filters over (s, Θ).
//!
//! [`Particles`] is the belief; [`RejectionFilter`] is the update of the `paper` preset: simulate particles and keep those whose
//! observation falls into the class of the real one (Silver and Veness 2010), reinvigorate with artificial noise where they run
//! out, and take in particles suggested from outside. [`WeightedFilter`] is that of the `surmise` preset: likelihood weights on continuous
//! observations, tempering, smoothed static parameters and quotas per structure, proposals with importance weights, restarts. Depletion is
//! a typed error, never an empty belief.
//!
//! # Example
//!
//! A coin that is either fair or always shows heads; tossing it tells them apart.
//!
//! ```
//! use belief::{Config, Particles, RejectionFilter};
//! use pomdp::{Discretise, GenerativeModel, Outcome, Perturb, Proposals, Purpose, Rng, Seed, Step, Updater};
//! use rand::RngExt as _;
//!
//! struct Coin;
//!
//! /// Probability of heads: what is unknown.
//! type Heads = f64;
//!
//! impl GenerativeModel for Coin {
//!     type State = Heads;
//!     type Action = ();
//!     type Observation = bool;
//!     fn actions(&self) -> &[()] { &[()] }
//!     fn step(&self, heads: &mut Heads, _toss: &(), rng: &mut Rng) -> Step<bool> {
//!         Step { observation: rng.random_bool(*heads), reward: 0.0, outcome: Outcome::Continue }
//!     }
//!     fn discount(&self) -> f64 { 1.0 }
//! }
//!
//! impl Discretise for Coin {
//!     type Key = bool;
//!     fn key(&self, observation: &bool) -> bool { *observation }
//! }
//!
//! impl Perturb for Coin {
//!     fn perturb(&self, heads: &mut Heads, rng: &mut Rng) {
//!         *heads = (*heads + rng.random_range(-0.01..0.01)).clamp(0.0, 1.0);
//!     }
//! }
//!
//! let mut filter = RejectionFilter::new(Config { particles: 1000, max_attempts: 10_000, noise_share: 0.2, proposal_share: 0.1 })?;
//! let belief = Particles::uniform(vec![0.5, 1.0])?;
//! let mut rng = Seed(1).stream(Purpose::Filter, 0);
//!
//! let (belief, report) = filter.update(&Coin, belief, &(), &true, Proposals::none(), &mut rng)?;
//! let biased = belief.states().iter().filter(|&&heads| heads == 1.0).count();
//! assert!((biased as f64 / 1000.0 - 2.0 / 3.0).abs() < 0.06); // Bayes: 1 / (1 + 1/2)
//! assert!((report.log_evidence - 0.75_f64.ln()).abs() < 0.06);
//! # Ok::<(), belief::Error>(())
//! ```
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

pub use config::Config;
pub use diagnostics::effective_sample_size;
pub use error::Error;
pub use particles::Particles;
pub use rejection::RejectionFilter;
pub use weighted::{Trackable, WeightedConfig, WeightedFilter};
