//! What the programs are built from may be passed on under our licence.

use std::process::Command;

use end_to_end::{root, stderr};
use spdx::{Expression, LicenseReq, ParseMode};

/// The licences that `deny.toml` allows.
fn allowed() -> Vec<String> {
    let text = std::fs::read_to_string(root().join("deny.toml")).unwrap();
    let file: toml::Table = text.parse().unwrap();
    file["licenses"]["allow"].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
}

#[test]
fn every_crate_that_the_programs_are_built_from_has_a_licence_that_goes_with_ours() {
    // As the programs are built: with default features, on this platform.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut tree = Command::new(cargo);
    tree.current_dir(root()).args(["tree", "--workspace", "--edges", "normal,build", "--prefix", "none"]);
    let output = tree.args(["--no-dedupe", "--format", "{p}|{l}"]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut crates: Vec<(&str, &str)> = text.lines().filter_map(|line| line.rsplit_once('|')).collect();
    crates.sort_unstable();
    crates.dedup();
    assert!(crates.len() > 150, "{} crates", crates.len());
    let allowed = allowed();
    let one = |requirement: &LicenseReq| allowed.contains(&requirement.to_string());
    let good = |licence: &str| {
        Expression::parse_mode(licence, ParseMode::LAX).is_ok_and(|expression| expression.evaluate(one))
    };
    let refused: Vec<String> = crates
        .iter()
        .filter(|(_, licence)| !good(licence))
        .map(|(name, licence)| format!("{name}: {licence}"))
        .collect();
    assert!(refused.is_empty(), "expected some of {}, found {refused:#?}", allowed.join(", "));
    assert!(!good("GPL-3.0-only") && !good("none") && good("GPL-2.0 OR MIT") && !good("GPL-2.0 AND MIT"));
}
