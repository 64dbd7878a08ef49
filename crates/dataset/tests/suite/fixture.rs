//! A small dataset of four shards.

use std::collections::BTreeMap;
use std::path::Path;

use dataset::{Counts, Plan, Row, Schema, VERSION};

fn names(prefix: &str, count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{prefix}_{i}")).collect()
}

pub(crate) fn plan() -> Plan {
    Plan {
        version: VERSION,
        schema: Schema {
            robot: "sawyer".into(),
            observation: names("observation", 5),
            action_count: 10,
            state: names("state", 7),
            theta: names("theta", 3),
            classes: names("class", 2),
            events: names("event", 2),
        },
        scenario_hash: "5ce0".into(),
        config: serde_json::json!({"horizon": 30, "noise": {"force_n": 0.1}}),
        seed: 1,
        commit: "c0ffee".into(),
        shards: 4,
        episodes_per_shard: 5,
    }
}

/// Finite bits without a pattern, from an integer hash; subnormals and negative zeros among them.
fn bits(key: u64) -> u64 {
    match key % 11 {
        0 => 1,
        1 => 1 << 63,
        _ => {
            let mixed = (key ^ 0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            (mixed ^ (mixed >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb) & !(1 << 62)
        }
    }
}

pub(crate) fn rows(plan: &Plan, index: u32) -> Vec<Row> {
    let first = u64::from(index) * plan.episodes_per_shard;
    let mut rows = Vec::new();
    for episode in first..first + plan.episodes_per_shard {
        let last = 2 + u32::try_from(episode % 7).unwrap();
        for step in 0..=last {
            let f64s = |kind: u64, n: u64, step: u32| {
                (0..n)
                    .map(|i| f64::from_bits(bits((episode * 100 + u64::from(step)) * 100 + kind * 10 + i)))
                    .collect::<Vec<_>>()
            };
            let f32s = |v: Vec<f64>| {
                v.iter().map(|v| f32::from_bits((v.to_bits() >> 32) as u32 & !(1 << 30))).collect::<Vec<_>>()
            };
            rows.push(Row {
                episode,
                step,
                action: if step == 0 { -1 } else { i8::try_from((episode + u64::from(step)) % 10).unwrap() },
                reward: -0.1 * step as f32,
                outcome: if step == last { 3 } else { 0 },
                observation: f32s(f64s(0, 5, step)),
                state: f64s(1, 7, step),
                theta: f64s(2, 3, 0),
                classes: vec![(episode % 3) as u8, 3],
                events: vec![u8::from(step > 0), u8::from(step > 2)],
            });
        }
    }
    rows
}

pub(crate) fn counts(index: u32) -> Counts {
    Counts::from([("diverged".into(), u64::from(index)), ("untouched".into(), 1)])
}

pub(crate) fn write(dir: &Path, plan: &Plan, index: u32) -> dataset::ShardInfo {
    dataset::write_shard(dir, index, &plan.schema, &plan.provenance(), &counts(index), &rows(plan, index)).unwrap()
}

pub(crate) fn make(dir: &Path, plan: &Plan) {
    plan.open(dir).unwrap();
    for index in 0..plan.shards {
        write(dir, plan, index);
    }
    dataset::finish(dir, plan).unwrap();
}

/// Visible files and their bytes.
pub(crate) fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(k, v)| (format!("{name}/{k}"), v)));
        } else if !name.starts_with('.') {
            found.insert(name, std::fs::read(&path).unwrap());
        }
    }
    found
}
