//! Logs recorded from MuJoCo (tests/data/mujoco-logs): what they hide is named, and nothing else.

use std::path::{Path, PathBuf};

use discrepancy::{ModelFile, Nominal, Report, Settings, Verdict, diagnose, rig_tool};
use measured_log::{Axis, Channel, Log, Number};

fn logs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs")
}

/// The report on a set, and the model that it ends with.
fn report(set: &str) -> (Report, ModelFile) {
    of(&measured_log::read(&logs().join(set)).unwrap(), set)
}

fn of(log: &Log, set: &str) -> (Report, ModelFile) {
    let nominal = Nominal::new(&log.header, rig_tool(log, None).unwrap()).unwrap();
    let settings = Settings::default();
    let diagnosis = diagnose(log, set, &nominal, &settings).unwrap();
    let report = Report::new(&diagnosis, &settings, 0.0);
    let model = ModelFile::new(&nominal, &diagnosis, &report, None);
    (report, model)
}

#[test]
fn a_tilted_table_is_named_with_its_slope() {
    let (found, model) = report("set-003");
    assert_eq!(found.verdict, Verdict::Effect, "{}", found.summary);
    let [effect] = found.effects.as_slice() else { panic!("{:?}", found.effects) };
    assert_eq!(effect.name, "table_tilt");
    // On logs of several engines a tilt that leads a force by so little is right more often than not, and no more.
    assert!(effect.confidence > 0.5 && found.confusion_set.starts_with(&["table_tilt", "constant_force"]));
    // What MuJoCo was given: tests/data/mujoco-logs/truth/set-003.json.
    for (value, truth) in effect.parameters.iter().zip([-0.021_389, -0.007_801]) {
        assert!((value.value - truth).abs() < 0.001, "{value:?}");
        assert!(value.interval90[0] < value.value && value.value < value.interval90[1], "{value:?}");
    }
    assert!(found.heldout.before > 1.2 && found.heldout.after < 1.1, "{:?}", found.heldout);
    assert!(found.rollouts <= 5000, "{}", found.rollouts);
    // That a second pass, which begins with this model, finds nothing is seen where the guide's commands are run.
    assert!(model.to_toml().unwrap().contains("table_tilt"));
}

#[test]
fn logs_of_other_shapes_and_effects_get_the_right_answer() {
    // A ball, a cylinder, and commands that are not followed; the others are for `diagnose-benchmark`.
    for set in ["set-000", "set-005", "set-007"] {
        let text = std::fs::read_to_string(logs().join("../truth").join(set).with_extension("json")).unwrap();
        let truth: serde_json::Value = serde_json::from_str(&text).unwrap();
        let (found, _) = report(set);
        let names: Vec<&str> = found.effects.iter().map(|effect| effect.name).collect();
        let hidden = truth["effect"].as_str().unwrap();
        assert_eq!((found.verdict, names), (Verdict::Effect, vec![hidden]), "{set}: {}", found.summary);
        assert!(found.confusion_set.contains(&hidden), "{set}: {:?}", found.confusion_set);
    }
}

#[test]
fn a_camera_that_is_late_is_a_skew_of_its_clock() {
    let (found, _) = report("set-001");
    assert_eq!(found.verdict, Verdict::None, "{}", found.summary);
    let clock = found.retuned.iter().find(|value| value.key == "clock.object_secs").unwrap();
    // What the truth calls `pose_delay`.
    assert!((clock.value - 0.026_398).abs() < 0.002, "{clock:?}");
    assert!(found.retuned_sentences().iter().any(|sentence| sentence.contains("object") && sentence.contains("late")));
}

#[test]
fn where_nothing_is_hidden_nothing_is_named() {
    let (found, model) = report("set-002");
    assert_eq!(found.verdict, Verdict::None, "{}", found.summary);
    assert!(found.effects.is_empty());
    // What the evidence leans to gains something, and less than a name takes.
    let gain = |name: &&str| found.ranking.iter().find(|rival| rival.name == *name).unwrap().log_evidence;
    let gains: Vec<f64> = found.confusion_set.iter().map(gain).collect();
    assert!(gains.iter().all(|gain| (0.0..10.0).contains(gain)), "{:?} gain {gains:?}", found.confusion_set);
    assert_eq!(gains.len(), found.ranking.iter().filter(|rival| rival.log_evidence > 0.0).count());
    assert!(!model.to_toml().unwrap().contains("table_tilt"));
}

#[test]
fn a_friction_that_was_taken_for_known_is_named_and_no_mass_stands_for_it() {
    // Nothing is hidden in the log but for what its header is made to say: 0.7 for the table, without any doubt, where MuJoCo was given 0.380. 0.27 kg for 0.49,
    // 4.1 standard deviations of the prior, do the same to a slow push.
    let mut log = measured_log::read(&logs().join("set-002")).unwrap();
    log.header.table.friction = 0.7.into();
    let (found, _) = of(&log, "set-002");
    assert_eq!(found.verdict, Verdict::Effect, "{}", found.summary);
    let [effect] = found.effects.as_slice() else { panic!("{:?}", found.effects) };
    assert_eq!(effect.name, "friction_level");
    let [low, high] = effect.parameters[0].interval90;
    // As wide as logs of other engines ask for: 0.047 since `width` was learnt anew.
    assert!(low < 0.380_36 && 0.380_36 < high && high - low < 0.05, "{:?}", effect.parameters);
    assert!(found.heldout.before > 2.0 && found.heldout.after < 1.1, "{:?}", found.heldout);
}

#[test]
fn a_mass_that_is_off_by_much_is_re_tuned_and_no_friction_stands_for_it() {
    // The friction is right and known; the mass is twice what the header says, 4.6 standard deviations of its prior.
    let mut log = measured_log::read(&logs().join("set-002")).unwrap();
    log.header.table.friction = 0.380_36.into();
    log.header.object.mass_kg = Number::Uncertain { mean: 0.25, stddev: 0.0375 };
    let (found, _) = of(&log, "set-002");
    assert_eq!(found.verdict, Verdict::None, "{}", found.summary);
    let mass = found.retuned.iter().find(|value| value.key == "object.mass_kg").unwrap();
    assert!((mass.value - 0.494_5).abs() < 0.01, "{:?}", found.retuned);
}

#[test]
fn what_the_catalogue_does_not_have_gets_no_name() {
    // A magnet under the table, by which two of the ten fitted episodes go: 1.16 held out is too little to call it `unknown`.
    let (found, _) = report("set-010");
    assert_ne!(found.verdict, Verdict::Effect, "{}", found.summary);
    assert!(found.probabilities.effect() < 0.5 && found.probabilities.none < 0.9, "{:?}", found.probabilities);
}

#[test]
fn a_tool_of_another_size_than_the_log_says_is_told_by_when_it_touches() {
    // In MuJoCo it is a ball of 20 mm.
    let mut log = measured_log::read(&logs().join("set-002")).unwrap();
    log.header.tool_radius_m = Some(0.014);
    let (found, _) = of(&log, "set-002");
    assert_ne!(found.verdict, Verdict::Effect, "{}", found.summary);
    let onset = found.contact_gap.unwrap().onset.unwrap();
    assert!((onset.after_m[1] + 0.006).abs() < 0.001, "{onset:?}");
    let description = found.description.unwrap();
    assert!(
        description.contains("before simulated ones") && description.contains("the sizes of tool"),
        "{description}"
    );
    assert!(found.next_experiment.starts_with("Measure the tool and the object"), "{}", found.next_experiment);
}

#[test]
fn a_scale_of_a_frame_whose_origin_is_far_away_is_no_offset() {
    // Half a metre from the origin a scale of 0.95 moves every pose by about 25 mm.
    const SCALE: f64 = 0.95;
    let mut log = measured_log::read(&logs().join("set-002")).unwrap();
    for episode in &mut log.episodes {
        for (channel, readings) in &mut episode.channels {
            let moved = |value: f64| match channel {
                Channel::Command(Axis::X) | Channel::Tool(Axis::X) => value + 0.5,
                Channel::ObjectPosition(Axis::X) => SCALE * (value + 0.5),
                Channel::ObjectPosition(_) => SCALE * value,
                _ => value,
            };
            *readings = readings.iter().map(|reading| reading.map(moved)).collect();
        }
    }
    let (found, _) = of(&log, "set-002");
    let [effect] = found.effects.as_slice() else { panic!("{}", found.summary) };
    assert_eq!(effect.name, "pose_scale", "{}", found.summary);
    assert!((effect.parameters[0].value - SCALE).abs() < 0.002, "{:?}", effect.parameters);
    assert!(found.heldout.after < 1.1, "{:?}", found.heldout);
}

#[test]
fn what_is_in_the_way_of_few_episodes_leads_and_is_not_sure() {
    // None of the episodes that choose or are reported meets the body: its evidence is that of four of eleven.
    let (found, _) = report("set-006");
    assert_eq!(found.ranking[0].name, "hidden_obstacle", "{:?}", found.ranking);
    assert_eq!(found.confusion_set[0], "hidden_obstacle");
    assert!(found.heldout.before < 1.1, "{:?}", found.heldout);
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    let set = "set-009";
    let mut log = measured_log::read(&logs().join(set)).unwrap();
    log.episodes.truncate(6);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        serde_json::to_string(&pool.install(|| of(&log, set).0)).unwrap()
    };
    let one = with(1);
    assert!(one.contains("wrist_payload"), "{one}");
    assert_eq!(one, with(2));
}

#[test]
fn a_broken_model_file_is_refused_with_file_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    for (text, expected) in [
        ("version = 2", "key `version`: expected 1, found 2"),
        ("version = 1\nnominl = {}", "nominl"),
        ("version = 1\n[effects]\nmodel = [{ table_tilt = { slope_x_rad = 9.0, slope_y_rad = 0.0 } }]", "slope_x_rad"),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = ModelFile::read(&path).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("model.toml"), "{error}");
    }
    std::fs::write(&path, "version = 1\n[nominal]\n\"object.colour\" = 1.0\n").unwrap();
    let log = measured_log::read(&logs().join("set-002")).unwrap();
    let mut nominal = Nominal::new(&log.header, rig_tool(&log, None).unwrap()).unwrap();
    let error = ModelFile::read(&path).unwrap().apply(&mut nominal).unwrap_err().to_string();
    assert!(error.contains("object.colour") && error.contains("object.mass_kg"), "{error}");
}
