//! Clocks that differ, stamps off the grid, and columns that are missing: of recorded logs with a tilt, a grain, damping or nothing.

use std::path::Path;

use discrepancy::{Nominal, Report, Settings, Verdict, diagnose, rig_tool};
use measured_log::{Channel, Log};

fn log(set: &str) -> Log {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
    measured_log::read(&folder.join(set)).unwrap()
}

fn report(log: &Log) -> Report {
    let nominal = Nominal::new(&log.header, rig_tool(log, None).unwrap()).unwrap();
    let settings = Settings::default();
    Report::new(&diagnose(log, "log", &nominal, &settings).unwrap(), &settings, 0.0)
}

fn names(report: &Report) -> Vec<&'static str> {
    report.effects.iter().map(|effect| effect.name).collect()
}

/// Columns that are stamped so many rows late; what was read first holds until then.
fn late(mut log: Log, of: impl Fn(Channel) -> bool, rows: usize) -> Log {
    for episode in &mut log.episodes {
        for (_, readings) in episode.channels.iter_mut().filter(|(channel, _)| of(**channel)) {
            *readings = (0..readings.len()).map(|row| readings.get(row.saturating_sub(rows))).collect();
        }
    }
    log
}

fn tool(channel: Channel) -> bool {
    matches!(channel, Channel::Command(_) | Channel::Tool(_))
}

fn force(channel: Channel) -> bool {
    matches!(channel, Channel::WristForce(_) | Channel::WristTorque(_))
}

/// Value and interval of a clock, ms.
fn clock(report: &Report, key: &str) -> (f64, [f64; 2]) {
    let value = report.retuned.iter().find(|value| value.key == key).unwrap();
    (1e3 * value.value, value.interval90.map(|end| 1e3 * end))
}

#[test]
fn a_tool_that_is_stamped_late_is_a_skew_and_no_effect() {
    // A row is 20 ms.
    let found = report(&late(log("set-003"), tool, 1));
    assert_eq!(names(&found), ["table_tilt"], "{}", found.summary);
    for key in ["clock.object_secs", "clock.force_secs"] {
        let (ms, [low, high]) = clock(&found, key);
        assert!((ms + 20.0).abs() < 3.0 && low < ms && ms < high, "{key}: {ms} [{low}, {high}]");
    }
    assert!(found.retuned_sentences().iter().any(|sentence| sentence.contains("early")));
}

#[test]
fn a_camera_later_than_any_clock_is_named_beside_what_else_is_missing() {
    let object = |channel| matches!(channel, Channel::ObjectPosition(_) | Channel::ObjectOrientation(_));
    let mut log = late(log("set-003"), object, 4);
    log.episodes.truncate(12);
    let found = report(&log);
    let mut named = names(&found);
    named.sort_unstable();
    assert_eq!(named, ["pose_delay", "table_tilt"], "{}", found.summary);
    let delay = found.effects.iter().flat_map(|effect| &effect.parameters).find(|value| value.key == "delay_secs");
    assert!(delay.is_some_and(|delay| (delay.value - 0.08).abs() < 0.006), "{delay:?}");
}

#[test]
fn a_late_force_has_its_own_name() {
    let found = report(&late(log("set-002"), force, 2));
    assert_eq!(found.effects.first().map(|effect| effect.name), Some("force_delay"), "{}", found.summary);
    let delay = &found.effects[0].parameters[0];
    assert!((delay.value - 0.04).abs() < 0.006, "{delay:?}");
}

#[test]
fn what_the_stamps_say_is_the_tick() {
    let mut stretched = log("set-005");
    stretched.episodes.iter_mut().for_each(|episode| episode.time_secs.iter_mut().for_each(|time| *time *= 1.01));
    let found = report(&stretched);
    // One without a twin: between a tilt and a constant force 1 % of the time decides.
    assert_eq!(names(&found), ["anisotropic_friction"], "{}", found.summary);
    assert!(found.heldout.after < 1.1, "{:?}", found.heldout);
}

#[test]
fn a_tool_without_commands_goes_where_it_was_read() {
    let mut bare = log("set-002");
    for episode in &mut bare.episodes {
        episode.channels.retain(|channel, _| !matches!(channel, Channel::Command(_)));
    }
    let found = report(&bare);
    assert_eq!(found.verdict, Verdict::None, "{}", found.summary);
}
