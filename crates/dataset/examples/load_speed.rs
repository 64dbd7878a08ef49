//! Writes and loads 150 000 transitions and prints how long that takes.
//!
//! `cargo run --release -p dataset --example load_speed [DIR]`; with a new DIR the files stay.

use std::time::Instant;

use dataset::{Counts, Plan, Reader, Row, Schema, VERSION};

const SHARDS: u32 = 8;
const EPISODES_PER_SHARD: u64 = 625;
const STEPS: u32 = 30;

#[expect(clippy::disallowed_methods, reason = "the result of this program is a duration")]
fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    println!("{what:<28} {:>7.3} s", start.elapsed().as_secs_f64());
    result
}

fn names(prefix: &str, count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{prefix}_{i}")).collect()
}

/// Episodes of a random walk: as hard to compress as noisy sensors, with all mantissa bits in use.
fn rows(shard: u32) -> Vec<Row> {
    let mut bits = u64::from(shard) + 1;
    let mut uniform = move || {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        bits as f64 / u64::MAX as f64 - 0.5
    };
    let mut rows = Vec::new();
    for episode in 0..EPISODES_PER_SHARD {
        let theta: Vec<f64> = (0..12).map(|_| uniform()).collect();
        let classes = vec![(episode % 3) as u8, (episode % 4) as u8];
        let mut state = vec![0.0; 33];
        for step in 0..=STEPS {
            state.iter_mut().for_each(|v| *v += 0.02 * uniform());
            rows.push(Row {
                episode: u64::from(shard) * EPISODES_PER_SHARD + episode,
                step,
                action: if step == 0 { -1 } else { (step % 10) as i8 },
                reward: if step == 0 { 0.0 } else { -1.0 },
                outcome: u8::from(step == STEPS),
                observation: state[..20].iter().map(|v| (v + 0.001 * uniform()) as f32).collect(),
                state: state.clone(),
                theta: theta.clone(),
                classes: classes.clone(),
                events: vec![u8::from(step > 3); 2],
            });
        }
    }
    rows
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let kept = std::env::args_os().nth(1).map(std::path::PathBuf::from);
    let dir = kept.as_deref().unwrap_or(folder.path());
    let plan = Plan {
        version: VERSION,
        schema: Schema {
            robot: "sawyer".into(),
            observation: names("observation", 20),
            action_count: 10,
            state: names("state", 33),
            theta: names("theta", 12),
            classes: names("class", 2),
            events: names("event", 2),
        },
        scenario_hash: String::new(),
        config: serde_json::json!({}),
        seed: 1,
        commit: "example".into(),
        shards: SHARDS,
        episodes_per_shard: EPISODES_PER_SHARD,
    };
    plan.open(dir)?;
    let shards: Vec<Vec<Row>> = (0..SHARDS).map(rows).collect();
    timed("write the shards", || -> Result<(), dataset::Error> {
        for (index, rows) in (0..).zip(&shards) {
            dataset::write_shard(dir, index, &plan.schema, &plan.provenance(), &Counts::new(), rows)?;
        }
        Ok(())
    })?;
    let manifest = timed("verify and write the manifest", || dataset::finish(dir, &plan))?;
    let reader = timed("open (sizes and hashes)", || Reader::open(dir))?;
    let episodes = timed("load all episodes", || reader.episodes())?;
    let bytes: u64 = manifest.shards.iter().map(|s| s.bytes).sum();
    let values = 20 * 4 + (33 + 12) * 8;
    let (rows, mib) = (manifest.rows, 1024.0 * 1024.0);
    println!("{} episodes, {} transitions, {rows} rows", episodes.len(), manifest.transitions);
    println!("{:.1} MiB in files, {:.1} MiB of values", bytes as f64 / mib, (rows * values) as f64 / mib);
    Ok(())
}
