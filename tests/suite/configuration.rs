//! `scenario check` explains what a run would use; `scenario schema` is what editors get.

use end_to_end::{root, run, stderr};
use serde_json::Value;

use crate::bad_input::refused;

fn stdout(arguments: &str) -> String {
    let output = run("scenario", arguments);
    assert!(output.status.success(), "scenario {arguments}: {}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_check_names_value_unit_meaning_and_layer_of_every_key() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    std::fs::write(&file, "name = \"mine\"\n[task]\nhorizon = 9\n").unwrap();
    let file = file.display().to_string();
    let arguments = format!("check {file} --robot jaco --preset surmise --set planner.depth=7 --json");
    let report: Value = serde_json::from_str(&stdout(&arguments)).unwrap();
    assert_eq!(
        (&report["scenario"], &report["robot"], &report["preset"]),
        (&"mine".into(), &"jaco".into(), &"surmise".into())
    );
    let keys = report["keys"].as_array().unwrap();
    let of = |key: &str| keys.iter().find(|k| k["key"] == key).unwrap_or_else(|| panic!("{key}"));
    for key in keys {
        assert!(key["meaning"].as_str().is_some_and(|text| text.len() > 2), "{key}");
    }
    let from = |key: &str| [of(key)["from"]["layer"].as_str().unwrap(), of(key)["from"]["name"].as_str().unwrap()];
    assert_eq!((&of("task.horizon")["value"], from("task.horizon")), (&9.into(), ["domain", file.as_str()]));
    assert_eq!((&of("planner.depth")["value"], from("planner.depth")), (&7.into(), ["set", "--set planner.depth=7"]));
    assert_eq!(from("belief.filter"), ["preset", "scenarios/presets/surmise.toml"]);
    assert_eq!(from("task.goal.x_m"), ["robot", "scenarios/robots/jaco.toml"]);
    assert_eq!(from("task.discount"), ["base", "scenarios/base.toml"]);
    assert_eq!((&of("task.goal.x_m")["unit"], &of("task.discount")["unit"]), (&"m".into(), &"".into()));
}

#[test]
fn the_table_is_aligned_and_can_be_cut_to_a_part() {
    let all = stdout("check D4");
    let part = stdout("check D4 --only task.reward");
    let lines: Vec<&str> = part.lines().take_while(|line| !line.is_empty()).collect();
    assert_eq!(lines.len(), 7, "{part}");
    let column = |name: &str| lines[0].find(name).unwrap();
    for line in &lines[1..] {
        assert!(line.starts_with("task.reward."), "{line}");
        for name in ["VALUE", "FROM", "MEANING"] {
            let (before, cell) = line.split_at(column(name));
            assert!(before.ends_with(' ') && !cell.starts_with(' '), "{name}: {line}");
        }
    }
    assert!(all.lines().count() > 150);
    assert!(
        all.ends_with("keys\n") && all.contains("D4 for sawyer with preset surmise is good"),
        "{}",
        stdout("check D4 --only name")
    );
}

#[test]
fn a_resolved_scenario_of_a_run_is_explained_by_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run").display().to_string();
    let played = run("eval", &format!("--domain D1 --methods heuristic --trials 1 --quick --out {out}"));
    assert!(played.status.success(), "{}", stderr(&played));
    let file = format!("{out}/scenario.toml");
    let report: Value = serde_json::from_str(&stdout(&format!("check {file} --json"))).unwrap();
    let layers = report["keys"].as_array().unwrap().iter().map(|key| key["from"]["layer"].as_str().unwrap());
    assert_eq!(layers.filter(|layer| !["domain", "format"].contains(layer)).count(), 0);
}

#[test]
fn bad_scenarios_are_answered_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    std::fs::write(&file, "name = \"mine\"\n[world]\nobstacle_mobilty = \"fixed\"\n").unwrap();
    let path = file.display();
    refused(
        "scenario",
        &format!("check {path}"),
        &["mine.toml", "`world.obstacle_mobilty`", "nearest is `obstacle_mobility`"],
    );
    refused("scenario", "check D4 --set depth=3", &["--set depth=3", "there is `planner.depth`"]);
    refused("scenario", "check D4 --set task.horizon=0", &["task.horizon", "1 to 10000"]);
    refused("scenario", "check D4 --set robot.urdf=none.urdf", &["none.urdf"]);
    refused("scenario", "check D9", &["unknown domain `D9`"]);
    refused("scenario", "check D4 --only nothing", &["--only nothing", "beginning of a key"]);
    refused("xtask", "scenario check nowhere.toml", &["nowhere.toml", "cannot be read"]);
}

#[test]
fn the_schemas_are_the_shipped_ones() {
    for (arguments, name) in [("schema", "scenario.json"), ("schema --robot", "robot.json")] {
        let shipped = std::fs::read_to_string(root().join("assets/schemas").join(name)).unwrap();
        assert!(stdout(arguments) == shipped, "{name}");
    }
}
