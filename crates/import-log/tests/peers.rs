//! Recordings that other programs wrote of one rig (`tests/peers/import/make_recordings.py`), against the log that they were made of.

use std::path::{Path, PathBuf};

use import_log::{Mapping, Source};
use measured_log::{Axis, Channel, Component, Episode, Log};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import")
}

fn imported(kind: Source, recording: &str, mapping: &str) -> Log {
    let mapping = Mapping::read(&folder().join(mapping)).unwrap();
    assert_eq!(mapping.unfilled(), 0);
    kind.import(&[folder().join(recording)], &mapping).unwrap()
}

fn original() -> Log {
    measured_log::read(&folder().join("original")).unwrap()
}

/// What the sensors of the original log resolve, by the last decimal that it has: half of it.
fn resolution(channel: Channel) -> f64 {
    match channel {
        Channel::Command(_) => 0.5e-6,
        Channel::Tool(_) => 0.5e-5,
        Channel::ObjectPosition(_) | Channel::ObjectOrientation(_) | Channel::WristTorque(_) => 0.5e-4,
        Channel::WristForce(_) => 0.5e-3,
        Channel::AddedMass => 1e-9,
        other => panic!("{other:?} is not in the log"),
    }
}

/// 1 or -1, so that the rotation `found` has the sign of `expected`: q and -q are one rotation.
fn sign(found: &Episode, expected: &Episode, row: usize) -> f64 {
    let (Some(a), Some(b)) = (found.orientation(row), expected.orientation(row)) else { return 1.0 };
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().signum()
}

/// The quaternion of the original is rounded and not of unit length: writers that turn it norm it.
fn unit(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / norm)
}

/// Asserts that the same was read at the same times, and returns the channels that were compared.
fn compare(found: &Log, expected: &Log, name: &str) -> Vec<Channel> {
    assert_eq!(found.episodes.len(), expected.episodes.len(), "{name}");
    let mut compared = Vec::new();
    for (found, expected) in found.episodes.iter().zip(&expected.episodes) {
        assert_eq!((found.id, found.rows()), (expected.id, expected.rows()), "{name}");
        for (a, b) in found.time_secs.iter().zip(&expected.time_secs) {
            assert!((a - b).abs() < 1e-6, "{name}: {a} s for {b} s");
        }
        for row in 0..found.rows() {
            let place = format!("{name}, episode {}, row {row}", found.id);
            for channel in found.channels.keys().filter(|c| !matches!(c, Channel::ObjectOrientation(_))) {
                match (found.get(*channel, row), expected.get(*channel, row)) {
                    (Some(a), Some(b)) => {
                        assert!((a - b).abs() < resolution(*channel), "{place}, {}: {a} for {b}", channel.name());
                    }
                    (a, b) => assert_eq!(a, b, "{place}, {}", channel.name()),
                }
            }
            let (a, b) = (found.orientation(row), expected.orientation(row));
            assert_eq!(a.is_some(), b.is_some(), "{place}");
            if let (Some(a), Some(b)) = (a, b) {
                let sign = sign(found, expected, row);
                for (a, b) in unit(a).into_iter().zip(unit(b)) {
                    assert!(
                        (sign * a - b).abs() < resolution(Channel::ObjectOrientation(Component::X)),
                        "{place}: {a}"
                    );
                }
            }
        }
        compared = found.channels.keys().copied().collect();
    }
    compared
}

/// What every recording has: tool, object and wrench; some have more.
fn channels(command: bool, added_mass: bool) -> Vec<Channel> {
    let vector = |make: fn(Axis) -> Channel| Axis::ALL.map(make);
    let mut all = Vec::new();
    if command {
        all.extend(vector(Channel::Command));
    }
    all.extend(vector(Channel::Tool));
    all.extend(vector(Channel::WristForce));
    all.extend(vector(Channel::WristTorque));
    all.extend(vector(Channel::ObjectPosition));
    all.extend(Component::ALL.map(Channel::ObjectOrientation));
    if added_mass {
        all.push(Channel::AddedMass);
    }
    all
}

const RECORDINGS: [(Source, &str, &str, bool, bool); 7] = [
    (Source::Ros2, "ros2_mcap", "ros2_mcap.toml", true, false),
    (Source::Ros2, "ros2_sqlite", "ros2_sqlite.toml", true, false),
    (Source::Mcap, "own_message.mcap", "own_message.toml", false, false),
    (Source::Mcap, "json.mcap", "json.toml", true, true),
    (Source::Mcap, "protobuf.mcap", "protobuf.toml", false, false),
    (Source::Lerobot, "lerobot", "lerobot.toml", true, false),
    (Source::Table, "rig.csv", "rig.toml", true, true),
];

#[test]
fn recordings_of_independent_writers_give_the_original_to_the_resolution_of_its_sensors() {
    let original = original();
    assert_eq!(original.episodes.len(), 4);
    for (kind, recording, mapping, command, added_mass) in RECORDINGS {
        let log = imported(kind, recording, mapping);
        let compared = compare(&log, &original, recording);
        assert_eq!(compared, channels(command, added_mass), "{recording}");
    }
}

#[test]
fn all_recordings_agree_with_each_other() {
    let all: Vec<(Log, &str)> = RECORDINGS
        .iter()
        .map(|(kind, recording, mapping, ..)| (imported(*kind, recording, mapping), *recording))
        .collect();
    for (one, name) in &all {
        for (other, other_name) in &all {
            for (a, b) in one.episodes.iter().zip(&other.episodes) {
                for row in 0..a.rows() {
                    let sign = sign(a, b, row);
                    for channel in a.channels.keys().filter(|channel| b.channels.contains_key(channel)) {
                        let turn = if matches!(channel, Channel::ObjectOrientation(_)) { sign } else { 1.0 };
                        let (x, y) = (a.get(*channel, row), b.get(*channel, row));
                        assert_eq!(x.is_some(), y.is_some(), "{name} and {other_name}, row {row}, {}", channel.name());
                        let apart = turn * x.unwrap_or(0.0) - y.unwrap_or(0.0);
                        // Norms of rounded quaternions differ from 1 by as much.
                        let most = 2.0 * resolution(*channel);
                        assert!(apart.abs() < most, "{name} and {other_name}, row {row}, {}: {apart}", channel.name());
                    }
                }
            }
        }
    }
}

#[test]
fn joints_are_taken_by_name_whatever_their_order() {
    let log = imported(Source::Ros2, "ros2_mcap", "joints.toml");
    let mut read = 0;
    for episode in &log.episodes {
        for (row, time) in episode.time_secs.iter().enumerate() {
            for joint in 0..6_u8 {
                // As the script that wrote them.
                let expected = 0.1 * f64::from(joint) + 0.5 * (time + f64::from(joint)).sin();
                let found = episode.get(Channel::Joint(joint), row).unwrap();
                assert!((found - expected).abs() < 1e-9, "joint {joint} at {time} s: {found} for {expected}");
                read += 1;
            }
        }
    }
    assert_eq!(read, 4 * 32 * 6);
}
