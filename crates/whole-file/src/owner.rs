//! Folders that hold results of another kind.

use std::fs::{File, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use crate::Error;

/// What marks a folder as that of results, and of which. Each is the file without which a program of the project reads no such folder. [`Owner`] cannot take the place of
/// this list: what older versions made, and all published results, have these files and no `.owner`.
const MARKS: [(&str, &str); 6] = [
    ("run.json", "an evaluation"),
    ("plan.json", "a dataset or a benchmark"),
    ("prior.json", "a prior"),
    ("log.toml", "a measured log"),
    ("trace.json", "an episode"),
    ("report.json", "a diagnosis"),
];

/// Refuses a folder that holds results of another kind than those that `own` marks: they would be mixed, and programs that read the folder mistaken. Refuses as well what
/// is no folder and cannot become one.
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
    crate::check_folder(folder)?;
    match MARKS.iter().find(|(mark, _)| *mark != own && folder.join(mark).exists()) {
        Some((mark, what)) => {
            let reason = format!("it holds {what} ({mark}), choose another folder");
            Err(Error::at("use", folder)(io::Error::new(io::ErrorKind::AlreadyExists, reason)))
        }
        None => Ok(()),
    }
}

/// Whose results a folder holds, for programs whose results do not say so themselves: a hidden file in it. A folder that holds files of the same names and does not say
/// whose they are is somebody else's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner {
    /// The program, such as "diagnose".
    pub program: &'static str,
    /// What the results are of, in one line: two runs of the same thing may replace each other's results. Empty where the program alone says enough.
    pub subject: String,
}

impl Owner {
    /// The file that says it.
    pub const FILE: &str = ".owner";

    /// Refuses a folder with results of another owner, one that holds any of `files` without saying whose they are, and what cannot become a folder.
    ///
    /// # Errors
    ///
    /// [`Error`] that names what is there.
    ///
    /// ```
    /// # use whole_file::Owner;
    /// let folder = tempfile::tempdir()?;
    /// let [first, second] = ["a", "b"].map(|log| Owner { program: "diagnose", subject: format!("logs/{log}") });
    /// assert!(first.check(folder.path(), &["model.toml"]).is_ok());
    /// let claim = first.claim(folder.path())?;
    /// std::fs::write(folder.path().join("model.toml"), "")?;
    /// assert!(first.check(folder.path(), &["model.toml"]).is_ok());
    /// let error = second.check(folder.path(), &["model.toml"]).unwrap_err();
    /// assert!(error.source.to_string().contains("results of diagnose for logs/a"), "{error}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check(&self, folder: &Path, files: &[&str]) -> Result<(), Error> {
        crate::check_folder(folder)?;
        let refuse = |reason: String| {
            let reason = format!("{reason}: choose another folder");
            Err(Error::at("use", folder)(io::Error::new(io::ErrorKind::AlreadyExists, reason)))
        };
        if let Some(file) = files.iter().find(|file| folder.join(file).is_dir()) {
            return refuse(format!("expected a file {file} or none, found a folder"));
        }
        let mark = folder.join(Self::FILE);
        match std::fs::read_to_string(&mark) {
            Ok(text) if text == self.text() => Ok(()),
            Ok(text) if !text.is_empty() && !is_mark(&text) => refuse(foreign(self.program)),
            Err(_) if mark.symlink_metadata().is_ok() => refuse(foreign(self.program)),
            // What was killed, or given up, before it wrote anything owns nothing; an empty mark is one that is being written.
            Ok(text) if !text.is_empty() && !holds_no_more(folder) => {
                let mut lines = text.lines();
                let (program, subject) = (lines.next().unwrap_or_default(), lines.next().unwrap_or_default());
                let of = if subject.is_empty() { String::new() } else { format!(" for {subject}") };
                refuse(crate::one_line(&format!("it holds results of {program}{of}"), 400))
            }
            _ => match files.iter().find(|file| is_there(&folder.join(file))) {
                Some(file) => refuse(format!("it holds {file}, which {} did not write", self.program)),
                None => Ok(()),
            },
        }
    }

    /// Takes a folder, which must exist, before the first result is written. It is marked, so a killed run leaves one that says whose it is, and another program that
    /// would write there is refused until the claim is dropped. A file system without locks refuses none.
    ///
    /// # Errors
    ///
    /// [`Error`] where it cannot be written, and where another program holds it or was faster.
    pub fn claim(&self, folder: &Path) -> Result<Claim, Error> {
        let mark = folder.join(Self::FILE);
        // Whoever gave the folder up has removed the mark, and a lock on that holds nothing.
        for _ in 0..TRIES {
            // For writing, as network file systems lock no others.
            let opened = File::options().read(true).write(true).create(true).truncate(false).open(&mark);
            let mut file = opened.map_err(Error::at("open", &mark))?;
            if let Err(TryLockError::WouldBlock) = file.try_lock() {
                let reason = "another program is writing into it: choose another folder, or wait";
                return Err(Error::at("use", folder)(io::Error::new(io::ErrorKind::AlreadyExists, reason)));
            }
            if !is_at(&file, &mark) {
                continue;
            }
            // Whoever was faster may have taken it for something else.
            self.check(folder, &[])?;
            let mut found = String::new();
            let own = file.read_to_string(&mut found).is_ok_and(|_| found == self.text());
            if !own {
                let written =
                    file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(self.text().as_bytes()));
                written.map_err(Error::at("write", &mark))?;
            }
            return Ok(Claim { folder: folder.to_path_buf(), made: !own, _file: file });
        }
        Err(Error::at("use", folder)(io::Error::new(io::ErrorKind::AlreadyExists, "other programs come and go in it")))
    }

    fn text(&self) -> String {
        format!("{}\n{}\n", self.program, crate::one_line(&self.subject, 4000))
    }
}

/// A folder that nobody else writes results into; the operating system lets go of it when the program ends, however it ends.
#[derive(Debug)]
pub struct Claim {
    folder: PathBuf,
    /// Whether the folder was nobody's before.
    made: bool,
    _file: File,
}

impl Claim {
    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Gives it back without results.
    pub fn give_up(self) {
        if self.made {
            drop(std::fs::remove_file(self.folder.join(Owner::FILE)));
        }
    }
}

/// Programs whose results are marked so.
const PROGRAMS: [&str; 2] = ["demo", "diagnose"];

/// Whether a file's text is a mark: a program and a subject, in a line each.
fn is_mark(text: &str) -> bool {
    let lines: Vec<&str> = text.lines().collect();
    lines.len() == 2 && PROGRAMS.contains(&lines[0]) && text.ends_with('\n')
}

fn foreign(program: &str) -> String {
    format!("it holds {}, which {program} did not write", Owner::FILE)
}

/// Whether a folder holds the mark alone.
fn holds_no_more(folder: &Path) -> bool {
    let inside = std::fs::read_dir(folder).map(|inside| inside.flatten().map(|entry| entry.file_name()).collect());
    inside.is_ok_and(|names: Vec<_>| names.iter().all(|name| name == Owner::FILE))
}

/// Whether an open file is still the one at a path.
fn is_at(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let id = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
        matches!((file.metadata().map(id), std::fs::metadata(path).map(id)), (Ok(open), Ok(there)) if open == there)
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        path.exists()
    }
}

/// How often a folder is tried to be claimed that others give up meanwhile.
const TRIES: usize = 20;

/// Whether something that is no folder is there, a link to nothing among it.
fn is_there(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|there| !there.is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_the_marks_name_that_is_none_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let demo = Owner { program: "demo", subject: String::new() };
        let mark = folder.path().join(Owner::FILE);
        for text in [&b"alice\n"[..], b"demo", b"\xff\xfe", b"demo\n\nmore\n", b"rsync\nlogs\n"] {
            std::fs::write(&mark, text).unwrap();
            let checked = demo.check(folder.path(), &[]).unwrap_err().source.to_string();
            assert_eq!(checked, "it holds .owner, which demo did not write: choose another folder");
            assert_eq!(demo.claim(folder.path()).unwrap_err().source.to_string(), checked);
            assert_eq!(std::fs::read(&mark).unwrap(), text);
        }
        std::fs::remove_file(&mark).unwrap();
        std::fs::create_dir(&mark).unwrap();
        assert!(demo.check(folder.path(), &[]).is_err());
    }

    #[test]
    fn a_folder_is_one_programs_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let [demo, diagnose] = ["demo", "diagnose"].map(|program| Owner { program, subject: String::new() });
        let first = demo.claim(folder.path()).unwrap();
        for second in [&demo, &diagnose] {
            let message = second.claim(folder.path()).unwrap_err().source.to_string();
            assert_eq!(message, "another program is writing into it: choose another folder, or wait");
        }
        drop(first);
        drop(demo.claim(folder.path()).unwrap());
        // What left nothing but its mark owns nothing; results keep their owner, also when they are made anew in vain.
        drop(diagnose.claim(folder.path()).unwrap());
        std::fs::write(folder.path().join("report.json"), "{}").unwrap();
        let message = demo.claim(folder.path()).unwrap_err().source.to_string();
        assert_eq!(message, "it holds results of diagnose: choose another folder");
        diagnose.claim(folder.path()).unwrap().give_up();
        diagnose.check(folder.path(), &["report.json"]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        demo.claim(folder.path()).unwrap().give_up();
        assert!(!folder.path().join(Owner::FILE).exists());
    }

    #[test]
    fn files_of_others_keep_a_folder_from_being_taken() {
        let folder = tempfile::tempdir().unwrap();
        let owner = Owner { program: "demo", subject: String::new() };
        std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
        owner.check(folder.path(), &["episode.html"]).unwrap();
        std::fs::write(folder.path().join("episode.html"), "mine").unwrap();
        let message = owner.check(folder.path(), &["episode.html"]).unwrap_err().source.to_string();
        assert_eq!(message, "it holds episode.html, which demo did not write: choose another folder");
        drop(owner.claim(folder.path()).unwrap());
        owner.check(folder.path(), &["episode.html"]).unwrap();
        let other = Owner { program: "diagnose", subject: "a".into() };
        let message = other.check(folder.path(), &["model.toml"]).unwrap_err().source.to_string();
        assert_eq!(message, "it holds results of demo: choose another folder");
        // A folder by the name of a result, and a file where the folder should be.
        std::fs::create_dir(folder.path().join("model.toml")).unwrap();
        let message = other.check(folder.path(), &["model.toml"]).unwrap_err().source.to_string();
        assert_eq!(message, "expected a file model.toml or none, found a folder: choose another folder");
        for refused in [
            other.check(&folder.path().join("notes.txt"), &[]),
            check_owner(&folder.path().join("notes.txt"), "run.json"),
        ] {
            assert_eq!(refused.unwrap_err().source.to_string(), "expected a folder or nothing there, found a file");
        }
        // A folder that is not there yet is anybody's.
        other.check(&folder.path().join("none"), &["model.toml"]).unwrap();
    }
}
