//! What a mapping says, and what is answered where it says something else; drafts; the program.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use import_log::{Mapping, Source, draft};
use measured_log::{Axis, Channel, Log};

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import")
}

const LOG: &str = "\
[log]
robot = \"none\"
period_secs = 0.1
tool_radius_m = 0.02
gravity_mps2 = 9.81
table = { height_m = 0.0, friction = 0.4 }
object = { shape = \"sphere\", size_m = [0.03], mass_kg = 0.2, com_m = [0.0, 0.0, 0.0] }
split = { holdout_fraction = 0.5 }
";

fn imported(head: &str, tail: &str, table: &str) -> Result<Log, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.csv");
    std::fs::write(&path, table).unwrap();
    let mapping = Mapping::parse(Path::new("map.toml"), &format!("version = 1\n{head}\n{LOG}{tail}"));
    let mapping = mapping.map_err(|error| error.to_string())?;
    Source::Table
        .import(&[path], &mapping)
        .map_err(|error| error.to_string().replace(folder.path().to_str().unwrap(), ""))
}

const HEAD: &str = "clock = { stamp = \"t\" }\nepisodes = { change = { value = \"e\" } }";
const OBJECT: &str = "[object]\nposition = [\"x\", 0, 0]\nrpy = [0, 0, \"yaw\"]\nangle_unit = \"deg\"\n";
const TABLE: &str = "e,t,x,yaw\n0,0.0,1,0\n0,0.1,2,90\n0,0.25,5,180\n1,0.0,1,0\n1,0.1,1,0\n";

#[test]
fn a_table_keeps_its_rows_and_a_grid_reads_between_them() {
    let log = imported(HEAD, OBJECT, TABLE).unwrap();
    assert_eq!(log.episodes[0].time_secs, [0.0, 0.1, 0.25]);
    let grid = |how: &str| {
        let head = format!("{HEAD}\ngrid = {{ sample = \"{how}\", near_secs = 0.12 }}");
        let log = imported(&head, OBJECT, TABLE).unwrap();
        let x = |row| log.episodes[0].get(Channel::ObjectPosition(Axis::X), row);
        assert_eq!(log.episodes[0].time_secs, [0.0, 0.1, 0.2], "the last row would be at 0.3 s");
        assert_eq!(log.episodes[1].rows(), 2, "the clock starts anew");
        (0..3).map(x).collect::<Vec<_>>()
    };
    assert_eq!(grid("hold"), [Some(1.0), Some(2.0), Some(2.0)]);
    assert_eq!(grid("nearest"), [Some(1.0), Some(2.0), Some(5.0)]);
    let linear = grid("linear");
    assert!((linear[2].unwrap() - 4.0).abs() < 1e-9, "{linear:?}");
}

#[test]
fn an_early_clock_makes_no_reading_one_of_the_episode_before() {
    let head = format!("{HEAD}\ngrid = {{ sample = \"linear\", near_secs = 0.2 }}");
    let log = imported(&head, &format!("{OBJECT}offset_secs = -0.05\n"), TABLE).unwrap();
    let lasts_secs: Vec<f64> = log.episodes.iter().filter_map(|episode| episode.time_secs.last().copied()).collect();
    assert!(lasts_secs.len() == 2 && lasts_secs.iter().all(|secs| *secs < 0.3), "{lasts_secs:?}");
}

#[test]
fn frames_mounts_and_signs_take_a_reading_to_where_a_log_has_it() {
    // The body's marker is 0.1 m ahead of its centre; the tracker is turned by a quarter about z and 1 m up.
    let tail = "[object]\nposition = [\"x\", 0, 0]\nrpy = [0, 0, \"yaw\"]\nangle_unit = \"deg\"\nframe = \"tracker\"\n\
                mount = { translation_m = [-0.1, 0.0, 0.0] }\n\
                [frames.tracker]\ntranslation_m = [0.0, 0.0, 1.0]\nrpy_deg = [0.0, 0.0, 90.0]\n\
                [object_velocity]\nvalue = [\"x\", 0, 0]\nunit = \"cm/s\"\naxes = \"object\"\n";
    let log = imported(HEAD, tail, TABLE).unwrap();
    let close = |found: [f64; 3], expected: [f64; 3]| (0..3).all(|i| (found[i] - expected[i]).abs() < 1e-12);
    // First row: x = 1 is y = 1 in the world, the body looks along y, its centre is 0.1 m behind.
    let first = log.episodes[0].vector(Channel::ObjectPosition, 0).unwrap();
    assert!(close(first, [0.0, 0.9, 1.0]), "{first:?}");
    // Second row: the body looks along -x.
    let second = log.episodes[0].vector(Channel::ObjectPosition, 1).unwrap();
    assert!(close(second, [0.1, 2.0, 1.0]), "{second:?}");
    let velocity = log.episodes[0].vector(Channel::ObjectVelocity, 1).unwrap();
    assert!(close(velocity, [-0.02, 0.0, 0.0]), "{velocity:?}");
}

#[test]
fn still_phases_and_gaps_cut_a_recording() {
    let mut table = String::from("t,x,yaw\n");
    for i in 0..100 {
        let t = f64::from(i) * 0.1;
        let x = (t - 2.0).clamp(0.0, 1.0) + (t - 7.0).clamp(0.0, 1.0);
        table.push_str(&format!("{t:.1},{x},0\n"));
    }
    let head = "clock = { stamp = \"t\" }\nepisodes = { still = { of = \"object\", within_m = 0.01, longer_than_secs = 1.0 } }";
    let log = imported(head, OBJECT, &table).unwrap();
    let lengths: Vec<usize> = log.episodes.iter().map(measured_log::Episode::rows).collect();
    assert_eq!(log.episodes.len(), 2, "{lengths:?}");
    assert!(
        lengths.iter().all(|rows| (18..=22).contains(rows)),
        "a second of motion and half a second around it: {lengths:?}"
    );
    let head = "clock = { stamp = \"t\" }\nepisodes = { gap = { longer_than_secs = 0.12 } }";
    let log = imported(head, OBJECT, "t,x,yaw\n0,0,0\n0.1,0,0\n0.5,0,0\n").unwrap();
    assert_eq!(log.episodes.len(), 2);
}

#[test]
fn each_mistake_in_a_mapping_is_named_with_its_key() {
    let cases: [(&str, &str, &str); 14] = [
        ("episodes = \"source\"", OBJECT, "map.toml, key `clock.stamp`: expected the name of the column"),
        (
            "clock = { stamp = \"q\" }\nepisodes = \"source\"",
            OBJECT,
            "expected a column of /rig.csv (`e`, `t`, `x`, `yaw`), found `q`",
        ),
        (HEAD, "[objekt]\nposition = \"x\"\n", "map.toml, key `objekt`: there is no key `objekt`"),
        (HEAD, "", "key `object`: expected it or another quantity"),
        (HEAD, "[object]\nposition = [\"x\", 0]\n", "key `object.position`: expected 3 entries, found 2"),
        (HEAD, "[object]\nposition = [\"x\", 0, 0]\nunit = \"deg\"\n", "key `object.unit`: expected a unit of length"),
        (
            HEAD,
            "[object]\nposition = [\"x\", 0, 0]\norientation = [0, 0, 0, 1]\n",
            "key `object.order`: expected \"xyzw\" or \"wxyz\"",
        ),
        (
            HEAD,
            "[object]\nposition = [\"x\", 0, 0]\nframe = \"a\"\n",
            "key `object.frame`: expected the name of a table [frames.NAME]",
        ),
        (HEAD, "[object]\nposition = [\"x\", 0, 0]\ntopic = \"/a\"\n", "key `object.topic`: expected none"),
        (HEAD, "[wrench]\nforce = [0, 0, \"x\"]\naxes = \"world\"\n", "key `wrench.of`: "),
        (
            HEAD,
            "[wrench]\nforce = [0, 0, \"x\"]\nof = \"tool\"\naxes = \"tool\"\n",
            "key `wrench.axes`: expected tool.orientation",
        ),
        (HEAD, "[joints]\nvalues = [\"x\"]\n", "key `joints`: expected no joints for log.robot = \"none\""),
        (
            "clock = { stamp = \"t\", unit = \"mm\" }\nepisodes = \"source\"",
            OBJECT,
            "key `clock.unit`: expected a unit of time",
        ),
        ("clock = { stamp = \"x\" }\nepisodes = \"source\"", OBJECT, "times that increase"),
    ];
    for (head, tail, expected) in cases {
        let message = imported(head, tail, TABLE).unwrap_err();
        assert!(message.contains(expected), "{message}\nfor {expected}");
    }
    let message = imported(HEAD, OBJECT, "e,t,x,yaw\n0,0,\"1,5\",0\n").unwrap_err();
    assert_eq!(
        message,
        "/rig.csv, row 1, column `x`: expected a finite number or nothing, found `1,5` (table.decimal = \",\" reads a decimal comma)"
    );
    let log = format!("version = 1\n{HEAD}\n{}{OBJECT}", LOG.replace("0.2, com", "-1, com"));
    let message = Mapping::parse(Path::new("map.toml"), &log).unwrap_err().to_string();
    assert!(message.starts_with("map.toml, key `log.object.mass_kg`: expected"), "{message}");
}

#[test]
fn a_vector_of_one_column_and_a_joint_given_twice_are_refused() {
    let message = imported(HEAD, "[object]\nposition = \"x\"\n", TABLE).unwrap_err();
    let expected =
        "key `object`: expected a list of 3 in `x`, or a list of columns here, found a column of single numbers";
    assert!(message.ends_with(expected), "{message}");
    let text = std::fs::read_to_string(data().join("joints.toml")).unwrap();
    let mapping = Mapping::parse(Path::new("map.toml"), &text.replacen("\"j5\"]", "\"j4\"]", 1)).unwrap();
    let message = Source::Ros2.import(&[data().join("ros2_mcap")], &mapping).unwrap_err().to_string();
    assert_eq!(message, "map.toml, key `joints.order`: expected different joints, found `j4` twice");
}

#[test]
fn of_a_longer_list_nothing_is_taken_by_its_order() {
    let text = std::fs::read_to_string(data().join("own_message.toml")).unwrap();
    let longer = text.replacen("\"tool_cm\"", "\"box.wxyz\"", 1);
    assert_ne!(text, longer);
    let mapping = Mapping::parse(Path::new("map.toml"), &longer).unwrap();
    let message = Source::Mcap.import(&[data().join("own_message.mcap")], &mapping).unwrap_err().to_string();
    let expected = "expected a list of 3 at `box.wxyz`, found one of 4 (elements are named one by one, as in [\"box.wxyz[0]\", …])";
    assert_eq!(message, format!("map.toml, key `tool`: {expected}"));
}

#[test]
fn a_clock_that_stands_still_is_refused() {
    let text = std::fs::read_to_string(data().join("json.toml")).unwrap();
    // The weight is the same all through an episode.
    let lines =
        text.lines().map(|line| if line.starts_with("clock") { "clock = { stamp = \"weight_g\" }" } else { line });
    let mapping = Mapping::parse(Path::new("map.toml"), &lines.collect::<Vec<_>>().join("\n")).unwrap();
    let message = Source::Mcap.import(&[data().join("json.mcap")], &mapping).unwrap_err().to_string();
    let expected = "key `command.stamp`: expected a clock that goes on, found 2 times in ";
    assert!(message.contains(expected), "{message}");
}

#[test]
fn topics_and_paths_that_are_not_there_are_named_with_what_is() {
    let text = std::fs::read_to_string(data().join("ros2_mcap.toml")).unwrap();
    for (from, to, expected) in [
        ("\"/tcp\"", "\"/tpc\"", "key `tool.topic`: expected a topic with messages in"),
        (
            "\"pose.position\"",
            "\"pose.place\"",
            "key `tool`: expected readings at `pose.place` in messages of `/tcp`, which hold `header.stamp.sec`, ",
        ),
        (
            "child_frame_id=box",
            "child_frame_id=bax",
            "key `object`: expected readings at `transforms[child_frame_id=bax].transform.translation` and ",
        ),
        ("\"/command\"", "\"/trial\"", "key `command`: expected readings"),
        ("stamp = \"header\"", "stamp = \"header.frame_id\"", "expected a time at header.frame_id"),
    ] {
        let mapping = Mapping::parse(Path::new("map.toml"), &text.replacen(from, to, 1)).unwrap();
        let result = Source::Ros2.import(&[data().join("ros2_mcap")], &mapping).map(|log| log.episodes.len());
        let message = result.unwrap_err().to_string();
        assert!(message.contains(expected), "{message}\nfor {expected}");
        if to == "child_frame_id=bax" {
            assert!(message.ends_with("(by name there are `box`, `lamp`)"), "{message}");
        }
        if to == "\"/tpc\"" {
            assert!(message.contains("`/ft_sensor`, `/joint_states`, `/tcp`, `/tf`, `/trial`"), "{message}");
        }
    }
}

#[test]
fn a_draft_for_our_own_columns_works_as_it_is() {
    let source = data().join("original/samples.csv");
    let text = draft(Source::Table, std::slice::from_ref(&source)).unwrap();
    let mapping = Mapping::parse(Path::new("draft.toml"), &text).unwrap();
    assert!(mapping.unfilled() > 0, "sizes and mass stand in no table");
    let log = Source::Table.import(&[source], &mapping).unwrap();
    let original = measured_log::read(&data().join("original")).unwrap();
    assert_eq!(log.episodes, original.episodes, "bit for bit");
    assert!((log.header.period_secs - 0.02).abs() < 1e-12);
}

#[test]
fn drafts_of_recordings_find_what_a_person_would() {
    for (kind, name, expected) in [
        (
            Source::Ros2,
            "ros2_mcap",
            &[
                "at = \"transforms[child_frame_id=box]\"",
                "topic = \"/tcp\"",
                "stamp = \"header\"",
                "topic = \"/ft_sensor\"",
                "topic = \"/trial\"",
            ][..],
        ),
        (Source::Mcap, "json.mcap", &["position = \"tcp.position\"", "force = \"ft.force\""]),
        (
            Source::Lerobot,
            "lerobot",
            &["observation.state[tool_x]", "value = \"episode_index\"", "stamp = \"timestamp\"", "period_secs = 0.02"],
        ),
        (
            Source::Table,
            "rig.csv",
            &["tcp_x_mm", "unit = \"mm\"", "separator = \";\"", "stamp = \"t_ms\", unit = \"ms\"", "force = [\"Fx_N\""],
        ),
    ] {
        let text = draft(kind, &[data().join(name)]).unwrap();
        for part in expected {
            assert!(text.contains(part), "{name} lacks {part}:\n{text}");
        }
        Mapping::parse(Path::new("draft.toml"), &text).unwrap_or_else(|error| panic!("{name}: {error}\n{text}"));
    }
}

fn program(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_import-log")).args(arguments).output().unwrap()
}

#[test]
fn the_program_drafts_imports_and_overwrites_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (map, out) = (folder.path().join("map.toml"), folder.path().join("log"));
    let (map, out) = (map.to_str().unwrap(), out.to_str().unwrap());
    let source = data().join("original/samples.csv");
    let source = source.to_str().unwrap();
    // A draft has no format.
    let refused = program(&["table", source, "--draft-map", map, "--format", "parquet"]);
    assert_eq!((refused.status.code(), Path::new(map).exists()), (Some(2), false));
    assert!(program(&["table", source, "--draft-map", map]).status.success());
    let again = program(&["table", source, "--draft-map", map]);
    assert_eq!(again.status.code(), Some(2));
    let done = program(&["table", source, "--map", map, "--out", out]);
    let (text, warning) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success() && text.contains("4 episodes, 128 rows"), "{text}{warning}");
    assert!(text.contains("object_x_m: 128 of 128 rows"), "{text}");
    assert!(warning.contains("marked FILL"), "{warning}");
    let log = measured_log::read(Path::new(out)).unwrap();
    assert_eq!(log.episodes.len(), 4);
    let toml = std::fs::read_to_string(Path::new(out).join("log.toml")).unwrap();
    assert!(toml.starts_with("# Imported by `import-log table` from samples.csv with map.toml."), "{toml}");
    assert_eq!(program(&["table", source, "--map", map, "--out", out]).status.code(), Some(2));
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &std::fs::read(data().join("json.mcap")).unwrap()[..9000]).unwrap();
    let json = data().join("json.toml");
    let other = folder.path().join("other");
    let failed =
        program(&["mcap", cut.to_str().unwrap(), "--map", json.to_str().unwrap(), "--out", other.to_str().unwrap()]);
    let message = String::from_utf8_lossy(&failed.stderr);
    assert_eq!(failed.status.code(), Some(2), "{message}");
    assert!(message.lines().count() == 1 && message.contains("ends in the middle") && !other.exists(), "{message}");
}
