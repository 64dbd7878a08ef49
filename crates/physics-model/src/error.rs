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

/// What is wrong with an effect's description.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum EffectError {
    /// No effect has this name.
    #[error("there is no effect {name:?}, expected one of {known}")]
    Unknown {
        /// The name.
        name: String,
        /// All names.
        known: String,
    },
    /// An effect has no parameter of this name.
    #[error("{effect} has no parameter {name:?}: {known} exist")]
    UnknownParameter {
        /// Name of the effect.
        effect: &'static str,
        /// The name.
        name: String,
        /// All names.
        known: String,
    },
    /// A vector of parameters has another length.
    #[error("{effect} has {expected} parameters, found {found} values")]
    Count {
        /// Name of the effect.
        effect: &'static str,
        /// How many parameters it has.
        expected: usize,
        /// How many values were given.
        found: usize,
    },
    /// A parameter is outside its physical limits.
    #[error("{effect}.{key}: expected {low} to {high}{}{unit}, found {value}", if .unit.is_empty() { "" } else { " " })]
    OutOfRange {
        /// Name of the effect.
        effect: &'static str,
        /// Key of the parameter.
        key: &'static str,
        /// The value.
        value: f64,
        /// Smallest possible.
        low: f64,
        /// Largest possible.
        high: f64,
        /// Unit, empty for a ratio.
        unit: &'static str,
    },
}
