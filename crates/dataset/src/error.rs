//! What can go wrong.

use std::path::{Path, PathBuf};

/// Errors of this crate. Each names the file, the key or column, and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused something.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// What was tried, as a verb.
        action: &'static str,
        /// On which file or folder.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// A JSON file has an unknown, missing or malformed key.
    #[error("{} is not valid: {reason}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The parser's words: key, line and column.
        reason: String,
    },
    /// A file was written by another version of this crate.
    #[error("{} has version {found}, but this program reads version {}", path.display(), crate::VERSION)]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// The folder holds the shards of another plan.
    #[error("{} is another plan, so nothing was written; it differs in {differences}", path.display())]
    PlanDiffers {
        /// The saved plan.
        path: PathBuf,
        /// Each differing key with the saved and the given value.
        differences: String,
    },
    /// A plan or schema that cannot be carried out.
    #[error("`{key}` of the plan is invalid: {reason}")]
    Plan {
        /// The key.
        key: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// A row that does not fit the schema or its neighbours.
    #[error("row {row} (episode {episode}, step {step}): column `{column}`: {reason}")]
    Row {
        /// Position in the shard, from 0.
        row: usize,
        /// Its episode.
        episode: u64,
        /// Its step.
        step: u32,
        /// The offending column.
        column: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// A shard of the plan has not been written yet.
    #[error("shard {index} is missing: expected the file {}", path.display())]
    MissingShard {
        /// Its index in the plan.
        index: u32,
        /// Where it should be.
        path: PathBuf,
    },
    /// A shard is damaged, or belongs to another plan or place.
    #[error("{} is no usable shard: {reason}; delete it to have it made again", path.display())]
    BrokenShard {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        reason: String,
    },
    /// A file in the data folder that does not belong to the plan; readers that take all files would read it too.
    #[error("{} is not part of the plan: move it out of the data folder", path.display())]
    UnexpectedFile {
        /// The file.
        path: PathBuf,
    },
    /// The folder has no manifest.
    #[error("{} is not a finished dataset: it has no meta/info.json, which is written after the last shard", dir.display())]
    Unfinished {
        /// The folder.
        dir: PathBuf,
    },
    /// The manifest contradicts itself or its shards.
    #[error("`{key}` in {} does not hold: {reason}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// The key.
        key: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// The Parquet writer failed.
    #[error("cannot encode {} as Parquet", path.display())]
    Encode {
        /// The shard.
        path: PathBuf,
        /// The writer's words.
        source: parquet::errors::ParquetError,
    },
}

impl Error {
    /// An [`Error::Io`] maker for `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }

    /// An [`Error::Plan`].
    pub(crate) fn plan(key: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Plan { key: key.into(), reason: reason.into() }
    }
}
