//! Errors of this crate.

use thiserror::Error;

/// Why an episode could not be played.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The scenario does not fit.
    #[error(transparent)]
    Scenario(#[from] scenario::Error),
    /// The filter's settings are impossible.
    #[error(transparent)]
    Belief(#[from] belief::Error),
    /// The planner's settings are impossible.
    #[error(transparent)]
    Planner(#[from] planner::Error),
    /// A method that needs a prior was given none.
    #[error("method {method} needs a trained prior, none was given")]
    NoPrior {
        /// Method.
        method: &'static str,
    },
    /// The bridge filter needs the density of all draws, which is not known of those that were chosen by the observation.
    #[error(
        "method {method} does not go with belief.filter = \"bridge\", which needs the density of its suggestions: use mixture, no-rnn, oracle or heuristic, or --preset paper"
    )]
    NoDensity {
        /// Method.
        method: &'static str,
    },
    /// The filters ask for different networks.
    #[error("belief.filter = \"{filter}\" needs another kind of network than the one given")]
    OtherNetwork {
        /// Filter.
        filter: &'static str,
    },
    /// The rejection filter has no weights.
    #[error(
        "method {method} does not go with belief.filter = \"rejection\", which cannot weigh suggestions: use rnn-sampling"
    )]
    NoWeights {
        /// Method.
        method: &'static str,
    },
    /// The oracle was asked of a world that does not know its own truth.
    #[error("method oracle needs a world that knows its true state")]
    NoTruth,
    /// The world failed.
    #[error(transparent)]
    World(#[from] crate::WorldError),
}
