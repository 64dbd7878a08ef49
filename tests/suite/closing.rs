//! From a hidden effect to a planner that knows of it: recorded, diagnosed, planned with.

use end_to_end::{run, stderr};

fn succeed(binary: &str, arguments: &str) {
    let output = run(binary, arguments);
    assert!(output.status.success(), "{binary} {arguments}: {}", stderr(&output));
}

fn table(path: &std::path::Path) -> toml::Table {
    std::fs::read_to_string(path).unwrap().parse().unwrap()
}

fn report(folder: &std::path::Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap()
}

#[test]
fn what_diagnose_finds_in_a_recorded_log_the_planner_reckons_with() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (log, found, again, played) = (at("log"), at("found"), at("again"), at("played"));
    succeed("record-log", &format!("--domain tilted --actions passive --out {}", log.display()));
    let diagnose = |model: &std::path::Path, out: &std::path::Path| {
        let (log, model, out) = (log.display(), model.display(), out.display());
        succeed("diagnose", &format!("--measured {log} --model {model} --out {out}"));
    };
    diagnose(&log.join("model.toml"), &found);
    let first = report(&found);
    assert_eq!(first["verdict"], "effect", "{first}");
    assert_eq!(first["effects"][0]["name"], "table_tilt");
    for (parameter, truth) in first["effects"][0]["parameters"].as_array().unwrap().iter().zip([0.0, 0.05]) {
        let value = parameter["value"].as_f64().unwrap();
        assert!((value - truth).abs() < 0.002, "{parameter}");
    }
    diagnose(&found.join("model.toml"), &again);
    assert_eq!(report(&again)["verdict"], "none");

    let model = found.join("model.toml");
    let plan = "--domain tilted --preset surmise --quick --methods no-rnn --trials 1";
    succeed("eval", &format!("{plan} --model {} --out {}", model.display(), played.display()));
    let scenario = table(&played.join("scenario.toml"));
    let known = |side: &str| -> Vec<String> {
        let effects = scenario["effects"][side].as_array().unwrap();
        effects.iter().flat_map(|effect| effect.as_table().unwrap().keys().cloned()).collect()
    };
    assert_eq!(known("truth"), ["rolling_resistance", "table_tilt"]);
    assert_eq!(known("model"), ["rolling_resistance", "table_tilt"]);
    assert_eq!(scenario["effects"]["model"], table(&model)["effects"]["model"]);
}
