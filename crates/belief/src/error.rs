//! Why there is no belief.

/// Errors of belief updates.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No particle explains the observation, perturbed ones and proposals included.
    #[error(
        "depleted: none of {attempts} simulated particles agrees with the observation ({diverged} diverged, {terminal} ended the \
         episode), and no proposal explains it either"
    )]
    Depleted {
        /// Transitions simulated.
        attempts: usize,
        /// Simulated worlds that diverged.
        diverged: usize,
        /// Simulated worlds that reached a terminal state although the real episode goes on.
        terminal: usize,
    },
    /// A belief needs at least one particle.
    #[error("a belief needs at least one particle, got none")]
    Empty,
    /// There must be one weight per particle.
    #[error("{states} particles came with {weights} weights")]
    WeightCount {
        /// Number of states.
        states: usize,
        /// Number of weights.
        weights: usize,
    },
    /// A weight is negative or not finite.
    #[error("weight of particle {index} is {value}, but must be finite and not negative")]
    Weight {
        /// Which particle.
        index: usize,
        /// Its weight.
        value: f64,
    },
    /// Weights without a positive finite sum describe no distribution.
    #[error("the weights sum to {sum}, but the sum must be positive and finite")]
    WeightSum {
        /// The sum.
        sum: f64,
    },
    /// A configured value lies outside its limits.
    #[error("belief: `{key}` is {value}, but must be {limit}")]
    Config {
        /// Field of the configuration.
        key: &'static str,
        /// Offending value.
        value: String,
        /// What would be accepted.
        limit: String,
    },
}
