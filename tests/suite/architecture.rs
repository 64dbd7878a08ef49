//! The crate table of ARCHITECTURE.md against the manifests.

use std::collections::{BTreeMap, BTreeSet};

use cargo_metadata::{DependencyKind, MetadataCommand};
use end_to_end::root;

#[test]
fn crates_use_only_what_the_architecture_table_says() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let mut table: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in text.lines().filter(|l| l.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let uses = cells[2].split(',').map(str::trim).filter(|c| *c != "–").map(String::from).collect();
        table.insert(cells[1].trim_matches('`').to_string(), uses);
    }
    let metadata = MetadataCommand::new().manifest_path(root().join("Cargo.toml")).no_deps().exec().unwrap();
    let ours: BTreeSet<String> = metadata.packages.iter().map(|p| p.name.to_string()).collect();
    for package in &metadata.packages {
        let name = package.name.to_string();
        if name == "end-to-end" {
            continue;
        }
        assert!(table.contains_key(&name), "{name} is missing in ARCHITECTURE.md");
        // What the cell names, and what those cells name.
        let mut allowed = BTreeSet::new();
        let mut open = table[&name].clone();
        while let Some(next) = open.pop() {
            assert!(ours.contains(&next), "ARCHITECTURE.md: {name} uses {next}, which does not exist");
            if allowed.insert(next.clone()) {
                open.extend(table[&next].clone());
            }
        }
        for dependency in package.dependencies.iter().filter(|d| d.kind == DependencyKind::Normal) {
            let used = &dependency.name;
            assert!(!ours.contains(used) || allowed.contains(used), "{name} uses {used} against ARCHITECTURE.md");
        }
    }
    for name in table.keys() {
        assert!(ours.contains(name), "ARCHITECTURE.md lists {name}, which does not exist");
    }
}

#[test]
fn only_the_prior_and_what_needs_it_link_burn() {
    let metadata = MetadataCommand::new().manifest_path(root().join("Cargo.toml")).no_deps().exec().unwrap();
    for package in &metadata.packages {
        let links = package.dependencies.iter().any(|d| d.name == "burn");
        assert_eq!(links, *package.name == "prior", "{}", package.name);
    }
}
