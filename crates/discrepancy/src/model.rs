//! A model as a vector: coordinates of the nominal model's tunables, then those of the effects that it is given. All have prior N(0, 1).

use crate::candidate::Candidate;
use crate::simulator::Hypothesis;

/// Re-tuning reaches this many prior standard deviations.
const TUNABLE_RANGE: f64 = 8.0;
/// Step of a finite difference.
const STEP: f64 = 0.2;

/// What is fitted.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Number of the nominal model's tunables.
    pub tunables: usize,
    /// Effects.
    pub parts: Vec<Candidate>,
}

impl Model {
    /// The nominal model alone.
    #[must_use]
    pub fn nominal(tunables: usize) -> Self {
        Self { tunables, parts: Vec::new() }
    }

    /// With a further effect.
    #[must_use]
    pub fn with(&self, part: &Candidate) -> Self {
        let mut parts = self.parts.clone();
        parts.push(part.clone());
        Self { tunables: self.tunables, parts }
    }

    /// Number of coordinates.
    #[must_use]
    pub fn count(&self) -> usize {
        self.tunables + self.parts.iter().map(|part| part.coordinates.len()).sum::<usize>()
    }

    /// Range of a coordinate.
    #[must_use]
    pub fn range(&self, index: usize) -> [f64; 2] {
        match index.checked_sub(self.tunables) {
            None => [-TUNABLE_RANGE, TUNABLE_RANGE],
            Some(mut index) => {
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
        if x[index] + STEP <= self.range(index)[1] { STEP } else { -STEP }
    }

    /// The hypothesis at `x`.
    #[must_use]
    pub fn hypothesis(&self, x: &[f64]) -> Hypothesis {
        let (z, mut rest) = x.split_at(self.tunables);
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
        (self.tunables..self.count())
            .filter(|index| {
                let [low, high] = self.range(*index);
                low == 0.0 || high == 0.0
            })
            .count()
    }
}
