//! Files that are cut, damaged or made to hurt: each gives a log or an error of one sentence, and no panic.

use std::path::{Path, PathBuf};

use import_log::{Error, Mapping, Source, draft};
use measured_log::Log;
use proptest::prelude::*;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import")
}

const FILES: [(Source, &str, &str); 7] = [
    (Source::Mcap, "ros2_mcap/ros2_mcap.mcap", "ros2_mcap.toml"),
    (Source::Mcap, "own_message.mcap", "own_message.toml"),
    (Source::Mcap, "json.mcap", "json.toml"),
    (Source::Mcap, "protobuf.mcap", "protobuf.toml"),
    (Source::Ros2, "ros2_sqlite/ros2_sqlite.db3", "ros2_sqlite.toml"),
    (Source::Table, "lerobot/data/chunk-000/file-000.parquet", "lerobot.toml"),
    (Source::Table, "rig.csv", "rig.toml"),
];

/// The mapping of a file; that of the LeRobot folder for its table alone.
fn mapping(name: &str) -> Mapping {
    let path = folder().join(name);
    let mut text = std::fs::read_to_string(&path).unwrap();
    if name == "lerobot.toml" {
        let names = ["tool_x", "tool_y", "tool_z", "box_x", "box_y", "box_z", "box_roll", "box_pitch", "box_yaw"];
        for (i, name) in names.iter().enumerate() {
            text = text.replace(&format!("[{name}]"), &format!("[{i}]"));
        }
        for (i, name) in ["fx", "fy", "fz"].iter().enumerate() {
            text = text.replace(&format!("[{name}]"), &format!("[{i}]"));
        }
        text = text.replacen("version = 1", "version = 1\nclock = { stamp = \"timestamp\" }", 1);
    }
    Mapping::parse(&path, &text).unwrap()
}

fn attempt(kind: Source, bytes: &[u8], mapping: &Mapping) -> Result<Log, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    std::fs::write(&path, bytes).unwrap();
    let _ = draft(kind, std::slice::from_ref(&path)).map_err(|error| one_sentence(&error, "recording"));
    kind.import(&[path], mapping)
}

/// Names the file, on one line of bounded length.
fn one_sentence(error: &Error, name: &str) {
    let message = error.to_string();
    assert!(message.contains(name), "{message}");
    assert!(!message.contains('\n') && message.len() < 4000, "{message}");
}

#[test]
fn whole_files_are_read() {
    for (kind, file, map) in FILES {
        let bytes = std::fs::read(folder().join(file)).unwrap();
        assert_eq!(attempt(kind, &bytes, &mapping(map)).unwrap().episodes.len(), 4, "{file}");
    }
}

#[test]
fn a_file_that_is_cut_is_refused_in_one_sentence() {
    for (kind, file, map) in FILES {
        let bytes = std::fs::read(folder().join(file)).unwrap();
        let mapping = mapping(map);
        let mut refused = 0;
        for length in (0..bytes.len()).step_by(1 + bytes.len() / 60) {
            match attempt(kind, &bytes[..length], &mapping) {
                // A table that is cut at the end of a row is a shorter table.
                Ok(log) => assert!(kind == Source::Table && log.episodes.len() <= 4, "{file}, {length} bytes"),
                Err(error) => {
                    let name = if error.to_string().contains("map") { ".toml" } else { "recording" };
                    one_sentence(&error, name);
                    refused += 1;
                }
            }
        }
        let least = if file == "rig.csv" { 20 } else { 60 };
        assert!(refused >= least, "{file}: {refused} refused");
    }
}

#[test]
fn rows_without_an_end_and_lengths_that_lie_do_not_fill_the_memory() {
    let mut endless = b"\xef\xbb\xbfVersuch;t_ms\n1;\"".to_vec();
    endless.resize(8 << 20, b'7');
    let text = "version = 1\nclock = { stamp = \"t_ms\", unit = \"ms\" }\n";
    let rig = std::fs::read_to_string(folder().join("rig.toml")).unwrap();
    let (_, log) = rig.split_once("[log]").unwrap();
    let (log, _) = log.split_once("[command]").unwrap();
    let text =
        format!("{text}episodes = \"source\"\n[log]{log}[object]\nposition = [\"t_ms\", 0, 0]\nrpy = [0, 0, 0]\n");
    let mapping = Mapping::parse(Path::new("endless.toml"), &text).unwrap();
    let message = attempt(Source::Table, &endless, &mapping).unwrap_err().to_string();
    assert!(message.ends_with("expected rows of at most 4194304 bytes, found a longer one"), "{message}");

    // A record of 2^63 bytes, and one of a chunk that unpacks to as much.
    let mapping = self::mapping("json.toml");
    for opcode in [3_u8, 5, 6] {
        let mut bytes = b"\x89MCAP0\r\n".to_vec();
        bytes.push(opcode);
        bytes.extend((1_u64 << 63).to_le_bytes());
        bytes.extend([0xff; 64]);
        one_sentence(&attempt(Source::Mcap, &bytes, &mapping).unwrap_err(), "recording");
    }
}

#[test]
fn a_view_is_no_table_of_messages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("views.db3");
    let base = rusqlite::Connection::open(&path).unwrap();
    base.execute_batch(
        "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT);
         CREATE VIEW messages AS WITH RECURSIVE n(topic_id) AS (SELECT 1 UNION ALL SELECT topic_id FROM n)
         SELECT topic_id, 0 AS timestamp, x'00' AS data FROM n;",
    )
    .unwrap();
    drop(base);
    let message = Source::Ros2.import(&[path], &mapping("ros2_sqlite.toml")).unwrap_err().to_string();
    assert!(message.ends_with("expected a table messages, found none"), "{message}");
}

#[test]
fn a_bag_names_files_of_its_own_folder_alone() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    std::fs::write(folder.path().join("outside.mcap"), b"secret").unwrap();
    let metadata = "rosbag2_bagfile_information:\n  relative_file_paths:\n    - ../outside.mcap\n";
    std::fs::write(bag.join("metadata.yaml"), metadata).unwrap();
    let message = Source::Ros2.import(&[bag], &mapping("ros2_mcap.toml")).unwrap_err().to_string();
    assert!(message.contains("bag/outside.mcap") && message.starts_with("cannot read"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bytes_give_a_log_or_one_sentence(
        which in 0..FILES.len(),
        places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let (kind, file, map) = FILES[which];
        let mut bytes = std::fs::read(folder().join(file)).unwrap();
        for (place, byte) in places {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if let Err(error) = attempt(kind, &bytes, &mapping(map)) {
            let message = error.to_string();
            prop_assert!(!message.contains('\n') && message.len() < 4000, "{}", message);
        }
    }

    #[test]
    fn damaged_mappings_give_a_mapping_or_one_sentence(
        which in 0..FILES.len(),
        start in any::<prop::sample::Index>(),
        length in 0..40_usize,
        text in "[ -~]{0,12}",
    ) {
        let path = folder().join(FILES[which].2);
        let mut bytes = std::fs::read_to_string(&path).unwrap();
        let start = start.index(bytes.len());
        let end = (start + length).min(bytes.len());
        prop_assume!(bytes.is_char_boundary(start) && bytes.is_char_boundary(end));
        bytes.replace_range(start..end, &text);
        match Mapping::parse(&path, &bytes) {
            Ok(mapping) => {
                let (kind, file, _) = FILES[which];
                let _ = kind.import(&[folder().join(file)], &mapping).map_err(|error| {
                    assert!(!error.to_string().contains('\n'), "{error}");
                });
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n') && error.to_string().contains(".toml")),
        }
    }
}
