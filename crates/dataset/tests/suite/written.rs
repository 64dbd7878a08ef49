//! What is written is read again, and does not depend on who wrote it when.

use dataset::{Counts, Episode, Plan, Reader, Row, ShardState};

use crate::fixture::{files, make, plan, rows, write};

#[test]
fn every_value_survives_a_write_and_a_read() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    make(dir.path(), &plan);
    let reader = Reader::open(dir.path()).unwrap();
    let written: Vec<Row> = (0..plan.shards).flat_map(|i| rows(&plan, i)).collect();
    let episodes = reader.episodes().unwrap();
    assert_eq!(episodes.len(), 20);
    assert_eq!(reader.manifest().rows, written.len() as u64);
    assert_eq!(reader.manifest().transitions, written.len() as u64 - 20);
    assert_eq!(reader.manifest().counts, Counts::from([("diverged".into(), 6), ("untouched".into(), 4)]));
    let f64s = |v: &[f64]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let f32s = |v: &[f32]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let mut expected = written.iter();
    for episode in &episodes {
        for i in 0..episode.rows() {
            let row = expected.next().unwrap();
            let outcome = if i + 1 == episode.rows() { episode.outcome } else { 0 };
            assert_eq!((row.episode, row.step as usize, row.outcome), (episode.episode, i, outcome));
            assert_eq!((row.action, row.reward.to_bits()), (episode.action[i], episode.reward[i].to_bits()));
            assert_eq!(f32s(&row.observation), f32s(episode.observation(i)));
            assert_eq!(f64s(&row.state), f64s(episode.state(i)));
            assert_eq!(f64s(&row.theta), f64s(&episode.theta));
            assert_eq!(row.classes, episode.classes);
            assert_eq!(row.events, episode.events[2 * i..2 * (i + 1)]);
        }
    }
    assert!(expected.next().is_none());
    assert_eq!(reader.shard_episodes(1).unwrap(), episodes[5..10]);
}

#[test]
fn rows_of_several_row_groups_and_empty_columns_survive() {
    let dir = tempfile::tempdir().unwrap();
    let mut plan = Plan { shards: 2, episodes_per_shard: 3000, ..plan() };
    plan.schema.state.clear();
    plan.schema.classes.clear();
    plan.schema.events.clear();
    plan.open(dir.path()).unwrap();
    let mut many = Vec::new();
    for episode in 0..2999 {
        many.extend((0..25).map(|step| Row {
            episode,
            step,
            action: if step == 0 { -1 } else { 1 },
            reward: 0.5,
            outcome: u8::from(step == 24),
            observation: vec![(episode * 25 + u64::from(step)) as f32; 5],
            state: vec![],
            theta: vec![episode as f64; 3],
            classes: vec![],
            events: vec![],
        }));
    }
    let info = dataset::write_shard(dir.path(), 0, &plan.schema, &plan.provenance(), &Counts::new(), &many).unwrap();
    assert_eq!((info.rows, info.episode_range), (74_975, Some((0, 2998))));
    let empty = dataset::write_shard(dir.path(), 1, &plan.schema, &plan.provenance(), &Counts::new(), &[]).unwrap();
    assert_eq!((empty.rows, empty.episode_range), (0, None));
    dataset::finish(dir.path(), &plan).unwrap();
    let episodes = Reader::open(dir.path()).unwrap().episodes().unwrap();
    let check = |e: &Episode| e.observation(24)[4] == (e.episode * 25 + 24) as f32 && e.theta == [e.episode as f64; 3];
    assert!(episodes.len() == 2999 && episodes.iter().all(check));
    assert!(episodes[0].state(3).is_empty());
}

#[test]
fn workers_in_any_order_and_number_make_the_same_bytes() {
    let (one, many, plan) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap(), plan());
    make(one.path(), &plan);
    std::thread::scope(|scope| {
        for worker in 0..4 {
            let (dir, plan) = (many.path(), &plan);
            scope.spawn(move || {
                plan.open(dir).unwrap();
                // Every worker tries every shard, from another start.
                for i in 0..plan.shards {
                    write(dir, plan, (worker + i) % plan.shards);
                }
            });
        }
    });
    dataset::finish(many.path(), &plan).unwrap();
    assert_eq!(files(one.path()), files(many.path()));
    assert_eq!(files(one.path()).len(), 4 + 2);
}

#[test]
fn an_interrupted_dataset_resumes_to_the_same_bytes_and_redoes_nothing() {
    let (whole, resumed, plan) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap(), plan());
    make(whole.path(), &plan);
    let dir = resumed.path();
    plan.open(dir).unwrap();
    write(dir, &plan, 0);
    write(dir, &plan, 2);
    // What a killed writer of shard 1 leaves behind.
    let half = &files(whole.path())["data/chunk-000/file-001.parquet"][..1000];
    std::fs::write(dir.join("data/chunk-000/.file-001.parquet.Ab3dE9.partial"), half).unwrap();

    let plan_again = Plan::read(dir).unwrap();
    assert_eq!(plan_again, plan);
    plan_again.open(dir).unwrap();
    let modified = |i| std::fs::metadata(dir.join(dataset::shard_path(i))).unwrap().modified().unwrap();
    let before = modified(2);
    let mut written = Vec::new();
    for index in 0..plan.shards {
        match dataset::shard_state(dir, index, &plan.hash()).unwrap() {
            ShardState::Missing => {
                write(dir, &plan, index);
                written.push(index);
            }
            ShardState::Finished(info) => assert_eq!(info, write(dir, &plan, index)),
            ShardState::Broken(reason) => panic!("{reason}"),
        }
    }
    assert_eq!(written, [1, 3]);
    assert_eq!(modified(2), before);
    dataset::finish(dir, &plan).unwrap();
    assert_eq!(files(whole.path()), files(dir));
}

#[test]
fn a_finished_shard_is_never_replaced_by_other_rows() {
    let (dir, plan) = (tempfile::tempdir().unwrap(), plan());
    let first = write(dir.path(), &plan, 0);
    let mut other = rows(&plan, 1);
    other[0].step = 9; // The rows of a finished shard are not even looked at.
    let again = dataset::write_shard(dir.path(), 0, &plan.schema, &plan.provenance(), &Counts::new(), &other).unwrap();
    assert_eq!(first, again);
}
