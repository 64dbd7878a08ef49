//! The manifest: what a finished dataset consists of.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::publish::{self, Existing, one_line};
use crate::shard::{data_files, finished};
use crate::{Counts, Error, Plan, Schema, ShardInfo, VERSION, shard_path};

/// `meta/info.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`VERSION`].
    pub version: u32,
    /// The columns.
    pub schema: Schema,
    /// Hash of the scenario's text.
    pub scenario_hash: String,
    /// Root seed.
    pub seed: u64,
    /// Commit of the program that made the data.
    pub commit: String,
    /// Hash of the plan.
    pub plan_hash: String,
    /// Number of rows, the first rows of the episodes included.
    pub rows: u64,
    /// Number of transitions: rows less episodes.
    pub transitions: u64,
    /// Number of episodes.
    pub episodes: u64,
    /// Sums of the shards' tallies.
    pub counts: Counts,
    /// The shards in index order.
    pub shards: Vec<ShardInfo>,
}

impl Manifest {
    fn new(plan: &Plan, shards: Vec<ShardInfo>) -> Self {
        let (rows, episodes) = totals(&shards);
        let mut counts = Counts::new();
        for (name, count) in shards.iter().flat_map(|s| &s.counts) {
            let sum = counts.entry(name.clone()).or_default();
            *sum = sum.saturating_add(*count);
        }
        Self {
            version: VERSION,
            schema: plan.schema.clone(),
            scenario_hash: plan.scenario_hash.clone(),
            seed: plan.seed,
            commit: plan.commit.clone(),
            plan_hash: plan.hash(),
            rows,
            transitions: rows - episodes,
            episodes,
            counts,
            shards,
        }
    }

    fn text(&self) -> String {
        serde_json::to_string_pretty(self).expect("names and numbers are always JSON") + "\n"
    }

    /// Reads the manifest of `dir` and checks that it agrees with itself.
    pub(crate) fn read(dir: &Path) -> Result<Self, Error> {
        let path = manifest_path(dir);
        let Some(bytes) = publish::read(&path)? else {
            return Err(Error::Unfinished { dir: dir.to_owned() });
        };
        let manifest: Self = publish::parse(&path, &bytes)?;
        manifest.check().map_err(|(key, reason)| Error::Manifest { path, key, reason })?;
        Ok(manifest)
    }

    fn check(&self) -> Result<(), (String, String)> {
        for (i, shard) in self.shards.iter().enumerate() {
            let expected = u32::try_from(i).map_or_else(|_| String::new(), shard_path);
            if shard.index as usize != i || shard.path != expected {
                let found = one_line(&shard.path, 100);
                let reason = format!("expected shard {i} in {expected}, found shard {} in {found}", shard.index);
                return Err((format!("shards[{i}]"), reason));
            }
        }
        let (rows, episodes) = totals(&self.shards);
        let sums = [
            ("rows", rows, self.rows),
            ("episodes", episodes, self.episodes),
            ("transitions", rows.saturating_sub(episodes), self.transitions),
        ];
        for (key, expected, found) in sums {
            if expected != found {
                return Err((key.into(), format!("the shards have {expected}, the manifest says {found}")));
            }
        }
        Ok(())
    }
}

fn totals(shards: &[ShardInfo]) -> (u64, u64) {
    shards.iter().fold((0, 0), |(r, e), s| (r.saturating_add(s.rows), e.saturating_add(s.episodes)))
}

pub(crate) fn manifest_path(dir: &Path) -> PathBuf {
    dir.join("meta/info.json")
}

/// Checks all shards of the plan and writes the manifest. Doing it again gives the same bytes.
///
/// # Errors
///
/// If `dir` holds another plan, if a shard is missing or broken or holds an episode of another shard, or if the data folder
/// holds another file. The manifest is then neither written nor changed.
pub fn finish(dir: &Path, plan: &Plan) -> Result<Manifest, Error> {
    plan.compare(dir)?;
    let plan_hash = plan.hash();
    let mut shards = Vec::new();
    for index in 0..plan.shards {
        let path = dir.join(shard_path(index));
        let info =
            finished(dir, index, &plan_hash)?.ok_or_else(|| Error::MissingShard { index, path: path.clone() })?;
        let from = u64::from(index).saturating_mul(plan.episodes_per_shard);
        let to = from.saturating_add(plan.episodes_per_shard);
        if let Some((first, last)) = info.episode_range
            && (first < from || last >= to)
        {
            let reason = format!("expected episodes from {from} to below {to}, found {first} to {last}");
            return Err(Error::BrokenShard { path, reason });
        }
        shards.push(info);
    }
    // Both lists are in the order of names, which may differ from that of indices.
    let mut expected: Vec<_> = shards.iter().map(|s| dir.join(&s.path)).collect();
    expected.sort();
    if let Some(path) = data_files(dir)?.into_iter().find(|f| expected.binary_search(f).is_err()) {
        return Err(Error::UnexpectedFile { path });
    }
    let manifest = Manifest::new(plan, shards);
    publish::publish(&manifest_path(dir), manifest.text().as_bytes(), Existing::Replace)?;
    Ok(manifest)
}
