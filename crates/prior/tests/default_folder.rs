//! Which network a program takes where none is named.

use std::path::Path;

use prior::{checkpoint, default_folder};

/// The folder that is chosen where networks are in `present`.
fn chosen(present: &[&str], quick: bool) -> String {
    let root = tempfile::tempdir().unwrap();
    for folder in present.iter().map(|name| root.path().join(name)) {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(checkpoint::FILE), "").unwrap();
    }
    let folder = default_folder(root.path(), "arm", checkpoint::FILE, quick);
    folder.strip_prefix(root.path()).map(Path::to_path_buf).unwrap().display().to_string()
}

#[test]
fn a_network_of_ones_own_replaces_the_shipped_one_of_its_name_alone() {
    let with = |own: &str| chosen(&["assets/priors/arm", own], false);
    assert_eq!(with("runs/priors/arm-fixed"), "assets/priors/arm");
    assert_eq!(with("runs/priors/arm"), "runs/priors/arm");
    assert_eq!(with("runs/quick/priors/arm"), "assets/priors/arm");
    assert_eq!(chosen(&[], false), "assets/priors/arm", "so that a message can name it");
}

#[test]
fn a_quickly_trained_network_comes_first_in_quick_runs() {
    let present = ["runs/quick/priors/arm", "runs/priors/arm", "assets/priors/arm"];
    assert_eq!(chosen(&present, true), "runs/quick/priors/arm");
    assert_eq!(chosen(&present[1..], true), "runs/priors/arm");
}
