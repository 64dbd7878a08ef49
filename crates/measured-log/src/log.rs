//! A log: header and episodes, and what makes one valid.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use crate::error::Problem;
use crate::header::{Header, Robot, Shape};
use crate::{Axis, Channel, Component, Error, MAX_ROWS, Readings, UNIT_TOLERANCE, split};

/// A measured or simulated log.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Content of `log.toml`.
    pub header: Header,
    /// In ascending order of their ids; all have the same columns.
    pub episodes: Vec<Episode>,
}

/// One episode: rows that belong together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Episode {
    /// Number of the episode.
    pub id: u64,
    /// Time from the start of the episode, s, one a row, strictly increasing.
    pub time_secs: Vec<f64>,
    /// Discrete action that runs in each row, 0–9, `None` in between; `None` where the log has no such column.
    pub action: Option<Vec<Option<u8>>>,
    /// The columns that the log has, one cell a row.
    pub channels: BTreeMap<Channel, Readings>,
}

impl Episode {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.time_secs.len()
    }

    /// Reading of a channel in a row; `None` where it is missing or the log lacks the column.
    #[must_use]
    pub fn get(&self, channel: Channel, row: usize) -> Option<f64> {
        self.channels.get(&channel)?.get(row)
    }

    /// The three components of a vector in a row, such as `episode.vector(Channel::Tool, row)`; `None` unless all were read.
    #[must_use]
    pub fn vector(&self, channel: fn(Axis) -> Channel, row: usize) -> Option<[f64; 3]> {
        let [x, y, z] = Axis::ALL.map(|axis| self.get(channel(axis), row));
        Some([x?, y?, z?])
    }

    /// Some rows of it.
    ///
    /// # Panics
    ///
    /// If it has not so many.
    #[must_use]
    pub fn part(&self, rows: Range<usize>) -> Self {
        Self {
            id: self.id,
            time_secs: self.time_secs[rows.clone()].to_vec(),
            action: self.action.as_ref().map(|action| action[rows.clone()].to_vec()),
            channels: self.channels.iter().map(|(channel, cells)| (*channel, cells.slice(rows.clone()))).collect(),
        }
    }

    /// Orientation of the object in a row as quaternion x, y, z, w, body to base, as measured: its norm is 1 within [`UNIT_TOLERANCE`].
    #[must_use]
    pub fn orientation(&self, row: usize) -> Option<[f64; 4]> {
        let [x, y, z, w] = Component::ALL.map(|c| self.get(Channel::ObjectOrientation(c), row));
        Some([x?, y?, z?, w?])
    }
}

impl Log {
    /// Whether it has a column: all episodes have the same.
    #[must_use]
    pub fn has(&self, channel: Channel) -> bool {
        self.episodes.first().is_some_and(|episode| episode.channels.contains_key(&channel))
    }

    /// Whether it is a valid log.
    ///
    /// # Errors
    ///
    /// [`Error`] as [`crate::read`] gives for a log in the files `header` and `samples`. Rows count over all episodes.
    pub fn checked(&self, header: &Path, samples: &Path) -> Result<(), Error> {
        self.check().map_err(|problem| problem.at(header, samples))
    }

    /// The first thing that makes it no valid log; rows count over all episodes, as in the file.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        self.header.check()?;
        let rows = self.episodes.iter().map(Episode::rows).sum();
        if rows > MAX_ROWS {
            return Err(Problem::Rows { found: rows });
        }
        if let Some(first) = self.episodes.first() {
            check_columns(&self.header, first)?;
        }
        let mut first_row = 0;
        for (index, episode) in self.episodes.iter().enumerate() {
            let same = |other: &Episode| {
                other.action.is_some() == episode.action.is_some() && other.channels.keys().eq(episode.channels.keys())
            };
            if !same(&self.episodes[0]) {
                let found = format!("others in episode {}", episode.id);
                return Err(Problem::cell(first_row, "episode", "the same columns in all episodes", &found));
            }
            if index > 0 && self.episodes[index - 1].id >= episode.id {
                let found = format!("{} after {}", episode.id, self.episodes[index - 1].id);
                return Err(Problem::cell(first_row, "episode", "ascending episodes, each in one piece", &found));
            }
            self.check_episode(episode, first_row)?;
            first_row += episode.rows();
        }
        split::check(self.header.split.holdout_fraction, self.episodes.len())
    }

    fn check_episode(&self, episode: &Episode, first_row: usize) -> Result<(), Problem> {
        if episode.rows() == 0 {
            return Err(Problem::cell(first_row, "episode", "at least one row an episode", &"none"));
        }
        for (row, time) in episode.time_secs.iter().enumerate() {
            if !(*time >= 0.0 && *time <= MAX_TIME_SECS) {
                let expected = format!("a time of 0 to {MAX_TIME_SECS} s");
                return Err(Problem::cell(first_row + row, "time_secs", &expected, time));
            }
            if row > 0 && *time <= episode.time_secs[row - 1] {
                let found = format!("{time:?} after {:?}", episode.time_secs[row - 1]);
                return Err(Problem::cell(first_row + row, "time_secs", "times that increase in an episode", &found));
            }
        }
        let lengths = episode.channels.iter().map(|(c, r)| (c.name(), r.len()));
        let lengths = lengths.chain(episode.action.iter().map(|a| ("action".to_string(), a.len())));
        for (name, found) in lengths {
            if found != episode.rows() {
                return Err(Problem::column(name, format!("expected {} cells, found {found}", episode.rows())));
            }
        }
        for (row, action) in episode.action.iter().flatten().enumerate() {
            if let Some(action) = action
                && *action > MAX_ACTION
            {
                return Err(Problem::cell(first_row + row, "action", "a whole number from 0 to 9 or nothing", action));
            }
        }
        for (channel, readings) in &episode.channels {
            for (row, reading) in readings.iter().enumerate() {
                check_reading(*channel, reading)
                    .map_err(|(expected, found)| Problem::cell(first_row + row, channel.name(), &expected, &found))?;
            }
        }
        for row in 0..episode.rows() {
            if let Some(q) = episode.orientation(row) {
                let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
                if (norm - 1.0).abs() > UNIT_TOLERANCE {
                    let expected = format!("a unit quaternion, within {UNIT_TOLERANCE}");
                    return Err(Problem::cell(first_row + row, "object_qx", &expected, &format!("norm {norm}")));
                }
            }
        }
        let weights = episode.channels.get(&Channel::AddedMass);
        let mut weights = weights.iter().flat_map(|w| w.iter()).enumerate().filter_map(|(row, w)| Some((row, w?)));
        if let Some((_, first)) = weights.next()
            && let Some((row, other)) = weights.find(|(_, w)| *w != first)
        {
            let expected = "the same weight in all of an episode";
            let found = format!("{other} after {first}");
            return Err(Problem::cell(first_row + row, Channel::AddedMass.name(), expected, &found));
        }
        // A ball looks the same from all sides.
        let ball = matches!(self.header.object.shape, Shape::Sphere { .. });
        let turned = |row| ball || episode.orientation(row).is_some();
        let pose = |row| episode.vector(Channel::ObjectPosition, row).filter(|_| turned(row));
        if self.header.robot == Robot::None && !(0..episode.rows()).any(|row| pose(row).is_some()) {
            let found = format!("none in episode {}", episode.id);
            return Err(Problem::cell(first_row, "object_x_m", "a whole object pose in each episode", &found));
        }
        Ok(())
    }
}

/// Largest action.
pub(crate) const MAX_ACTION: u8 = 9;

/// A day: what is longer is a date, or another unit.
const MAX_TIME_SECS: f64 = 86_400.0;

/// Expectation and finding where a reading is not believable.
fn check_reading(channel: Channel, reading: Option<f64>) -> Result<(), (String, String)> {
    let Some(value) = reading else { return Ok(()) };
    let limit = channel.limit();
    let low = if channel == Channel::AddedMass { 0.0 } else { -limit };
    if value >= low && value <= limit { Ok(()) } else { Err((format!("{low} to {limit}"), value.to_string())) }
}

/// Refuses columns that miss their neighbours, and logs that lack what every log of the robot needs.
fn check_columns(header: &Header, episode: &Episode) -> Result<(), Problem> {
    let has = |channel: Channel| episode.channels.contains_key(&channel);
    let known = Channel::all(header.robot);
    for channel in episode.channels.keys() {
        if !known.contains(channel) {
            let reason = format!("expected no such column for robot = \"{}\"", header.robot.name());
            return Err(Problem::column(channel.name(), reason));
        }
        if let Some(missing) = channel.group().into_iter().find(|c| !has(*c)) {
            return Err(Problem::column(missing.name(), format!("expected beside {}, found none", channel.name())));
        }
        let joints = |make: fn(u8) -> Channel| (0..header.robot.joints()).map(make).find(|c| !has(*c));
        let missing = match channel {
            Channel::Joint(_) => joints(Channel::Joint),
            Channel::JointTorque(_) => joints(Channel::JointTorque),
            _ => None,
        };
        if let Some(missing) = missing {
            return Err(Problem::column(missing.name(), format!("expected beside {}, found none", channel.name())));
        }
    }
    let (position, orientation) = (Channel::ObjectPosition(Axis::X), Channel::ObjectOrientation(Component::X));
    // A ball looks the same from all sides.
    let ball = matches!(header.object.shape, Shape::Sphere { .. });
    for (one, other) in [(position, orientation), (orientation, position)] {
        if ball && one == orientation {
            continue;
        }
        if (header.robot == Robot::None || has(other)) && !has(one) {
            return Err(Problem::column(one.name(), "expected the pose of the object, found none"));
        }
    }
    let tool = [Channel::Command(Axis::X), Channel::Tool(Axis::X)];
    if header.robot == Robot::None {
        if tool.into_iter().any(has) && header.tool_radius_m.is_none() {
            return Err(Problem::key("tool_radius_m", "expected the radius of the ball whose path the log holds"));
        }
        if episode.action.is_some() {
            return Err(Problem::column("action", "expected no such column for robot = \"none\""));
        }
    } else if episode.action.is_none() && !tool.into_iter().chain([Channel::Joint(0)]).any(has) {
        let reason = "expected it or action, tool_x_m or joint_0_rad, to know what the arm did, found none";
        return Err(Problem::column("command_x_m", reason));
    }
    Ok(())
}
