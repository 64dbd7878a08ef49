//! Tables: CSV with any separator, and Parquet.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read, Seek as _};
use std::path::Path;
use std::rc::Rc;

use crate::Error;
use crate::error::{excerpt, open};
use crate::mapping::Mapping;
use crate::parquet_file;
use crate::plan::Plan;
use crate::rows::{Columns, ElementNames, Extractor, Place};
use crate::store::Store;
use crate::value::Value;

/// Bytes of a row of a CSV table at most.
const LONGEST_ROW: u64 = 4 << 20;
/// Bytes in which the names of the columns are looked for.
const LONGEST_HEAD: u64 = 1 << 20;
const SEPARATORS: [u8; 4] = [b',', b';', b'\t', b'|'];

/// Takes what a plan asks for from a table.
pub(crate) fn read(mapping: &Mapping, plan: &Plan, path: &Path, store: &mut Store) -> Result<(), Error> {
    let file = open(path)?;
    if is_parquet(&file, path)? {
        return parquet_file::read(mapping, plan, path, file, &ElementNames::new(), store);
    }
    let mut csv = Csv::open(path, file, mapping.raw.table.separator)?;
    let decimal = match mapping.raw.table.decimal {
        None | Some('.') => None,
        Some(',') if csv.separator != b',' => Some(','),
        Some(',') => {
            return Err(mapping.wrong("table.decimal", "expected another sign than the separator, found `,`"));
        }
        Some(other) => {
            let found = excerpt(&other.to_string());
            return Err(mapping.wrong("table.decimal", format!("expected \".\" or \",\", found {found}")));
        }
    };
    let (names, elements) = (csv.names.clone(), ElementNames::new());
    let columns = Columns { lists: vec![false; names.len()], names, elements: &elements };
    let mut extractor = Extractor::new(mapping, plan, path, columns)?;
    while csv.next()? {
        let record = &csv.record;
        extractor.row(store, &|place: Place| text_cell(record.get(place.column), decimal))?;
    }
    Ok(())
}

/// Whether a file begins as Parquet does.
pub(crate) fn is_parquet(mut file: &File, path: &Path) -> Result<bool, Error> {
    let mut begin = [0; 4];
    let count = file.read(&mut begin).map_err(Error::io("read", path))?;
    file.rewind().map_err(Error::io("read", path))?;
    Ok(count == 4 && begin == *b"PAR1")
}

/// What pandas, R and spreadsheets write where nothing was read.
const NOTHING: [&str; 8] = ["", "nan", "NaN", "NAN", "null", "None", "NA", "NULL"];

fn text_cell(bytes: Option<&[u8]>, decimal: Option<char>) -> Value {
    let text = String::from_utf8_lossy(bytes.unwrap_or_default());
    let text = text.trim();
    if NOTHING.contains(&text) {
        return Value::Missing;
    }
    match decimal {
        Some(comma) => Value::Text(text.replace(comma, ".")),
        None => Value::Text(text.into()),
    }
}

/// A CSV table, row by row.
pub(crate) struct Csv<'a> {
    path: &'a Path,
    reader: csv::Reader<Limited>,
    allowed: Rc<Cell<u64>>,
    pub(crate) names: Vec<String>,
    pub(crate) separator: u8,
    pub(crate) record: csv::ByteRecord,
    row: u64,
}

impl<'a> Csv<'a> {
    pub(crate) fn open(path: &'a Path, file: File, separator: Option<char>) -> Result<Self, Error> {
        let separator = match separator {
            Some(one) if one.is_ascii() => one as u8,
            Some(other) => {
                return Err(Error::source(path, "table.separator", "one ASCII sign", excerpt(&other.to_string())));
            }
            None => guess(path, &file)?,
        };
        let allowed = Rc::new(Cell::new(LONGEST_HEAD));
        let limited = Limited { file, read: 0, allowed: allowed.clone() };
        let mut reader =
            csv::ReaderBuilder::new().delimiter(separator).trim(csv::Trim::All).flexible(true).from_reader(limited);
        let names = reader.byte_headers().map_err(|e| csv_error(path, e))?;
        let name = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_start_matches('\u{feff}').to_string();
        let names: Vec<String> = names.iter().map(name).collect();
        if names.iter().all(String::is_empty) {
            return Err(Error::source(path, "row of names", "names of columns", "none"));
        }
        if let Some(name) = names.iter().find(|name| name.chars().any(|c| c.is_control() || c == '\u{fffd}')) {
            return Err(Error::source(path, "row of names", "text: CSV or Parquet", excerpt(name)));
        }
        for (i, name) in names.iter().enumerate() {
            if names[..i].contains(name) && !name.is_empty() {
                return Err(Error::source(path, "row of names", "each name once", format!("{} twice", excerpt(name))));
            }
        }
        Ok(Self { path, reader, allowed, names, separator, record: csv::ByteRecord::new(), row: 0 })
    }

    /// Reads the next row, if there is one.
    pub(crate) fn next(&mut self) -> Result<bool, Error> {
        self.allowed.set(self.reader.position().byte() + LONGEST_ROW);
        self.row += 1;
        if !self.reader.read_byte_record(&mut self.record).map_err(|e| csv_error(self.path, e))? {
            return Ok(false);
        }
        if self.record.len() != self.names.len() {
            let expected = format!("{} cells as in the row of names", self.names.len());
            let place = format!("row {}", self.row);
            return Err(Error::source(self.path, place, &expected, self.record.len().to_string()));
        }
        Ok(true)
    }
}

/// The separator that stands most often in the row of names.
fn guess(path: &Path, mut file: &File) -> Result<u8, Error> {
    let mut line = Vec::new();
    let mut head = BufReader::new(file).take(LONGEST_HEAD);
    head.read_until(b'\n', &mut line).map_err(Error::io("read", path))?;
    file.rewind().map_err(Error::io("read", path))?;
    let count = |sign: u8| line.iter().filter(|byte| **byte == sign).count();
    // The first of equals: a comma.
    Ok(SEPARATORS.into_iter().rev().max_by_key(|sign| count(*sign)).unwrap_or(b','))
}

/// A file of which no more is read than is allowed: a row without an end would fill the memory.
struct Limited {
    file: File,
    read: u64,
    allowed: Rc<Cell<u64>>,
}

impl Read for Limited {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.read > self.allowed.get() {
            let text = format!("expected rows of at most {LONGEST_ROW} bytes, found a longer one");
            return Err(io::Error::new(io::ErrorKind::InvalidData, text));
        }
        let count = self.file.read(buffer)?;
        self.read += count as u64;
        Ok(count)
    }
}

fn csv_error(path: &Path, error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) if source.kind() == io::ErrorKind::InvalidData => {
            Error::Syntax { path: path.to_owned(), reason: source.to_string() }
        }
        csv::ErrorKind::Io(source) => Error::Io { action: "read", path: path.to_owned(), source },
        _ => Error::Syntax { path: path.to_owned(), reason },
    }
}
