//! Measured against simulated courses of a component, for plots.

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

impl Trial {
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
