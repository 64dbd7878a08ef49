//! Folders that hold results of another kind.

use std::io;
use std::path::Path;

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
    /// first.claim(folder.path())?;
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
        match std::fs::read_to_string(folder.join(Self::FILE)) {
            Ok(text) if text == self.text() => Ok(()),
            Ok(text) => {
                let mut lines = text.lines();
                let (program, subject) = (lines.next().unwrap_or_default(), lines.next().unwrap_or_default());
                let of = if subject.is_empty() { String::new() } else { format!(" for {subject}") };
                refuse(crate::one_line(&format!("it holds results of {program}{of}"), 400))
            }
            Err(_) => match files.iter().find(|file| is_there(&folder.join(file))) {
                Some(file) => refuse(format!("it holds {file}, which {} did not write", self.program)),
                None => Ok(()),
            },
        }
    }

    /// Marks a folder, which must exist, before the first result is written: so a killed run leaves one that says whose it is.
    ///
    /// # Errors
    ///
    /// [`Error`] where it cannot be written.
    pub fn claim(&self, folder: &Path) -> Result<(), Error> {
        crate::write(&folder.join(Self::FILE), self.text().as_bytes(), crate::Existing::Replace).map(drop)
    }

    fn text(&self) -> String {
        format!("{}\n{}\n", self.program, crate::one_line(&self.subject, 4000))
    }
}

/// Whether something that is no folder is there, a link to nothing among it.
fn is_there(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|there| !there.is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_others_keep_a_folder_from_being_taken() {
        let folder = tempfile::tempdir().unwrap();
        let owner = Owner { program: "demo", subject: String::new() };
        std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
        owner.check(folder.path(), &["episode.html"]).unwrap();
        std::fs::write(folder.path().join("episode.html"), "mine").unwrap();
        let message = owner.check(folder.path(), &["episode.html"]).unwrap_err().source.to_string();
        assert_eq!(message, "it holds episode.html, which demo did not write: choose another folder");
        owner.claim(folder.path()).unwrap();
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
