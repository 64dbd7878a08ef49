//! Sets of up to 32 actions as bits, so that a policy chooses among them without an allocation.

use pomdp::{ActionPrior, Rng};
use rand::RngExt as _;

/// Set of action numbers below 32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Actions(pub u32);

impl Actions {
    /// Whether it holds `action`.
    #[must_use]
    pub fn contains(self, action: usize) -> bool {
        self.0 >> action & 1 == 1
    }

    /// A member drawn uniformly.
    ///
    /// # Panics
    ///
    /// Where the set is empty.
    #[must_use]
    #[inline]
    pub fn choose(self, rng: &mut Rng) -> usize {
        assert!(self.0 != 0, "no action to choose from");
        let count = self.0.count_ones();
        let mut left = self.0;
        if count > 1 {
            // The high half of draw × count: uniform to one part in 2³² / count.
            for _ in 0..(u64::from(rng.random::<u32>()) * u64::from(count)) >> 32 {
                left &= left - 1;
            }
        }
        left.trailing_zeros() as usize
    }

    /// Marks what is not a member as illegal.
    pub fn restrict(self, priors: &mut [ActionPrior]) {
        for (index, prior) in priors.iter_mut().enumerate() {
            prior.legal = self.contains(index);
        }
    }
}

/// How much a policy knows, as in POMCP 1.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knowledge {
    /// Every action is as good as any other.
    Pure,
    /// Actions that cannot be of use are left out.
    Legal,
    /// Only what the problem's heuristic prefers; legal actions where it prefers none.
    Preferred,
}

/// What POMCP 1.0 is told about a problem: by default preferred actions alone, in the tree and in rollouts (its «smart» level for both).
///
/// The advice depends on what the agent knows alone: its own place and what it measured, which the states of these problems carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Advice {
    /// Which actions a new node has: `priors` of the policy.
    pub tree: Knowledge,
    /// Which actions a rollout takes, uniformly.
    pub rollout: Knowledge,
    /// Initial visits of the preferred actions of a new node (SmartTreeCount).
    pub visits: u32,
    /// Their initial value (SmartTreeValue).
    pub value: f64,
}

impl Default for Advice {
    fn default() -> Self {
        Self { tree: Knowledge::Preferred, rollout: Knowledge::Preferred, visits: 10, value: 1.0 }
    }
}

impl Advice {
    /// Writes the priors of a node where `legal` and `preferred` actions are those given.
    pub(crate) fn write(&self, legal: Actions, preferred: Actions, priors: &mut [ActionPrior]) {
        match self.tree {
            Knowledge::Pure => {}
            Knowledge::Legal => legal.restrict(priors),
            Knowledge::Preferred if preferred == Actions::default() => legal.restrict(priors),
            Knowledge::Preferred => {
                preferred.restrict(priors);
                for prior in priors.iter_mut().filter(|p| p.legal) {
                    (prior.visits, prior.value) = (self.visits, self.value);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    #[test]
    fn members_are_drawn_evenly() {
        // Null: each of four members has probability 1/4. n = 4000, standard deviation 27.4; tolerance 4 of them.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let set = Actions(0b1010_0000_0000_0000_0000_0000_0001_0010);
        let mut counts = [0_i32; 32];
        for _ in 0..4000 {
            counts[set.choose(&mut rng)] += 1;
        }
        for (action, count) in counts.into_iter().enumerate() {
            let expected = if set.contains(action) { 1000 } else { 0 };
            assert!((count - expected).abs() <= if expected == 0 { 0 } else { 110 }, "{action}: {count}");
        }
    }
}
