//! Motions of an arm whose log would tell most of what its model may lack.
//!
//! A motion is a Fourier series for each joint (Swevers, Ganseman, Tükel, De Schutter and Van Brussel 1997) that begins and ends at rest. Of the series
//! that keep the limits, the one is sought whose log tells most: the expected information about the numbers in question, in nats (Lindley 1956),
//! with what else a model may be wrong about unknown at the same time. For a linear model with normal errors and priors it is half the
//! ln of a ratio of determinants (Bayesian D-optimality; Chaloner and Verdinelli 1995), whatever the true numbers are.
//!
//! Links are taken for rods between the joints, as thick as said. A motion should be looked at in a simulator before a robot makes it.

mod information;
mod motion;
mod room;
mod search;

pub use information::{Question, Spread};
pub use motion::{Motion, Sample};
pub use search::{Excitation, Settings, excitation};

/// Why there is no motion.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    /// A setting outside its limits.
    #[error("{0}")]
    Setting(String),
    /// No series was found that keeps the limits.
    #[error("no motion of {seconds} s was found that keeps the limits: {why}")]
    Limits {
        /// Length of the motion, s.
        seconds: f64,
        /// Which limit the best one breaks.
        why: String,
    },
}
