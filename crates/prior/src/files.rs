//! Files that are either whole or absent.
//!
//! A folder holds one JSON file and binary files named after their content. The JSON file, renamed into place last, says
//! which binaries belong to it: a program killed at any moment leaves the old set or the new one.

use crate::Error;
use crate::parameters::{Parameters, TensorSpec};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value, json};
use std::path::Path;

/// A binary file beside the JSON file that names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileRef {
    /// Name in the same folder.
    pub name: String,
    /// Length.
    pub bytes: u64,
    /// Hash of the content, in hexadecimal.
    pub blake3: String,
}

/// Size of a JSON file.
const MOST_JSON_BYTES: u64 = 64 << 20;
/// Size of a binary file.
const MOST_BLOB_BYTES: u64 = 4 << 30;

/// The one field that is read before all others.
#[derive(Deserialize)]
struct Versioned {
    version: u64,
}

/// Writes `bytes` as `PREFIX-HASH.EXTENSION`.
pub(crate) fn write_blob(dir: &Path, prefix: &str, extension: &str, bytes: &[u8]) -> Result<FileRef, Error> {
    let blake3 = blake3::hash(bytes).to_hex().to_string();
    let name = format!("{prefix}-{}.{extension}", &blake3[..12]);
    write(dir, &name, bytes)?;
    Ok(FileRef { name, bytes: bytes.len() as u64, blake3 })
}

/// Reads a binary file back, refusing another length or content.
pub(crate) fn read_blob(dir: &Path, file: &FileRef) -> Result<Vec<u8>, Error> {
    // A name that is a path would have any file read.
    let plain = file.name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
    if !plain || !file.name.starts_with(|c: char| c.is_ascii_alphanumeric()) || file.name.len() > 100 {
        let name = whole_file::one_line(&file.name, 100);
        let reason = format!("names the file `{name}`, expected letters, digits, `-`, `_`, `.`");
        return Err(Error::Format { path: dir.to_path_buf(), reason });
    }
    let path = dir.join(&file.name);
    let bytes = read(&path, MOST_BLOB_BYTES)?;
    if bytes.len() as u64 != file.bytes {
        return Err(Error::Length { path, found: bytes.len() as u64, expected: file.bytes });
    }
    let found = blake3::hash(&bytes).to_hex().to_string();
    if found != file.blake3 {
        return Err(Error::Hash { path, found, expected: whole_file::one_line(&file.blake3, 64) });
    }
    Ok(bytes)
}

fn read(path: &Path, most_bytes: u64) -> Result<Vec<u8>, Error> {
    whole_file::read(path, most_bytes).map_err(|e| Error::io(&e.path, e.action)(e.source))
}

/// Renames the JSON file into place, then removes the binaries with these prefixes that it does not name.
pub(crate) fn commit(dir: &Path, name: &str, value: &impl Serialize, sets: &[(&str, &FileRef)]) -> Result<(), Error> {
    let path = dir.join(name);
    let mut text = serde_json::to_vec_pretty(value).map_err(|source| Error::Json {
        path: path.clone(),
        kind: "writable",
        source: source.into(),
    })?;
    text.push(b'\n');
    write(dir, name, &text)?;
    let entries = std::fs::read_dir(dir).map_err(Error::io(dir, "list"))?;
    for entry in entries {
        let entry = entry.map_err(Error::io(dir, "list"))?;
        let (name, path) = (entry.file_name(), entry.path());
        let Some(name) = name.to_str() else { continue };
        let ours = sets.iter().any(|(prefix, _)| name.strip_prefix(prefix).is_some_and(|rest| rest.starts_with('-')));
        if ours && sets.iter().all(|(_, kept)| kept.name != name) {
            std::fs::remove_file(&path).map_err(Error::io(&path, "remove"))?;
        }
    }
    Ok(())
}

/// Reads a JSON file of `version`; the version is looked at before anything else.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path, kind: &'static str, version: u64) -> Result<T, Error> {
    let text = read(path, MOST_JSON_BYTES)?;
    let refuse = |source: serde_json::Error| Error::Json { path: path.to_path_buf(), kind, source: source.into() };
    let found = serde_json::from_slice::<Versioned>(&text).map_err(refuse)?.version;
    if found != version {
        return Err(Error::Version { path: path.to_path_buf(), found, expected: version });
    }
    serde_json::from_slice(&text).map_err(refuse)
}

fn write(dir: &Path, name: &str, bytes: &[u8]) -> Result<(), Error> {
    write_atomically(&dir.join(name), bytes)
}

/// Writes a file whole or not at all, with the folders above it.
///
/// # Errors
///
/// [`Error::Io`] if the disk refuses.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let dir = path.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(dir).map_err(Error::io(dir, "create"))?;
    let written = whole_file::write(path, bytes, whole_file::Existing::Replace);
    written.map(|_| ()).map_err(|e| Error::io(&e.path, e.action)(e.source))
}

/// Weights in the safetensors format: little-endian header length, JSON header, little-endian f32.
pub(crate) fn to_safetensors(parameters: &Parameters<f32>, specs: &[TensorSpec]) -> Vec<u8> {
    let (mut header, mut offset) = (Map::new(), 0);
    for spec in specs {
        let end = offset + 4 * spec.len();
        header.insert(spec.name.clone(), json!({"dtype": "F32", "shape": spec.shape, "data_offsets": [offset, end]}));
        offset = end;
    }
    let mut header = Value::Object(header).to_string();
    while !header.len().is_multiple_of(8) {
        header.push(' ');
    }
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.as_bytes());
    bytes.extend(parameters.tensors.iter().flatten().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// Reads the tensors of `specs` from safetensors; `path` is for messages.
pub(crate) fn from_safetensors(bytes: &[u8], specs: &[TensorSpec], path: &Path) -> Result<Parameters<f32>, Error> {
    let refuse = |reason: &str| Error::Format { path: path.to_path_buf(), reason: whole_file::one_line(reason, 400) };
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| refuse("shorter than its first field"))?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| refuse("header too long"))?;
    let (header, data) = rest.split_at_checked(length).ok_or_else(|| refuse("shorter than its header"))?;
    let header: Map<String, Value> = serde_json::from_slice(header)
        .map_err(|e| refuse(&format!("header: {}", whole_file::plain(&e.to_string()))))?;
    let read = |spec: &TensorSpec| {
        let expected = format!("F32 {:?}", spec.shape);
        let mismatch = |found: String| Error::Tensor {
            path: path.to_path_buf(),
            tensor: spec.name.clone(),
            found: whole_file::one_line(&found, 100),
            expected: expected.clone(),
        };
        let entry = header.get(&spec.name).ok_or_else(|| mismatch("missing".into()))?;
        let found = format!("{} {}", entry["dtype"].as_str().unwrap_or("?"), entry["shape"]);
        if found.replace(' ', "") != expected.replace(' ', "") {
            return Err(mismatch(found));
        }
        let range = (entry["data_offsets"][0].as_u64(), entry["data_offsets"][1].as_u64());
        let (Some(first), Some(end)) = range else { return Err(mismatch("without offsets".into())) };
        let values = data.get(first as usize..end as usize).filter(|values| values.len() == 4 * spec.len());
        let values = values.ok_or_else(|| mismatch(format!("bytes {first}..{end} of {}", data.len())))?;
        Ok(values.chunks_exact(4).map(|word| f32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect())
    };
    Ok(Parameters { tensors: specs.iter().map(read).collect::<Result<_, _>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::tests::dimensions;
    use pomdp::Seed;

    #[test]
    fn weights_survive_the_file_and_misfits_are_named() {
        let specs = dimensions(3, 2, &[3], &[4], 2).tensors();
        let parameters = Parameters::initial(&dimensions(3, 2, &[3], &[4], 2), Seed(1));
        let bytes = to_safetensors(&parameters, &specs);
        let path = Path::new("w");
        assert_eq!(from_safetensors(&bytes, &specs, path).unwrap(), parameters);
        let wider = dimensions(3, 2, &[3], &[5], 2).tensors();
        let message = from_safetensors(&bytes, &wider, path).unwrap_err().to_string();
        assert_eq!(message, "w: tensor `layers.0.input` is F32 [3,16], but the network needs F32 [3, 20]");
        let deeper = dimensions(3, 2, &[3], &[4, 4], 2).tensors();
        let message = from_safetensors(&bytes, &deeper, path).unwrap_err().to_string();
        assert_eq!(message, "w: tensor `layers.1.input` is missing, but the network needs F32 [4, 16]");
        for length in [0, 7, 20, bytes.len() - 1] {
            assert!(from_safetensors(&bytes[..length], &specs, path).is_err(), "{length}");
        }
    }

    #[test]
    fn a_commit_leaves_exactly_what_it_names() {
        let dir = tempfile::tempdir().unwrap();
        let first = write_blob(dir.path(), "weights", "bin", b"one").unwrap();
        commit(dir.path(), "a.json", &json!({"version": 1}), &[("weights", &first)]).unwrap();
        std::fs::write(dir.path().join("weightsother.bin"), b"not ours").unwrap();
        let second = write_blob(dir.path(), "weights", "bin", b"two").unwrap();
        assert_eq!(read_blob(dir.path(), &first).unwrap(), b"one", "the old set is whole until the commit");
        commit(dir.path(), "a.json", &json!({"version": 1}), &[("weights", &second)]).unwrap();
        let mut names: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["a.json".into(), second.name.into(), std::ffi::OsString::from("weightsother.bin")]);
    }
}
