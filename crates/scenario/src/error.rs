//! Errors of this crate: every one names file, key and expectation.

use std::path::PathBuf;

use thiserror::Error;

/// Why a scenario cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A domain, robot or preset that has no file.
    #[error("unknown {kind} `{name}`: expected one of {known}, or a path to a .toml file")]
    Unknown {
        /// Domain, robot or preset.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// What exists.
        known: String,
    },
    /// A file that cannot be read.
    #[error("{file}: cannot be read")]
    Read {
        /// File.
        file: PathBuf,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// A file that is not TOML.
    #[error("{file}: not valid TOML: {message}")]
    Syntax {
        /// File.
        file: PathBuf,
        /// Where and what.
        message: String,
    },
    /// A file of another format version.
    #[error("{file}: version is {found}, this program reads version {expected}")]
    Version {
        /// File.
        file: PathBuf,
        /// Found.
        found: String,
        /// Expected.
        expected: u32,
    },
    /// A key that is unknown, missing or of the wrong type.
    #[error("{file}: key `{key}`: {message}")]
    Key {
        /// The file (or `--set`) that last gave the key or its table.
        file: String,
        /// Path of the key.
        key: String,
        /// Expectation.
        message: String,
    },
    /// An override that is not `key=value`.
    #[error("--set {text}: expected key=value with a dotted key and a TOML value, for example planner.depth=15")]
    Override {
        /// What was given.
        text: String,
    },
    /// An override whose value begins as a list, a table or a text in quotes, and is none.
    #[error("--set {text}: expected a TOML value, for example [1, 2], [\"a\", \"b\"] or {{ low = 0.1, high = 0.2 }}")]
    OverrideValue {
        /// What was given.
        text: String,
    },
    /// A value out of its range.
    #[error("{file}: {problem}")]
    Value {
        /// Where it was given.
        file: String,
        /// Key, expectation and value.
        problem: String,
    },
    /// The project folder cannot be found, or the arm not be loaded.
    #[error(transparent)]
    Robot(#[from] physics_model::robot::RobotError),
    /// The task cannot be set up.
    #[error("scenario {name}: {problem}")]
    Task {
        /// Scenario.
        name: String,
        /// What is wrong.
        problem: String,
    },
}
