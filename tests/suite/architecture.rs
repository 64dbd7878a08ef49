//! The crate table of ARCHITECTURE.md against the manifests.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::{files, root, stderr};
use serde_json::Value;

/// Packages with programs, but for `book`: mdBook wants another feature of a crate that others use too.
const WITH_PROGRAMS: [&str; 10] = [
    "arm-excitation",
    "bench",
    "datagen",
    "diagnose-benchmark",
    "discrepancy",
    "experiments",
    "import-log",
    "prior-training",
    "report",
    "scenario",
];

/// What cargo prints.
fn cargo(arguments: &[&str]) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo).current_dir(root()).args(arguments).output().unwrap();
    assert!(output.status.success(), "cargo {}: {}", arguments.join(" "), stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// Members of the workspace by folder, with what they depend on, but for tests. Packages that can be published have the prefix `surmise-`,
/// which neither their folders nor those who use them know.
fn members() -> Vec<(String, Vec<String>)> {
    let metadata: Value = serde_json::from_str(&cargo(&["metadata", "--no-deps", "--format-version", "1"])).unwrap();
    let folder = |package: &Value| {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap());
        manifest.parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned()
    };
    let used = |dependency: &Value| {
        let name = dependency["rename"].as_str().or(dependency["name"].as_str());
        name.unwrap().to_owned()
    };
    let member = |package: &Value| {
        let all = package["dependencies"].as_array().unwrap();
        (folder(package), all.iter().filter(|dependency| dependency["kind"].is_null()).map(used).collect())
    };
    metadata["packages"].as_array().unwrap().iter().map(member).collect()
}

#[test]
fn crates_use_only_what_the_architecture_table_says() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let mut table: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in text.lines().filter(|l| l.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let uses = cells[2].split(',').map(str::trim).filter(|c| *c != "–").map(String::from).collect();
        table.insert(cells[1].trim_matches('`').to_string(), uses);
    }
    let members = members();
    let ours: BTreeSet<String> = members.iter().map(|(name, _)| name.clone()).collect();
    for (name, dependencies) in &members {
        if name == "tests" {
            continue;
        }
        assert!(table.contains_key(name), "{name} is missing in ARCHITECTURE.md");
        // What the cell names, and what those cells name.
        let mut allowed = BTreeSet::new();
        let mut open = table[name].clone();
        while let Some(next) = open.pop() {
            assert!(ours.contains(&next), "ARCHITECTURE.md: {name} uses {next}, which does not exist");
            if allowed.insert(next.clone()) {
                open.extend(table[&next].clone());
            }
        }
        for used in dependencies {
            assert!(!ours.contains(used) || allowed.contains(used), "{name} uses {used} against ARCHITECTURE.md");
        }
    }
    for name in table.keys() {
        assert!(ours.contains(name), "ARCHITECTURE.md lists {name}, which does not exist");
    }
}

/// `cargo xtask` builds a program with `report` and `measured-log` beside it: what such programs share must be compiled once.
#[test]
fn programs_that_are_built_one_by_one_share_their_dependencies() {
    /// Crates with the choices of features that they are compiled with.
    type Tree = BTreeMap<String, BTreeSet<String>>;
    let tree = |program: &str| -> Tree {
        let options = ["--edges", "normal,build", "--prefix", "none", "--no-dedupe", "--format", "{p}|{f}"];
        let selection = ["--package", "report", "--package", "import-log", "--package", program];
        let mut tree = Tree::new();
        for line in cargo(&[&["tree"][..], &selection, &options].concat()).lines() {
            // An empty line between the packages that were selected.
            let Some((name, features)) = line.split_once('|') else { continue };
            tree.entry(name.into()).or_default().insert(features.into());
        }
        tree
    };
    let base = tree("report");
    for program in WITH_PROGRAMS {
        let some = tree(program);
        for (name, features) in &base {
            assert_eq!(some.get(name), Some(features), "{name}, with {program}");
        }
    }
}

/// CI compiles the tests, and the programs that they run. A crate that tests want with another feature would be compiled twice, and with it all of ours
/// that depend on it: that took minutes, when the library of benchmarks wanted two more of clap's.
#[test]
fn tests_and_programs_share_their_dependencies() {
    let tree = |edges: &str| -> BTreeMap<String, BTreeSet<String>> {
        let options = ["--prefix", "none", "--no-dedupe", "--format", "{p}|{f}"];
        let mut tree = BTreeMap::<String, BTreeSet<String>>::new();
        for line in cargo(&[&["tree", "--workspace", "--edges", edges][..], &options].concat()).lines() {
            let Some((name, features)) = line.split_once('|') else { continue };
            // A crate that its own tests depend on is marked as seen before.
            tree.entry(name.into()).or_default().insert(features.trim_end_matches(" (*)").into());
        }
        tree
    };
    let (programs, tests) = (tree("normal,build"), tree("normal,build,dev"));
    assert!(programs.len() > 150, "{} crates", programs.len());
    for (name, features) in &programs {
        assert_eq!(tests.get(name), Some(features), "{name}");
    }
}

/// All source files below a folder, with their text.
fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let rust = |path: &PathBuf| path.extension().is_some_and(|end| end == "rs");
    let paths = files(folder).into_iter().filter(|(path, _)| rust(path));
    paths.map(|(path, bytes)| (path, String::from_utf8(bytes).unwrap())).collect()
}

#[test]
fn programs_print_where_a_closed_pipe_is_no_panic() {
    let mut read = 0;
    for (path, text) in [root().join("crates"), root().join("xtask")].iter().flat_map(|folder| sources(folder)) {
        let program = path.iter().any(|folder| folder == "src");
        if program {
            let found = ["println!(", "print!("].iter().find(|name| text.contains(*name));
            assert!(found.is_none(), "{}: {found:?} instead of program::out! or say!", path.display());
            read += 1;
        }
    }
    assert!(read > 200, "{read} files");
}

#[test]
fn files_and_functions_stay_small() {
    for folder in ["crates", "tests", "xtask"] {
        for (path, text) in sources(&root().join(folder)) {
            let lines: Vec<&str> = text.lines().collect();
            assert!(lines.len() <= 500, "{}: {} lines", path.display(), lines.len());
            for (first, line) in lines.iter().enumerate() {
                let code = line.trim_start();
                let begins =
                    ["fn ", "pub fn ", "pub(crate) fn ", "pub(super) fn "].iter().any(|word| code.starts_with(word));
                let end = format!("{}}}", &line[..line.len() - code.len()]);
                let length = lines[first..].iter().position(|line| *line == end).map_or(0, |last| last + 1);
                // A declaration without a body ends elsewhere.
                let declared = lines[first..].iter().take(12).position(|line| line.ends_with(';'));
                let body = lines[first..].iter().take(12).position(|line| line.ends_with('{') || line.ends_with('}'));
                let has_body = body.is_some_and(|body| declared.is_none_or(|declared| body <= declared));
                assert!(!begins || !has_body || length <= 80, "{}: {code} has {length} lines", path.display());
            }
        }
    }
}

/// Algorithm 1 fits on a screen, and says which of the paper's lines each of its steps is.
#[test]
fn algorithm_1_is_one_function_with_the_lines_of_the_paper_in_order() {
    let path = root().join("crates/agent/src/agent.rs");
    let text = std::fs::read_to_string(&path).unwrap();
    let body = text.lines().skip_while(|line| !line.trim_start().starts_with("fn play("));
    let lines: Vec<&str> = body.take_while(|line| *line != "    }").collect();
    assert!((10..60).contains(&lines.len()), "{}: `play` has {} lines", path.display(), lines.len() + 1);
    let numbers: Vec<u32> = lines
        .iter()
        .filter_map(|line| line.trim_start().strip_prefix("// ")?.split_once(": ")?.0.parse().ok())
        .collect();
    assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7, 8], "{}: the numbered steps of `play`", path.display());
}
