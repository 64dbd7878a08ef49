//! Files that appear whole or not at all: a program killed at any moment leaves the old file or the new one.
//!
//! # Example
//!
//! ```
//! # let folder = tempfile::tempdir()?;
//! let path = folder.path().join("table.csv");
//! assert!(whole_file::write(&path, b"a,b\n", whole_file::Existing::Keep)?);
//! assert!(!whole_file::write(&path, b"c,d\n", whole_file::Existing::Keep)?, "somebody else was first");
//! assert_eq!(std::fs::read(&path)?, b"a,b\n");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// What to do with a file that is already there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Leave it.
    Keep,
    /// Replace it in one step.
    Replace,
}

/// What the operating system refused.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}", path.display())]
pub struct Error {
    /// Verb, such as "write".
    pub action: &'static str,
    /// What was touched.
    pub path: PathBuf,
    /// Cause.
    #[source]
    pub source: io::Error,
}

impl Error {
    fn at<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> Self + use<'a> {
        move |source| Self { action, path: path.to_path_buf(), source }
    }
}

/// Writes `bytes` to a hidden temporary file beside `path`, syncs it, gives it its name and syncs the folder, which must exist. Returns
/// whether it did: with [`Existing::Keep`] a file that is there, or that somebody else wrote meanwhile, stays.
///
/// # Errors
///
/// [`Error`] where the operating system refuses; nothing is left behind then.
pub fn write(path: &Path, bytes: &[u8], existing: Existing) -> Result<bool, Error> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let prefix = format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".partial");
    #[cfg(unix)]
    {
        // As any other new file, less the umask; the default lets only the owner read.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(Error::at("create a temporary file in", folder))?;
    let written = file.write_all(bytes).and_then(|()| file.as_file().sync_all());
    written.map_err(Error::at("write", path))?;
    let named = match existing {
        Existing::Keep => file.persist_noclobber(path),
        Existing::Replace => file.persist(path),
    };
    match named {
        Ok(_) => {}
        Err(e) if existing == Existing::Keep && e.error.kind() == io::ErrorKind::AlreadyExists => return Ok(false),
        Err(e) => return Err(Error::at("publish", path)(e.error)),
    }
    #[cfg(unix)]
    std::fs::File::open(folder).and_then(|folder| folder.sync_all()).map_err(Error::at("sync the folder", folder))?;
    Ok(true)
}

/// Removes the temporary files that killed writers have left in `folder`, not below it; nobody may be writing there. Returns how many.
///
/// # Errors
///
/// [`Error`] where the folder cannot be listed or a file cannot be removed. A folder that is not there holds none.
pub fn sweep(folder: &Path) -> Result<usize, Error> {
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(0),
        listed => listed.map_err(Error::at("list", folder))?,
    };
    let mut removed = 0;
    for entry in entries {
        let path = entry.map_err(Error::at("list", folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with('.') && name.ends_with(".partial") {
            std::fs::remove_file(&path).map_err(Error::at("remove", &path))?;
            removed += 1;
        }
    }
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_or_kept_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        for (bytes, existing, wrote, content) in [
            (b"1", Existing::Keep, true, b"1"),
            (b"2", Existing::Keep, false, b"1"),
            (b"3", Existing::Replace, true, b"3"),
        ] {
            assert_eq!(write(&path, bytes, existing).unwrap(), wrote);
            assert_eq!(std::fs::read(&path).unwrap(), content);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_killed_writers_left_is_swept_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        for name in [".a.json.x7Yz.partial", "a.json", ".hidden", "b.partial"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(sweep(folder.path()).unwrap(), 1);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
        assert_eq!(sweep(&folder.path().join("none")).unwrap(), 0);
    }

    #[test]
    fn a_refusal_names_the_path_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("none/a");
        let message = write(&missing, b"1", Existing::Replace).unwrap_err().to_string();
        assert!(message.starts_with("cannot create a temporary file in ") && message.ends_with("none"), "{message}");
        // A folder stands where the file should be.
        let taken = folder.path().join("taken");
        std::fs::create_dir(&taken).unwrap();
        let error = write(&taken, b"1", Existing::Replace).unwrap_err();
        assert_eq!((error.action, error.path.as_path()), ("publish", taken.as_path()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
