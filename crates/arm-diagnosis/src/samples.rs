//! `samples.csv` of a joint log.

use std::path::Path;

use arm_dynamics::Arm;

use crate::error::{Error, refuse};
use crate::header::Header;
use crate::log::Log;

/// Size of the samples.
const MOST_BYTES: u64 = 2 << 30;
/// Rows, at most: 2 hours at 1 kHz.
const MOST_ROWS: usize = 8_000_000;

struct Columns {
    episode: Option<usize>,
    time: usize,
    position: Vec<usize>,
    velocity: Vec<usize>,
    torque: Vec<usize>,
    current: Vec<usize>,
    command: Vec<usize>,
    unread: Vec<String>,
}

impl Columns {
    fn find(path: &Path, names: &[String], arm: &Arm) -> Result<Self, Error> {
        let place = |name: &str| names.iter().position(|found| found.eq_ignore_ascii_case(name));
        let unit = |joint: usize, turning: &'static str, sliding: &'static str| {
            if arm.joints()[joint].slides { sliding } else { turning }
        };
        let all = |name: &dyn Fn(usize) -> String| -> Result<Vec<usize>, Error> {
            let found: Vec<Option<usize>> = (0..arm.joints().len()).map(|joint| place(&name(joint))).collect();
            let missing = found.iter().position(Option::is_none);
            match missing {
                None => Ok(found.into_iter().flatten().collect()),
                Some(_) if found.iter().all(Option::is_none) => Ok(Vec::new()),
                Some(joint) => {
                    let problem =
                        format!("has no column {}, expected one for each of {} joints", name(joint), found.len());
                    Err(refuse(path, &problem))
                }
            }
        };
        let columns = Self {
            episode: place("episode"),
            time: place("time_secs").ok_or_else(|| refuse(path, "has no column time_secs"))?,
            position: all(&|j| format!("joint_{j}_{}", unit(j, "rad", "m")))?,
            velocity: all(&|j| format!("joint_{j}_{}", unit(j, "rps", "mps")))?,
            torque: all(&|j| format!("joint_{}_{j}_{}", unit(j, "torque", "force"), unit(j, "nm", "n")))?,
            current: all(&|j| format!("joint_current_{j}_a"))?,
            command: all(&|j| format!("command_joint_{j}_{}", unit(j, "rad", "m")))?,
            unread: Vec::new(),
        };
        if columns.position.is_empty() {
            return Err(refuse(path, "has no columns joint_0_rad …: the measured positions"));
        }
        let read: Vec<usize> =
            [&columns.position, &columns.velocity, &columns.torque, &columns.current, &columns.command]
                .into_iter()
                .flatten()
                .copied()
                .chain([columns.time])
                .chain(columns.episode)
                .collect();
        let unread = (0..names.len()).filter(|i| !read.contains(i)).map(|i| names[i].clone()).collect();
        Ok(Self { unread, ..columns })
    }
}

/// Reads the samples into a log.
pub(crate) fn read_samples(path: &Path, header: Header, arm: Arm) -> Result<Log, Error> {
    let bytes =
        whole_file::read(path, MOST_BYTES).map_err(|error| Error::Read { path: path.into(), source: error.source })?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes.as_slice());
    let broken = |error: csv::Error| refuse(path, &in_words(&error));
    let names: Vec<String> =
        reader.headers().map_err(broken)?.iter().map(|name| name.trim_start_matches('\u{feff}').to_owned()).collect();
    if let [only] = names.as_slice()
        && let Some(separator) = [';', '\t', '|'].into_iter().find(|separator| only.contains(*separator))
    {
        return Err(refuse(path, &format!("is separated by {separator:?}, expected commas")));
    }
    let mut columns = Columns::find(path, &names, &arm)?;
    let constants = columns.currents_for_torques(path, &header)?;
    let empty = |places: &[usize]| vec![Vec::new(); places.len()];
    let mut log = Log {
        episodes: vec![0],
        time_secs: Vec::new(),
        position: empty(&columns.position),
        velocity: empty(&columns.velocity),
        torque: empty(&columns.torque),
        command: empty(&columns.command),
        unread: columns.unread.clone(),
        notes: Vec::new(),
        header,
        arm,
    };
    let mut episode = String::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(broken)? {
        if log.time_secs.len() >= MOST_ROWS {
            return Err(refuse(path, &format!("has more than {MOST_ROWS} rows")));
        }
        columns.add(path, &names, &record, &mut episode, &mut log)?;
    }
    log.episodes.push(log.time_secs.len());
    // Stamps may count from 1970: then few digits are left of what is between them.
    let first = log.time_secs.first().copied().unwrap_or(0.0);
    log.time_secs.iter_mut().for_each(|time| *time -= first);
    for (joint, values) in log.torque.iter_mut().enumerate() {
        let constant = constants.get(joint).copied().unwrap_or(1.0);
        values.iter_mut().for_each(|value| *value *= constant);
    }
    Ok(log)
}

/// What is wrong with a table.
fn in_words(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
            let line = pos.as_ref().map_or(0, csv::Position::line);
            format!("line {line} has {len} cells, expected {expected_len} as in the first line")
        }
        csv::ErrorKind::Utf8 { pos, .. } => {
            format!("line {}: expected UTF-8 text", pos.as_ref().map_or(0, csv::Position::line))
        }
        _ => "expected a table of comma-separated values".into(),
    }
}

/// Rows further apart, s, belong to different episodes: how the arm moved between them is not known.
const LONGEST_GAP_SECS: f64 = 1.0;

impl Columns {
    /// Takes currents for torques where there are no others; the torque of an ampere in each joint.
    fn currents_for_torques(&mut self, path: &Path, header: &Header) -> Result<Vec<f64>, Error> {
        if !self.torque.is_empty() || self.current.is_empty() {
            return Ok(Vec::new());
        }
        let Some(constants) = &header.gear.torque_constant_nmpa else {
            let problem = "has columns joint_current_0_a …, expected gear.torque_constant_nmpa in log.toml to make torques of them";
            return Err(refuse(path, problem));
        };
        self.torque = std::mem::take(&mut self.current);
        Ok((0..self.torque.len()).map(|joint| constants.of(joint).unwrap_or(1.0)).collect())
    }

    /// Adds a row to the log; `episode` is the one of the row before.
    fn add(
        &self,
        path: &Path,
        names: &[String],
        record: &csv::StringRecord,
        episode: &mut String,
        log: &mut Log,
    ) -> Result<(), Error> {
        let (row, line) = (log.time_secs.len(), record.position().map_or(0, csv::Position::line));
        let number = |place: usize| -> Result<f64, Error> {
            let text = record.get(place).unwrap_or("");
            if text.is_empty() || text.eq_ignore_ascii_case("nan") {
                return Ok(f64::NAN);
            }
            let value: Option<f64> = text.parse().ok();
            value.filter(|value| value.abs() < 1e9).ok_or_else(|| {
                refuse(path, &format!("line {line}, column {}: {text:?}, expected a number", names[place]))
            })
        };
        // Stamps may count from 1970.
        let text = record.get(self.time).unwrap_or("");
        let now = text.parse().ok().filter(|now: &f64| now.abs() < 1e12);
        let Some(now) = now else {
            return Err(refuse(path, &format!("line {line}: time_secs is {text:?}, expected a number of seconds")));
        };
        let here = self.episode.map_or("", |place| record.get(place).unwrap_or(""));
        if row > 0 && here != episode {
            log.episodes.push(row);
        } else if row > 0 && now <= log.time_secs[row - 1] {
            let problem =
                format!("line {line}: time_secs is {now} after {}, expected it to grow", log.time_secs[row - 1]);
            return Err(refuse(path, &problem));
        } else if row > 0 && now - log.time_secs[row - 1] > LONGEST_GAP_SECS.max(20.0 * log.header.period_secs) {
            log.episodes.push(row);
        }
        here.clone_into(episode);
        log.time_secs.push(now);
        let groups = [
            (&self.position, &mut log.position),
            (&self.velocity, &mut log.velocity),
            (&self.torque, &mut log.torque),
            (&self.command, &mut log.command),
        ];
        for (places, readings) in groups {
            for (place, values) in places.iter().zip(readings) {
                values.push(number(*place)?);
            }
        }
        Ok(())
    }
}
