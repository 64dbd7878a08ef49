//! A recording of others with its mapping: a table, an MCAP file or a ROS 2 bag.

use ::import_log::{Mapping, Source, draft};
use ::measured_log::{Format, Notes};

use crate::Verdict;
use crate::parts::{join, split};
use crate::verdict::{asset, folder, put, refused};

/// Imports the second file by the mapping in the first, as the kind of source that it begins like, and drafts a mapping of it. A log that comes out can be
/// written and is read again to the same.
///
/// # Panics
///
/// Where the importer breaks its rule.
#[must_use]
pub fn import_log(data: &[u8]) -> Verdict {
    let [map, recording] = split::<2>(data);
    let folder = folder();
    let (map_path, path) = (folder.path().join("map.toml"), folder.path().join("recording"));
    put(&map_path, map);
    put(&path, recording);
    let kind = match recording {
        [0x89, b'M', b'C', b'A', b'P', ..] => Source::Mcap,
        [b'S', b'Q', b'L', b'i', b't', b'e', ..] => Source::Ros2,
        _ => Source::Table,
    };
    let names = ["map.toml", "recording"];
    let sources = [path];
    if let Err(error) = draft(kind, &sources) {
        let _ = refused(&error, &names);
    }
    let mapping = match Mapping::read(&map_path) {
        Ok(mapping) => mapping,
        Err(error) => return refused(&error, &names),
    };
    let log = match kind.import(&sources, &mapping) {
        Ok(log) => log,
        Err(error) => return refused(&error, &names),
    };
    let copy = folder.path().join("copy");
    ::measured_log::write(&copy, &log, Format::Csv, &Notes::new())
        .unwrap_or_else(|error| panic!("what was imported cannot be written: {error}"));
    let again = ::measured_log::read(&copy).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again, log, "a log is read again to the same");
    Verdict::Accepted
}

/// One rig, recorded by independent writers in six ways, and its log as Parquet.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let file = |name: &str| asset(&format!("tests/data/import/{name}"));
    let mut seeds: Vec<Vec<u8>> = [
        ("rig.toml", "rig.csv"),
        ("json.toml", "json.mcap"),
        ("protobuf.toml", "protobuf.mcap"),
        ("own_message.toml", "own_message.mcap"),
        ("ros2_mcap.toml", "ros2_mcap/ros2_mcap.mcap"),
        ("ros2_sqlite.toml", "ros2_sqlite/ros2_sqlite.db3"),
    ]
    .map(|(map, recording)| join(&[&file(map), &file(recording)]))
    .into();
    let folder = folder();
    for name in ["log.toml", "samples.csv"] {
        put(&folder.path().join(name), &file(&format!("original/{name}")));
    }
    let copy = folder.path().join("copy");
    let log = ::measured_log::read(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    ::measured_log::write(&copy, &log, Format::Parquet, &Notes::new()).unwrap_or_else(|error| panic!("{error}"));
    let parquet = std::fs::read(copy.join("samples.parquet")).unwrap_or_else(|error| panic!("{error}"));
    seeds.push(join(&[PARQUET_MAP.as_bytes(), &parquet]));
    seeds
}

/// Without what the importer samples anew: rows, clock and poses.
const PARQUET_MAP: &str = r#"version = 1
clock = { stamp = "time_secs" }
episodes = { change = { value = "episode" } }
[log]
robot = "none"
period_secs = 0.02
gravity_mps2 = 9.81
table = { height_m = 0.0, friction = { mean = 0.35, stddev = 0.0525 } }
object = { shape = "box", size_m = [0.08, 0.06, 0.05], mass_kg = 0.5, com_m = [0.0, 0.0, 0.0] }
split = { holdout_fraction = 0.3 }
[object]
position = ["object_x_m", "object_y_m", "object_z_m"]
orientation = ["object_qx", "object_qy", "object_qz", "object_qw"]
order = "xyzw"
"#;
