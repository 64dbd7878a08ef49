//! Which episodes are held out.

use crate::Log;
use crate::error::Problem;

/// Indices into [`Log::episodes`], both ascending.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// The episodes that may be fitted.
    pub fit: Vec<usize>,
    /// The episodes that are kept for the comparison of before and after.
    pub holdout: Vec<usize>,
}

impl Log {
    /// The hold-out split, a function of `seed`, the episodes' ids and `split.holdout_fraction` alone: neither readings nor the order of the
    /// file matter.
    ///
    /// Each episode gets a ticket: the first 8 bytes of the BLAKE3 hash of seed and id (8 bytes each, little endian), read little endian.
    /// The round(fraction · episodes) smallest tickets (halves up) are held out. So an episode that is added moves at most one other across.
    #[must_use]
    pub fn split(&self, seed: u64) -> Split {
        let order = self.shuffled(seed);
        Split::of(&order, 0..held_out(self.header.split.holdout_fraction, order.len()))
    }

    /// The split of cross-validation that holds out part `part` of `parts`, counted from 0. Episodes are ordered by
    /// [`Self::split`]'s tickets and cut into parts whose lengths differ by at most one. Nothing is held out of a part
    /// that does not exist.
    #[must_use]
    pub fn fold(&self, seed: u64, part: usize, parts: usize) -> Split {
        let order = self.shuffled(seed);
        let end = |part: usize| part.min(parts) * order.len() / parts.max(1);
        Split::of(&order, end(part)..end(part + 1))
    }

    /// Indices of the episodes by their tickets.
    #[must_use]
    pub fn shuffled(&self, seed: u64) -> Vec<usize> {
        let mut tickets: Vec<(u64, usize)> =
            self.episodes.iter().enumerate().map(|(index, episode)| (ticket(seed, episode.id), index)).collect();
        tickets.sort_unstable();
        tickets.into_iter().map(|(_, index)| index).collect()
    }
}

impl Split {
    /// Holds out a range of an order of episodes.
    fn of(order: &[usize], held: std::ops::Range<usize>) -> Self {
        let sorted = |mut indices: Vec<usize>| {
            indices.sort_unstable();
            indices
        };
        Self { fit: sorted([&order[..held.start], &order[held.end..]].concat()), holdout: sorted(order[held].to_vec()) }
    }
}

fn ticket(seed: u64, id: u64) -> u64 {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    bytes[8..].copy_from_slice(&id.to_le_bytes());
    let mut first = [0; 8];
    first.copy_from_slice(&blake3::hash(&bytes).as_bytes()[..8]);
    u64::from_le_bytes(first)
}

/// Number of episodes that are held out.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "counts of episodes are far below 2^53 and the fraction is between 0 and 1"
)]
fn held_out(fraction: f64, episodes: usize) -> usize {
    ((fraction * episodes as f64).round() as usize).min(episodes)
}

/// Both sides need an episode.
pub(crate) fn check(fraction: f64, episodes: usize) -> Result<(), Problem> {
    let enough = |episodes: usize| (1..episodes).contains(&held_out(fraction, episodes));
    if enough(episodes) {
        return Ok(());
    }
    // More episodes never hurt: the search ends, at 1 / fraction or 1 / (1 - fraction), or says that no log is long enough.
    let needed = (episodes..=crate::MAX_ROWS).find(|n| enough(*n)).unwrap_or(crate::MAX_ROWS);
    Err(Problem::Episodes { needed: needed as u64, fraction, found: episodes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tickets_are_fixed_for_all_time() {
        // Published comparisons depend on them.
        assert_ne!(ticket(0, 1), ticket(1, 0));
        let mut order: Vec<u64> = (0..10).collect();
        order.sort_by_key(|id| ticket(1, *id));
        assert_eq!(order, [6, 8, 3, 7, 2, 1, 9, 5, 0, 4]);
    }

    #[test]
    fn both_sides_need_an_episode() {
        for (fraction, needed) in [(0.3, 2), (0.5, 2), (0.1, 5), (0.9, 6), (0.999, 501)] {
            assert_eq!(check(fraction, 0), Err(Problem::Episodes { needed, fraction, found: 0 }));
            check(fraction, usize::try_from(needed).unwrap()).unwrap();
        }
    }
}
