//! ROS 2 bags: a folder with `metadata.yaml` and MCAP or sqlite3 files, or one such file.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use rusqlite::limits::Limit;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags};
use saphyr_parser::{Event, Parser};

use crate::decode::Decoder;
use crate::error::{excerpt, open, read_text};
use crate::messages::{Message, Sink};
use crate::{Error, builtin, mcap_file};

/// Bytes of `metadata.yaml`, and of a message or a definition in sqlite3, at most.
const MAX_METADATA: u64 = 4 << 20;
const LARGEST_BLOB: i32 = 64 << 20;
const MOST_TOPICS: usize = 10_000;
const MOST_FILES: usize = 10_000;

/// Gives the messages of a bag to `sink`, file by file.
pub(crate) fn read<S: Sink>(path: &Path, sink: &mut S) -> Result<(), Error> {
    let files = if path.is_dir() { files(path)? } else { vec![path.to_owned()] };
    for file in files {
        let mut begin = [0; 16];
        let count = open(&file)?.read(&mut begin).map_err(Error::io("read", &file))?;
        if begin[..count].starts_with(b"SQLite format 3\0") {
            check_size(&file)?;
            read_sqlite(&file, sink)?;
        } else if begin[..count].starts_with(b"\x89MCAP") {
            mcap_file::read(&file, sink)?;
        } else {
            let found = if count == 0 { "an empty file" } else { "another beginning" };
            return Err(Error::source(&file, "at its beginning", "MCAP or SQLite format 3", found));
        }
    }
    Ok(())
}

/// The files that `metadata.yaml` names, in their order. Only their names count: bags are moved, and nothing outside is read.
fn files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let path = folder.join("metadata.yaml");
    let text = read_text(&path, MAX_METADATA)?;
    let metadata = metadata(&text).map_err(|reason| Error::Syntax { path: path.clone(), reason })?;
    if !metadata.compression.is_empty() {
        let expected = "a bag without compression of its own (`ros2 bag convert` writes one)";
        return Err(Error::source(&path, "key compression_mode", expected, excerpt(&metadata.compression)));
    }
    let name = |text: &String| {
        let name = Path::new(text).file_name().filter(|_| !text.ends_with("..")).map(|name| folder.join(name));
        name.ok_or_else(|| Error::source(&path, "key relative_file_paths", "the name of a file", excerpt(text)))
    };
    let files: Vec<PathBuf> = metadata.files.iter().map(name).collect::<Result<_, Error>>()?;
    if files.is_empty() || files.len() > MOST_FILES {
        let expected = format!("1 to {MOST_FILES} files");
        return Err(Error::source(&path, "key relative_file_paths", &expected, files.len().to_string()));
    }
    Ok(files)
}

#[derive(Debug, Default, PartialEq)]
struct Metadata {
    files: Vec<String>,
    compression: String,
}

/// What is needed of `metadata.yaml`: keys of the table `rosbag2_bagfile_information`.
fn metadata(text: &str) -> Result<Metadata, String> {
    let mut found = Metadata::default();
    // For each table or list that is open: the last key, or none in a list; and whether a key comes next.
    let mut open: Vec<(Option<String>, bool)> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, _) = event.map_err(|e| whole_file::one_line(&e.to_string(), 200))?;
        let depth = open.len();
        match event {
            Event::Alias(_) => return Err("expected no aliases, found one".into()),
            Event::MappingStart(..) | Event::SequenceStart(..) if depth > 64 => {
                return Err("expected at most 64 levels, found more".into());
            }
            Event::MappingStart(..) => open.push((Some(String::new()), true)),
            Event::SequenceStart(..) => open.push((None, false)),
            Event::MappingEnd | Event::SequenceEnd => {
                open.pop();
                value_ends(&mut open);
            }
            Event::Scalar(text, ..) => {
                let key = |level: usize| open.get(level).and_then(|(key, _)| key.as_deref());
                let inside = key(0) == Some("rosbag2_bagfile_information");
                match (depth, key(1), open.last()) {
                    (3, Some("relative_file_paths"), Some((None, _))) if inside => found.files.push(text.to_string()),
                    (2, Some("compression_mode"), Some((_, false))) if inside => {
                        found.compression =
                            if text.eq_ignore_ascii_case("none") { String::new() } else { text.to_string() };
                    }
                    _ => {}
                }
                match open.last_mut() {
                    Some((Some(key), next @ true)) => {
                        *key = text.to_string();
                        *next = false;
                    }
                    _ => value_ends(&mut open),
                }
            }
            _ => {}
        }
    }
    if found.files.is_empty() {
        return Err("expected rosbag2_bagfile_information with relative_file_paths, found none".into());
    }
    Ok(found)
}

/// After a value in a table comes a key.
fn value_ends(open: &mut [(Option<String>, bool)]) {
    if let Some((Some(_), next)) = open.last_mut() {
        *next = true;
    }
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::broken(path, "a bag in sqlite3", reason)
}

/// Refuses a file that is shorter than its header says: what is read may lie before the cut, and then SQLite would not tell.
///
/// The header: [SQLite's file format](https://www.sqlite.org/fileformat.html), 1.3.2 and 1.3.8.
fn check_size(path: &Path) -> Result<(), Error> {
    let mut head = [0; 100];
    let mut file = open(path)?;
    let found = file.metadata().map_err(Error::io("read", path))?.len();
    file.read_exact(&mut head).map_err(|_| broken(path, &"it ends in the middle of its header"))?;
    let number = |at: usize| u64::from(u32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]));
    let page = match u64::from(u16::from_be_bytes([head[16], head[17]])) {
        1 => 65_536,
        size => size,
    };
    // Old writers leave the count of pages, and then these two differ.
    if number(24) == number(92) && found < page * number(28) {
        return Err(broken(
            path,
            &format!("expected {} bytes, found {found}: it ends in the middle", page * number(28)),
        ));
    }
    Ok(())
}

fn read_sqlite<S: Sink>(path: &Path, sink: &mut S) -> Result<(), Error> {
    let bad = |error: rusqlite::Error| broken(path, &error);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let base = Connection::open_with_flags(path, flags).map_err(bad)?;
    // A file of others: bounded values, no functions from its schema, pages that are checked.
    base.set_limit(Limit::SQLITE_LIMIT_LENGTH, LARGEST_BLOB).map_err(bad)?;
    for (name, value) in [("trusted_schema", "off"), ("cell_size_check", "on"), ("mmap_size", "0")] {
        base.pragma_update(None, name, value).map_err(bad)?;
    }
    let tables = tables(&base).map_err(bad)?;
    for needed in ["topics", "messages"] {
        if !tables.contains(&needed.to_string()) {
            return Err(broken(path, &format!("expected a table {needed}, found none")));
        }
    }
    let definitions = if tables.contains(&"message_definitions".to_string()) {
        definitions(&base).map_err(bad)?
    } else {
        BTreeMap::new()
    };
    let topics = topics(&base).map_err(bad)?;
    if topics.len() > MOST_TOPICS {
        return Err(broken(path, &format!("expected at most {MOST_TOPICS} topics, found more")));
    }
    let mut decoders = BTreeMap::new();
    for topic in topics {
        let decoder = decoder(&topic, &definitions);
        sink.channel(path, &topic.name, &topic.kind, decoder.as_ref().err().map(String::as_str))?;
        if let Ok(decoder) = decoder
            && sink.wants(&topic.name)
        {
            decoders.insert(topic.id, (topic.name, decoder));
        }
    }
    let mut query = base.prepare("SELECT topic_id, timestamp, data FROM messages").map_err(bad)?;
    let mut rows = query.query([]).map_err(bad)?;
    while let Some(row) = rows.next().map_err(bad)? {
        let Some((topic, decoder)) = decoders.get(&row.get(0).map_err(bad)?) else { continue };
        let time = i128::from(row.get::<_, i64>(1).map_err(bad)?);
        let data = match row.get_ref(2).map_err(bad)? {
            ValueRef::Blob(bytes) => bytes,
            other => return Err(broken(path, &format!("expected a message as bytes, found {}", other.data_type()))),
        };
        let value = decoder
            .decode(data)
            .map_err(|reason| broken(path, &format!("message of {} at {time} ns: {reason}", excerpt(topic))))?;
        sink.message(&Message { path, topic, log_nanos: time, publish_nanos: time, value })?;
    }
    Ok(())
}

struct Topic {
    id: i64,
    name: String,
    kind: String,
    format: String,
}

/// Names of plain tables: a view could be endless.
fn tables(base: &Connection) -> rusqlite::Result<Vec<String>> {
    let sql = "SELECT name FROM sqlite_schema WHERE type = 'table' AND sql LIKE 'CREATE TABLE%' LIMIT 100";
    base.prepare(sql)?.query_map([], |row| row.get(0))?.collect()
}

fn topics(base: &Connection) -> rusqlite::Result<Vec<Topic>> {
    let sql = format!("SELECT id, name, type, serialization_format FROM topics LIMIT {}", MOST_TOPICS + 1);
    let topic = |row: &rusqlite::Row<'_>| {
        Ok(Topic { id: row.get(0)?, name: row.get(1)?, kind: row.get(2)?, format: row.get(3)? })
    };
    base.prepare(&sql)?.query_map([], topic)?.collect()
}

/// Encoding and text of the definition of each type, as bags since ROS 2 Iron hold them.
fn definitions(base: &Connection) -> rusqlite::Result<BTreeMap<String, (String, String)>> {
    let sql =
        format!("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions LIMIT {MOST_TOPICS}");
    base.prepare(&sql)?.query_map([], |row| Ok((row.get(0)?, (row.get(1)?, row.get(2)?))))?.collect()
}

fn decoder(topic: &Topic, definitions: &BTreeMap<String, (String, String)>) -> Result<Decoder, String> {
    if let Some((encoding, text)) = definitions.get(&topic.kind)
        && !text.is_empty()
    {
        return Decoder::new(&topic.format, &topic.kind, encoding, text.as_bytes());
    }
    let text = builtin::definition(&topic.kind).ok_or_else(|| {
        "expected a definition of this type in the bag, found none (an MCAP bag holds them: `ros2 bag convert`)"
            .to_string()
    })?;
    Decoder::new(&topic.format, &topic.kind, "ros2msg", text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
rosbag2_bagfile_information:
  version: 5
  storage_identifier: sqlite3
  relative_file_paths:
    - rig/rig_0.db3
    - rig_1.db3
  files:
    - path: other.db3
      message_count: 3
  topics_with_message_count:
    - topic_metadata:
        name: /tool
        offered_qos_profiles: \"- history: 3\\n  depth: 0\"
      message_count: 3
  compression_format: \"\"
  compression_mode: NONE
";

    #[test]
    fn only_the_files_of_the_bag_itself_are_taken() {
        let found = metadata(TEXT).unwrap();
        assert_eq!(found.files, ["rig/rig_0.db3", "rig_1.db3"]);
        assert_eq!(found.compression, "");
        assert_eq!(metadata(&TEXT.replace("NONE", "FILE")).unwrap().compression, "FILE");
    }

    #[test]
    fn what_is_no_metadata_is_refused() {
        for text in ["", "a: b", "[[[", "rosbag2_bagfile_information: 3", "a: &x [1]\nb: *x"] {
            assert!(metadata(text).is_err(), "{text}");
        }
        assert!(metadata(&"[".repeat(100_000)).is_err());
    }
}
