//! Folders that hold results of another kind.

use std::io;
use std::path::Path;

use crate::Error;

/// What marks a folder as that of results, and of which.
const MARKS: [(&str, &str); 6] = [
    ("run.json", "an evaluation"),
    ("plan.json", "a dataset or a benchmark"),
    ("prior.json", "a prior"),
    ("log.toml", "a measured log"),
    ("trace.json", "an episode"),
    ("report.json", "a diagnosis"),
];

/// Refuses a folder that holds results of another kind than those that `own` marks: they would be mixed, and programs that read the folder mistaken.
///
/// # Errors
///
/// [`Error`] that names what is there.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// whole_file::check_owner(folder.path(), "trace.json")?;
/// std::fs::write(folder.path().join("run.json"), "{}")?;
/// assert!(whole_file::check_owner(folder.path(), "run.json").is_ok());
/// let error = whole_file::check_owner(folder.path(), "trace.json").unwrap_err();
/// assert!(error.source.to_string().contains("holds an evaluation (run.json)"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn check_owner(folder: &Path, own: &str) -> Result<(), Error> {
    match MARKS.iter().find(|(mark, _)| *mark != own && folder.join(mark).exists()) {
        Some((mark, what)) => {
            let reason = format!("it holds {what} ({mark}), choose another folder");
            Err(Error::at("use", folder)(io::Error::new(io::ErrorKind::AlreadyExists, reason)))
        }
        None => Ok(()),
    }
}
