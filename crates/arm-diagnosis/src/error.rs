//! What is wrong with a joint log.

use std::path::{Path, PathBuf};

use arm_dynamics::ArmError;
use thiserror::Error;

/// Why a joint log cannot be diagnosed. Messages name file, key or column, and what was expected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file of the log cannot be read.
    #[error("{}: cannot be read: {source}", .path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A file of the log is not as the format has it.
    #[error("{}: {problem}", .path.display())]
    Log {
        /// File.
        path: PathBuf,
        /// Line, key or column, and what was expected.
        problem: String,
    },
    /// The robot of the log.
    #[error(transparent)]
    Arm(#[from] ArmError),
}

pub(crate) fn refuse(path: &Path, problem: &str) -> Error {
    Error::Log { path: path.into(), problem: whole_file::one_line(problem, 600) }
}
