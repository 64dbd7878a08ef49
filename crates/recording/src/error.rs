//! What can go wrong.

use std::path::PathBuf;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file that is no trace.
    #[error("{}: expected the trace of an episode: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        reason: String,
    },
    /// A trace of another version.
    #[error("{}: version is {found}, this program reads version {}", path.display(), crate::VERSION)]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// A trace that cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The recording cannot be made.
    #[cfg(feature = "rerun")]
    #[error("cannot record for the viewer")]
    Recording {
        /// Why.
        #[from]
        source: rerun::RecordingStreamError,
    },
    /// The recording cannot be put into a file.
    #[cfg(feature = "rerun")]
    #[error("cannot encode the recording: {message}")]
    Encode {
        /// The library's words.
        message: String,
    },
}
