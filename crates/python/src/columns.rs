//! Columns of numbers as bytes.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::LogError;

/// Bytes of a 64-bit float.
const WIDTH: usize = size_of::<f64>();

/// Names and cells.
pub(crate) type Columns = Vec<(String, Vec<f64>)>;

/// Columns as Python takes them: names with the bytes of their cells.
pub(crate) fn to_python(py: Python<'_>, columns: Columns) -> Vec<(String, Bound<'_, PyBytes>)> {
    let bytes = |cells: Vec<f64>| cells.into_iter().flat_map(f64::to_ne_bytes).collect::<Vec<u8>>();
    columns.into_iter().map(|(name, cells)| (name, PyBytes::new(py, &bytes(cells)))).collect()
}

/// Cells of a column.
pub(crate) fn cells(name: &str, bytes: &[u8]) -> PyResult<Vec<f64>> {
    let (cells, rest) = bytes.as_chunks::<WIDTH>();
    if !rest.is_empty() {
        return Err(LogError::new_err(format!("column `{name}`: expected 64-bit floats, found {} bytes", bytes.len())));
    }
    Ok(cells.iter().map(|cell| f64::from_ne_bytes(*cell)).collect())
}
