//! Files that appear whole or not at all, and JSON that is read version first.

use std::io::Write;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::{Error, VERSION};

/// What to do with a file that is already there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Existing {
    /// Leave it.
    Keep,
    /// Replace it in one step.
    Replace,
}

/// Writes `bytes` to a hidden temporary file beside `path`, syncs it and gives it its name. Returns whether it did:
/// with [`Existing::Keep`] a file that somebody else published meanwhile stays.
pub(crate) fn publish(path: &Path, bytes: &[u8], existing: Existing) -> Result<bool, Error> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else {
        unreachable!("{} is a file in a folder", path.display());
    };
    std::fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
    let prefix = format!(".{}.", name.to_string_lossy());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".partial");
    #[cfg(unix)]
    {
        // As any other new file, less the umask; the default lets only the owner read.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(Error::io("create a temporary file in", folder))?;
    file.write_all(bytes).map_err(Error::io("write", file.path()))?;
    file.as_file().sync_all().map_err(Error::io("sync", file.path()))?;
    let result = match existing {
        Existing::Keep => file.persist_noclobber(path),
        Existing::Replace => file.persist(path),
    };
    match result {
        Ok(_) => {}
        Err(e) if existing == Existing::Keep && e.error.kind() == std::io::ErrorKind::AlreadyExists => {
            return Ok(false);
        }
        Err(e) => return Err(Error::io("publish", path)(e.error)),
    }
    #[cfg(unix)]
    std::fs::File::open(folder).and_then(|f| f.sync_all()).map_err(Error::io("sync the folder", folder))?;
    Ok(true)
}

/// Reads a file; `None` where there is none.
pub(crate) fn read(path: &Path) -> Result<Option<Vec<u8>>, Error> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io("read", path)(e)),
    }
}

/// Parses JSON that has a `version`. The version is looked at first, so that a file of another version says so instead
/// of listing keys.
pub(crate) fn parse<T: DeserializeOwned>(path: &Path, bytes: &[u8]) -> Result<T, Error> {
    #[derive(Deserialize)]
    struct Version {
        version: u32,
    }
    let invalid = |e: serde_json::Error| Error::Json { path: path.to_owned(), reason: e.to_string() };
    let Version { version } = serde_json::from_slice(bytes).map_err(invalid)?;
    if version != VERSION {
        return Err(Error::Version { path: path.to_owned(), found: version });
    }
    serde_json::from_slice(bytes).map_err(invalid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_existing_file_is_kept_or_replaced_as_asked_and_nothing_else_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b.json");
        assert!(publish(&path, b"1", Existing::Keep).unwrap());
        assert!(!publish(&path, b"2", Existing::Keep).unwrap());
        assert_eq!(read(&path).unwrap().unwrap(), b"1");
        assert!(publish(&path, b"3", Existing::Replace).unwrap());
        assert_eq!(read(&path).unwrap().unwrap(), b"3");
        assert_eq!(std::fs::read_dir(dir.path().join("a")).unwrap().count(), 1);
    }
}
