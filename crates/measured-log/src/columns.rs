//! The samples as columns over all episodes, as the files hold them.

use std::collections::BTreeMap;

use crate::channel::nearest;
use crate::error::{Problem, excerpt};
use crate::log::MAX_ACTION;
use crate::{Channel, Episode, MAX_ROWS, Readings, Robot};

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    Episode,
    Time,
    Action,
    Channel(Channel),
}

impl Role {
    pub(crate) fn name(self) -> String {
        match self {
            Self::Episode => "episode".into(),
            Self::Time => "time_secs".into(),
            Self::Action => "action".into(),
            Self::Channel(channel) => channel.name(),
        }
    }

    /// The roles of the columns `names`, each known and none twice.
    pub(crate) fn of(names: &[&str], robot: Robot) -> Result<Vec<Self>, Problem> {
        // With the channels of all robots, so that a column of another one is refused for that reason and not as unknown.
        let mut known = BTreeMap::new();
        for robot in [Robot::Sawyer, Robot::Jaco, robot] {
            let channels = Channel::all(robot).into_iter().map(Self::Channel);
            known.extend([Self::Episode, Self::Time, Self::Action].into_iter().chain(channels).map(|r| (r.name(), r)));
        }
        let mut roles = Vec::with_capacity(names.len());
        for name in names {
            let Some(role) = known.get(*name) else {
                let nearest = nearest(name, known.keys().map(String::as_str)).unwrap_or("episode");
                let reason = format!("expected a column of the format with its unit, such as {nearest}");
                return Err(Problem::column(excerpt(name).trim_matches('`'), reason));
            };
            if roles.contains(role) {
                return Err(Problem::column(*name, "expected once, found twice"));
            }
            roles.push(*role);
        }
        for needed in [Self::Episode, Self::Time] {
            if !roles.contains(&needed) {
                return Err(Problem::column(needed.name(), "expected in every log, found none"));
            }
        }
        Ok(roles)
    }
}

/// A cell on its way from a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cell<'a> {
    Missing,
    Text(&'a str),
    Integer(i128),
    Float(f64),
}

impl Cell<'_> {
    fn found(self) -> String {
        match self {
            Self::Missing => "an empty cell".into(),
            Self::Text(text) => excerpt(text),
            Self::Integer(value) => value.to_string(),
            Self::Float(value) => value.to_string(),
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "bounded first")]
    fn number(self) -> Result<Option<f64>, ()> {
        let value = match self {
            Self::Missing => return Ok(None),
            Self::Text(text) => text.parse().map_err(|_| ())?,
            Self::Integer(value) if value.unsigned_abs() <= 1 << 53 => value as f64,
            Self::Integer(_) => return Err(()),
            Self::Float(value) => value,
        };
        if f64::is_finite(value) { Ok(Some(value)) } else { Err(()) }
    }

    /// A whole number from 0; some tables keep those beside gaps as floats.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded first")]
    fn whole(self) -> Result<Option<u64>, ()> {
        match self {
            Self::Missing => Ok(None),
            Self::Text(text) => text.parse().map(Some).map_err(|_| ()),
            Self::Integer(value) => u64::try_from(value).map(Some).map_err(|_| ()),
            Self::Float(value) if value.fract() == 0.0 && (0.0..=9e15).contains(&value) => Ok(Some(value as u64)),
            Self::Float(_) => Err(()),
        }
    }
}

/// Columns over all rows.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    episode: Vec<u64>,
    time_secs: Vec<f64>,
    action: Option<Vec<Option<u8>>>,
    channels: BTreeMap<Channel, Readings>,
}

impl Columns {
    /// Empty columns of these roles.
    pub(crate) fn new(roles: &[Role]) -> Self {
        let mut columns = Self::default();
        for role in roles {
            match role {
                Role::Action => columns.action = Some(Vec::new()),
                Role::Channel(channel) => {
                    columns.channels.insert(*channel, Readings::default());
                }
                Role::Episode | Role::Time => {}
            }
        }
        columns
    }

    /// Appends a cell of row `row` to the column of `role`.
    pub(crate) fn push(&mut self, role: Role, row: usize, cell: Cell<'_>) -> Result<(), Problem> {
        if row >= MAX_ROWS {
            return Err(Problem::Rows { found: row + 1 });
        }
        let wrong = |expected: &str| Problem::cell(row, role.name(), expected, &cell.found());
        match role {
            Role::Episode => {
                let id = cell.whole().ok().flatten().ok_or_else(|| wrong("the whole number of an episode"))?;
                self.episode.push(id);
            }
            Role::Time => {
                let time = cell.number().ok().flatten().ok_or_else(|| wrong("a finite number of seconds"))?;
                self.time_secs.push(time);
            }
            Role::Action => {
                let expected = || wrong("a whole number from 0 to 9 or nothing");
                let action = match cell.whole().map_err(|()| expected())? {
                    None => None,
                    Some(action) => {
                        let action = u8::try_from(action).ok().filter(|a| *a <= MAX_ACTION);
                        Some(action.ok_or_else(expected)?)
                    }
                };
                self.action.get_or_insert_default().push(action);
            }
            Role::Channel(channel) => {
                let reading = cell.number().map_err(|()| wrong("a finite number or nothing"))?;
                self.channels.entry(channel).or_default().push(reading);
            }
        }
        Ok(())
    }

    /// Cut where the number of the episode changes.
    pub(crate) fn into_episodes(self) -> Vec<Episode> {
        let mut start = 0;
        self.episode
            .chunk_by(|a, b| a == b)
            .map(|run| {
                let rows = start..start + run.len();
                start = rows.end;
                Episode {
                    id: run[0],
                    time_secs: self.time_secs[rows.clone()].to_vec(),
                    action: self.action.as_ref().map(|action| action[rows.clone()].to_vec()),
                    channels: self.channels.iter().map(|(c, r)| (*c, r.slice(rows.clone()))).collect(),
                }
            })
            .collect()
    }
}
