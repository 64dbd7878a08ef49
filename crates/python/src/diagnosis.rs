//! Diagnoses.

use std::path::{Path, PathBuf};
use std::time::Instant;

use discrepancy::answer::{Place, check_place, owner};
use discrepancy::{Answer, ModelFile, Settings, diagnose_watched};
use pyo3::prelude::*;

use crate::error::exception;
use crate::log::Log;
use crate::model::{Model, nominal};
use crate::watch::watched;

/// The answer to a log.
#[pyclass(frozen, module = "surmise._surmise")]
pub(crate) struct Diagnosis {
    answer: Answer,
    retuned: ModelFile,
}

/// Finds what the nominal model of a log lacks.
#[pyfunction]
#[pyo3(signature = (log, model, seed, fold, robot, threads, told))]
#[expect(clippy::too_many_arguments, reason = "the command has as many, each with its name")]
#[expect(clippy::disallowed_methods, reason = "the report says how long it took; nothing depends on it")]
#[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
pub(crate) fn diagnose(
    py: Python<'_>,
    log: &Log,
    model: Option<&Model>,
    seed: u64,
    fold: Option<[usize; 2]>,
    robot: Option<PathBuf>,
    threads: usize,
    told: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let started = Instant::now();
    let settings = Settings { seed, fold, ..Settings::default() };
    watched(py, threads, told.as_ref(), |progress| {
        let mut nominal = nominal(log, robot.as_deref())?;
        if let Some(model) = model {
            model.file.apply_as(&model.name, &mut nominal)?;
        }
        let diagnosis = diagnose_watched(&log.log, &log.name, &nominal, &settings, progress)?;
        let begun = model.map(|model| (model.name.as_str(), &model.file));
        let seconds = started.elapsed().as_secs_f64();
        let answer = Answer::new((&log.name, &log.log), &nominal, &diagnosis, &settings, begun, seconds);
        Ok(Diagnosis { answer, retuned: ModelFile::retuned(&nominal, &diagnosis) })
    })
}

#[pymethods]
impl Diagnosis {
    /// Text of report.json.
    fn json(&self) -> PyResult<String> {
        self.answer.json().map_err(|error| exception(&error))
    }

    /// Text of report.html.
    fn html(&self) -> String {
        self.answer.page()
    }

    /// The nominal model with the effects that were found.
    fn model(&self) -> Model {
        Model { file: self.answer.model.clone(), name: format!("the model found for {}", self.answer.name) }
    }

    /// The nominal model alone, re-tuned.
    fn nominal(&self) -> Model {
        Model { file: self.retuned.clone(), name: format!("the nominal model of {}", self.answer.name) }
    }

    /// Writes report.json, report.html and model.toml.
    #[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
    fn save(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        let owner = owner(Path::new(&self.answer.name));
        let written = py.detach(|| {
            check_place(&folder, &owner)?;
            self.answer.write(&Place::make(&folder, &owner)?.claim)
        });
        written.map_err(|error| exception(&error))
    }
}
