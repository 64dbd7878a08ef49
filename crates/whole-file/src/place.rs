//! Places where results cannot go, told before any work is done for them.

use std::io::{self, ErrorKind};
use std::path::Path;

use crate::Error;

/// Refuses a folder for results that is none and cannot become one: a file is there, or in its way.
///
/// # Errors
///
/// [`Error`] with what was expected and what was found.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// whole_file::check_folder(&folder.path().join("new/folder"))?;
/// let file = folder.path().join("notes");
/// std::fs::write(&file, "")?;
/// let error = whole_file::check_folder(&file.join("below")).unwrap_err();
/// assert!(error.source.to_string().starts_with("expected a folder above it, found the file "), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn check_folder(folder: &Path) -> Result<(), Error> {
    let refuse = |reason: String| Err(Error::at("use", folder)(io::Error::new(ErrorKind::NotADirectory, reason)));
    for place in folder.ancestors().filter(|place| !place.as_os_str().is_empty()) {
        let found = match std::fs::metadata(place) {
            Ok(there) if there.is_dir() => return Ok(()),
            Ok(there) if there.is_file() => "file",
            Ok(_) => "device",
            // A link to nothing is in the way as well.
            Err(_) if place.is_symlink() => "link to nothing",
            Err(_) => continue,
        };
        return if place == folder {
            refuse(format!("expected a folder or nothing there, found a {found}"))
        } else {
            refuse(format!("expected a folder above it, found the {found} {}", place.display()))
        };
    }
    Ok(())
}

/// Refuses a file for a result where none can be: a folder or a device is there, or there is no folder for it.
///
/// # Errors
///
/// [`Error`] with what was expected and what was found.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// whole_file::check_file(&folder.path().join("page.html"))?;
/// let error = whole_file::check_file(&folder.path().join("none/page.html")).unwrap_err();
/// assert!(error.source.to_string().starts_with("expected a folder that is there, found no "), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn check_file(file: &Path) -> Result<(), Error> {
    let refuse = |reason: String| Err(Error::at("write", file)(io::Error::new(ErrorKind::InvalidInput, reason)));
    match std::fs::metadata(file) {
        Ok(there) if there.is_file() => return Ok(()),
        Ok(there) => {
            let found = if there.is_dir() { "folder" } else { "device" };
            return refuse(format!("expected a file or nothing there, found a {found}"));
        }
        Err(_) => {}
    }
    let above = file.parent().filter(|above| !above.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match std::fs::metadata(above) {
        Ok(there) if there.is_dir() => Ok(()),
        Ok(_) => refuse(format!("expected a folder above it, found the file {}", above.display())),
        Err(_) => refuse(format!("expected a folder that is there, found no {}", above.display())),
    }
}

/// Refuses a file for a result where another program's is: what is there has to be such a result, as `is_own` says of its text.
///
/// # Errors
///
/// [`Error`] that names `what` is written there, and as [`check_file`].
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let file = folder.path().join("table.md");
/// let check = || whole_file::check_own(&file, "a table", |text| text.starts_with("| engine"));
/// check()?;
/// std::fs::write(&file, "my notes")?;
/// assert_eq!(check().unwrap_err().source.to_string(), "it is there, and is not a table of this program: choose another file");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn check_own(file: &Path, what: &str, is_own: impl FnOnce(&str) -> bool) -> Result<(), Error> {
    check_file(file)?;
    if !file.exists() || std::fs::read_to_string(file).is_ok_and(|text| is_own(&text)) {
        return Ok(());
    }
    let reason = format!("it is there, and is not {what} of this program: choose another file");
    Err(Error::at("replace", file)(io::Error::new(ErrorKind::AlreadyExists, reason)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_can_be_made_unless_something_else_is_there_or_in_its_way() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        std::fs::write(&file, "").unwrap();
        let reason = |path: &Path| check_folder(path).unwrap_err().source.to_string();
        for good in [root.path().to_path_buf(), root.path().join("a"), root.path().join("a/b/c"), "new".into()] {
            check_folder(&good).unwrap();
        }
        assert_eq!(reason(&file), "expected a folder or nothing there, found a file");
        let below = format!("expected a folder above it, found the file {}", file.display());
        assert_eq!((reason(&file.join("a")), reason(&file.join("a/b"))), (below.clone(), below));
        #[cfg(unix)]
        {
            assert_eq!(reason(Path::new("/dev/null")), "expected a folder or nothing there, found a device");
            let link = root.path().join("link");
            std::os::unix::fs::symlink(root.path().join("gone"), &link).unwrap();
            assert_eq!(reason(&link), "expected a folder or nothing there, found a link to nothing");
        }
    }

    #[test]
    fn a_file_needs_a_folder_and_a_free_name() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        check_file(&file).unwrap();
        check_file(Path::new("new")).unwrap();
        std::fs::write(&file, "").unwrap();
        check_file(&file).unwrap();
        let reason = |path: &Path| check_file(path).unwrap_err().source.to_string();
        assert_eq!(reason(root.path()), "expected a file or nothing there, found a folder");
        let none = root.path().join("none");
        assert_eq!(reason(&none.join("a")), format!("expected a folder that is there, found no {}", none.display()));
        assert_eq!(reason(&file.join("a")), format!("expected a folder above it, found the file {}", file.display()));
    }
}
