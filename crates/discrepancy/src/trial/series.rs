//! Measured against simulated courses of a component, for plots.

use measured_log::{Axis, Channel};
use physics_model::rig::RigReading;

use super::{Course, Kind, Trial};

/// A component as read and as simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Time from the first row, s.
    pub time_secs: f64,
    /// Reading.
    pub measured: f64,
    /// What the simulation says.
    pub simulated: f64,
}

/// Where a simulation has object and tool in a row, in its units of length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Time as in the log, s.
    pub(crate) time_secs: f64,
    /// Centre of the object's shape.
    pub(crate) object: [f64; 3],
    /// Quaternion x, y, z, w.
    pub(crate) orientation: [f64; 4],
    /// Centre of the tool, where there is one.
    pub(crate) tool: Option<[f64; 3]>,
}

impl Trial {
    /// Where object and tool are in each row, as simulated.
    pub(crate) fn places(&self, start: &RigReading, readings: &[RigReading]) -> Vec<Place> {
        let course = Course { start, readings };
        let place = |(row, time): (&(usize, f64), &f64)| {
            let turn = course.orientation(*row);
            let vector = |channel: fn(Axis) -> Channel| Axis::ALL.map(|axis| course.value(channel(axis), *row));
            Place {
                time_secs: *time,
                object: vector(Channel::ObjectPosition),
                orientation: [turn.i, turn.j, turn.k, turn.w],
                tool: course.at(row.0).tool_m.map(|_| vector(Channel::Tool)),
            }
        };
        self.rows.iter().zip(&self.time_secs).map(place).collect()
    }

    /// Every reading of a component of a kind with columns, beside what was simulated; empty where nothing was read.
    #[must_use]
    pub fn compared(&self, kind: Kind, component: usize, start: &RigReading, readings: &[RigReading]) -> Vec<Compared> {
        let Some(scalar) = self.scalars.iter().find(|s| (s.kind, s.component) == (kind, component)) else {
            return Vec::new();
        };
        let course = Course { start, readings };
        let rows = scalar.values.iter().zip(&self.rows).zip(&self.time_secs);
        rows.filter_map(|((value, row), time)| {
            let simulated = course.value(scalar.channel, *row);
            Some(Compared { time_secs: time - self.time_secs[0], measured: (*value)?, simulated })
        })
        .collect()
    }
}
