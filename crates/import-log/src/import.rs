//! One function for each kind of source.

use std::path::{Path, PathBuf};

use measured_log::Log;

use crate::assemble::episodes;
use crate::mapping::{Mapping, RawEpisodes};
use crate::messages::Extractor;
use crate::plan::{Kind, Plan, resolve};
use crate::store::Store;
use crate::{Error, bag, lerobot, mcap_file, table};

/// A kind of source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// CSV or Parquet.
    Table,
    /// MCAP files.
    Mcap,
    /// ROS 2 bags.
    Ros2,
    /// LeRobot data sets.
    Lerobot,
}

impl Source {
    /// The log that `mapping` makes of sources of this kind, which follow each other.
    ///
    /// # Errors
    ///
    /// [`Error`] where a source cannot be read or lacks what the mapping asks for, and where no valid log comes out.
    pub fn import(self, sources: &[PathBuf], mapping: &Mapping) -> Result<Log, Error> {
        match self {
            Self::Table => rows(sources, mapping, None, table::read),
            Self::Lerobot => rows(sources, mapping, Some(lerobot::CLOCK), lerobot::read),
            Self::Mcap => messages(sources, mapping, |path, extractor| mcap_file::read(path, extractor)),
            Self::Ros2 => messages(sources, mapping, |path, extractor| bag::read(path, extractor)),
        }
    }
}

/// For each channel of a log, its name, how many of the rows have a reading, and from where to where they go.
#[must_use]
pub fn summary(log: &Log) -> Vec<String> {
    let Some(first) = log.episodes.first() else { return Vec::new() };
    let rows: usize = log.episodes.iter().map(measured_log::Episode::rows).sum();
    let line = |channel: &measured_log::Channel| {
        let readings = || log.episodes.iter().filter_map(|e| e.channels.get(channel)).flat_map(|r| r.iter().flatten());
        let (low, high) = (readings().fold(f64::INFINITY, f64::min), readings().fold(f64::NEG_INFINITY, f64::max));
        match readings().count() {
            0 => format!("{}: no reading", channel.name()),
            count => format!("{}: {count} of {rows} rows, {low:.4} to {high:.4}", channel.name()),
        }
    };
    first.channels.keys().map(line).collect()
}

/// Reads the rows of one table.
type Read = fn(&Mapping, &Plan, &Path, &mut Store) -> Result<(), Error>;

fn rows(sources: &[PathBuf], mapping: &Mapping, clock: Option<&str>, read: Read) -> Result<Log, Error> {
    let plan = resolve(mapping, Kind::Table, clock)?;
    import(mapping, &plan, sources, |source, store| read(mapping, &plan, source, store))
}

fn messages(
    sources: &[PathBuf],
    mapping: &Mapping,
    read: impl Fn(&Path, &mut Extractor<'_>) -> Result<(), Error>,
) -> Result<Log, Error> {
    let plan = resolve(mapping, Kind::Messages, None)?;
    import(mapping, &plan, sources, |source, store| {
        let mut extractor = Extractor::new(mapping, &plan, store)?;
        read(source, &mut extractor)?;
        extractor.finish(source)
    })
}

/// Reads the sources one after the other, each as episodes of its own or all as one recording.
pub(crate) fn import(
    mapping: &Mapping,
    plan: &Plan,
    sources: &[PathBuf],
    mut read: impl FnMut(&Path, &mut Store) -> Result<(), Error>,
) -> Result<Log, Error> {
    let new = || Store::new(plan, mapping.header.period_secs);
    let each = matches!(mapping.raw.episodes, RawEpisodes::Source);
    let mut done = Vec::new();
    let mut store = new();
    for (index, source) in sources.iter().enumerate() {
        read(source, &mut store)?;
        if each || index + 1 == sources.len() {
            episodes(mapping, plan, std::mem::replace(&mut store, new()), source, &mut done)?;
        }
    }
    let path = sources.first().cloned().unwrap_or_default();
    if done.is_empty() {
        return Err(Error::source(&path, "as a whole", "at least one episode with a reading", "none"));
    }
    let log = Log { header: mapping.header.clone(), episodes: done };
    log.checked(&mapping.path, Path::new("samples"))
        .map_err(|source| Error::Made { path, source: Box::new(source) })?;
    Ok(log)
}
