//! Errors of this crate.

use thiserror::Error;

/// Why a hypothesis (s, Θ) cannot be a world.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Impossible {
    /// A value is not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which value.
        what: &'static str,
    },
    /// A value is outside its physical range.
    #[error("{what} is {value}, expected {low} to {high}")]
    OutOfRange {
        /// Which value.
        what: &'static str,
        /// The value.
        value: f64,
        /// Smallest possible.
        low: f64,
        /// Largest possible.
        high: f64,
    },
    /// Two bodies overlap more than contacts do.
    #[error("{first} and {second} overlap by {depth_m} m, at most {limit_m} m is possible")]
    Overlap {
        /// One body.
        first: &'static str,
        /// The other body.
        second: &'static str,
        /// Penetration, m.
        depth_m: f64,
        /// Limit, m.
        limit_m: f64,
    },
}
