//! Files and folders of runs. They are written whole or not at all, and never over files of others.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::Error;

/// Writes a file whole or not at all.
pub(crate) fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let error = |e: whole_file::Error| Error::File { file: path.to_path_buf(), action: "writing", source: e.source };
    whole_file::write(path, bytes, whole_file::Existing::Replace).map(|_| ()).map_err(error)
}

/// Plain data as JSON for people and machines.
pub(crate) fn pretty<T: Serialize>(value: &T) -> String {
    serde_json::to_string_pretty(value).expect("plain data has a JSON form") + "\n"
}

/// An [`Error::File`] from its cause.
pub(crate) fn file_error(file: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Error {
    let file = file.to_path_buf();
    move |source| Error::File { file, action, source }
}

/// Takes `folder`, made where it is missing, for the run that `identity` describes: the file `name` in it says so from then on. A folder
/// of another run is refused, and one that holds any of the files `ours` and does not say whose they are.
pub(crate) fn claim<T: Serialize>(
    folder: &Path,
    name: &'static str,
    identity: &T,
    ours: &[impl AsRef<Path>],
) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(file_error(folder, "creating the folder"))?;
    check_claim(folder, name, identity, ours)?;
    let file = folder.join(name);
    if !file.exists() {
        // Never replaced, as it carries the lock of the folder: where another program is quicker, its file counts.
        let written = whole_file::write(&file, pretty(identity).as_bytes(), whole_file::Existing::Keep);
        written.map_err(|e| file_error(&file, "writing")(e.source))?;
    }
    let text = std::fs::read_to_string(&file).map_err(file_error(&file, "reading"))?;
    check_identity(&file, &text, identity)
}

/// Refuses a folder as [`claim`] does, and writes nothing.
pub(crate) fn check_claim<T: Serialize>(
    folder: &Path,
    name: &'static str,
    identity: &T,
    ours: &[impl AsRef<Path>],
) -> Result<(), Error> {
    let file = folder.join(name);
    match std::fs::read_to_string(&file) {
        Ok(text) => check_identity(&file, &text, identity),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            let found = ours.iter().map(|name| folder.join(name)).find(|file| file.exists());
            found.map_or(Ok(()), |file| Err(Error::Foreign { file, expected: name }))
        }
        Err(e) => Err(file_error(&file, "reading")(e)),
    }
}

/// Refuses the identity `text` of another run.
pub(crate) fn check_identity<T: Serialize>(file: &Path, text: &str, expected: &T) -> Result<(), Error> {
    let found: Value = serde_json::from_str(text).unwrap_or(Value::Null);
    let expected = serde_json::to_value(expected).expect("plain data has a JSON form");
    for (key, value) in expected.as_object().expect("a struct is an object") {
        let other = found.get(key).unwrap_or(&Value::Null);
        if other != value {
            // Which network a run plays with.
            let none = if key == "prior_hash" { "that of no network" } else { "missing" };
            let words = |value: &Value| if value.is_null() { none.to_owned() } else { value.to_string() };
            return Err(Error::OtherRun {
                file: file.to_path_buf(),
                key: key.clone(),
                found: words(other),
                expected: words(value),
            });
        }
    }
    Ok(())
}
