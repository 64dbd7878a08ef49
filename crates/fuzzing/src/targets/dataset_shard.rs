//! A dataset of one shard: its manifest and the Parquet file.

use std::path::Path;

use dataset::{Counts, Episode, Plan, Reader, Row, Schema, ShardState};
use serde_json::Value;

use crate::Verdict;
use crate::parts::{join, split};
use crate::verdict::{folder, put, refused};

/// Reads the two files as they are, and once more with the seal and the manifest's hash put right, so that what lies behind them sees the bytes
/// too. What is accepted can be written again to the same.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn dataset_shard(data: &[u8]) -> Verdict {
    let [manifest, shard] = split::<2>(data);
    let verdict = read(manifest, shard);
    let shard = sealed(shard);
    if let Some(manifest) = matching(manifest, &shard)
        && verdict == Verdict::Refused
    {
        return read(&manifest, &shard);
    }
    verdict
}

fn read(manifest: &[u8], shard: &[u8]) -> Verdict {
    let folder = folder();
    let dir = folder.path();
    put(&dir.join("meta/info.json"), manifest);
    put(&dir.join(dataset::shard_path(0)), shard);
    if let ShardState::Broken(reason) = dataset::shard_state(dir, 0, "hash").unwrap_or(ShardState::Missing) {
        assert!(!reason.is_empty() && !reason.contains(char::is_control), "{reason:?}");
    }
    let reader = match Reader::open(dir) {
        Ok(reader) => reader,
        Err(error) => return refused(&error, &["info.json", "file-000.parquet"]),
    };
    match reader.episodes() {
        Ok(episodes) => check(&reader, &episodes),
        Err(error) => return refused(&error, &["info.json", "file-000.parquet"]),
    }
    Verdict::Accepted
}

/// Everything that writing refuses is refused by reading.
fn check(reader: &Reader, episodes: &[Episode]) {
    let schema = &reader.manifest().schema;
    let rows: Vec<Row> = episodes.iter().flat_map(|episode| rows(schema, episode)).collect();
    let plan = Plan { schema: schema.clone(), ..plan() };
    let copy = folder();
    let written = dataset::write_shard(copy.path(), 0, schema, &plan.provenance(), &Counts::new(), &rows);
    let info = written.unwrap_or_else(|error| panic!("what was read cannot be written: {error}"));
    assert_eq!(info.rows, reader.manifest().rows, "rows");
    assert_eq!(info.episodes, reader.manifest().episodes, "episodes");
}

fn rows(schema: &Schema, episode: &Episode) -> Vec<Row> {
    let (last, width) = (episode.rows() - 1, schema.events.len());
    (0..=last)
        .map(|row| Row {
            episode: episode.episode,
            step: u32::try_from(row).unwrap_or(u32::MAX),
            action: episode.action[row],
            reward: episode.reward[row],
            outcome: if row == last { episode.outcome } else { 0 },
            observation: episode.observation(row).to_vec(),
            state: episode.state(row).to_vec(),
            theta: episode.theta.clone(),
            classes: episode.classes.clone(),
            events: episode.events[row * width..(row + 1) * width].to_vec(),
        })
        .collect()
}

/// The shard with the seal that its bytes ask for: `surmise1` and their BLAKE3 hash, before the footer.
fn sealed(shard: &[u8]) -> Vec<u8> {
    const SEAL: usize = 8 + blake3::OUT_LEN;
    let mut shard = shard.to_vec();
    let Some((rest, [a, b, c, d, b'P', b'A', b'R', b'1'])) = shard.split_last_chunk::<8>() else { return shard };
    let length = u32::from_le_bytes([*a, *b, *c, *d]) as usize;
    let Some(footer) = rest.len().checked_sub(length).filter(|footer| *footer >= SEAL) else { return shard };
    let mut hasher = blake3::Hasher::new();
    hasher.update(&shard[..footer - SEAL]);
    hasher.update(&shard[footer..]);
    let seal = [&b"surmise1"[..], hasher.finalize().as_bytes()].concat();
    shard[footer - SEAL..footer].copy_from_slice(&seal);
    shard
}

/// The manifest with size and hash of the shard.
fn matching(manifest: &[u8], shard: &[u8]) -> Option<Vec<u8>> {
    let mut manifest: Value = serde_json::from_slice(manifest).ok()?;
    let entry = manifest.get_mut("shards")?.get_mut(0)?.as_object_mut()?;
    entry.insert("bytes".into(), shard.len().into());
    entry.insert("blake3".into(), blake3::hash(shard).to_hex().as_str().into());
    Some(manifest.to_string().into_bytes())
}

fn plan() -> Plan {
    let names = |prefix: &str, count: u8| (0..count).map(|i| format!("{prefix}_{i}")).collect();
    Plan {
        version: dataset::VERSION,
        schema: Schema {
            robot: "sawyer".into(),
            observation: names("observation", 3),
            action_count: 10,
            state: names("state", 4),
            theta: names("theta", 2),
            classes: names("class", 2),
            events: names("event", 1),
        },
        scenario_hash: "5ce0".into(),
        config: serde_json::json!({"horizon": 30}),
        seed: 1,
        commit: "c0ffee".into(),
        shards: 1,
        episodes_per_shard: 4,
    }
}

fn made(dir: &Path, plan: &Plan) -> Result<(), dataset::Error> {
    let mut rows = Vec::new();
    for episode in 0..plan.episodes_per_shard {
        for step in 0..5_u8 {
            let value = |i: u8| f64::from(step * 7 + i) / 3.0;
            let count = |names: &[String]| u8::try_from(names.len()).unwrap_or(0);
            let schema = &plan.schema;
            rows.push(Row {
                episode,
                step: u32::from(step),
                action: if step == 0 { -1 } else { 3 },
                reward: -1.0,
                outcome: if step == 4 { 2 } else { 0 },
                observation: (0..count(&schema.observation)).map(|i| f32::from(step * 3 + i)).collect(),
                state: (0..count(&schema.state)).map(value).collect(),
                theta: vec![0.5; schema.theta.len()],
                classes: vec![1; schema.classes.len()],
                events: vec![u8::from(step > 0); schema.events.len()],
            });
        }
    }
    plan.open(dir)?;
    dataset::write_shard(dir, 0, &plan.schema, &plan.provenance(), &Counts::from([("diverged".into(), 1)]), &rows)?;
    dataset::finish(dir, plan)?;
    Ok(())
}

/// A small dataset, and one without classes and events.
///
/// # Panics
///
/// If no files can be written.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let plain = Schema { classes: Vec::new(), events: Vec::new(), ..plan().schema };
    let plans = [plan(), Plan { schema: plain, ..plan() }];
    let seed = |plan: &Plan| {
        let folder = folder();
        let dir = folder.path();
        made(dir, plan).unwrap_or_else(|error| panic!("{error}"));
        let file = |path: &str| std::fs::read(dir.join(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
        join(&[&file("meta/info.json"), &file(&dataset::shard_path(0))])
    };
    plans.iter().map(seed).collect()
}
