//! Where the answer to a log goes.

use std::path::{Path, PathBuf};

use whole_file::Owner;

/// The folder in `runs` where none is given: named after the log's; where that holds the answer to another log, or files of somebody else, with a hash of the log's path.
pub(crate) fn default(runs: &Path, measured: &Path, owner: &Owner, files: &[&str]) -> PathBuf {
    let name = measured.canonicalize().ok().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
    let name = name.unwrap_or_else(|| "log".into());
    let folder = runs.join(&name);
    let free = whole_file::check_owner(&folder, "report.json").and_then(|()| owner.check(&folder, files));
    if free.is_ok() {
        return folder;
    }
    let hash = blake3::hash(owner.subject.as_bytes()).to_hex();
    folder.with_file_name(format!("{name}-{}", &hash[..8]))
}

#[cfg(test)]
mod tests {
    use discrepancy::answer::owner;

    use super::*;

    #[test]
    fn logs_in_folders_of_one_name_get_folders_of_their_own() {
        let root = tempfile::tempdir().unwrap();
        let runs = root.path().join("runs");
        let [first, second] = ["a/log", "b/log"].map(|log| root.path().join(log));
        let files = ["report.json"];
        let answer = |log: &Path| {
            std::fs::create_dir_all(log).unwrap();
            let owner = owner(log);
            let folder = default(&runs, log, &owner, &files);
            owner.check(&folder, &files).unwrap();
            std::fs::create_dir_all(&folder).unwrap();
            drop(owner.claim(&folder).unwrap());
            std::fs::write(folder.join("report.json"), "{}").unwrap();
            folder
        };
        let (one, two) = (answer(&first), answer(&second));
        assert_eq!(one, runs.join("log"));
        let name = two.file_name().unwrap().to_string_lossy().into_owned();
        assert!(name.starts_with("log-") && name.len() == 12, "{name}");
        // Each is found again.
        assert_eq!((answer(&first), answer(&second)), (one, two));
        // Somebody else's files are no answer.
        std::fs::create_dir_all(runs.join("mine")).unwrap();
        std::fs::write(runs.join("mine/report.json"), "{}").unwrap();
        assert_ne!(answer(&root.path().join("c/mine")), runs.join("mine"));
    }
}
