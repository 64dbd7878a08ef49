//! Measured against simulated courses of a component, for plots.

use physics_model::rig::RigReading;

use super::{Kind, Trial, predicted};

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
        let at = |tick: usize| match tick {
            0 => start,
            tick => readings.get(tick - 1).or(readings.last()).unwrap_or(start),
        };
        let rows = scalar.values.iter().zip(&self.rows).zip(&self.time_secs);
        rows.filter_map(|((value, (tick, share)), time)| {
            let mut simulated = predicted(at(*tick), scalar.channel);
            if *share > 0.0 {
                simulated += share * (predicted(at(tick + 1), scalar.channel) - simulated);
            }
            Some(Compared { time_secs: time - self.time_secs[0], measured: (*value)?, simulated })
        })
        .collect()
    }
}
