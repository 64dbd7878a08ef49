//! Where the answer to a log goes.

use std::path::{Path, PathBuf};

use whole_file::Owner;

/// The owner of an answer: the log, wherever it is called from.
pub(crate) fn owner(measured: &Path) -> Owner {
    let log = measured.canonicalize().unwrap_or_else(|_| measured.to_path_buf());
    Owner { program: "diagnose", subject: log.display().to_string() }
}

/// The folder where none is given: named after the log's; where that holds the answer to another log, or files of somebody else, with a hash of the log's path.
pub(crate) fn default(measured: &Path, owner: &Owner, files: &[&str]) -> PathBuf {
    let name = measured.canonicalize().ok().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
    let name = name.unwrap_or_else(|| "log".into());
    let folder = Path::new("runs/diagnose").join(&name);
    let free = whole_file::check_owner(&folder, "report.json").and_then(|()| owner.check(&folder, files));
    if free.is_ok() {
        return folder;
    }
    let hash = blake3::hash(owner.subject.as_bytes()).to_hex();
    folder.with_file_name(format!("{name}-{}", &hash[..8]))
}
