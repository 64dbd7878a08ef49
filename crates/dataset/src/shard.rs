//! One shard: where it lies, how it is written once, and whether it is whole.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use crate::columns::Columns;
use crate::decode::decode;
use crate::encode::{Header, encode};
use crate::publish::{self, Existing};
use crate::{Counts, Error, Provenance, Row, Schema};

/// Files of one chunk folder.
const CHUNK_FILES: u32 = 1000;

/// A finished shard.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardInfo {
    /// Index in the plan.
    pub index: u32,
    /// File, relative to the dataset's folder: [`shard_path`].
    pub path: String,
    /// Size of the file.
    pub bytes: u64,
    /// Hash of the file, 64 hexadecimal digits.
    pub blake3: String,
    /// Number of rows, the first rows of the episodes included.
    pub rows: u64,
    /// Number of episodes.
    pub episodes: u64,
    /// First and last episode; `None` in a shard without rows.
    pub episode_range: Option<(u64, u64)>,
    /// The caller's tallies.
    pub counts: Counts,
}

impl ShardInfo {
    fn new(header: Header, columns: &Columns, bytes: &[u8]) -> Self {
        Self {
            index: header.index,
            path: shard_path(header.index),
            bytes: bytes.len() as u64,
            blake3: blake3::hash(bytes).to_hex().to_string(),
            rows: header.rows,
            episodes: header.episodes,
            episode_range: columns.episode.first().copied().zip(columns.episode.last().copied()),
            counts: header.counts,
        }
    }
}

/// What is there of a shard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShardState {
    /// No file: it is still to be made.
    Missing,
    /// A whole file of this plan.
    Finished(ShardInfo),
    /// A file that is damaged or belongs elsewhere: the reason, as in [`Error::BrokenShard`].
    Broken(String),
}

/// File of a shard, relative to the dataset's folder.
///
/// ```
/// assert_eq!(dataset::shard_path(1002), "data/chunk-001/file-002.parquet");
/// ```
#[must_use]
pub fn shard_path(index: u32) -> String {
    format!("data/chunk-{:03}/file-{:03}.parquet", index / CHUNK_FILES, index % CHUNK_FILES)
}

/// Writes a shard, unless it is finished already: then that one is returned and the rows are not looked at.
///
/// Safe against itself: if two processes write the same shard at once, the first to finish wins and both return it.
///
/// # Errors
///
/// If a row does not fit ([`Error::Row`]), if a damaged or foreign file is in the way ([`Error::BrokenShard`]), or if the
/// folder cannot be written.
pub fn write_shard(
    dir: &Path,
    index: u32,
    schema: &Schema,
    provenance: &Provenance,
    counts: &Counts,
    rows: &[Row],
) -> Result<ShardInfo, Error> {
    if let Some(info) = finished(dir, index, &provenance.plan_hash)? {
        return Ok(info);
    }
    schema.check()?;
    let path = dir.join(shard_path(index));
    let columns = Columns::from_rows(schema, rows)?;
    let header = Header {
        index,
        schema: schema.clone(),
        provenance: provenance.clone(),
        counts: counts.clone(),
        rows: columns.rows() as u64,
        episodes: columns.episodes().len() as u64,
    };
    let bytes = encode(&header, &columns).map_err(|source| Error::Encode { path: path.clone(), source })?;
    if publish::publish(&path, &bytes, Existing::Keep)? {
        return Ok(ShardInfo::new(header, &columns, &bytes));
    }
    finished(dir, index, &provenance.plan_hash)?.ok_or(Error::MissingShard { index, path })
}

/// Looks at a shard: compares all its bytes with the hash inside it and its origin with `plan_hash`, and decodes it.
///
/// # Errors
///
/// If the file is there and cannot be read.
pub fn shard_state(dir: &Path, index: u32, plan_hash: &str) -> Result<ShardState, Error> {
    let Some(bytes) = publish::read(&dir.join(shard_path(index)))? else {
        return Ok(ShardState::Missing);
    };
    let bytes = Bytes::from(bytes);
    let (header, columns) = match decode(bytes.clone()) {
        Ok(parts) => parts,
        Err(reason) => return Ok(ShardState::Broken(reason)),
    };
    if header.provenance.plan_hash != plan_hash {
        let found = publish::one_line(&header.provenance.plan_hash, 100);
        return Ok(ShardState::Broken(format!("it belongs to another plan: expected {plan_hash}, found {found}")));
    }
    if header.index != index {
        return Ok(ShardState::Broken(format!("expected shard {index}, found shard {}", header.index)));
    }
    Ok(ShardState::Finished(ShardInfo::new(header, &columns, &bytes)))
}

/// The shard if it is finished, `None` if it is missing, an error if it is broken.
pub(crate) fn finished(dir: &Path, index: u32, plan_hash: &str) -> Result<Option<ShardInfo>, Error> {
    match shard_state(dir, index, plan_hash)? {
        ShardState::Missing => Ok(None),
        ShardState::Finished(info) => Ok(Some(info)),
        ShardState::Broken(reason) => Err(Error::BrokenShard { path: dir.join(shard_path(index)), reason }),
    }
}

/// Visible files of the data folder, relative to `dir` and sorted. Hidden ones are what writers are at, or left behind.
pub(crate) fn data_files(dir: &Path) -> Result<Vec<PathBuf>, Error> {
    fn visit(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), Error> {
        for entry in std::fs::read_dir(folder).map_err(Error::io("list", folder))? {
            let entry = entry.map_err(Error::io("list", folder))?;
            if entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            if entry.file_type().map_err(Error::io("look at", &entry.path()))?.is_dir() {
                visit(&entry.path(), found)?;
            } else {
                found.push(entry.path());
            }
        }
        Ok(())
    }
    let mut found = Vec::new();
    visit(&dir.join("data"), &mut found)?;
    found.sort();
    Ok(found)
}
