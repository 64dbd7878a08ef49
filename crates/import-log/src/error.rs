//! What can go wrong, and files of others.

use std::fs::File;
use std::path::{Path, PathBuf};

/// Errors of this crate: one sentence each, with the file, the place in it, what was expected and what was found.
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
    /// A file of the workspace's own kind that could not be read.
    #[error("{source}: {}", source.source)]
    File {
        /// What was tried, on which file, and why it failed.
        #[from]
        source: whole_file::Error,
    },
    /// A log or its header is no valid one, or could not be written.
    #[error(transparent)]
    Log(#[from] measured_log::Error),
    /// The log that was made of a source is no valid one.
    #[error("the log that was made of {}: {source}", path.display())]
    Made {
        /// The source.
        path: PathBuf,
        /// What is wrong with it; rows count over all episodes of the log.
        source: Box<measured_log::Error>,
    },
    /// A source with more than can be read in bounded memory.
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
    /// A text file that is not text, or not in its format.
    #[error("{} cannot be read: {reason}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line and cause.
        reason: String,
    },
    /// A key of a mapping is unknown, missing, of the wrong type or out of range, or names what the source does not hold.
    #[error("{}, key `{key}`: {reason}", path.display())]
    Key {
        /// The mapping.
        path: PathBuf,
        /// Dotted path of the key.
        key: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// A source that is not what its importer expects.
    #[error("{}, {place}: expected {expected}, found {found}", path.display())]
    Source {
        /// The file.
        path: PathBuf,
        /// Row, column, topic or message.
        place: String,
        /// What was expected.
        expected: String,
        /// What was found.
        found: String,
    },
    /// A source that is damaged or of another layout.
    #[error("{} cannot be decoded as {format}: {reason}", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// The decoder's words.
        reason: String,
    },
}

impl Error {
    /// An [`Error::Io`] maker for `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }

    /// An [`Error::Source`].
    pub(crate) fn source(path: &Path, place: impl Into<String>, expected: &str, found: impl Into<String>) -> Self {
        Self::Source { path: path.to_owned(), place: place.into(), expected: expected.into(), found: found.into() }
    }

    /// An [`Error::Broken`] with the words of a decoder.
    pub(crate) fn broken(path: &Path, format: &'static str, reason: &dyn std::fmt::Display) -> Self {
        Self::Broken {
            path: path.to_owned(),
            format,
            reason: whole_file::one_line(&whole_file::plain(&reason.to_string()), 300),
        }
    }

    /// Whether the disk refused what was to be written: no fault of the input.
    #[must_use]
    pub fn is_failure(&self) -> bool {
        matches!(self, Self::Log(measured_log::Error::Write { .. }))
    }
}

/// Opens a plain file: a pipe or a device could block or never end.
pub(crate) fn open(path: &Path) -> Result<File, Error> {
    let about = std::fs::metadata(path).map_err(Error::io("read", path))?;
    if !about.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is not a plain file");
        return Err(Error::Io { action: "read", path: path.to_owned(), source });
    }
    File::open(path).map_err(Error::io("read", path))
}

/// Reads a plain file of at most `limit` bytes.
pub(crate) fn read(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    Ok(whole_file::read(path, limit)?)
}

/// Reads a text file of at most `limit` bytes.
pub(crate) fn read_text(path: &Path, limit: u64) -> Result<String, Error> {
    String::from_utf8(read(path, limit)?).map_err(|e| Error::Syntax {
        path: path.to_owned(),
        reason: format!("expected UTF-8 text, found another byte at {}", e.utf8_error().valid_up_to()),
    })
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

/// What to write where a list is longer than the vector that it was named for.
pub(crate) fn one_by_one(path: &str) -> String {
    format!("(elements are named one by one, as in [\"{path}[0]\", …])")
}
