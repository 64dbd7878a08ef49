//! Choice among the actions of one node: UCB1 while searching, the highest mean at the end.

use pomdp::Rng;
use rand::RngExt as _;

use crate::Exploration;
use crate::nodes::Slot;

/// Which action of the root is executed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Choice {
    /// The one with the highest mean return; among equals the one with more visits.
    #[default]
    HighestMean,
    /// The one with the most visits; among equals the one with the higher mean. A mean over few visits is often high by chance.
    MostVisits,
}

/// What is known of one action at one node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ActionStats {
    /// Simulations that took it, and initial visits: N(ha). Zero for an illegal action.
    pub visits: u64,
    /// Mean discounted return from this node on: V(ha). Zero where there are no visits.
    pub value: f64,
}

impl ActionStats {
    /// Takes in what another tree found: the mean of the returns of both.
    pub(crate) fn merge(&mut self, other: Self) {
        self.visits += other.visits;
        if other.visits > 0 {
            self.value += (other.value - self.value) * (other.visits as f64 / self.visits as f64);
        }
    }
}

/// Smallest and largest return seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReturnRange {
    min: f64,
    max: f64,
}

impl ReturnRange {
    /// Range of the mean returns that `slots` bring along. Without them a search in a pruned tree would begin with a range of
    /// zero, act greedily, and never widen it where the greedy action always returns the same.
    pub(crate) fn of_means(slots: &[Slot]) -> Self {
        let mut range = Self { min: f64::INFINITY, max: f64::NEG_INFINITY };
        for visited in slots.iter().filter(|s| s.visits() > 0) {
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

impl Exploration {
    pub(crate) fn constant(self, returns: ReturnRange) -> f64 {
        match self {
            Self::Fixed(c) => c,
            Self::ReturnRange(factor) => factor * returns.width(),
        }
    }
}

/// Index of the action to simulate: unvisited ones first, in random order, then the largest V(ha) + c √(ln N(h) / N(ha)).
/// Ties are broken at random: where all returns are equal so far, the lowest index would otherwise be all that is ever tried.
pub(crate) fn select(slots: &[Slot], exploration: f64, rng: &mut Rng) -> usize {
    let (mut visits, mut unvisited) = (0, 0);
    for slot in slots.iter().filter(|s| s.legal()) {
        visits += u64::from(slot.visits());
        unvisited += usize::from(slot.visits() == 0);
    }
    if unvisited > 0 {
        let chosen = rng.random_range(0..unvisited);
        let mut candidates = slots.iter().enumerate().filter(|(_, s)| s.legal() && s.visits() == 0);
        return candidates.nth(chosen).expect("the draw lies below the count of the same filter").0;
    }
    let log_visits = (visits as f64).ln();
    let (mut best, mut best_bound, mut ties) = (0, f64::NEG_INFINITY, 0_u32);
    for (index, slot) in slots.iter().enumerate().filter(|(_, s)| s.legal()) {
        let bound = slot.value + exploration * (log_visits / f64::from(slot.visits())).sqrt();
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

/// The return of a simulation that took `action`, which has it recorded already; the best value instead where another action has a
/// better one than `action`.
pub(crate) fn unless_exploring(slots: &[Slot], action: usize, discounted_return: f64) -> f64 {
    let values = slots.iter().filter(|s| s.visits() > 0).map(|s| s.value);
    let best = values.fold(f64::NEG_INFINITY, f64::max);
    if slots[action].value < best { best } else { discounted_return }
}

/// Index of the action to execute: highest mean return, then more visits, then the lowest index; or visits first. Unvisited actions are
/// out.
pub(crate) fn best(stats: &[ActionStats], choice: Choice) -> Option<usize> {
    let visited = stats.iter().enumerate().filter(|(_, s)| s.visits > 0);
    // `max_by` returns the last of equal elements; reversing makes that the lowest index.
    let best = visited.rev().max_by(|(_, a), (_, b)| {
        let (means, visits) = (a.value.total_cmp(&b.value), a.visits.cmp(&b.visits));
        match choice {
            Choice::HighestMean => means.then(visits),
            Choice::MostVisits => visits.then(means),
        }
    });
    best.map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Rng, Seed};
    use proptest::prelude::*;

    use super::*;

    fn slots(pairs: &[(u32, f64)]) -> Vec<Slot> {
        pairs.iter().map(|&(visits, value)| Slot::of(visits, value)).collect()
    }

    fn stats(pairs: &[(u32, f64)]) -> Vec<ActionStats> {
        slots(pairs).into_iter().map(Slot::stats).collect()
    }

    fn rng() -> Rng {
        Seed(1).stream(Purpose::Test, 0)
    }

    #[test]
    fn the_bound_trades_mean_against_visits() {
        // ln 100 = 4.605: bounds at c = 1 are 1 + √(4.605/90) = 1.226 and 0.5 + √(4.605/10) = 1.179, at c = 2 they are
        // 1.452 and 1.857.
        let slots = slots(&[(90, 1.0), (10, 0.5)]);
        assert_eq!(select(&slots, 0.0, &mut rng()), 0);
        assert_eq!(select(&slots, 1.0, &mut rng()), 0);
        assert_eq!(select(&slots, 2.0, &mut rng()), 1);
        // The bounds cross at c = 0.5 / (0.6786 − 0.2262) = 1.1052.
        assert_eq!(select(&slots, 1.105, &mut rng()), 0);
        assert_eq!(select(&slots, 1.106, &mut rng()), 1);
    }

    #[test]
    fn unvisited_actions_come_first_and_in_every_order() {
        let mut orders = std::collections::BTreeSet::new();
        for item in 0..200 {
            let mut rng = Seed(1).stream(Purpose::Test, item);
            let mut slots = slots(&[(0, 0.0), (5, 1e9), (0, 0.0), (0, 0.0)]);
            let order: Vec<usize> = (0..3)
                .map(|_| {
                    let index = select(&slots, 1.0, &mut rng);
                    slots[index].record(0.0);
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
        let slots = slots(&[(4, 1.0), (4, 1.0), (4, 0.0), (4, 1.0)]);
        let mut counts = [0_i32; 4];
        let mut rng = rng();
        for _ in 0..3000 {
            counts[select(&slots, 1.0, &mut rng)] += 1;
        }
        assert_eq!(counts[2], 0);
        assert!([0, 1, 3].iter().all(|&i| (counts[i] - 1000).abs() < 104), "{counts:?}");
    }

    #[test]
    fn illegal_actions_are_neither_chosen_nor_counted() {
        // ln 100, as in the test above: had the illegal slot been counted, the second action would win at c = 1.
        let slots = slots(&[(90, 1.0), (u32::MAX, 1e9), (10, 0.5)]);
        assert_eq!(select(&slots, 1.105, &mut rng()), 0);
        assert_eq!(select(&slots, 1.106, &mut rng()), 2);
        assert_eq!(slots[1].stats().visits, 0);
        assert_eq!(best(&[slots[1].stats(), slots[0].stats()], Choice::HighestMean), Some(1));
    }

    #[test]
    fn a_return_passes_where_the_action_is_the_best_and_the_best_value_passes_elsewhere() {
        // Neither the value of an illegal action nor that of an unvisited one counts.
        let slots = slots(&[(9, -2.0), (u32::MAX, 1e9), (1, -3.0), (0, 0.0), (4, -2.0)]);
        assert_eq!(unless_exploring(&slots, 0, 7.0), 7.0);
        assert_eq!(unless_exploring(&slots, 0, -90.0), -90.0);
        assert_eq!(unless_exploring(&slots, 4, -90.0), -90.0, "one of two best actions");
        assert_eq!(unless_exploring(&slots, 2, 7.0), -2.0);
        assert_eq!(unless_exploring(&slots, 2, -90.0), -2.0);
    }

    #[test]
    fn the_final_action_has_the_highest_mean_then_more_visits_then_the_lowest_index() {
        assert_eq!(best(&stats(&[(9, 1.0), (1, 2.0), (0, 0.0)]), Choice::HighestMean), Some(1));
        assert_eq!(best(&stats(&[(2, 1.0), (3, 1.0), (1, 1.0)]), Choice::HighestMean), Some(1));
        assert_eq!(best(&stats(&[(2, 0.0), (3, 1.0), (3, 1.0)]), Choice::HighestMean), Some(1));
        assert_eq!(
            best(&stats(&[(0, 0.0), (3, -1.0)]), Choice::HighestMean),
            Some(1),
            "an unvisited action has no mean"
        );
        assert_eq!(best(&stats(&[(0, 0.0)]), Choice::HighestMean), None);
        let by_visits = |pairs: &[(u32, f64)]| best(&stats(pairs), Choice::MostVisits);
        assert_eq!(by_visits(&[(9, 1.0), (1, 2.0), (0, 0.0)]), Some(0));
        assert_eq!(by_visits(&[(9, 1.0), (9, 2.0), (9, 2.0), (0, 0.0)]), Some(1));
    }

    #[test]
    fn the_range_starts_from_the_kept_means_and_is_never_negative() {
        assert_eq!(ReturnRange::of_means(&slots(&[(0, 0.0), (0, 0.0)])).width(), 0.0);
        let mut range = ReturnRange::of_means(&slots(&[(1, -3.0), (0, 50.0), (2, 4.0)]));
        assert_eq!(range.width(), 7.0);
        range.include(10.0);
        assert_eq!(range.width(), 13.0);
    }

    proptest! {
        #[test]
        fn a_running_mean_is_the_mean(returns in prop::collection::vec(-1e3..1e3_f64, 1..50)) {
            let mut slot = Slot::of(0, 0.0);
            for &value in &returns {
                slot.record(value);
            }
            let mean = returns.iter().sum::<f64>() / returns.len() as f64;
            prop_assert_eq!(slot.visits() as usize, returns.len());
            prop_assert!((slot.value - mean).abs() < 1e-9, "{} is not {}", slot.value, mean);
        }

        #[test]
        fn merged_means_are_those_of_all_returns(trees in prop::collection::vec((0_u32..9, -1e3..1e3_f64), 1..9)) {
            let mut merged = ActionStats::default();
            for &(visits, value) in &trees {
                merged.merge(ActionStats { visits: u64::from(visits), value });
            }
            let visits: u32 = trees.iter().map(|t| t.0).sum();
            let total: f64 = trees.iter().map(|t| f64::from(t.0) * t.1).sum();
            prop_assert_eq!(merged.visits, u64::from(visits));
            prop_assert!((merged.value * f64::from(visits) - total).abs() < 1e-8);
        }
    }
}
