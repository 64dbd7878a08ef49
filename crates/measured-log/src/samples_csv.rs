//! `samples.csv`.

use std::fmt::Write as _;
use std::io::Read;

use crate::columns::{Cell, Columns, Role};
use crate::error::Problem;
use crate::{Episode, Robot};

/// Reads all rows. Cells may be quoted and have spaces around them.
pub(crate) fn decode(file: impl Read, robot: Robot) -> Result<Vec<Episode>, Failure> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(file);
    let names = reader.byte_headers().map_err(Failure::Csv)?.clone();
    let names: Vec<String> = names
        .iter()
        .map(|name| match std::str::from_utf8(name) {
            Ok(name) => Ok(name.to_string()),
            Err(_) => {
                let found = crate::error::excerpt(&String::from_utf8_lossy(name));
                Err(Problem::column(found.trim_matches('`'), "expected UTF-8 text"))
            }
        })
        .collect::<Result<_, _>>()?;
    let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
    // Spreadsheets begin with a byte order mark.
    if let Some(first) = names.first_mut() {
        *first = first.trim_start_matches('\u{feff}');
    }
    let roles = Role::of(&names, robot)?;
    let mut columns = Columns::new(&roles);
    let mut record = csv::ByteRecord::new();
    let mut row = 0;
    while reader.read_byte_record(&mut record).map_err(Failure::Csv)? {
        if record.len() != roles.len() {
            return Err(Failure::Cells { row, expected: roles.len(), found: record.len() });
        }
        for (role, cell) in roles.iter().zip(&record) {
            let cell = match std::str::from_utf8(cell) {
                Ok("") => Cell::Missing,
                Ok(text) => Cell::Text(text),
                Err(_) => {
                    let found = crate::error::excerpt(&String::from_utf8_lossy(cell));
                    return Err(Problem::cell(row, role.name(), "UTF-8 text", &found).into());
                }
            };
            columns.push(*role, row, cell)?;
        }
        row += 1;
    }
    Ok(columns.into_episodes())
}

/// Why no rows could be read.
#[derive(Debug)]
pub(crate) enum Failure {
    Csv(csv::Error),
    Cells { row: usize, expected: usize, found: usize },
    Problem(Problem),
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        Self::Problem(problem)
    }
}

/// CSV text of valid episodes: the shortest decimal of each number that reads back to the same bits.
pub(crate) fn encode(episodes: &[Episode]) -> String {
    let mut text = String::from("episode,time_secs");
    if let Some(first) = episodes.first() {
        if first.action.is_some() {
            text.push_str(",action");
        }
        for channel in first.channels.keys() {
            let _ = write!(text, ",{}", channel.name());
        }
    }
    text.push('\n');
    for episode in episodes {
        for (row, time) in episode.time_secs.iter().enumerate() {
            let _ = write!(text, "{},{time:?}", episode.id);
            if let Some(action) = &episode.action {
                text.push(',');
                if let Some(action) = action[row] {
                    let _ = write!(text, "{action}");
                }
            }
            for readings in episode.channels.values() {
                text.push(',');
                if let Some(value) = readings.get(row) {
                    let _ = write!(text, "{value:?}");
                }
            }
            text.push('\n');
        }
    }
    text
}
