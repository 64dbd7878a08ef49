//! The shipped priors: whole, and as they were committed.

use std::path::Path;

use serde_json::Value;

use super::probe::ask;
use super::{Check, State};

/// Folders below `assets/priors` with the file that names the weights: of the rejection filter, and of the bridge filter.
const SHIPPED: [(&str, &str); 6] = [
    ("sawyer", "prior.json"),
    ("jaco", "prior.json"),
    ("sawyer-fixed", "posterior.json"),
    ("sawyer-movable", "posterior.json"),
    ("jaco-fixed", "posterior.json"),
    ("jaco-movable", "posterior.json"),
];

pub(crate) fn checks(root: &Path) -> Vec<Check> {
    let of = |(name, file): (&str, &str)| {
        let remedy = format!("git checkout -- assets/priors/{name}; git lfs pull where it is a pointer");
        let found = prior(root, &format!("assets/priors/{name}"), file);
        Check::new(&format!("prior of {name}"), found, "eval with the network's suggestions", remedy).required()
    };
    SHIPPED.map(of).into()
}

fn prior(root: &Path, folder: &str, file: &str) -> Result<String, (State, String)> {
    let broken = |problem: String| (State::Broken, problem);
    let head = root.join(folder).join(file);
    let text = std::fs::read_to_string(&head).map_err(|_| (State::Missing, format!("no {folder}/{file}")))?;
    let head: Value = serde_json::from_str(&text)
        .map_err(|error| broken(format!("{file}: {}", whole_file::plain(&error.to_string()))))?;
    let (Some(name), Some(bytes)) = (head["weights"]["name"].as_str(), head["weights"]["bytes"].as_u64()) else {
        return Err(broken(format!("{file} names no weights")));
    };
    let found =
        std::fs::metadata(root.join(folder).join(name)).map_err(|_| (State::Missing, format!("no {name}")))?.len();
    if found != bytes {
        return Err(broken(format!("{name} has {found} bytes, expected {bytes}")));
    }
    as_committed(root, &format!("{folder}/{name}"))
}

/// Git hashes the content: the hash in the JSON file would need a library that a menu has no other use for. `eval` checks that one.
fn as_committed(root: &Path, path: &str) -> Result<String, (State, String)> {
    let folder = root.display().to_string();
    let git = |arguments: &[&str]| ask("git", &[&["-C", &folder], arguments].concat()).ok();
    let committed = git(&["rev-parse", &format!("HEAD:{path}")]);
    match (committed, git(&["hash-object", path])) {
        (Some(committed), Some(found)) if committed == found => Ok("as committed".into()),
        (Some(_), Some(_)) => Err((State::Broken, format!("{path} differs from the commit"))),
        // Another prior than the shipped one, or no checkout: length and name have to do.
        _ => Ok("whole, but in no commit to compare with".into()),
    }
}
