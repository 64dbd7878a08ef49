//! What a reader said, and what a refusal has to look like.

use std::error::Error;
use std::path::{Path, PathBuf};

/// What a reader said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is valid, as the body has checked.
    Accepted,
    /// It is not, and the error is as it should be.
    Refused,
}

/// Longest sentence, bytes: what an error quotes of a file is cut.
const LONGEST: usize = 4000;

/// Checks the sentence of a program, which is the error with its causes, and that it names one of `names`.
pub(crate) fn refused(error: &dyn Error, names: &[&str]) -> Verdict {
    let mut sentence = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        sentence = format!("{sentence}: {error}");
        cause = error.source();
    }
    assert!(!sentence.trim().is_empty(), "an error without a word");
    assert!(sentence.len() <= LONGEST, "{} bytes of error: {}…", sentence.len(), sentence.split_at(200).0);
    assert!(!sentence.contains(char::is_control), "an error is one line without control characters: {sentence:?}");
    assert!(names.iter().any(|name| sentence.contains(name)), "an error names one of {names:?}: {sentence}");
    Verdict::Refused
}

/// The checkout.
pub(crate) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.ancestors().nth(2).unwrap_or(package).to_path_buf()
}

/// A file of the checkout.
pub(crate) fn asset(path: &str) -> Vec<u8> {
    std::fs::read(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// A folder for one case; what the body writes there is gone when it ends.
pub(crate) fn folder() -> tempfile::TempDir {
    // In memory, where there is such a place: what is published is synced, which a disk takes its time for.
    let memory = Path::new("/dev/shm");
    let made = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    made.unwrap_or_else(|error| panic!("no temporary folder: {error}"))
}

/// Writes a file of a case, with the folders above it.
pub(crate) fn put(path: &Path, bytes: &[u8]) {
    let written = path.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(path, bytes));
    written.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}
