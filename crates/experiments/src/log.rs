//! Logs of finished trials: a line each, whole lines whatever kills the program.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use agent::Method;

use crate::files::file_error;
use crate::{Error, TrialRecord};

/// Finished trials of a run.
pub(crate) type Trials = BTreeMap<(Method, u32), TrialRecord>;

/// Where a run writes the trials that it plays.
#[derive(Debug)]
pub(crate) enum Log {
    /// The log of the folder's holder.
    Own(PathBuf, File),
    /// A worker's at the shard of this index, begun with its first trial.
    Attempt(PathBuf, u32),
    /// One that a write has failed in: what follows half a line would be lost.
    Closed(PathBuf),
}

impl Log {
    /// Appends a line, at once, so that a kill leaves whole lines and at most one broken last one. After a write that failed nothing is written any more.
    pub(crate) fn append(&mut self, line: &str) -> Result<(), Error> {
        if let Self::Attempt(folder, shard) = self {
            *self = begin(&folder.join("shards"), *shard)?;
        }
        let (path, written) = match self {
            Self::Own(path, file) => (path, file.write_all(line.as_bytes()).and_then(|()| file.sync_data())),
            Self::Attempt(path, _) | Self::Closed(path) => {
                (path, Err(std::io::Error::other("an earlier write failed")))
            }
        };
        let file = path.clone();
        written.map_err(|source| {
            *self = Self::Closed(file.clone());
            Error::File { file, action: "writing", source }
        })
    }
}

/// A new log: two attempts never share one.
fn begin(folder: &Path, shard: u32) -> Result<Log, Error> {
    let failed = |source| Error::File { file: folder.to_path_buf(), action: "beginning a log in the folder", source };
    std::fs::create_dir_all(folder).map_err(failed)?;
    let mut builder = tempfile::Builder::new();
    let prefix = format!("{shard:05}-");
    builder.prefix(&prefix).suffix(".jsonl");
    #[cfg(unix)]
    {
        // As any other new file, less the umask; the default lets only the owner read.
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let (file, path) = builder.tempfile_in(folder).and_then(|file| Ok(file.keep()?)).map_err(failed)?;
    Ok(Log::Own(path, file))
}

/// What is in a log; nothing where there is none.
pub(crate) fn read_log(file: &Path) -> Result<Vec<u8>, Error> {
    match std::fs::read(file) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        read => read.map_err(file_error(file, "reading")),
    }
}

/// The end of the last line that has a line feed: what follows is what a kill left of a write.
fn whole_lines(text: &[u8]) -> usize {
    text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1)
}

/// Cuts what a kill left of a write, so that the next record starts a line of its own. Only for who holds the folder.
pub(crate) fn cut_broken_line(file: &Path) -> Result<(), Error> {
    let text = read_log(file)?;
    let whole = whole_lines(&text);
    if whole < text.len() {
        let cut = OpenOptions::new().write(true).open(file).and_then(|f| f.set_len(whole as u64));
        cut.map_err(file_error(file, "cutting a broken line"))?;
    }
    Ok(())
}

/// Records of a log's whole lines; of two of one trial the first.
pub(crate) fn parse_trials(file: &Path, text: &[u8]) -> Result<Trials, Error> {
    let mut trials = Trials::new();
    for (index, line) in text[..whole_lines(text)].split_inclusive(|byte| *byte == b'\n').enumerate() {
        let record: TrialRecord = serde_json::from_slice(line).map_err(|e| Error::Record {
            file: file.to_path_buf(),
            line: index + 1,
            message: whole_file::plain(&e.to_string()),
        })?;
        trials.entry((record.method, record.trial)).or_insert(record);
    }
    Ok(trials)
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn after_a_failed_write_nothing_is_written_any_more() {
        let path = PathBuf::from("/dev/full");
        let full = std::fs::OpenOptions::new().append(true).open(&path).unwrap();
        let mut log = Log::Own(path, full);
        assert!(log.append("1").is_err());
        let message = error_chain(&log.append("2").unwrap_err());
        assert!(message.contains("/dev/full") && message.contains("an earlier write failed"), "{message}");
    }

    #[cfg(target_os = "linux")]
    fn error_chain(error: &Error) -> String {
        let causes = std::iter::successors(Some(error as &dyn std::error::Error), |e| e.source());
        causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
    }
}
