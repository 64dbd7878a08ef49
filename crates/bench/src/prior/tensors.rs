//! Arrays for Python, in the safetensors format: little-endian header length, JSON header, values.

use std::path::Path;

use anyhow::{Context as _, Result};
use prior::{Dimensions, Parameters};
use serde_json::{Map, Value, json};

/// Named arrays of one file.
#[derive(Debug, Default)]
pub(crate) struct Tensors {
    header: Map<String, Value>,
    values: Vec<u8>,
}

impl Tensors {
    /// Adds an array; `bytes` are its values in little-endian order, `dtype` their type as safetensors names it.
    pub(crate) fn add(&mut self, name: &str, dtype: &str, shape: &[usize], bytes: impl IntoIterator<Item = u8>) {
        let first = self.values.len();
        self.values.extend(bytes);
        let entry = json!({ "dtype": dtype, "shape": shape, "data_offsets": [first, self.values.len()] });
        self.header.insert(name.into(), entry);
    }

    /// Weights, or gradients, in f32.
    pub(crate) fn weights_f32(parameters: &Parameters<f32>, sizes: &Dimensions) -> Self {
        let mut tensors = Self::default();
        for (values, spec) in parameters.tensors.iter().zip(sizes.tensors()) {
            tensors.add(&spec.name, "F32", &spec.shape, values.iter().flat_map(|value| value.to_le_bytes()));
        }
        tensors
    }

    /// Weights, or gradients, in f64.
    pub(crate) fn weights_f64(parameters: &Parameters<f64>, sizes: &Dimensions) -> Self {
        let mut tensors = Self::default();
        for (values, spec) in parameters.tensors.iter().zip(sizes.tensors()) {
            tensors.add(&spec.name, "F64", &spec.shape, values.iter().flat_map(|value| value.to_le_bytes()));
        }
        tensors
    }

    pub(crate) fn write(self, path: &Path) -> Result<()> {
        let header = Value::Object(self.header).to_string();
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header.into_bytes());
        bytes.extend(self.values);
        std::fs::write(path, bytes).with_context(|| path.display().to_string())
    }
}
