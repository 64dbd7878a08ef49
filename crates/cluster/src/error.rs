//! Errors of this crate.

use std::path::{Path, PathBuf};

/// Why an array cannot be submitted, or has not made its shards.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The engine's program is not there.
    #[error("--executor {executor}: `{program}` cannot be started here: expected an installed {executor}")]
    NoProgram {
        /// Executor.
        executor: &'static str,
        /// Its program.
        program: String,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// The engine said no.
    #[error("--executor {executor}: `{program}` failed: {message}")]
    Refused {
        /// Executor.
        executor: &'static str,
        /// Its program.
        program: String,
        /// What it said.
        message: String,
    },
    /// The engine's program answered something else than expected.
    #[error("--executor {executor}: `{program}` answered `{answer}`: expected {expected}")]
    Answer {
        /// Executor.
        executor: &'static str,
        /// Its program.
        program: String,
        /// What it printed.
        answer: String,
        /// What it should have printed.
        expected: &'static str,
    },
    /// The array ended and left shards undone.
    #[error(
        "{executor} job {job} ended with {missing} of {submitted} shards unfinished{log}; the same command makes those that are missing"
    )]
    Unfinished {
        /// Executor.
        executor: &'static str,
        /// Number of the job.
        job: String,
        /// Shards without a result.
        missing: usize,
        /// Shards of the array.
        submitted: usize,
        /// Where one of their workers says why, and its last line; empty where none left a log.
        log: String,
    },
    /// Another program works in the folder.
    #[error("{}: another program is at work in this folder: wait for it, or choose another --out", folder.display())]
    Busy {
        /// Folder.
        folder: PathBuf,
    },
    /// An argument that no script can hold.
    #[error("argument {index}: expected text without NUL bytes, as it goes into a script")]
    Argument {
        /// Its position.
        index: usize,
    },
    /// The operating system refused something.
    #[error("cannot {action} {}", path.display())]
    File {
        /// Verb, such as "write".
        action: &'static str,
        /// What was touched.
        path: PathBuf,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
}

impl Error {
    /// An [`Error::File`] maker for `map_err`.
    pub(crate) fn file<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(std::io::Error) -> Self + use<'a> {
        move |source| Self::File { action, path: path.to_path_buf(), source }
    }
}
