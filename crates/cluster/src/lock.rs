//! One program at a time in a folder.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::Path;

use crate::Error;

/// Held while a program works in a folder; the operating system lets go of it when the program ends, however it ends.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock of the folder that `file` lies in. It lies on that file, one that is there as long as the folder is in use and is
    /// never replaced, such as `plan.json`: nothing is written to it.
    ///
    /// A file system without locks gives no lock. Two programs at once then do the work twice.
    ///
    /// # Errors
    ///
    /// [`Error::Busy`] where another program holds it, [`Error::File`] where the file cannot be opened.
    pub fn take(file: &Path) -> Result<Self, Error> {
        // For writing, as network file systems lock no others.
        let opened = OpenOptions::new().read(true).write(true).open(file).map_err(Error::file("open", file))?;
        match opened.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::Busy { folder: file.parent().unwrap_or(file).to_path_buf() });
            }
            Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(source)) => return Err(Error::file("lock", file)(source)),
        }
        Ok(Self { _file: opened })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_lock_is_refused_until_the_first_is_gone_and_the_file_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plan.json");
        let message = Lock::take(&file).unwrap_err().to_string();
        assert!(message.contains("plan.json"), "{message}");
        std::fs::write(&file, "{}").unwrap();
        let first = Lock::take(&file).unwrap();
        let message = Lock::take(&file).unwrap_err().to_string();
        assert!(message.contains(&folder.path().display().to_string()) && message.contains("at work"), "{message}");
        drop(first);
        Lock::take(&file).unwrap();
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "{}");
    }
}
