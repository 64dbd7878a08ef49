//! The published reports of calibration.

use std::path::Path;

use bench::calibration::table;

#[test]
fn the_published_tables_are_those_of_the_published_figures_and_no_zero_has_a_sign() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/results/calibration");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let read = |name: &str| std::fs::read_to_string(entry.path().join(name)).unwrap();
        let summary = serde_json::from_str(&read("calibration.json")).unwrap();
        let text = read("calibration.md");
        assert_eq!(table(&summary), text, "{:?}", entry.file_name());
        assert!(!text.contains("-0.00 ") && !text.contains("-0.000 "), "{:?}", entry.file_name());
        count += 1;
    }
    assert!(count >= 3, "{count} tables");
}
