//! How many simulated episodes a stage may take.
//!
//! Each stage has a budget of its own. What one stage takes does not change what another may: a candidate that is screened and
//! not fitted changes no answer.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::trial::WHOLE;

/// Simulated episodes that a stage has taken, and those that it may take.
#[derive(Debug)]
pub struct Budget {
    /// In millionths of an episode: pieces count in proportion to their durations.
    taken: AtomicUsize,
    /// After so many no further effect is looked for.
    rounds: usize,
    /// After so many fits end where they are.
    fits: usize,
    /// What would end above so many does not begin.
    limit: usize,
}

impl Budget {
    /// With these limits, in the order of the fields.
    #[must_use]
    pub fn new([rounds, fits, limit]: [usize; 3]) -> Self {
        Self { taken: AtomicUsize::new(0), rounds, fits, limit }
    }

    /// Of a stage that takes what it takes.
    #[must_use]
    pub fn unlimited() -> Self {
        Self::new([usize::MAX; 3])
    }

    /// Takes millionths of an episode.
    pub(crate) fn take(&self, share: usize) {
        self.taken.fetch_add(share, Ordering::Relaxed);
    }

    /// Episodes taken so far.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.taken.load(Ordering::Relaxed).div_ceil(WHOLE)
    }

    /// Whether a further effect may be looked for.
    #[must_use]
    pub fn has_rounds(&self) -> bool {
        self.taken() < self.rounds
    }

    /// Whether fits may go on.
    #[must_use]
    pub fn has_fits(&self) -> bool {
        self.taken() < self.fits
    }

    /// Whether so many more episodes are within it.
    #[must_use]
    pub fn affords(&self, count: usize) -> bool {
        self.taken().saturating_add(count) <= self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_ends_where_its_budget_does() {
        let budget = Budget::new([2, 3, 4]);
        let states = std::array::from_fn(|_| {
            let state = [budget.has_rounds(), budget.has_fits(), budget.affords(1)];
            budget.take(WHOLE);
            state
        });
        assert_eq!(states, [[true; 3], [true; 3], [false, true, true], [false, false, true], [false; 3]]);
        assert!(Budget::unlimited().affords(usize::MAX));
    }
}
