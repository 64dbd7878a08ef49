//! Files that appear whole or not at all: a program killed at any moment leaves the old file or the new one. Files of others are read in
//! bounded memory, and quoted in one line. What programs print is the business of `program`.
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

mod owner;
mod place;
mod plain;

use std::cell::Cell;
use std::io::{self, Read as _, Write as _};
use std::panic::{UnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::{Path, PathBuf};
use std::sync::Once;

pub use owner::{Claim, Owner, check_owner};
pub use place::{check_file, check_folder, check_own};
pub use plain::{key_of, plain};

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
/// [`Error`] where the operating system refuses, and where what is there is a device or a pipe, which would be replaced by a file; nothing is left behind
/// then.
pub fn write(path: &Path, bytes: &[u8], existing: Existing) -> Result<bool, Error> {
    if std::fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        return Err(Error::at("replace", path)(io::Error::other("it is not a plain file")));
    }
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
    // Less the name of the temporary file, which says nothing to anybody.
    let bare = |e: io::Error| io::Error::from(e.kind());
    let mut file = builder.tempfile_in(folder).map_err(|e| Error::at("write into the folder", folder)(bare(e)))?;
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

/// Reads a plain file of at most `most_bytes`: a pipe or a device could block or never end, and so could a file that grows.
///
/// # Errors
///
/// [`Error`] where it is not a plain file, or is larger, and where the operating system refuses.
pub fn read(path: &Path, most_bytes: u64) -> Result<Vec<u8>, Error> {
    let at = |kind, text: String| Error::at("read", path)(io::Error::new(kind, text));
    let about = std::fs::metadata(path).map_err(Error::at("read", path))?;
    if !about.is_file() {
        return Err(at(io::ErrorKind::InvalidInput, "it is not a plain file".into()));
    }
    let too_large =
        |found| at(io::ErrorKind::FileTooLarge, format!("expected at most {most_bytes} bytes, found {found}"));
    if about.len() > most_bytes {
        return Err(too_large(about.len().to_string()));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(about.len()).unwrap_or(0));
    let file = std::fs::File::open(path).map_err(Error::at("read", path))?;
    file.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes).map_err(Error::at("read", path))?;
    if bytes.len() as u64 > most_bytes { Err(too_large("more".into())) } else { Ok(bytes) }
}

/// Number, from 1, of the line of a text that holds the byte at `offset`.
#[must_use]
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
}

/// Text of a file as part of a message: on one line, without control characters, cut after `most_chars`.
///
/// ```
/// assert_eq!(whole_file::one_line("unknown key `a\nb\u{7}`", 14), "unknown key `a…");
/// assert_eq!(whole_file::one_line(" two\n  lines ", 14), "two lines");
/// ```
#[must_use]
pub fn one_line(text: &str, most_chars: usize) -> String {
    // Words of a text that is far too long are not all looked at.
    let text = text.char_indices().nth(most_chars.saturating_mul(8)).map_or(text, |(end, _)| &text[..end]);
    let spaced = |c: char| c.is_control() || c.is_whitespace();
    let words: Vec<&str> = text.split(spaced).filter(|word| !word.is_empty()).collect();
    let line = words.join(" ");
    match line.char_indices().nth(most_chars) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

/// Runs a decoder of others that panics where it should return an error; `None` where it did. The panic says nothing on standard error, where
/// an error of one sentence follows; all others say what they always do.
pub fn caught<T>(decode: impl FnOnce() -> T + UnwindSafe) -> Option<T> {
    thread_local! {
        static QUIET: Cell<bool> = const { Cell::new(false) };
    }
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let loud = take_hook();
        set_hook(Box::new(move |panic| {
            if !QUIET.get() {
                loud(panic);
            }
        }));
    });
    let before = QUIET.replace(true);
    let result = catch_unwind(decode);
    QUIET.set(before);
    result.ok()
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
    fn a_decoder_that_panics_is_caught_and_others_go_on() {
        assert_eq!(caught(|| 7), Some(7));
        assert_eq!(caught(|| Vec::<u8>::new()[0]), None);
        // Also within another one.
        assert_eq!(caught(|| caught(|| Vec::<u8>::new()[0])), Some(None));
        assert_eq!(caught(|| 8), Some(8));
    }

    #[test]
    fn what_is_no_plain_file_or_too_large_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        let error = read(&path, 4).unwrap_err();
        assert_eq!(error.source.to_string(), "expected at most 4 bytes, found 5");
        assert_eq!(read(folder.path(), 4).unwrap_err().source.to_string(), "it is not a plain file");
        assert_eq!(read(&folder.path().join("b"), 4).unwrap_err().source.kind(), io::ErrorKind::NotFound);
        #[cfg(unix)]
        assert_eq!(read(Path::new("/dev/zero"), 4).unwrap_err().source.to_string(), "it is not a plain file");
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
        assert!(message.starts_with("cannot write into the folder ") && message.ends_with("none"), "{message}");
        // A folder stands where the file should be.
        let taken = folder.path().join("taken");
        std::fs::create_dir(&taken).unwrap();
        let error = write(&taken, b"1", Existing::Replace).unwrap_err();
        assert_eq!((error.action, error.path.as_path()), ("publish", taken.as_path()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
