//! What can go wrong.

use std::path::{Path, PathBuf};

/// Errors of this crate: one sentence each, with the file, the row and column or the key, and what was expected. Rows count from 1, the
/// first row after the column names.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused something.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried, as a verb.
        action: &'static str,
        /// On which file or folder.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// A file in place of a log's folder.
    #[error("{} is a file: expected the folder of a log, with log.toml and samples.csv or samples.parquet", path.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
    },
    /// The folder for a log is none, or holds results of another kind.
    #[error("{source}: {}", source.source)]
    Taken {
        /// What is there.
        source: whole_file::Error,
    },
    /// A file could not be written whole.
    #[error("{source}: {}", source.source)]
    Write {
        /// What was tried, on which file, and why it failed.
        source: whole_file::Error,
    },
    /// A file that is too large to be read in bounded memory.
    #[error("{} is too large: expected at most {limit} {what}, found {found}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Unit of the limit.
        what: &'static str,
        /// The limit.
        limit: u64,
        /// What the file has.
        found: u64,
    },
    /// A text file that is not text, or not TOML.
    #[error("{} cannot be read: {reason}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line and cause.
        reason: String,
    },
    /// A log of another version of the format.
    #[error("{}, key `version`: expected {}, found {found}", path.display(), crate::VERSION)]
    Version {
        /// The file.
        path: PathBuf,
        /// What stands there.
        found: String,
    },
    /// A key of `log.toml` is unknown, missing, of the wrong type or out of range.
    #[error("{}, key `{key}`: {reason}", path.display())]
    Key {
        /// The file.
        path: PathBuf,
        /// Dotted path of the key.
        key: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// The folder has no samples, or both a CSV and a Parquet file.
    #[error("{}: expected exactly one of samples.csv and samples.parquet, found {found}", dir.display())]
    Samples {
        /// The folder.
        dir: PathBuf,
        /// "neither" or "both".
        found: &'static str,
    },
    /// A column is unknown, missing, given twice, or does not fit the robot.
    #[error("{}, column `{column}`: {reason}", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// Its name.
        column: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// A cell that is malformed or contradicts its neighbours.
    #[error("{}, row {row}, column `{column}`: expected {expected}, found {found}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Row from 1.
        row: u64,
        /// Name of the column.
        column: String,
        /// What was expected.
        expected: String,
        /// What was found.
        found: String,
    },
    /// A row with another number of cells than the header.
    #[error("{}, row {row}: expected {expected} cells, found {found}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Row from 1.
        row: u64,
        /// Number of columns.
        expected: u64,
        /// Number of cells.
        found: u64,
    },
    /// A Parquet file that is damaged or of another layout.
    #[error("{} cannot be decoded as Parquet: {reason}", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// The decoder's words.
        reason: String,
    },
    /// Too few episodes for the hold-out split.
    #[error(
        "{}: expected at least {needed} episodes, so that split.holdout_fraction = {fraction} leaves some on both sides, found {found}",
        path.display()
    )]
    TooFewEpisodes {
        /// The samples.
        path: PathBuf,
        /// Least number of episodes.
        needed: u64,
        /// `split.holdout_fraction`.
        fraction: f64,
        /// Episodes of the log.
        found: u64,
    },
    /// The folder holds a log already.
    #[error("{} exists: expected a folder without a log, nothing was written", path.display())]
    Exists {
        /// The file that is in the way.
        path: PathBuf,
    },
}

impl Error {
    /// An [`Error::Io`] maker for `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }
}

/// A complaint about values that have no file yet; [`Problem::at`] gives them theirs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Problem {
    Column { column: String, reason: String },
    Cell { row: usize, column: String, expected: String, found: String },
    Key { key: String, reason: String },
    Rows { found: usize },
    Episodes { needed: u64, fraction: f64, found: usize },
}

impl Problem {
    pub(crate) fn cell(row: usize, column: impl Into<String>, expected: &str, found: &impl ToString) -> Self {
        Self::Cell { row, column: column.into(), expected: expected.into(), found: found.to_string() }
    }

    pub(crate) fn column(column: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Column { column: column.into(), reason: reason.into() }
    }

    pub(crate) fn key(key: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Key { key: key.into(), reason: reason.into() }
    }

    /// The error for the files `header` (`log.toml`) and `samples`.
    pub(crate) fn at(self, header: &Path, samples: &Path) -> Error {
        let path = samples.to_owned();
        match self {
            Self::Column { column, reason } => Error::Column { path, column, reason },
            Self::Cell { row, column, expected, found } => {
                Error::Cell { path, row: row as u64 + 1, column, expected, found }
            }
            Self::Key { key, reason } => Error::Key { path: header.to_owned(), key, reason },
            Self::Rows { found } => {
                Error::TooLarge { path, what: "rows", limit: crate::MAX_ROWS as u64, found: found as u64 }
            }
            Self::Episodes { needed, fraction, found } => {
                Error::TooFewEpisodes { path, needed, fraction, found: found as u64 }
            }
        }
    }
}

/// `text` for a message: one line, of bounded length, without control characters.
pub(crate) fn excerpt(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short: String = text.chars().take(LONGEST).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    format!("`{short}`")
}
