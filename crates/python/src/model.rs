//! Models: what a diagnosis found, to simulate with or to begin with.

use std::path::{Path, PathBuf};

use discrepancy::{Error, ModelFile, Nominal, Row, Seen, overlay, rig_tool};
use physics_model::robot::check_root;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::columns::{Columns, to_python};
use crate::error::exception;
use crate::log::Log;
use crate::watch::watched;

/// Content of a model.toml.
#[pyclass(frozen, module = "surmise._surmise")]
pub(crate) struct Model {
    pub(crate) file: ModelFile,
    /// What a report calls it.
    #[pyo3(get)]
    pub(crate) name: String,
}

#[pymethods]
impl Model {
    /// Reads a model.toml.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
    fn read(path: PathBuf) -> PyResult<Self> {
        let file = ModelFile::read(&path).map_err(|error| exception(&error))?;
        Ok(Self { file, name: path.display().to_string() })
    }

    /// Names of its effects in the catalogue.
    fn effects(&self) -> Vec<&'static str> {
        self.file.effects().iter().map(|effect| effect.kind().name()).collect()
    }

    /// Text of model.toml.
    fn toml(&self) -> PyResult<String> {
        self.file.to_toml().map_err(|error| exception(&error))
    }

    /// Names and bytes of the columns of a log, as measured and as simulated.
    #[pyo3(signature = (log, robot, threads, told))]
    #[expect(clippy::needless_pass_by_value, reason = "what Python gives is owned")]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        log: &Log,
        robot: Option<PathBuf>,
        threads: usize,
        told: Option<Py<PyAny>>,
    ) -> PyResult<Vec<(String, Bound<'py, PyBytes>)>> {
        let columns = watched(py, threads, told.as_ref(), |progress| {
            let nominal = nominal(log, robot.as_deref())?;
            overlay(&log.log, &log.name, &nominal, &self.file, progress).map(|rows| columns(&rows))
        })?;
        Ok(to_python(py, columns))
    }
}

/// The nominal model of a log. `root`: the project folder, for the arms; where it is `None`, one is looked for as the command does.
pub(crate) fn nominal(log: &Log, root: Option<&Path>) -> Result<Nominal, Error> {
    if let Some(root) = root {
        check_root(root)?;
    }
    Nominal::new(&log.log.header, rig_tool(&log.log, root)?)
}

/// What columns begin with, and where they are from.
type Side = (&'static str, fn(&Row) -> &Seen);

/// Rows as columns: NaN where nothing was read. Without a tool there are no columns of it.
fn columns(rows: &[Row]) -> Columns {
    const AXES: [&str; 3] = ["x", "y", "z"];
    let column = |name: String, cell: &dyn Fn(&Row) -> f64| (name, rows.iter().map(cell).collect());
    let mut all = vec![
        column("episode".into(), &|row| row.episode as f64),
        column("piece".into(), &|row| row.piece as f64),
        column("time_secs".into(), &|row| row.time_secs),
    ];
    let sides: [Side; 2] = [("measured", |row| &row.measured), ("simulated", |row| &row.simulated)];
    for (side, seen) in sides {
        for (index, axis) in AXES.iter().enumerate() {
            let cell = |row: &Row| seen(row).object_m.map_or(f64::NAN, |place| place[index]);
            all.push(column(format!("{side}_object_{axis}_m"), &cell));
        }
        for (index, component) in ["x", "y", "z", "w"].iter().enumerate() {
            let cell = |row: &Row| seen(row).orientation.map_or(f64::NAN, |turn| turn[index]);
            all.push(column(format!("{side}_object_q{component}"), &cell));
        }
        if !rows.iter().any(|row| seen(row).tool_m.is_some()) {
            continue;
        }
        for (index, axis) in AXES.iter().enumerate() {
            let cell = |row: &Row| seen(row).tool_m.map_or(f64::NAN, |place| place[index]);
            all.push(column(format!("{side}_tool_{axis}_m"), &cell));
        }
    }
    all
}
