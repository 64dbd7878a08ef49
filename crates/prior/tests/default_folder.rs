//! Which network a program takes where none is named.

use std::path::Path;

use prior::{checkpoint, default_folder};

/// The folder that is chosen where networks are in `present`.
fn chosen(present: &[&str], names: &[&str], quick: bool) -> String {
    let root = tempfile::tempdir().unwrap();
    for folder in present.iter().map(|name| root.path().join(name)) {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(checkpoint::FILE), "").unwrap();
    }
    let folder = default_folder(root.path(), names, quick);
    folder.strip_prefix(root.path()).map(Path::to_path_buf).unwrap().display().to_string()
}

#[test]
fn a_network_of_ones_own_replaces_the_shipped_one_of_its_name_alone() {
    let names = ["arm-fixed", "arm"];
    let shipped = ["assets/priors/arm-fixed", "assets/priors/arm"];
    let with = |own: &str| chosen(&[shipped.as_slice(), &[own]].concat(), &names, false);
    assert_eq!(with("runs/priors/arm"), "assets/priors/arm-fixed");
    assert_eq!(with("runs/priors/arm-fixed"), "runs/priors/arm-fixed");
    assert_eq!(with("runs/quick/priors/arm"), "assets/priors/arm-fixed");
    assert_eq!(chosen(&["runs/priors/arm", "assets/priors/arm"], &names, false), "runs/priors/arm");
    assert_eq!(chosen(&[], &names, false), "assets/priors/arm", "so that a message can name it");
}

#[test]
fn a_quickly_trained_network_comes_first_in_quick_runs() {
    let present = ["runs/quick/priors/arm", "runs/priors/arm-fixed", "assets/priors/arm-fixed"];
    assert_eq!(chosen(&present, &["arm-fixed", "arm"], true), "runs/quick/priors/arm");
    assert_eq!(chosen(&present[1..], &["arm-fixed", "arm"], true), "runs/priors/arm-fixed");
}
