//! Choice among the actions of one node: UCB1 while searching, the highest mean at the end.

use pomdp::Rng;
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

/// What is known of one action at one node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ActionStats {
    /// Simulations that took it: N(ha).
    pub visits: u64,
    /// Mean discounted return from this node on: V(ha). Zero where there are no visits.
    pub value: f64,
}

impl ActionStats {
    /// Takes in one return.
    pub(crate) fn record(&mut self, discounted_return: f64) {
        self.visits += 1;
        self.value += (discounted_return - self.value) / self.visits as f64;
    }
}

/// Smallest and largest return seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReturnRange {
    min: f64,
    max: f64,
}

impl ReturnRange {
    /// Range of the mean returns that `stats` brings along. Without them a search in a pruned tree would begin with a range of
    /// zero, act greedily, and never widen it where the greedy action always returns the same.
    pub(crate) fn of_means(stats: &[ActionStats]) -> Self {
        let mut range = Self { min: f64::INFINITY, max: f64::NEG_INFINITY };
        for visited in stats.iter().filter(|s| s.visits > 0) {
            range.include(visited.value);
        }
        range
    }

    pub(crate) fn include(&mut self, discounted_return: f64) {
        self.min = self.min.min(discounted_return);
        self.max = self.max.max(discounted_return);
    }

    /// Largest minus smallest; zero before the first return.
    pub(crate) fn width(self) -> f64 {
        (self.max - self.min).max(0.0)
    }
}

/// Index of the action to simulate: unvisited ones first, in random order, then the largest V(ha) + c √(ln N(h) / N(ha)).
/// Ties are broken at random: where all returns are equal so far, the lowest index would otherwise be all that is ever tried.
pub(crate) fn select(stats: &[ActionStats], exploration: f64, rng: &mut Rng) -> usize {
    let unvisited = stats.iter().filter(|s| s.visits == 0).count();
    if unvisited > 0 {
        let chosen = rng.random_range(0..unvisited);
        let mut candidates = stats.iter().enumerate().filter(|(_, s)| s.visits == 0);
        return candidates.nth(chosen).expect("the draw lies below the count of the same filter").0;
    }
    let visits: u64 = stats.iter().map(|s| s.visits).sum();
    let log_visits = (visits as f64).ln();
    let (mut best, mut best_bound, mut ties) = (0, f64::NEG_INFINITY, 0_u32);
    for (index, action) in stats.iter().enumerate() {
        let bound = action.value + exploration * (log_visits / action.visits as f64).sqrt();
        if bound > best_bound {
            (best, best_bound, ties) = (index, bound, 1);
        } else if bound == best_bound {
            // One pass: the k-th of k tied candidates replaces the earlier choice with probability 1/k.
            ties += 1;
            if rng.random_range(0..ties) == 0 {
                best = index;
            }
        }
    }
    best
}

/// Index of the action to execute: highest mean return, then more visits, then the lowest index. Unvisited actions are out.
pub(crate) fn best(stats: &[ActionStats]) -> Option<usize> {
    let visited = stats.iter().enumerate().filter(|(_, s)| s.visits > 0);
    // `max_by` returns the last of equal elements; reversing makes that the lowest index.
    let best = visited.rev().max_by(|(_, a), (_, b)| a.value.total_cmp(&b.value).then(a.visits.cmp(&b.visits)));
    best.map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Rng, Seed};
    use proptest::prelude::*;

    use super::*;

    fn stats(pairs: &[(u64, f64)]) -> Vec<ActionStats> {
        pairs.iter().map(|&(visits, value)| ActionStats { visits, value }).collect()
    }

    fn rng() -> Rng {
        Seed(1).stream(Purpose::Test, 0)
    }

    #[test]
    fn the_bound_trades_mean_against_visits() {
        // ln 100 = 4.605: bounds at c = 1 are 1 + √(4.605/90) = 1.226 and 0.5 + √(4.605/10) = 1.179, at c = 2 they are
        // 1.452 and 1.857.
        let stats = stats(&[(90, 1.0), (10, 0.5)]);
        assert_eq!(select(&stats, 0.0, &mut rng()), 0);
        assert_eq!(select(&stats, 1.0, &mut rng()), 0);
        assert_eq!(select(&stats, 2.0, &mut rng()), 1);
        // The bounds cross at c = 0.5 / (0.6786 − 0.2262) = 1.1052.
        assert_eq!(select(&stats, 1.105, &mut rng()), 0);
        assert_eq!(select(&stats, 1.106, &mut rng()), 1);
    }

    #[test]
    fn unvisited_actions_come_first_and_in_every_order() {
        let mut orders = std::collections::BTreeSet::new();
        for item in 0..200 {
            let mut rng = Seed(1).stream(Purpose::Test, item);
            let mut stats = stats(&[(0, 0.0), (5, 1e9), (0, 0.0), (0, 0.0)]);
            let order: Vec<usize> = (0..3)
                .map(|_| {
                    let index = select(&stats, 1.0, &mut rng);
                    stats[index].record(0.0);
                    index
                })
                .collect();
            assert!(!order.contains(&1), "{order:?}");
            orders.insert(order);
        }
        assert_eq!(orders.len(), 6, "{orders:?}");
    }

    #[test]
    fn ties_are_shared_evenly() {
        // Null: each of three tied actions is chosen with probability 1/3. n = 3000, standard deviation 25.8; tolerance 4 of them.
        let stats = stats(&[(4, 1.0), (4, 1.0), (4, 0.0), (4, 1.0)]);
        let mut counts = [0_i32; 4];
        let mut rng = rng();
        for _ in 0..3000 {
            counts[select(&stats, 1.0, &mut rng)] += 1;
        }
        assert_eq!(counts[2], 0);
        assert!([0, 1, 3].iter().all(|&i| (counts[i] - 1000).abs() < 104), "{counts:?}");
    }

    #[test]
    fn the_final_action_has_the_highest_mean_then_more_visits_then_the_lowest_index() {
        assert_eq!(best(&stats(&[(9, 1.0), (1, 2.0), (0, 0.0)])), Some(1));
        assert_eq!(best(&stats(&[(2, 1.0), (3, 1.0), (1, 1.0)])), Some(1));
        assert_eq!(best(&stats(&[(2, 0.0), (3, 1.0), (3, 1.0)])), Some(1));
        assert_eq!(best(&stats(&[(0, 0.0), (3, -1.0)])), Some(1), "an unvisited action has no mean");
        assert_eq!(best(&stats(&[(0, 0.0)])), None);
    }

    #[test]
    fn the_range_starts_from_the_kept_means_and_is_never_negative() {
        assert_eq!(ReturnRange::of_means(&stats(&[(0, 0.0), (0, 0.0)])).width(), 0.0);
        let mut range = ReturnRange::of_means(&stats(&[(1, -3.0), (0, 50.0), (2, 4.0)]));
        assert_eq!(range.width(), 7.0);
        range.include(10.0);
        assert_eq!(range.width(), 13.0);
    }

    proptest! {
        #[test]
        fn a_running_mean_is_the_mean(returns in prop::collection::vec(-1e3..1e3_f64, 1..50)) {
            let mut stats = ActionStats::default();
            for &value in &returns {
                stats.record(value);
            }
            let mean = returns.iter().sum::<f64>() / returns.len() as f64;
            prop_assert_eq!(stats.visits, returns.len() as u64);
            prop_assert!((stats.value - mean).abs() < 1e-9, "{} is not {}", stats.value, mean);
        }
    }
}
