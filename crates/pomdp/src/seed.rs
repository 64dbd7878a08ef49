//! Named random streams: one root seed, one ChaCha8 stream per purpose and item.
//!
//! Parallel work takes a stream per item, never per thread, so results do not depend on the number of threads.

use rand::SeedableRng;

/// The only generator: portable, seekable, fast.
pub type Rng = rand_chacha::ChaCha8Rng;

/// What a stream is used for.
///
/// The named purposes cover planning under partial observability and learning a prior. Use [`Purpose::Custom`] for
/// others.
///
/// # Example
///
/// ```
/// use pomdp::{Purpose, Seed};
/// use rand::Rng as _;
///
/// const RAIN: Purpose = Purpose::Custom(1);
/// const TRAFFIC: Purpose = Purpose::Custom(2);
/// let seed = Seed(7);
/// assert_ne!(seed.stream(RAIN, 0).next_u64(), seed.stream(TRAFFIC, 0).next_u64());
/// // Never the same as a named purpose, whatever its number.
/// assert_ne!(seed.stream(RAIN, 0).next_u64(), seed.stream(Purpose::World, 0).next_u64());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Purpose {
    /// Draw of a world (Θ and initial state).
    World,
    /// Noise of the true world.
    Truth,
    /// Initial belief.
    InitialBelief,
    /// Search.
    Search,
    /// Belief update.
    Filter,
    /// Draws from the learned prior.
    Suggestion,
    /// Data generation policy.
    Exploration,
    /// Initial weights of a network.
    Weights,
    /// Order of the training examples.
    Shuffle,
    /// Split of data into training and held-out parts.
    Split,
    /// Dropout masks and other noise in training.
    Regularisation,
    /// Bootstrap and permutation statistics.
    Statistics,
    /// Tests.
    Test,
    /// Noise of the size of a training target's resolution.
    Resolution,
    /// A purpose of your own, with a number that you choose. Two libraries that share a root seed should each take a
    /// [`Seed::child`] of it.
    Custom(u64),
}

impl Purpose {
    /// Number of the purpose, and the space that the number belongs to: 0 for named purposes, 1 for [`Self::Custom`]. Append-only: changing a
    /// number changes every recorded result.
    fn number(self) -> (u64, u64) {
        match self {
            Self::World => (1, 0),
            Self::Truth => (2, 0),
            Self::InitialBelief => (3, 0),
            Self::Search => (4, 0),
            Self::Filter => (5, 0),
            Self::Suggestion => (6, 0),
            Self::Exploration => (7, 0),
            Self::Weights => (8, 0),
            Self::Shuffle => (9, 0),
            Self::Split => (10, 0),
            Self::Regularisation => (11, 0),
            Self::Statistics => (12, 0),
            Self::Test => (13, 0),
            Self::Resolution => (14, 0),
            Self::Custom(number) => (number, 1),
        }
    }
}

/// Root seed of a run.
///
/// # Example
///
/// ```
/// use pomdp::{Purpose, Seed};
/// use rand::Rng as _;
/// let seed = Seed(7);
/// assert_eq!(seed.stream(Purpose::Search, 3).next_u64(), seed.stream(Purpose::Search, 3).next_u64());
/// assert_ne!(seed.stream(Purpose::Search, 3).next_u64(), seed.stream(Purpose::Search, 4).next_u64());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Seed(pub u64);

impl Seed {
    /// Stream of `purpose` for item number `item`: an episode, a shard, a trial.
    #[must_use]
    pub fn stream(self, purpose: Purpose, item: u64) -> Rng {
        // The ChaCha key holds root, purpose, item and space side by side. No two of them share a key, so no mixing function is needed.
        let (number, space) = purpose.number();
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&self.0.to_le_bytes());
        key[8..16].copy_from_slice(&number.to_le_bytes());
        key[16..24].copy_from_slice(&item.to_le_bytes());
        key[24..].copy_from_slice(&space.to_le_bytes());
        Rng::from_seed(key)
    }

    /// Root seed of a part of the work that needs streams of its own (a trial, a shard).
    #[must_use]
    pub fn child(self, purpose: Purpose, item: u64) -> Self {
        use rand::Rng as _;
        Self(self.stream(purpose, item).next_u64())
    }
}

#[cfg(test)]
mod tests {
    use rand::Rng as _;

    use super::*;

    #[test]
    fn streams_stay_what_they_were() {
        // Recorded results depend on these streams. Seed 7, item 3, first number of each.
        let first = |purpose| Seed(7).stream(purpose, 3).next_u64();
        let all = [
            Purpose::World,
            Purpose::Truth,
            Purpose::InitialBelief,
            Purpose::Search,
            Purpose::Filter,
            Purpose::Suggestion,
            Purpose::Exploration,
            Purpose::Weights,
            Purpose::Shuffle,
            Purpose::Split,
            Purpose::Regularisation,
            Purpose::Statistics,
            Purpose::Test,
            Purpose::Resolution,
        ];
        for (purpose, number) in all.into_iter().zip(1_u64..) {
            let mut key = [0; 32];
            for (place, part) in [7, number, 3].into_iter().enumerate() {
                key[8 * place..8 * place + 8].copy_from_slice(&part.to_le_bytes());
            }
            assert_eq!(first(purpose), Rng::from_seed(key).next_u64(), "{purpose:?}");
        }
        let drawn = (first(Purpose::World), first(Purpose::Resolution), Seed(7).child(Purpose::World, 3));
        let expected = 5_851_584_255_930_404_047;
        assert_eq!(drawn, (expected, 10_483_954_293_300_117_920, Seed(expected)));
        let custom: Vec<u64> = (0..20).map(|number| first(Purpose::Custom(number))).collect();
        assert!(all.into_iter().all(|purpose| !custom.contains(&first(purpose))));
    }
}
