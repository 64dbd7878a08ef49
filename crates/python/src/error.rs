//! Errors of the library as exceptions.

use discrepancy::Error;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::{PyErr, create_exception};

create_exception!(
    surmise,
    LogError,
    PyValueError,
    "A log or a model that cannot be used: one sentence that says what was expected and found."
);

/// The exception for an error: what the system refuses is an `OSError`, all else a `LogError`, each with the sentence that the command prints.
pub(crate) fn exception(error: &Error) -> PyErr {
    let text = error.to_string();
    match error {
        Error::Write { .. } | Error::Folder { .. } => PyOSError::new_err(text),
        _ => LogError::new_err(text),
    }
}

/// The same for an error of a log.
pub(crate) fn log_exception(error: measured_log::Error) -> PyErr {
    match error {
        measured_log::Error::Write { .. } => PyOSError::new_err(error.to_string()),
        other => exception(&Error::from(other)),
    }
}
