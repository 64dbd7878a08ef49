//! What a diagnosis leaves behind, whoever asked for it: `report.json`, `report.html`, `model.toml`, and the model as files of other simulators.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use measured_log::Log;
use simulator_files::{mjcf, urdf};
use whole_file::{Claim, Existing, Owner};

use crate::diagnosis::{Diagnosis, Settings};
use crate::error::Error;
use crate::model_file::ModelFile;
use crate::nominal::Nominal;
use crate::page::page;
use crate::report::Report;

/// What is written, the report last: with it all is there.
pub const FILES: [&str; 6] =
    ["nominal.mjcf.xml", "model.mjcf.xml", "model.urdf", "model.toml", "report.html", "report.json"];

/// The answer to a log.
#[derive(Clone, Debug)]
pub struct Answer {
    /// What the log is called, as a rule its folder.
    pub name: String,
    /// Content of `report.json`.
    pub report: Report,
    /// Content of `model.toml`.
    pub model: ModelFile,
    /// Text of `nominal.mjcf.xml`, the re-tuned nominal model, `model.mjcf.xml` and `model.urdf`.
    pub simulators: [String; 3],
}

impl Answer {
    /// Of a diagnosis of the `log` called `name` that took so many seconds. `begun`: the model that `nominal` began with, and what it is called.
    #[must_use]
    pub fn new(
        (name, log): (&str, &Log),
        nominal: &Nominal,
        diagnosis: &Diagnosis,
        settings: &Settings,
        begun: Option<(&str, &ModelFile)>,
        seconds: f64,
    ) -> Self {
        let mut report = Report::new(diagnosis, settings, seconds);
        report.warn(log, nominal);
        report.model = begun.map(|(name, _)| name.into());
        let model = ModelFile::new(nominal, diagnosis, &report, begun.map(|(_, file)| file));
        let [before, after] = [&ModelFile::retuned(nominal, diagnosis), &model].map(|file| file.applied(nominal));
        let [before, after] = [before.scene(name), after.scene(name)];
        let simulators = [mjcf(&before), mjcf(&after), urdf(&after)];
        Self { name: name.into(), report, model, simulators }
    }

    /// Text of `report.json`.
    ///
    /// # Errors
    ///
    /// [`Error::Model`] for a value that JSON cannot hold.
    pub fn json(&self) -> Result<String, Error> {
        let text = serde_json::to_string_pretty(&self.report);
        Ok(text.map_err(|error| Error::Model { reason: error.to_string() })? + "\n")
    }

    /// Text of `report.html`.
    #[must_use]
    pub fn page(&self) -> String {
        page(&self.name, &self.report)
    }

    /// Writes [`FILES`] into a folder that was claimed for them (see [`check_place`]).
    ///
    /// # Errors
    ///
    /// [`Error::Write`] where the system refuses, [`Error::Model`] for a value that a file cannot hold.
    pub fn write(&self, place: &Claim) -> Result<(), Error> {
        let out = place.folder();
        let texts = [self.model.to_toml()?, self.page(), self.json()?];
        for (file, text) in FILES.into_iter().zip(self.simulators.iter().chain(&texts)) {
            whole_file::write(&out.join(file), text.as_bytes(), Existing::Replace)?;
        }
        Ok(())
    }
}

/// The owner of an answer: the log, wherever it is called from.
#[must_use]
pub fn owner(measured: &Path) -> Owner {
    let log = measured.canonicalize().unwrap_or_else(|_| measured.to_path_buf());
    Owner { program: "diagnose", subject: log.display().to_string() }
}

/// Whether a folder may hold the answer: it holds nobody else's.
///
/// # Errors
///
/// [`Error::Taken`] with what is there.
pub fn check_place(out: &Path, owner: &Owner) -> Result<(), Error> {
    let free = whole_file::check_owner(out, "report.json").and_then(|()| owner.check(out, &FILES));
    free.map_err(|source| Error::Taken { source })
}

/// A folder for an answer, with those above it that were made for it.
#[derive(Debug)]
pub struct Place {
    /// The folder, claimed.
    pub claim: Claim,
    made: Vec<PathBuf>,
}

impl Place {
    /// Makes the folder `out` and those above it, and claims it.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] where the system refuses, [`Error::Taken`] where another program writes there.
    pub fn make(out: &Path, owner: &Owner) -> Result<Self, Error> {
        let made: Vec<PathBuf> = out.ancestors().take_while(|path| !path.exists()).map(Path::to_path_buf).collect();
        std::fs::create_dir_all(out).map_err(|source| Error::Folder { path: out.into(), source })?;
        match owner.claim(out) {
            Ok(claim) => Ok(Self { claim, made }),
            Err(source) => {
                remove(&made);
                Err(match source.source.kind() {
                    ErrorKind::AlreadyExists => Error::Taken { source },
                    _ => Error::Write { source },
                })
            }
        }
    }

    /// Leaves nothing behind.
    pub fn give_up(self) {
        self.claim.give_up();
        remove(&self.made);
    }
}

/// Removes folders, as far as they are empty.
fn remove(folders: &[PathBuf]) {
    folders.iter().for_each(|path| drop(std::fs::remove_dir(path)));
}
