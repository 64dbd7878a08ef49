//! The format: what is read, what is refused and in which words, and that what is written reads back bit for bit.

use std::path::Path;

use measured_log::{Axis, Channel, Format, Log, Notes, Number, Shape};
use proptest::prelude::*;

const HEADER: &str = r#"version = 1
robot = "none"
period_secs = 0.01
tool_radius_m = 0.02
tool_friction = 0.1
gravity_mps2 = 9.81

[table]
height_m = 0.0
friction = { mean = 0.4, stddev = 0.04 }

[object]
shape = "box"
size_m = [0.08, { mean = 0.06, stddev = 0.001 }, 0.05]
mass_kg = { mean = 0.5, stddev = 0.05 }
com_m = [0.0, 0, 0.0]

[noise]
object_position_m = 0.0005

[split]
holdout_fraction = 0.5
"#;

const SAMPLES: &str = "\
episode,time_secs,command_x_m,command_y_m,command_z_m,object_x_m,object_y_m,object_z_m,object_qx,object_qy,object_qz,object_qw
3,0.0,0.1,0.2,0.3,0.5,0.0,0.025,0,0,0,1
3,0.01,0.1,0.2,0.3,,,,,,,
8,0.0,0.1,0.2,0.3,0.5,0.0,0.025,0,0,0,1
";

fn read(header: &str, samples: &str) -> Result<Log, String> {
    read_bytes(header.as_bytes(), samples.as_bytes())
}

/// The log, or the message without the folder's name.
fn read_bytes(header: &[u8], samples: &[u8]) -> Result<Log, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("log.toml"), header).unwrap();
    std::fs::write(folder.path().join("samples.csv"), samples).unwrap();
    read_folder(folder.path())
}

fn read_folder(dir: &Path) -> Result<Log, String> {
    measured_log::read(dir).map_err(|e| e.to_string().replace(&format!("{}/", dir.display()), ""))
}

#[test]
fn a_valid_log_is_read_with_its_gaps() {
    let log = read(HEADER, SAMPLES).unwrap();
    assert_eq!(log.episodes.iter().map(|e| (e.id, e.rows())).collect::<Vec<_>>(), [(3, 2), (8, 1)]);
    assert_eq!(log.episodes[0].vector(Channel::ObjectPosition, 0), Some([0.5, 0.0, 0.025]));
    assert_eq!(log.episodes[0].orientation(1), None);
    assert_eq!(log.episodes[0].get(Channel::Command(Axis::Y), 1), Some(0.2));
    assert_eq!(log.episodes[0].get(Channel::Tool(Axis::Y), 1), None);
    assert_eq!(log.header.object.mass_kg, Number::Uncertain { mean: 0.5, stddev: 0.05 });
    let Shape::Box { size_m } = log.header.object.shape else { panic!("{:?}", log.header.object.shape) };
    assert_eq!(size_m.map(Number::mean), [0.08, 0.06, 0.05]);
}

#[test]
fn every_fault_of_the_header_names_its_key() {
    let cases = [
        ("version = 1", "version = 2", "log.toml, key `version`: expected 1, found `2`"),
        ("\"none\"", "\"panda\"", "key `robot`: there is no choice `panda`, expected one of `sawyer`, `jaco`, `none`"),
        ("period_secs = 0.01", "period_secs = 0.0", "key `period_secs`: expected 1e-9 to 10, found 0"),
        ("period_secs = 0.01", "period_secs = nan", "key `period_secs`"),
        ("period_secs = 0.01", "period_ms = 10", "key `period_ms`: there is no key `period_ms`, expected one of"),
        ("tool_radius_m = 0.02\n", "", "key `tool_radius_m`: expected the radius"),
        ("tool_radius_m = 0.02", "tool_radius_m = -1", "key `tool_radius_m`: expected 1e-9 to 10"),
        ("gravity_mps2 = 9.81\n", "", "key `gravity_mps2`: `gravity_mps2` is missing"),
        ("stddev = 0.04", "sttdev = 0.04", "key `table.friction.sttdev`: there is no key"),
        ("stddev = 0.04", "stddev = 0.0", "key `table.friction.stddev`: expected more than 0, found 0"),
        ("mean = 0.5", "mean = -0.5", "key `object.mass_kg`: expected 1e-9 to 10000"),
        ("mass_kg", "mass_g", "key `object.mass_g`: there is no key"),
        ("[0.08, ", "[0.0, ", "key `object.size_m[0]`: expected 1e-9 to 10, found 0"),
        ("[0.08, ", "[", "key `object.size_m`: expected [x, y, z] for shape = \"box\", found 2 numbers"),
        ("\"box\"", "\"sphere\"", "key `object.size_m`: expected [radius] for shape = \"sphere\", found 3 numbers"),
        ("\"box\"", "\"prism\"", "key `object.size_m`: expected outline_m and height_m"),
        ("\"box\"", "\"cone\"", "key `object.shape`: there is no choice `cone`"),
        ("com_m = [0.0, 0, 0.0]", "com_m = [0.0, 0]", "key `object.com_m`"),
        (
            "com_m",
            "inertia_kgm2 = [1.0, 0.1, 0.1]\ncom_m",
            "key `object.inertia_kgm2[0]`: expected at most the sum of the other two, as of every body, found 1",
        ),
        ("com_m", "restitution = 2.0\ncom_m", "key `object.restitution`: expected 0 to 1, found 2"),
        ("com_m", "feet_m = []\ncom_m", "key `object.feet_m`: expected only for shape = \"prism\""),
        ("object_position_m", "object_position_mm", "key `noise.object_position_mm`: there is no key"),
        ("0.0005", "0.0", "key `noise.object_position_m`: expected 1e-9 to"),
        ("fraction = 0.5", "fraction = 1.0", "key `split.holdout_fraction`: expected a number between 0 and 1"),
        ("[split]", "[split", "log.toml cannot be read: line 21"),
    ];
    for (from, to, expected) in cases {
        let broken = HEADER.replacen(from, to, 1);
        assert_ne!(broken, HEADER, "{from}");
        let message = read(&broken, SAMPLES).unwrap_err();
        assert!(message.contains(expected) && !message.contains('\n'), "{to}: {message}");
    }
}

#[test]
fn outlines_that_cross_are_refused_by_their_key() {
    let prism = |outline: &str| {
        HEADER.replace("\"box\"", "\"prism\"").replace(
            "size_m = [0.08, { mean = 0.06, stddev = 0.001 }, 0.05]",
            &format!("outline_m = {outline}\nheight_m = 0.05\nfeet_m = [[0.01, 0.01], [0.09, 0.01], [0.01, 0.09]]"),
        )
    };
    let log = read(&prism("[[0.0, 0.0], [0.15, 0.0], [0.0, 0.15]]"), SAMPLES).unwrap();
    assert!(matches!(log.header.object.shape, Shape::Prism { .. }));
    let message = read(&prism("[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]"), SAMPLES).unwrap_err();
    assert_eq!(message, "log.toml, key `object.outline_m`: expected a simple outline, found that edges 1 and 3 meet");
}

#[test]
fn every_fault_of_the_samples_names_row_and_column() {
    let cases = [
        ("episode,", "trial,", "column `trial`: expected a column of the format with its unit"),
        ("episode,time_secs,", "episode,", "column `time_secs`: expected in every log, found none"),
        (
            "command_y_m",
            "command_y_mm",
            "column `command_y_mm`: expected a column of the format with its unit, such as command_y_m",
        ),
        ("command_y_m", "command_x_m", "column `command_x_m`: expected once, found twice"),
        ("command_y_m", "added_mass_kg", "column `command_y_m`: expected beside command_x_m, found none"),
        ("command_y_m", "joint_0_rad", "column `command_y_m`: expected beside command_x_m"),
        (
            "command_y_m",
            "action",
            "row 1, column `action`: expected a whole number from 0 to 9 or nothing, found `0.2`",
        ),
        ("object_qw", "added_mass_kg", "column `object_qw`: expected beside object_qx, found none"),
        (
            "3,0.01,",
            "3,0.00,",
            "row 2, column `time_secs`: expected times that increase in an episode, found 0.0 after 0.0",
        ),
        ("3,0.01,", "3,-0.01,", "row 2, column `time_secs`: expected a time of 0 to 86400 s, found -0.01"),
        ("3,0.01,", "3,,", "row 2, column `time_secs`: expected a finite number of seconds, found an empty cell"),
        ("3,0.01,0.1", "3,0.01,NaN", "row 2, column `command_x_m`: expected a finite number or nothing, found `NaN`"),
        ("3,0.01,0.1", "3,0.01,-inf", "row 2, column `command_x_m`: expected a finite number or nothing, found `-inf`"),
        (
            "3,0.01,0.1",
            "3,0.01,1e999",
            "row 2, column `command_x_m`: expected a finite number or nothing, found `1e999`",
        ),
        ("3,0.01,0.1", "3,0.01,1e30", "row 2, column `command_x_m`: expected -1000 to 1000, found 1000000000"),
        ("3,0.01,0.1", "3,0.01,0x1", "row 2, column `command_x_m`: expected a finite number or nothing, found `0x1`"),
        ("3,0.01,", "3.5,0.01,", "row 2, column `episode`: expected the whole number of an episode, found `3.5`"),
        ("3,0.01,", "-3,0.01,", "row 2, column `episode`"),
        ("8,0.0", "2,0.0", "row 3, column `episode`: expected ascending episodes, each in one piece, found 2 after 3"),
        ("8,0.0", "3,0.02", "samples.csv: expected at least 2 episodes"),
        ("0.025,0,0,0,1\n3", "0.025,0,0,90,1\n3", "row 1, column `object_qz`: expected -1.01 to 1.01, found 90"),
        (
            "0.025,0,0,0,1\n3",
            "0.025,0,0,1,1\n3",
            "row 1, column `object_qx`: expected a unit quaternion, within 0.01, found norm 1.414",
        ),
        (
            "0.025,0,0,0,1\n3",
            "0.025,,0,0,1\n3",
            "row 1, column `object_x_m`: expected a whole object pose in each episode, found none in episode 3",
        ),
        (",,,,,,,\n", ",,,,,,\n", "row 2: expected 12 cells, found 11"),
    ];
    for (from, to, expected) in cases {
        let broken = SAMPLES.replacen(from, to, 1);
        assert_ne!(broken, SAMPLES, "{from}");
        let message = read(HEADER, &broken).unwrap_err();
        assert!(message.starts_with("samples.csv") && message.contains(expected), "{to}: {message}");
        assert!(!message.contains('\n'), "{message}");
    }
    let message = read_bytes(HEADER.as_bytes(), &SAMPLES.replace("0.5,", "\0,").into_bytes()).unwrap_err();
    assert!(message.contains("row 1, column `object_x_m`"), "{message}");
    let mut bytes = SAMPLES.as_bytes().to_vec();
    let at = SAMPLES.find("0.025").unwrap();
    bytes[at] = 0xff;
    let message = read_bytes(HEADER.as_bytes(), &bytes).unwrap_err();
    assert!(message.contains("row 1, column `object_z_m`: expected UTF-8 text"), "{message}");
}

#[test]
fn an_arm_needs_its_joints_and_something_that_it_did() {
    let sawyer = HEADER.replace("\"none\"", "\"sawyer\"");
    read(&sawyer, SAMPLES).unwrap();
    let without = SAMPLES.replace("command_x_m,command_y_m,command_z_m", "wrist_fx_n,wrist_fy_n,wrist_fz_n");
    let message = read(&sawyer, &without).unwrap_err();
    assert!(message.contains("column `command_x_m`: expected it or action"), "{message}");
    let one_joint = SAMPLES.replace("command_x_m,command_y_m,command_z_m", "joint_0_rad,joint_1_rad,joint_2_rad");
    let message = read(&sawyer, &one_joint).unwrap_err();
    assert!(message.contains("column `joint_3_rad`: expected beside joint_0_rad, found none"), "{message}");
    let message = read(HEADER, &one_joint).unwrap_err();
    assert!(message.contains("column `joint_0_rad`: expected no such column for robot = \"none\""), "{message}");
}

#[test]
fn a_folder_without_samples_or_with_two_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let message = read_folder(folder.path()).unwrap_err();
    assert!(message.starts_with("cannot read log.toml: "), "{message}");
    std::fs::write(folder.path().join("log.toml"), HEADER).unwrap();
    assert!(read_folder(folder.path()).unwrap_err().ends_with("found neither"));
    let message = read_folder(&folder.path().join("log.toml")).unwrap_err();
    assert!(message.contains("is a file: expected the folder of a log"), "{message}");
    for name in ["samples.csv", "samples.parquet"] {
        std::fs::write(folder.path().join(name), SAMPLES).unwrap();
    }
    assert!(read_folder(folder.path()).unwrap_err().ends_with("found both"));
    std::fs::remove_file(folder.path().join("samples.csv")).unwrap();
    let message = read_folder(folder.path()).unwrap_err();
    assert!(message.starts_with("samples.parquet cannot be decoded as Parquet: "), "{message}");
    std::fs::remove_file(folder.path().join("samples.parquet")).unwrap();
    std::fs::create_dir(folder.path().join("samples.csv")).unwrap();
    assert!(read_folder(folder.path()).unwrap_err().contains("it is not a plain file"));
}

#[test]
fn nothing_is_written_over_a_log_and_nothing_invalid_is_written() {
    let mut log = read(HEADER, SAMPLES).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("a/b");
    measured_log::write(&dir, &log, Format::Csv, &Notes::new()).unwrap();
    let before = std::fs::read(dir.join("samples.csv")).unwrap();
    for format in [Format::Csv, Format::Parquet] {
        let message = measured_log::write(&dir, &log, format, &Notes::new()).unwrap_err().to_string();
        assert!(message.ends_with("exists: expected a folder without a log, nothing was written"), "{message}");
    }
    assert_eq!(std::fs::read(dir.join("samples.csv")).unwrap(), before);
    log.episodes[1].time_secs[0] = f64::NAN;
    let other = folder.path().join("c");
    let message = measured_log::write(&other, &log, Format::Csv, &Notes::new()).unwrap_err().to_string();
    assert!(message.contains("row 3, column `time_secs`") && !other.exists(), "{message}");
}

#[test]
fn notes_stand_above_their_keys_and_cannot_break_the_file() {
    let log = read(HEADER, SAMPLES).unwrap();
    let notes = Notes::from([("", "head".into()), ("object.mass_kg", "scales\nversion = 7\u{7}\r".into())]);
    let folder = tempfile::tempdir().unwrap();
    measured_log::write(folder.path(), &log, Format::Csv, &notes).unwrap();
    let text = std::fs::read_to_string(folder.path().join("log.toml")).unwrap();
    assert!(text.starts_with("# head\nversion = 1\n"), "{text}");
    assert!(text.contains("# scales\n# version = 7\nmass_kg = { mean = 0.5, stddev = 0.05 }\n"), "{text}");
    assert_eq!(read_folder(folder.path()).unwrap(), log);
}

/// Bits of all readings and times; a gap is `None`.
fn bits(log: &Log) -> Vec<Option<u64>> {
    let mut bits = Vec::new();
    for episode in &log.episodes {
        bits.extend(episode.time_secs.iter().map(|t| Some(t.to_bits())));
        for readings in episode.channels.values() {
            bits.extend(readings.iter().map(|r| r.map(f64::to_bits)));
        }
        bits.extend(episode.action.iter().flatten().map(|a| a.map(u64::from)));
    }
    bits
}

/// Readings of every magnitude, signed zeros, subnormals and gaps.
fn readings(rows: usize) -> impl Strategy<Value = Vec<Option<f64>>> {
    let value = prop_oneof![-1e3..1e3, -1e-300..1e-300, Just(-0.0), Just(5e-324), Just(0.1 + 0.2)];
    prop::collection::vec(prop::option::weighted(0.8, value), rows)
}

fn logs() -> impl Strategy<Value = Log> {
    let sizes = prop::collection::btree_map(any::<u64>(), 1..6_usize, 2..5);
    sizes.prop_flat_map(|sizes| {
        let rows: usize = sizes.values().sum();
        let actions = prop::option::of(prop::collection::vec(prop::option::of(0..10_u8), rows));
        let columns = prop::collection::vec(readings(rows), 6);
        (Just(sizes), actions, columns, prop::collection::vec(1e-9..1.0, rows)).prop_map(assemble)
    })
}

type Parts = (std::collections::BTreeMap<u64, usize>, Option<Vec<Option<u8>>>, Vec<Vec<Option<f64>>>, Vec<f64>);

fn assemble((sizes, actions, columns, steps): Parts) -> Log {
    let mut header = read(HEADER, SAMPLES).unwrap().header;
    header.robot = measured_log::Robot::Jaco;
    let mut start = 0;
    let mut episodes = Vec::new();
    for (id, rows) in sizes {
        let range = start..start + rows;
        start = range.end;
        let channels = Axis::ALL.map(Channel::Command).into_iter().chain(Axis::ALL.map(Channel::WristForce));
        let time = steps[range.clone()].iter().scan(0.0, |time, step| {
            *time += step;
            Some(*time)
        });
        episodes.push(measured_log::Episode {
            id,
            time_secs: time.collect(),
            action: actions.as_ref().map(|a| a[range.clone()].to_vec()),
            channels: channels.zip(&columns).map(|(c, r)| (c, r[range.clone()].iter().copied().collect())).collect(),
        });
    }
    Log { header, episodes }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_reads_back_bit_for_bit(log in logs()) {
        for format in [Format::Csv, Format::Parquet] {
            let folder = tempfile::tempdir().unwrap();
            measured_log::write(folder.path(), &log, format, &Notes::new()).unwrap();
            let again = read_folder(folder.path()).unwrap();
            prop_assert_eq!(&again, &log);
            prop_assert_eq!(bits(&again), bits(&log));
        }
    }

    #[test]
    fn the_parts_of_a_cross_validation_hold_out_every_episode_once(log in logs(), seed in any::<u64>(), parts in 1..9_usize) {
        let folds: Vec<_> = (0..parts).map(|part| log.fold(seed, part, parts)).collect();
        let mut held: Vec<usize> = folds.iter().flat_map(|split| split.holdout.clone()).collect();
        held.sort_unstable();
        prop_assert_eq!(&held, &(0..log.episodes.len()).collect::<Vec<_>>());
        let lengths = || folds.iter().map(|split| split.holdout.len());
        prop_assert!(lengths().max() <= lengths().min().map(|least| least + 1));
        for split in &folds {
            prop_assert!(split.fit.iter().all(|index| !split.holdout.contains(index)));
            prop_assert_eq!(split.fit.len() + split.holdout.len(), log.episodes.len());
        }
        prop_assert_eq!(log.fold(seed, parts, parts).holdout, Vec::<usize>::new());
    }

    #[test]
    fn the_split_knows_ids_and_seed_alone(log in logs(), seed in any::<u64>()) {
        let split = log.split(seed);
        prop_assert!(!split.fit.is_empty() && !split.holdout.is_empty());
        let mut all = [split.fit.clone(), split.holdout.clone()].concat();
        all.sort_unstable();
        prop_assert_eq!(all, (0..log.episodes.len()).collect::<Vec<_>>());
        let ids = |log: &Log, of: &[usize]| {
            let mut ids: Vec<u64> = of.iter().map(|i| log.episodes[*i].id).collect();
            ids.sort_unstable();
            ids
        };
        let mut reversed = log.clone();
        reversed.episodes.reverse();
        prop_assert_eq!(ids(&reversed, &reversed.split(seed).holdout), ids(&log, &split.holdout));
    }
}

#[test]
fn what_a_message_quotes_is_one_line_and_cut() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let refused = |header: &[u8], samples: &[u8]| {
        std::fs::write(dir.join("log.toml"), header).unwrap();
        std::fs::write(dir.join("samples.csv"), samples).unwrap();
        let message = measured_log::read(dir).unwrap_err().to_string();
        assert!(!message.contains(char::is_control) && message.len() < 1500, "{message:?}");
        message
    };
    let header = include_bytes!("fixtures/log.toml");
    let column = refused(header, b"episode,\x07\xff\x00name\n");
    assert!(column.contains("samples.csv") && column.contains("expected UTF-8 text"), "{column}");
    let long = [header.as_slice(), b"\n[split.", &b"a".repeat(100_000), b"]\n"].concat();
    assert!(refused(&long, b"").contains("log.toml"));
    let torn = [b"\"a\\nb\" = 1\n".as_slice(), header].concat();
    let torn = refused(&torn, b"");
    assert!(torn.contains("log.toml, key `a b`: there is no key `a b`"), "{torn}");
}

/// Code blocks of a page of the book in a language.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src").join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let parts = text.split("```").skip(1).step_by(2);
    parts.filter_map(|part| part.strip_prefix(language)?.strip_prefix('\n')).map(String::from).collect()
}

#[test]
fn the_samples_in_the_book_are_logs() {
    // As many episodes as the split needs, each like the one that is shown.
    let rows = &blocks("guides/diagnose.md", "csv")[0];
    let (head, rows) = rows.split_once('\n').unwrap();
    assert!(rows.lines().count() >= 3 && rows.lines().all(|row| row.starts_with("0,")), "{rows}");
    let mut samples = format!("{head}\n");
    for episode in 0..10 {
        samples.extend(rows.lines().map(|row| format!("{episode}{}\n", &row[1..])));
    }
    for page in ["guides/diagnose.md", "reference/measured-log.md"] {
        let headers = blocks(page, "toml");
        assert_eq!(headers.len(), 1, "{page}");
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("log.toml"), &headers[0]).unwrap();
        std::fs::write(folder.path().join("samples.csv"), &samples).unwrap();
        let log = measured_log::read(folder.path()).unwrap_or_else(|error| panic!("{page}: {error}"));
        assert_eq!(log.episodes.len(), 10, "{page}");
    }
}
