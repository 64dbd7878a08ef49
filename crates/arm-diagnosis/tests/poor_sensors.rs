//! The log that comes with the project, of an arm with friction in joint1 and joint3, as poorer sensors would have read it.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use arm_diagnosis::{Diagnosis, Log, Settings, diagnose};

/// The log with each cell of a column of torques changed.
fn read(change: impl Fn(&str, f64) -> String) -> Result<Log, String> {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/joint-log");
    let folder = tempfile::tempdir().unwrap();
    for name in ["arm.urdf", "log.toml"] {
        std::fs::copy(from.join(name), folder.path().join(name)).unwrap();
    }
    let samples = std::fs::read_to_string(from.join("samples.csv")).unwrap();
    let mut lines = samples.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut text = header.join(",") + "\n";
    for line in lines {
        let cell = |(name, cell): (&&str, &str)| {
            let torque = name.starts_with("joint_torque_") || name.starts_with("joint_force_");
            if torque { change(name, cell.parse().unwrap()) } else { cell.to_owned() }
        };
        let cells: Vec<String> = header.iter().zip(line.split(',')).map(cell).collect();
        text += &(cells.join(",") + "\n");
    }
    std::fs::write(folder.path().join("samples.csv"), text).unwrap();
    Log::read(folder.path()).map_err(|error| error.to_string())
}

fn joints(diagnosis: &Diagnosis) -> Vec<usize> {
    let effect = diagnosis.effects.first().unwrap_or_else(|| panic!("{:?}", diagnosis.considered));
    assert_eq!(effect.name, "joint_friction");
    let mut joints: Vec<usize> = effect.joints.iter().filter_map(|joint| joint.joint).collect();
    joints.sort_unstable();
    joints
}

#[test]
fn a_joint_whose_torque_is_dead_is_left_out_and_the_others_are_diagnosed() {
    for (dead, why) in [("0.25", "never changes"), ("", "is never read")] {
        let log = read(|name, value| if name == "joint_torque_3_nm" { dead.into() } else { value.to_string() });
        let diagnosis = diagnose(&log.unwrap(), &Settings::default()).unwrap();
        assert_eq!(joints(&diagnosis), [1]);
        assert!(diagnosis.considered.iter().all(|one| !one.joints.contains(&3)), "{:?}", diagnosis.considered);
        assert!(diagnosis.notes.iter().any(|note| note.contains("\"joint3\"") && note.contains(why)), "{why}");
        assert!(diagnosis.heldout.after < 10.0, "{:?}", diagnosis.heldout);
    }
    let message = read(|_, _| "1.5".into()).unwrap_err();
    assert!(message.contains("no torque of any joint changes"), "{message}");
}

#[test]
fn readings_that_are_rounded_coarsely_are_not_taken_for_exact_ones() {
    // Steps of 0.5 N·m: most readings are those of the row before, so their third differences are 0.
    let rounded = |name: &str, value: f64| {
        if name == "joint_torque_7_nm" { ((2.0 * value).round() / 2.0).to_string() } else { value.to_string() }
    };
    let diagnosis = diagnose(&read(rounded).unwrap(), &Settings::default()).unwrap();
    assert_eq!(joints(&diagnosis), [1, 3]);
    assert!(diagnosis.remainder[7].noise_nm > 0.02, "{:?}", diagnosis.remainder[7]);
    assert!(diagnosis.heldout.after < 10.0, "{:?}", diagnosis.heldout);
}

#[test]
fn a_first_torque_of_a_sensor_that_has_not_begun_says_nothing() {
    let rows = AtomicUsize::new(0);
    let first = |name: &str, value: f64| {
        let spoilt = name == "joint_torque_1_nm" && rows.fetch_add(1, Ordering::Relaxed) == 0;
        if spoilt { "500".into() } else { value.to_string() }
    };
    let [spoilt, good] = [read(first), read(|_, value| value.to_string())]
        .map(|log| diagnose(&log.unwrap(), &Settings::default()).unwrap());
    assert_eq!(joints(&spoilt), [1, 3]);
    let rms = |diagnosis: &Diagnosis| diagnosis.located.iter().map(|cell| cell.share * cell.rows).sum::<f64>();
    assert!((rms(&spoilt) / rms(&good) - 1.0).abs() < 0.02, "{} {}", rms(&spoilt), rms(&good));
    for (a, b) in spoilt.remainder.iter().zip(&good.remainder) {
        assert!((a.moving_nm / b.moving_nm - 1.0).abs() < 0.02, "{a:?} {b:?}");
    }
}
