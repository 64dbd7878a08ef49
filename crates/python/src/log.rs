//! Logs.

use std::path::{Path, PathBuf};

use measured_log::{Format, Header, Notes};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::columns::{cells, to_python};
use crate::error::{LogError, exception, log_exception};
use crate::model::nominal;

/// A log that was read and checked.
#[pyclass(frozen, module = "surmise._surmise")]
pub(crate) struct Log {
    pub(crate) log: measured_log::Log,
    /// What a report calls it: its folder as it was given, or what its maker said.
    #[pyo3(get)]
    pub(crate) name: String,
}

#[pymethods]
impl Log {
    /// Reads the folder of a log.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let log = py.detach(|| measured_log::read(&path)).map_err(log_exception)?;
        Ok(Self { log, name: path.display().to_string() })
    }

    /// Of columns of 64-bit floats, NaN where nothing was read. `header`: TOML as in log.toml, or JSON of the same keys.
    #[staticmethod]
    fn of_columns(
        columns: Vec<(String, Bound<'_, PyBytes>)>,
        header: &str,
        is_json: bool,
        name: String,
    ) -> PyResult<Self> {
        let header = if is_json { json_header(header)? } else { toml_header(header)? };
        let read: Vec<(String, Vec<f64>)> = (columns.into_iter())
            .map(|(name, bytes)| cells(&name, bytes.as_bytes()).map(|cells| (name, cells)))
            .collect::<PyResult<_>>()?;
        let slices: Vec<(&str, &[f64])> = read.iter().map(|(name, cells)| (name.as_str(), cells.as_slice())).collect();
        let log = measured_log::Log::from_columns(header, &slices, Path::new(&name)).map_err(log_exception)?;
        Ok(Self { log, name })
    }

    /// Names and bytes of the columns.
    fn columns<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, PyBytes>)> {
        to_python(py, self.log.columns())
    }

    /// Numbers of the episodes.
    fn episodes(&self) -> Vec<u64> {
        self.log.episodes.iter().map(|episode| episode.id).collect()
    }

    /// Text of log.toml.
    fn header(&self) -> String {
        measured_log::print_header(&self.log.header, &Notes::new())
    }

    /// What its own readings say against it: JSON.
    #[pyo3(signature = (robot=None))]
    #[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
    fn check(&self, py: Python<'_>, robot: Option<PathBuf>) -> PyResult<String> {
        let checked = py.detach(|| -> Result<String, discrepancy::Error> {
            let tool = nominal(self, robot.as_deref())?.tool().clone();
            let check = discrepancy::warning::check(&self.log, &tool);
            serde_json::to_string(&check).map_err(|error| discrepancy::Error::Model { reason: error.to_string() })
        });
        checked.map_err(|error| exception(&error))
    }

    /// Writes log.toml and samples.csv or samples.parquet into a folder without a log.
    #[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
    fn save(&self, py: Python<'_>, folder: PathBuf, parquet: bool) -> PyResult<()> {
        let format = if parquet { Format::Parquet } else { Format::Csv };
        py.detach(|| measured_log::write(&folder, &self.log, format, &Notes::new())).map_err(log_exception)
    }
}

/// What stands for log.toml in messages about a header that has no file.
const HEADER: &str = "header";

fn toml_header(text: &str) -> PyResult<Header> {
    measured_log::parse_header(Path::new(HEADER), text).map_err(log_exception)
}

fn json_header(text: &str) -> PyResult<Header> {
    let wrong = |error: &dyn std::fmt::Display| LogError::new_err(format!("{HEADER}: {error}"));
    let value: serde_json::Value = serde_json::from_str(text).map_err(|error| wrong(&error))?;
    let table = toml::Table::try_from(value).map_err(|error| wrong(&error))?;
    measured_log::header(Path::new(HEADER), table).map_err(log_exception)
}
