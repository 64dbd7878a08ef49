//! The native half of the Python package `surmise`: logs, diagnoses and models, without a table or a notebook in it.
//!
//! What a user sees is in `python/surmise`: attributes, tables, progress. Columns of numbers go over as bytes of 64-bit floats in the machine's order, so that
//! neither side needs a library of arrays. Work runs detached from the interpreter; the calling thread looks after Ctrl-C ([`watch`]).

mod columns;
mod diagnosis;
mod error;
mod log;
mod model;
mod watch;

use pyo3::prelude::*;

/// The native half of the package `surmise`.
#[pymodule]
mod _surmise {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::diagnosis::{Diagnosis, diagnose};
    #[pymodule_export]
    use crate::error::LogError;
    #[pymodule_export]
    use crate::log::Log;
    #[pymodule_export]
    use crate::model::Model;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
