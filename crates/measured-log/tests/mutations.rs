//! Whatever happens to the bytes of a log, the answer is a log or an error of one line: never a panic, never an endless loop.

use std::path::Path;

use measured_log::{Format, Notes};
use proptest::prelude::*;

/// A change of one file.
#[derive(Clone, Debug)]
enum Mutation {
    Flip { at: prop::sample::Index, bit: u8 },
    Set { at: prop::sample::Index, byte: u8 },
    Truncate { at: prop::sample::Index },
    Insert { at: prop::sample::Index, text: Vec<u8> },
    Remove { at: prop::sample::Index, length: usize },
    SwapFields { first: prop::sample::Index, second: prop::sample::Index },
    Repeat { times: usize },
}

impl Mutation {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        match self {
            Self::Flip { at, bit } => bytes[at.index(length)] ^= 1 << bit,
            Self::Set { at, byte } => bytes[at.index(length)] = *byte,
            Self::Truncate { at } => bytes.truncate(at.index(length)),
            Self::Insert { at, text } => {
                let at = at.index(length);
                bytes.splice(at..at, text.iter().copied());
            }
            Self::Remove { at, length: count } => {
                let at = at.index(length);
                bytes.drain(at..(at + count).min(length));
            }
            Self::SwapFields { first, second } => {
                let mut fields: Vec<Vec<u8>> = bytes.split(|b| *b == b',').map(<[u8]>::to_vec).collect();
                let count = fields.len();
                fields.swap(first.index(count), second.index(count));
                *bytes = fields.join(&b',');
            }
            Self::Repeat { times } => *bytes = bytes.repeat(*times),
        }
    }
}

fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    let index = any::<prop::sample::Index>;
    let nasty = [
        "NaN",
        "inf",
        "-inf",
        "1e999",
        "1e308",
        "-1e308",
        "9".repeat(400).as_str(),
        "18446744073709551616",
        "\"",
        "\"\"\"",
        "\r",
        "\n\n",
        ",",
        ",,,,",
        "\0",
        "\u{feff}",
        "[[",
        "= {",
        "2^63",
        "-0",
        "0x",
        "_",
        "é",
    ]
    .map(|text| text.as_bytes().to_vec());
    let text = prop_oneof![prop::sample::select(nasty.to_vec()), prop::collection::vec(any::<u8>(), 1..20)];
    let one = prop_oneof![
        (index(), 0..8_u8).prop_map(|(at, bit)| Mutation::Flip { at, bit }),
        (index(), any::<u8>()).prop_map(|(at, byte)| Mutation::Set { at, byte }),
        index().prop_map(|at| Mutation::Truncate { at }),
        (index(), text).prop_map(|(at, text)| Mutation::Insert { at, text }),
        (index(), 1..200_usize).prop_map(|(at, length)| Mutation::Remove { at, length }),
        (index(), index()).prop_map(|(first, second)| Mutation::SwapFields { first, second }),
        (2..4_usize).prop_map(|times| Mutation::Repeat { times }),
    ];
    prop::collection::vec(one, 1..5)
}

const HEADER: &str = include_str!("fixtures/log.toml");
const SAMPLES: &str = include_str!("fixtures/samples.csv");

fn write(dir: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(dir.join(name), bytes).unwrap();
}

/// The samples as Parquet.
fn parquet() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "log.toml", HEADER.as_bytes());
    write(folder.path(), "samples.csv", SAMPLES.as_bytes());
    let log = measured_log::read(folder.path()).unwrap();
    let dir = folder.path().join("parquet");
    measured_log::write(&dir, &log, Format::Parquet, &Notes::new()).unwrap();
    std::fs::read(dir.join("samples.parquet")).unwrap()
}

/// Reads; an error must be one line of bounded length that names a file.
fn read(dir: &Path) -> Result<bool, TestCaseError> {
    match measured_log::read(dir) {
        Ok(log) => {
            // What was accepted can be written, so it has passed all checks.
            let copy = dir.join("copy");
            measured_log::write(&copy, &log, Format::Csv, &Notes::new())
                .map_err(|e| TestCaseError::fail(e.to_string()))?;
            let again = measured_log::read(&copy).map_err(|e| TestCaseError::fail(e.to_string()))?;
            prop_assert_eq!(again, log);
            Ok(true)
        }
        Err(error) => {
            let message = error.to_string();
            prop_assert!(message.contains("log.toml") || message.contains("samples."), "{}", message);
            prop_assert!(!message.contains(char::is_control) && message.len() < 1500, "{:?}", message);
            Ok(false)
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 250, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_mutated_header_is_read_or_refused(mutations in mutations()) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = HEADER.as_bytes().to_vec();
        for mutation in &mutations {
            mutation.apply(&mut bytes);
        }
        write(folder.path(), "log.toml", &bytes);
        write(folder.path(), "samples.csv", SAMPLES.as_bytes());
        read(folder.path())?;
    }

    #[test]
    fn mutated_csv_is_read_or_refused(mutations in mutations()) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = SAMPLES.as_bytes().to_vec();
        for mutation in &mutations {
            mutation.apply(&mut bytes);
        }
        write(folder.path(), "log.toml", HEADER.as_bytes());
        write(folder.path(), "samples.csv", &bytes);
        read(folder.path())?;
    }

    #[test]
    fn mutated_parquet_is_read_or_refused(mutations in mutations()) {
        static WHOLE: std::sync::LazyLock<Vec<u8>> = std::sync::LazyLock::new(parquet);
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = WHOLE.clone();
        for mutation in &mutations {
            mutation.apply(&mut bytes);
        }
        write(folder.path(), "log.toml", HEADER.as_bytes());
        write(folder.path(), "samples.parquet", &bytes);
        read(folder.path())?;
    }
}

#[test]
fn the_unchanged_log_is_read() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "log.toml", HEADER.as_bytes());
    write(folder.path(), "samples.csv", SAMPLES.as_bytes());
    assert!(read(folder.path()).unwrap());
}
