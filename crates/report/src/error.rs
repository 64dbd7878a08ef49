//! What can go wrong.

use std::path::PathBuf;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A picture that cannot be drawn.
    #[error(transparent)]
    Figure(#[from] figures::Error),
    /// A combined table that this version does not understand.
    #[error("{}: expected a table of this version's `eval --all`, and found one of another ({reason}): make it anew with --keep-finished", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        reason: String,
    },
    /// A folder that holds neither a run nor an episode.
    #[error(
        "{}: expected a run of `eval` (run.json), of `eval --all` (all.json) or an episode of `demo` (trace.json)",
        path.display()
    )]
    NoRun {
        /// The folder.
        path: PathBuf,
    },
}
