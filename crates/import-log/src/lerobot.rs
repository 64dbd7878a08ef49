//! LeRobot data sets, versions 2 and 3: `meta/info.json`, and Parquet files below `data`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::Error;
use crate::error::{excerpt, open, read_text};
use crate::mapping::Mapping;
use crate::parquet_file;
use crate::plan::Plan;
use crate::rows::ElementNames;
use crate::store::Store;

/// Bytes of `info.json` at most.
const MAX_INFO: u64 = 4 << 20;
const MOST_FILES: usize = 100_000;

/// The clock of every data set.
pub(crate) const CLOCK: &str = "timestamp";

#[derive(Debug, Deserialize)]
struct RawInfo {
    codebase_version: String,
    fps: Option<f64>,
    #[serde(default)]
    features: BTreeMap<String, RawFeature>,
}

#[derive(Debug, Deserialize)]
struct RawFeature {
    #[serde(default)]
    names: serde_json::Value,
}

/// What `meta/info.json` says.
#[derive(Debug)]
pub(crate) struct Info {
    pub(crate) fps: Option<f64>,
    pub(crate) elements: ElementNames,
}

pub(crate) fn info(folder: &Path) -> Result<Info, Error> {
    let path = folder.join("meta/info.json");
    let text = read_text(&path, MAX_INFO)?;
    let raw: RawInfo = serde_json::from_str(&text).map_err(|e| Error::Syntax {
        path: path.clone(),
        reason: whole_file::one_line(&whole_file::plain(&e.to_string()), 200),
    })?;
    if !["v2", "v3"].iter().any(|known| raw.codebase_version.starts_with(known)) {
        let found = excerpt(&raw.codebase_version);
        return Err(Error::source(&path, "key codebase_version", "v2.0, v2.1 or v3.0", found));
    }
    let elements = raw.features.into_iter().map(|(name, feature)| (name, names(&feature.names))).collect();
    Ok(Info { fps: raw.fps.filter(|fps| *fps > 0.0 && fps.is_finite()), elements })
}

/// A list of names, or lists below a word such as `motors`.
fn names(value: &serde_json::Value) -> Vec<String> {
    match value {
        serde_json::Value::Array(list) => list.iter().filter_map(|name| Some(name.as_str()?.to_string())).collect(),
        serde_json::Value::Object(groups) => groups.values().flat_map(names).collect(),
        _ => Vec::new(),
    }
}

/// The files with the frames, in their order.
pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let data = folder.join("data");
    let mut found = Vec::new();
    for chunk in list(&data)? {
        if chunk.is_dir() {
            found.extend(list(&chunk)?.into_iter().filter(|path| path.extension().is_some_and(|e| e == "parquet")));
        }
        if found.len() > MOST_FILES {
            let what = "files of frames";
            return Err(Error::TooLarge { path: data, what, limit: MOST_FILES as u64, found: found.len() as u64 });
        }
    }
    if found.is_empty() {
        return Err(Error::source(&data, "as a folder", "files chunk-*/*.parquet", "none"));
    }
    Ok(found)
}

fn list(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let entries = std::fs::read_dir(folder).map_err(Error::io("list", folder))?;
    let paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<PathBuf>, std::io::Error>>();
    let mut paths = paths.map_err(Error::io("list", folder))?;
    paths.sort();
    Ok(paths)
}

/// Takes what a plan asks for from a data set.
pub(crate) fn read(mapping: &Mapping, plan: &Plan, folder: &Path, store: &mut Store) -> Result<(), Error> {
    let info = info(folder)?;
    for path in files(folder)? {
        parquet_file::read(mapping, plan, &path, open(&path)?, &info.elements, store)?;
    }
    Ok(())
}
