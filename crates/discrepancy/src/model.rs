//! A model as a vector: coordinates of the nominal model's tunables, sizes of the engine's errors (see [`crate::study`]), then coordinates of
//! the effects that it is given. All have prior N(0, 1).

use crate::candidate::Candidate;
use crate::clock::Clock;
use crate::simulator::Hypothesis;

/// Re-tuning reaches this many prior standard deviations.
const TUNABLE_RANGE: f64 = 8.0;
/// Errors of the engine reach this many standard deviations.
const ERROR_RANGE: f64 = 4.0;
/// Step of a finite difference.
pub(crate) const STEP: f64 = 0.2;

/// What is fitted.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Number of the nominal model's tunables.
    pub tunables: usize,
    /// Number of clocks among them, the first ones.
    pub clocks: usize,
    /// Number of the engine's errors.
    pub errors: usize,
    /// Effects.
    pub parts: Vec<Candidate>,
}

impl Model {
    /// The nominal model alone.
    #[must_use]
    pub fn nominal(tunables: usize, errors: usize) -> Self {
        Self { tunables, clocks: 0, errors, parts: Vec::new() }
    }

    /// Of whose tunables the first are so many clocks.
    #[must_use]
    pub fn with_clocks(self, clocks: usize) -> Self {
        Self { clocks, ..self }
    }

    /// With a further effect.
    #[must_use]
    pub fn with(&self, part: &Candidate) -> Self {
        let mut parts = self.parts.clone();
        parts.push(part.clone());
        Self { parts, ..*self }
    }

    /// Number of coordinates.
    #[must_use]
    pub fn count(&self) -> usize {
        self.tunables + self.errors + self.parts.iter().map(|part| part.coordinates.len()).sum::<usize>()
    }

    /// Number of those of which a simulation depends.
    #[must_use]
    pub fn simulated(&self) -> usize {
        self.count() - self.errors - self.clocks
    }

    /// Range of a coordinate.
    #[must_use]
    pub fn range(&self, index: usize) -> [f64; 2] {
        match index.checked_sub(self.tunables) {
            None if index < self.clocks => Clock::ALL[index].range(),
            None => [-TUNABLE_RANGE, TUNABLE_RANGE],
            Some(index) if index < self.errors => [-ERROR_RANGE, ERROR_RANGE],
            Some(index) => {
                let mut index = index - self.errors;
                for part in &self.parts {
                    if index < part.coordinates.len() {
                        return part.coordinates[index].range;
                    }
                    index -= part.coordinates.len();
                }
                [0.0, 0.0]
            }
        }
    }

    /// Step of a finite difference at `x`, away from a border.
    #[must_use]
    pub fn step(&self, x: &[f64], index: usize) -> f64 {
        if index < self.clocks {
            return Clock::ALL[index].step(x[index]);
        }
        if x[index] + STEP <= self.range(index)[1] { STEP } else { -STEP }
    }

    /// Sizes of the engine's errors at `x`.
    #[must_use]
    pub fn engine_errors<'a>(&self, x: &'a [f64]) -> &'a [f64] {
        &x[self.tunables..self.tunables + self.errors]
    }

    /// Whether a coordinate is one of the engine's errors: it changes residuals, and no simulation.
    #[must_use]
    pub fn is_engine_error(&self, index: usize) -> bool {
        (self.tunables..self.tunables + self.errors).contains(&index)
    }

    /// The hypothesis at `x`.
    #[must_use]
    pub fn hypothesis(&self, x: &[f64]) -> Hypothesis {
        let (z, rest) = x.split_at(self.tunables);
        let mut rest = &rest[self.errors..];
        let mut effects = Vec::with_capacity(self.parts.len());
        for part in &self.parts {
            let (own, others) = rest.split_at(part.coordinates.len());
            effects.push(part.effect(own));
            rest = others;
        }
        Hypothesis { z: z.to_vec(), effects }
    }

    /// What the prior says beyond N(0, 1): a coordinate that is looked for on one side alone has twice the density there.
    #[must_use]
    pub fn one_sided(&self) -> usize {
        (self.tunables + self.errors..self.count())
            .filter(|index| {
                let [low, high] = self.range(*index);
                low == 0.0 || high == 0.0
            })
            .count()
    }
}
