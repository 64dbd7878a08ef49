//! The folder of a log.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use whole_file::Existing;

use crate::{Error, Log, MAX_FILE_BYTES, Notes, header_toml, samples_csv, samples_parquet};

/// Size of `log.toml` at most.
const MAX_HEADER_BYTES: u64 = 1 << 20;

const HEADER: &str = "log.toml";

/// Format of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `samples.csv`.
    Csv,
    /// `samples.parquet`.
    Parquet,
}

impl Format {
    /// What every file of samples begins with.
    fn begins(self) -> &'static [u8] {
        match self {
            Self::Csv => b"episode,",
            Self::Parquet => b"PAR1",
        }
    }

    /// Name of the file.
    #[must_use]
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Csv => "samples.csv",
            Self::Parquet => "samples.parquet",
        }
    }
}

/// Reads and checks the log in the folder `dir`.
///
/// # Errors
///
/// [`Error`] with file, row and column, or key, and what was expected.
pub fn read(dir: &Path) -> Result<Log, Error> {
    if dir.is_file() {
        return Err(Error::NoFolder { path: dir.to_owned() });
    }
    let header_path = dir.join(HEADER);
    let bytes = read_bounded(&header_path, MAX_HEADER_BYTES)?;
    let text = std::str::from_utf8(&bytes).map_err(|e| Error::Syntax {
        path: header_path.clone(),
        reason: format!("expected UTF-8 text, found another byte at {}", e.valid_up_to()),
    })?;
    let header = header_toml::parse(&header_path, text)?;
    let there = |format: Format| {
        let path = dir.join(format.file_name());
        path.try_exists().map_err(Error::io("look for", &path)).map(|exists| exists.then_some((format, path)))
    };
    let (format, path) = match (there(Format::Csv)?, there(Format::Parquet)?) {
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => return Err(Error::Samples { dir: dir.to_owned(), found: "neither" }),
        (Some(_), Some(_)) => return Err(Error::Samples { dir: dir.to_owned(), found: "both" }),
    };
    let episodes = match format {
        Format::Csv => {
            let file = open_bounded(&path, MAX_FILE_BYTES)?;
            samples_csv::decode(file.take(MAX_FILE_BYTES), header.robot).map_err(|failure| match failure {
                samples_csv::Failure::Csv(e) => csv_error(&path, e),
                samples_csv::Failure::Cells { row, expected, found } => Error::Row {
                    path: path.clone(),
                    row: row as u64 + 1,
                    expected: expected as u64,
                    found: found as u64,
                },
                samples_csv::Failure::Problem(problem) => problem.at(&header_path, &path),
            })?
        }
        Format::Parquet => {
            let bytes = read_bounded(&path, MAX_FILE_BYTES)?;
            samples_parquet::decode(bytes.into(), header.robot).map_err(|failure| match failure {
                samples_parquet::Failure::Parquet(reason) => Error::Parquet { path: path.clone(), reason },
                samples_parquet::Failure::Problem(problem) => problem.at(&header_path, &path),
            })?
        }
    };
    let log = Log { header, episodes };
    log.check().map_err(|problem| problem.at(&header_path, &path))?;
    Ok(log)
}

/// Writes a log into the folder `dir`, which is made if it is not there, with `notes` as comments of `log.toml`. The samples come first and
/// `log.toml` last, each whole or not at all: samples without `log.toml` are unfinished and may be written again. A file of their name that
/// does not begin as samples do is somebody else's and stays.
///
/// # Errors
///
/// [`Error`] where the log breaks a rule of the format, where the folder holds one already, or where the system refuses.
pub fn write(dir: &Path, log: &Log, format: Format, notes: &Notes) -> Result<(), Error> {
    let (header_path, path) = (dir.join(HEADER), dir.join(format.file_name()));
    log.check().map_err(|problem| problem.at(&header_path, &path))?;
    let other = match format {
        Format::Csv => Format::Parquet,
        Format::Parquet => Format::Csv,
    };
    for taken in [header_path.clone(), dir.join(other.file_name())] {
        if taken.try_exists().map_err(Error::io("look for", &taken))? {
            return Err(Error::Exists { path: taken });
        }
    }
    if path.try_exists().map_err(Error::io("look for", &path))? {
        let mut begins = Vec::new();
        let file = File::open(&path).map_err(Error::io("read", &path))?;
        file.take(8).read_to_end(&mut begins).map_err(Error::io("read", &path))?;
        if !begins.starts_with(format.begins()) {
            return Err(Error::Exists { path });
        }
    }
    std::fs::create_dir_all(dir).map_err(Error::io("make the folder", dir))?;
    let samples = match format {
        Format::Csv => samples_csv::encode(&log.episodes).into_bytes(),
        Format::Parquet => samples_parquet::encode(&log.episodes)
            .map_err(|e| Error::Parquet { path: path.clone(), reason: e.to_string() })?,
    };
    let publish = |path: &Path, bytes: &[u8], existing| {
        whole_file::write(path, bytes, existing).map_err(|source| Error::Write { source })
    };
    publish(&path, &samples, Existing::Replace)?;
    if publish(&header_path, header_toml::print(&log.header, notes).as_bytes(), Existing::Keep)? {
        Ok(())
    } else {
        Err(Error::Exists { path: header_path })
    }
}

/// Opens a plain file of bounded size: a pipe or a device could block or never end.
pub(crate) fn open_bounded(path: &Path, limit: u64) -> Result<File, Error> {
    let about = std::fs::metadata(path).map_err(Error::io("read", path))?;
    if !about.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is not a plain file");
        return Err(Error::Io { action: "read", path: path.to_owned(), source });
    }
    if about.len() > limit {
        return Err(Error::TooLarge { path: path.to_owned(), what: "bytes", limit, found: about.len() });
    }
    File::open(path).map_err(Error::io("read", path))
}

/// Reads a plain file of bounded size.
pub(crate) fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    open_bounded(path, limit)?.take(limit).read_to_end(&mut bytes).map_err(Error::io("read", path))?;
    Ok(bytes)
}

fn csv_error(path: &Path, error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => Error::Io { action: "read", path: path.to_owned(), source },
        _ => Error::Syntax { path: path.to_owned(), reason },
    }
}
