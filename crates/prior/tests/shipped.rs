//! The priors in `assets/` can be loaded and have a report of their own.

use std::path::Path;

use prior::{Calibration, Checkpoint};

#[test]
fn every_shipped_prior_loads_and_its_report_holds() {
    for robot in ["sawyer", "jaco"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/priors").join(robot);
        let checkpoint = Checkpoint::load(&folder, None).unwrap();
        assert_eq!(checkpoint.layout.robot, robot);
        assert!(checkpoint.network.memory);
        let text = std::fs::read_to_string(folder.join("calibration.json")).unwrap();
        let report: Calibration = serde_json::from_str(&text).unwrap();
        assert_eq!(report.parameters.len(), checkpoint.layout.continuous.len());
        assert_eq!(report.static_targets.len(), 12);
        for parameter in report.parameters.iter().filter(|p| report.static_targets.contains(&p.name)) {
            assert!((0.87..=0.93).contains(&parameter.coverage90), "{robot}: {parameter:?}");
        }
        for step in report.sharpening.iter().filter(|step| step.since_contact.count >= 100) {
            let nll = &step.since_contact.static_nll;
            let network = nll.network.unwrap();
            let worst = nll.baseline.unwrap().min(nll.memoryless.unwrap());
            assert!(network < worst, "{robot}, step {}: {nll:?}", step.step);
        }
        for picture in ["coverage", "confusion", "likelihood", "ranks", "sharpening", "curve"] {
            assert!(folder.join(picture).with_extension("png").is_file(), "{robot}: {picture}");
        }
    }
}
