//! Settings of the resample–move filter.

use crate::Error;
use crate::config::{MOST_ATTEMPTS, MOST_PARTICLES, require};

/// Settings of [`crate::ResampleMoveFilter`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schemars", schemars(description = "Settings of `ResampleMoveFilter`."))]
pub struct ResampleMoveConfig {
    /// Particles.
    pub particles: usize,
    /// Share of the particles below which the effective sample size makes the filter resample and move, in [0, 1].
    pub resample_share: f64,
    /// Transitions that the moves of one update may simulate. The step of the particles themselves comes on top.
    pub move_transitions: usize,
    /// Moves that each particle tries after a resampling, at most.
    pub sweeps: usize,
}

impl Default for ResampleMoveConfig {
    fn default() -> Self {
        Self { particles: 200, resample_share: 0.5, move_transitions: 10_000, sweeps: 10 }
    }
}

impl ResampleMoveConfig {
    /// Whether all values are within their limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`], naming the first value that is not.
    pub fn validate(&self) -> Result<(), Error> {
        let most = format!("between 1 and {MOST_PARTICLES}");
        require((1..=MOST_PARTICLES).contains(&self.particles), "particles", &self.particles, most)?;
        require((0.0..=1.0).contains(&self.resample_share), "resample_share", &self.resample_share, "in [0, 1]")?;
        let most = format!("at most {MOST_ATTEMPTS}");
        require(self.move_transitions <= MOST_ATTEMPTS, "move_transitions", &self.move_transitions, most.as_str())?;
        require(self.sweeps <= MOST_ATTEMPTS, "sweeps", &self.sweeps, most)
    }
}
