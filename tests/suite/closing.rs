//! From a hidden effect to a planner that knows of it: recorded, diagnosed, planned with, as `docs/src/guides/diagnose.md` says it.

use crate::docs::play_with;
use crate::pages::check_diagnosis;

fn table(path: &std::path::Path) -> toml::Table {
    std::fs::read_to_string(path).unwrap().parse().unwrap()
}

fn report(folder: &std::path::Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap()
}

#[test]
fn what_diagnose_finds_in_a_recorded_log_the_planner_reckons_with() {
    let project = play_with("docs/src/guides/diagnose.md", &[], &[]);
    let runs = project.path().join("runs");
    let first = report(&runs.join("tilted/found"));
    assert_eq!(first["verdict"], "effect", "{first}");
    assert_eq!(first["effects"][0]["name"], "table_tilt");
    for (parameter, truth) in first["effects"][0]["parameters"].as_array().unwrap().iter().zip([0.0, 0.05]) {
        let value = parameter["value"].as_f64().unwrap();
        assert!((value - truth).abs() < 0.002, "{parameter}");
    }
    check_diagnosis(&runs.join("tilted/found/report.html"));
    check_diagnosis(&runs.join("diagnose/tilt-again/report.html"));
    // What has been found once is in the model, and nothing is missing any more.
    assert_eq!(report(&runs.join("diagnose/tilt"))["effects"][0]["name"], "table_tilt");
    let again = report(&runs.join("diagnose/tilt-again"));
    assert_eq!(again["verdict"], "none");
    assert_eq!(again["heldout"]["before"], again["heldout"]["after"]);

    let known = |run: &str, side: &str| -> Vec<String> {
        let scenario = table(&runs.join("tilted").join(run).join("scenario.toml"));
        let effects = scenario["effects"][side].as_array().unwrap();
        effects.iter().flat_map(|effect| effect.as_table().unwrap().keys().cloned()).collect()
    };
    assert_eq!(known("before", "truth"), ["rolling_resistance", "table_tilt"]);
    assert_eq!(known("before", "model"), ["rolling_resistance"]);
    assert_eq!(known("after", "model"), ["rolling_resistance", "table_tilt"]);
    let found = table(&runs.join("tilted/found/model.toml"));
    assert_eq!(table(&runs.join("tilted/after/scenario.toml"))["effects"]["model"], found["effects"]["model"]);
}
