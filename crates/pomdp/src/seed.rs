//! Named random streams: one root seed, one ChaCha8 stream per purpose and item.
//!
//! Parallel work takes a stream per item, never per thread, so results do not depend on the number of threads.

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

/// The project's only generator: portable, seekable, fast.
pub type Rng = rand_chacha::ChaCha8Rng;

/// What a stream is used for. Discriminants are append-only: changing one changes every recorded result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum Purpose {
    /// Draw of a world (Θ and initial state).
    World = 1,
    /// Noise of the true world.
    Truth = 2,
    /// Initial belief.
    InitialBelief = 3,
    /// Search.
    Search = 4,
    /// Belief update.
    Filter = 5,
    /// Draws from the learned prior.
    Suggestion = 6,
    /// Data generation policy.
    Exploration = 7,
    /// Initial weights of a network.
    Weights = 8,
    /// Order of the training examples.
    Shuffle = 9,
    /// Split of data into training and held-out parts.
    Split = 10,
    /// Dropout masks and other noise in training.
    Regularisation = 11,
    /// Bootstrap and permutation statistics.
    Statistics = 12,
    /// Tests.
    Test = 13,
    /// Noise of the size of a training target's resolution.
    Resolution = 14,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seed(pub u64);

impl Seed {
    /// Stream of `purpose` for item number `item` (an episode, a shard, a trial).
    #[must_use]
    pub fn stream(self, purpose: Purpose, item: u64) -> Rng {
        // The ChaCha key holds (root, purpose, item) side by side: no two triples share a key, so no mixing function is needed.
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&self.0.to_le_bytes());
        key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
        key[16..24].copy_from_slice(&item.to_le_bytes());
        Rng::from_seed(key)
    }

    /// Root seed of a part of the work that needs streams of its own (a trial, a shard).
    #[must_use]
    pub fn child(self, purpose: Purpose, item: u64) -> Self {
        use rand::Rng as _;
        Self(self.stream(purpose, item).next_u64())
    }
}
