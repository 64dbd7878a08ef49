//! Files that appear whole or not at all, and JSON that is read version first.

use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;
pub(crate) use whole_file::{Existing, one_line};

use crate::{Error, VERSION};

/// Writes a file whole or not at all, with the folders above it. Returns whether it did: see [`whole_file::write`].
pub(crate) fn publish(path: &Path, bytes: &[u8], existing: Existing) -> Result<bool, Error> {
    let Some(folder) = path.parent() else { unreachable!("{} is a file in a folder", path.display()) };
    std::fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
    whole_file::write(path, bytes, existing).map_err(|e| Error::io(e.action, &e.path)(e.source))
}

/// Size of a file: a shard is decoded in memory.
const MOST_BYTES: u64 = 4 << 30;

/// Reads a file; `None` where there is none.
pub(crate) fn read(path: &Path) -> Result<Option<Vec<u8>>, Error> {
    match whole_file::read(path, MOST_BYTES) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(e) if e.source.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io(e.action, &e.path)(e.source)),
    }
}

/// Parses JSON that has a `version`. The version is looked at first, so that a file of another version says so instead
/// of listing keys.
pub(crate) fn parse<T: DeserializeOwned>(path: &Path, bytes: &[u8]) -> Result<T, Error> {
    #[derive(Deserialize)]
    struct Version {
        version: u32,
    }
    let invalid = |e: serde_json::Error| Error::Json {
        path: path.to_owned(),
        reason: one_line(&whole_file::plain(&e.to_string()), 400),
    };
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
