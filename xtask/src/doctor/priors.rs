//! The shipped priors: whole, and as they were committed.

use std::path::Path;

use serde_json::Value;

use super::probe::ask;
use super::{Check, State};

/// Folders below `assets/priors`: of the rejection filter, and of the bridge filter.
const SHIPPED: [&str; 4] = ["sawyer", "jaco", "sawyer-fixed", "sawyer-movable"];

pub(crate) fn checks(root: &Path) -> Vec<Check> {
    let of = |name: &str| {
        let remedy = format!("git checkout -- assets/priors/{name}; git lfs pull where it is a pointer");
        let found = prior(root, &format!("assets/priors/{name}"));
        Check::new(&format!("prior of {name}"), found, "eval with the network's suggestions", remedy).required()
    };
    SHIPPED.map(of).into()
}

fn prior(root: &Path, folder: &str) -> Result<String, (State, String)> {
    let broken = |problem: String| (State::Broken, problem);
    let head = root.join(folder).join("prior.json");
    let text = std::fs::read_to_string(&head).map_err(|_| (State::Missing, format!("no {folder}/prior.json")))?;
    let head: Value = serde_json::from_str(&text)
        .map_err(|error| broken(format!("prior.json: {}", whole_file::plain(&error.to_string()))))?;
    let (Some(name), Some(bytes)) = (head["weights"]["name"].as_str(), head["weights"]["bytes"].as_u64()) else {
        return Err(broken("prior.json names no weights".into()));
    };
    let file = root.join(folder).join(name);
    let found = std::fs::metadata(&file).map_err(|_| (State::Missing, format!("no {name}")))?.len();
    if found != bytes {
        return Err(broken(format!("{name} has {found} bytes, expected {bytes}")));
    }
    as_committed(root, &format!("{folder}/{name}"))
}

/// Git hashes the content: the hash in `prior.json` would need a library that a menu has no other use for. `eval` checks that one.
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
