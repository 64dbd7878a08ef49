//! Traces as JSON files.

use std::path::Path;

use serde::Deserialize;

use crate::{EpisodeTrace, Error, VERSION};

/// Most bytes of a trace: an episode of 20 actions has about 400 kB.
pub const LARGEST_BYTES: u64 = 256 << 20;

/// Writes a trace, whole or not at all.
///
/// # Errors
///
/// Where the operating system refuses.
pub fn write(trace: &EpisodeTrace, path: &Path) -> Result<(), Error> {
    let failed = |source| Error::Write { path: path.to_path_buf(), source };
    let mut bytes = serde_json::to_vec(trace).map_err(|e| failed(e.into()))?;
    bytes.push(b'\n');
    whole_file::write(path, &bytes, whole_file::Existing::Replace).map_err(|e| failed(e.source))?;
    Ok(())
}

/// Reads a trace.
///
/// # Errors
///
/// A file that cannot be read, is no trace, or has another version.
pub fn read(path: &Path) -> Result<EpisodeTrace, Error> {
    /// Read first, so that an old file says so.
    #[derive(Deserialize)]
    struct Version {
        version: u32,
    }
    let refused = |e: whole_file::Error| Error::Read { path: path.to_path_buf(), source: e.source };
    let text = whole_file::read(path, LARGEST_BYTES).map_err(refused)?;
    let content = |error: serde_json::Error| {
        let reason = whole_file::one_line(&whole_file::plain(&error.to_string()), 400);
        Error::Content { path: path.to_path_buf(), reason }
    };
    let Version { version: found } = serde_json::from_slice(&text).map_err(content)?;
    if found != VERSION {
        return Err(Error::Version { path: path.to_path_buf(), found });
    }
    serde_json::from_slice(&text).map_err(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_trace_is_refused_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.json");
        let refusal = |text: &str| {
            std::fs::write(&path, text).unwrap();
            let error = read(&path).unwrap_err();
            assert!(error.to_string().contains("trace.json"), "{error}");
            error
        };
        assert!(matches!(refusal(""), Error::Content { .. }));
        assert!(matches!(refusal("{\"version\": 7}"), Error::Version { found: 7, .. }));
        assert!(matches!(refusal("{\"version\": 1, \"titel\": \"\"}"), Error::Content { .. }));
        assert!(matches!(read(&folder.path().join("none.json")), Err(Error::Read { .. })));
    }
}
