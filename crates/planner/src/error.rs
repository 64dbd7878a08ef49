//! What can go wrong before a search starts.

/// Errors of the planner.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A configured value lies outside its limits.
    #[error("planner: `{key}` is {value}, but must be {limit}")]
    Config {
        /// Field of [`crate::Config`], with dots between nested keys.
        key: &'static str,
        /// Offending value.
        value: String,
        /// What would be accepted.
        limit: String,
    },
}
