//! A measured log: header and samples, as CSV or Parquet.

use std::path::Path;

use ::measured_log::{Format, Log, Notes};

use crate::Verdict;
use crate::parts::{join, split};
use crate::verdict::{asset, folder, put, refused};

/// Reads the two files as a log, the second as Parquet if it begins like one. What is accepted can be written in both formats and read again to the
/// same.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn measured_log(data: &[u8]) -> Verdict {
    let [header, samples] = split::<2>(data);
    let folder = folder();
    let dir = folder.path();
    put(&dir.join("log.toml"), header);
    let name = if samples.starts_with(b"PAR1") { "samples.parquet" } else { "samples.csv" };
    put(&dir.join(name), samples);
    let log = match ::measured_log::read(dir) {
        Ok(log) => log,
        Err(error) => return refused(&error, &["log.toml", name]),
    };
    for (format, copy) in [(Format::Csv, "csv"), (Format::Parquet, "parquet")] {
        let copy = dir.join(copy);
        ::measured_log::write(&copy, &log, format, &Notes::new())
            .unwrap_or_else(|error| panic!("what was read cannot be written: {error}"));
        assert_eq!(read(&copy), log, "a log is read again to the same");
    }
    let split = log.split(1);
    assert!(!split.fit.is_empty() && !split.holdout.is_empty(), "both parts have episodes");
    Verdict::Accepted
}

fn read(dir: &Path) -> Log {
    ::measured_log::read(dir).unwrap_or_else(|error| panic!("{error}"))
}

/// A log of an arm and one of a thrown object, each in both formats.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let fixture = |name: &str| asset(&format!("crates/measured-log/tests/fixtures/{name}"));
    let logs = [(fixture("log.toml"), fixture("samples.csv")), (THROWN.into(), thrown().into())];
    let mut seeds = Vec::new();
    for (header, csv) in logs {
        let folder = folder();
        put(&folder.path().join("log.toml"), &header);
        put(&folder.path().join("samples.csv"), &csv);
        let copy = folder.path().join("copy");
        ::measured_log::write(&copy, &read(folder.path()), Format::Parquet, &Notes::new())
            .unwrap_or_else(|error| panic!("{error}"));
        let parquet = std::fs::read(copy.join("samples.parquet")).unwrap_or_else(|error| panic!("{error}"));
        seeds.extend([join(&[&header, &csv]), join(&[&header, &parquet])]);
    }
    seeds
}

const THROWN: &str = r#"version = 1
robot = "none"
period_secs = 0.01
gravity_mps2 = 9.81
table = { height_m = 0.0, friction = { mean = 0.4, stddev = 0.04 } }
object = { shape = "sphere", size_m = [{ mean = 0.03, stddev = 0.001 }], mass_kg = 0.2, com_m = [0.0, 0.0, 0.0] }
noise = { object_position_m = 0.001 }
split = { holdout_fraction = 0.5 }
"#;

/// Long enough for Parquet to use a dictionary for some columns and none for others.
fn thrown() -> String {
    let mut text =
        String::from("episode,time_secs,object_x_m,object_y_m,object_z_m,object_qx,object_qy,object_qz,object_qw\n");
    for episode in 0..6 {
        for row in 0..40 {
            let time = f64::from(row) * 0.01;
            let height = 0.5 - 4.905 * time * time;
            text.push_str(&format!("{episode},{time},{},0,{height},0,0,0,1\n", 0.1 * time));
        }
    }
    text
}
