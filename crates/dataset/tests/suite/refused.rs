//! Damaged, foreign and unfinished files are refused by name.

use std::error::Error as _;
use std::path::Path;

use dataset::{Counts, Error, Plan, Reader, ShardState};

use crate::fixture::{files, make, plan, rows, write};

fn edit(path: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn a_truncated_shard_is_refused_and_named() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    make(dir.path(), &plan);
    let path = dir.path().join(dataset::shard_path(2));
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    let expectations = [
        Reader::open(dir.path()).unwrap_err().to_string(),
        dataset::finish(dir.path(), &plan).unwrap_err().to_string(),
        dataset::write_shard(dir.path(), 2, &plan.schema, &plan.provenance(), &Counts::new(), &[])
            .unwrap_err()
            .to_string(),
    ];
    for message in expectations {
        assert!(message.contains("file-002.parquet"), "{message}");
    }
    assert_eq!(std::fs::read(&path).unwrap().len(), bytes.len() - 1);
}

#[test]
fn a_shard_with_any_changed_byte_is_refused() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    make(dir.path(), &plan);
    let path = dir.path().join(dataset::shard_path(0));
    let whole = std::fs::read(&path).unwrap();
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        std::fs::write(&path, bytes).unwrap();
        let state = dataset::shard_state(dir.path(), 0, &plan.hash()).unwrap();
        assert!(matches!(state, ShardState::Broken(_)), "byte {at}: {state:?}");
        let error = Reader::open(dir.path()).unwrap_err().to_string();
        assert!(error.contains("shards[0].blake3") && error.contains("file-000"), "{error}");
    }
}

#[test]
fn a_shard_of_another_plan_or_place_is_refused() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    let other = Plan { seed: 2, ..plan.clone() };
    plan.open(dir.path()).unwrap();
    write(dir.path(), &plan, 0);
    let state = dataset::shard_state(dir.path(), 0, &other.hash()).unwrap();
    assert!(
        matches!(&state, ShardState::Broken(r) if r.contains("another plan") && r.contains(&other.hash())),
        "{state:?}"
    );
    std::fs::copy(dir.path().join(dataset::shard_path(0)), dir.path().join(dataset::shard_path(1))).unwrap();
    let state = dataset::shard_state(dir.path(), 1, &plan.hash()).unwrap();
    assert_eq!(state, ShardState::Broken("expected shard 1, found shard 0".into()));
}

#[test]
fn another_plan_is_an_error_that_names_the_keys_and_changes_nothing() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    make(dir.path(), &plan);
    let before = files(dir.path());
    let mut other = Plan { seed: 2, ..plan.clone() };
    other.config["noise"]["force_n"] = 0.2.into();
    for error in [other.open(dir.path()).unwrap_err(), dataset::finish(dir.path(), &other).unwrap_err()] {
        let message = error.to_string();
        assert!(message.contains("plan.json"), "{message}");
        assert!(message.contains("`config.noise.force_n` (saved: 0.1, given: 0.2)"), "{message}");
        assert!(message.contains("`seed` (saved: 1, given: 2)"), "{message}");
        assert!(!message.contains("commit"), "{message}");
    }
    assert_eq!(files(dir.path()), before);
    plan.open(dir.path()).unwrap();
}

#[test]
fn a_missing_shard_is_named() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    plan.open(dir.path()).unwrap();
    for index in [0, 1, 3] {
        write(dir.path(), &plan, index);
    }
    let error = dataset::finish(dir.path(), &plan).unwrap_err();
    assert!(matches!(error, Error::MissingShard { index: 2, .. }), "{error}");
    let error = Reader::open(dir.path()).unwrap_err();
    assert!(matches!(error, Error::Unfinished { .. }), "{error}");
    write(dir.path(), &plan, 2);
    dataset::finish(dir.path(), &plan).unwrap();
    let reader = Reader::open(dir.path()).unwrap();
    std::fs::remove_file(dir.path().join(dataset::shard_path(3))).unwrap();
    for error in [Reader::open(dir.path()).unwrap_err(), reader.episodes().unwrap_err()] {
        assert!(error.to_string().contains("shard 3 is missing") && error.to_string().contains("file-003"), "{error}");
    }
}

#[test]
fn a_foreign_file_or_episode_in_the_data_folder_is_refused() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    make(dir.path(), &plan);
    let stray = dir.path().join("data/chunk-000/file-004.parquet");
    std::fs::write(&stray, "").unwrap();
    let error = dataset::finish(dir.path(), &plan).unwrap_err();
    assert!(matches!(&error, Error::UnexpectedFile { path } if *path == stray), "{error}");
    std::fs::remove_file(&stray).unwrap();

    let path = dir.path().join(dataset::shard_path(1));
    std::fs::remove_file(&path).unwrap();
    let others = rows(&plan, 2);
    dataset::write_shard(dir.path(), 1, &plan.schema, &plan.provenance(), &Counts::new(), &others).unwrap();
    let error = dataset::finish(dir.path(), &plan).unwrap_err().to_string();
    assert!(
        error.contains("file-001") && error.contains("expected episodes from 5 to below 10, found 10 to 14"),
        "{error}"
    );
}

#[test]
fn a_manifest_or_plan_of_the_future_or_with_an_unknown_key_says_so() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    for name in ["meta/info.json", "plan.json"] {
        std::fs::remove_dir_all(dir.path().join("data")).ok();
        std::fs::remove_file(dir.path().join("plan.json")).ok();
        make(dir.path(), &plan);
        let path = dir.path().join(name);
        let read = || match name {
            "plan.json" => Plan::read(dir.path()).map(|_| ()).unwrap_err(),
            _ => Reader::open(dir.path()).map(|_| ()).unwrap_err(),
        };
        edit(&path, "\"seed\": 1", "\"sede\": 1");
        let message = read().to_string();
        assert!(message.contains(name) && message.contains("there is no key `sede`"), "{message}");
        // The version wins over keys that only the future knows.
        edit(&path, "\"version\": 2", "\"version\": 3");
        let error = read();
        assert!(matches!(error, Error::Version { found: 3, .. }), "{error}");
        assert!(error.to_string().contains(name) && error.source().is_none(), "{error}");
    }
}

#[test]
fn a_manifest_that_contradicts_its_shards_is_refused_by_key() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    let path = dir.path().join("meta/info.json");
    for (from, to, key) in [
        ("\"episodes\": 20", "\"episodes\": 21", "`episodes`"),
        ("data/chunk-000/file-001", "data/../../file-001", "`shards[1]`"),
        ("\"observation_4\"", "\"observation_5\"", "`shards[0].schema`"),
    ] {
        make(dir.path(), &plan);
        edit(&path, from, to);
        let error = Reader::open(dir.path()).and_then(|r| r.episodes()).unwrap_err().to_string();
        assert!(error.contains("info.json") && error.contains(key), "{error}");
    }
}

#[test]
fn a_manifest_that_promises_more_than_memory_is_refused() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    make(dir.path(), &plan);
    let path = dir.path().join("meta/info.json");
    let text = std::fs::read_to_string(&path).unwrap();
    for episodes in [1_000_000_000_u64, 1 << 62] {
        let mut manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
        manifest["shards"][0]["episodes"] = episodes.into();
        manifest["episodes"] = (episodes + 15).into();
        manifest["transitions"] = 0.into();
        std::fs::write(&path, manifest.to_string()).unwrap();
        let error = Reader::open(dir.path()).unwrap().episodes().unwrap_err().to_string();
        assert!(error.contains("info.json") && error.contains("shards[0].episodes"), "{error}");
    }
}
