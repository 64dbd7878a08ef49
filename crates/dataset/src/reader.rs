//! A finished dataset, episode by episode.

use std::path::{Path, PathBuf};

use bytes::Bytes;

use crate::columns::Columns;
use crate::decode::decode;
use crate::manifest::manifest_path;
use crate::{Error, Manifest, ShardInfo, publish};

/// One episode as flat buffers; the first row is the initial observation, before any action.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Number of the episode.
    pub episode: u64,
    /// How it ended: see [`crate::Row::outcome`].
    pub outcome: u8,
    /// Actions, one a row; the first is −1.
    pub action: Vec<i8>,
    /// Rewards, one a row.
    pub reward: Vec<f32>,
    /// Observations.
    ///
    /// # Shapes
    ///
    /// `[rows, schema.observation]`, row-major.
    pub observation: Vec<f32>,
    /// States without Θ.
    ///
    /// # Shapes
    ///
    /// `[rows, schema.state]`, row-major.
    pub state: Vec<f64>,
    /// Continuous values of Θ, once.
    pub theta: Vec<f64>,
    /// Discrete values of Θ, once.
    pub classes: Vec<u8>,
    /// What happened in the action that led to a row: 0 or 1.
    ///
    /// # Shapes
    ///
    /// `[rows, schema.events]`, row-major.
    pub events: Vec<u8>,
}

impl Episode {
    /// Number of rows: one more than there are transitions.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.action.len()
    }

    /// Observation of a row.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    #[must_use]
    pub fn observation(&self, row: usize) -> &[f32] {
        at(&self.observation, row, self.rows())
    }

    /// State of a row.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    #[must_use]
    pub fn state(&self, row: usize) -> &[f64] {
        at(&self.state, row, self.rows())
    }
}

/// Row `row` of a row-major buffer of `rows` rows.
fn at<T>(values: &[T], row: usize, rows: usize) -> &[T] {
    assert!(row < rows, "row {row} of an episode of {rows}");
    let width = values.len() / rows;
    &values[row * width..(row + 1) * width]
}

/// A finished dataset whose files match its manifest.
#[derive(Clone, Debug)]
pub struct Reader {
    dir: PathBuf,
    manifest: Manifest,
}

impl Reader {
    /// Opens a finished dataset: checks the manifest, and size and hash of each shard.
    ///
    /// # Errors
    ///
    /// If there is no manifest, if it is of another version or has an unknown key, or if a shard is missing or changed.
    pub fn open(dir: &Path) -> Result<Self, Error> {
        let reader = Self { dir: dir.to_owned(), manifest: Manifest::read(dir)? };
        for shard in &reader.manifest.shards {
            reader.bytes(shard)?;
        }
        Ok(reader)
    }

    /// The manifest.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// All episodes in ascending order.
    ///
    /// # Errors
    ///
    /// As [`Self::shard_episodes`].
    pub fn episodes(&self) -> Result<Vec<Episode>, Error> {
        // Not as many as the manifest says: nothing has been checked against it yet.
        let mut episodes = Vec::new();
        for shard in &self.manifest.shards {
            episodes.append(&mut self.read(shard)?);
        }
        Ok(episodes)
    }

    /// The episodes of one shard, for datasets that do not fit in memory.
    ///
    /// # Errors
    ///
    /// If the shard was removed or changed since the dataset was opened, or contradicts the manifest.
    ///
    /// # Panics
    ///
    /// If the manifest has no such shard.
    pub fn shard_episodes(&self, index: usize) -> Result<Vec<Episode>, Error> {
        self.read(&self.manifest.shards[index])
    }

    fn read(&self, shard: &ShardInfo) -> Result<Vec<Episode>, Error> {
        let (header, columns) = decode(self.bytes(shard)?)
            .map_err(|reason| Error::BrokenShard { path: self.dir.join(&shard.path), reason })?;
        let m = &self.manifest;
        let same = [
            ("schema", header.schema == m.schema),
            ("plan_hash", header.provenance.plan_hash == m.plan_hash),
            ("index", header.index == shard.index),
            ("rows", header.rows == shard.rows),
            ("episodes", header.episodes == shard.episodes),
        ];
        if let Some((key, _)) = same.into_iter().find(|(_, same)| !same) {
            return Err(self.contradiction(shard, key, "expected what the shard itself says".into()));
        }
        Ok(split(&columns))
    }

    /// Bytes of a shard with the size and hash of the manifest.
    fn bytes(&self, shard: &ShardInfo) -> Result<Bytes, Error> {
        let path = self.dir.join(&shard.path);
        let Some(bytes) = publish::read(&path)? else {
            return Err(Error::MissingShard { index: shard.index, path });
        };
        if bytes.len() as u64 != shard.bytes {
            let reason = format!("expected {} bytes, {} has {}", shard.bytes, path.display(), bytes.len());
            return Err(self.contradiction(shard, "bytes", reason));
        }
        let found = blake3::hash(&bytes).to_hex();
        if found.as_str() != shard.blake3 {
            let expected = publish::one_line(&shard.blake3, 64);
            let reason = format!("expected {expected}, {} has {found}", path.display());
            return Err(self.contradiction(shard, "blake3", reason));
        }
        Ok(bytes.into())
    }

    fn contradiction(&self, shard: &ShardInfo, key: &str, reason: String) -> Error {
        Error::Manifest { path: manifest_path(&self.dir), key: format!("shards[{}].{key}", shard.index), reason }
    }
}

fn split(columns: &Columns) -> Vec<Episode> {
    let rows = columns.rows();
    let part = |range: &std::ops::Range<usize>, len: usize| {
        let width = len / rows;
        range.start * width..range.end * width
    };
    columns
        .episodes()
        .iter()
        .map(|range| {
            let first = range.start..range.start + 1;
            Episode {
                episode: columns.episode[range.start],
                outcome: columns.outcome[range.end - 1],
                action: columns.action[range.clone()].to_vec(),
                reward: columns.reward[range.clone()].to_vec(),
                observation: columns.observation[part(range, columns.observation.len())].to_vec(),
                state: columns.state[part(range, columns.state.len())].to_vec(),
                theta: columns.theta[part(&first, columns.theta.len())].to_vec(),
                classes: columns.classes[part(&first, columns.classes.len())].to_vec(),
                events: columns.events[part(range, columns.events.len())].to_vec(),
            }
        })
        .collect()
}
