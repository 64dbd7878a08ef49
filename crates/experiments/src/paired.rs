//! Two methods on the same worlds.

use std::collections::BTreeMap;

use agent::Method;
use serde::{Deserialize, Serialize};
use statistics::sign_flip;

use crate::log::Trials;

/// Trials by which of two methods reached the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// One method.
    pub first: Method,
    /// The other.
    pub second: Method,
    /// Worlds that both solved.
    pub both: u32,
    /// Worlds that only the first solved.
    pub first_only: u32,
    /// Worlds that only the second solved.
    pub second_only: u32,
    /// Worlds that neither solved.
    pub neither: u32,
    /// Exact McNemar test, two-sided: probability of a split at least as uneven if both were as good (McNemar 1947).
    pub p: f64,
}

impl Pair {
    fn new(first: Method, second: Method, cells: &Cells) -> Self {
        let Cells { both, first_only, second_only, neither, .. } = *cells;
        Self { first, second, both, first_only, second_only, neither, p: cells.p() }
    }
}

/// Numbers of worlds by which of two solved them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cells {
    pub(crate) both: u32,
    pub(crate) first_only: u32,
    pub(crate) second_only: u32,
    pub(crate) neither: u32,
    /// By the number of the world: how many more the second solved. Worlds of one number share their draws in all domains.
    nets: BTreeMap<u32, i32>,
}

impl Cells {
    /// Two methods, from one run or two, over the worlds that both have played. Equal numbers are equal worlds.
    pub(crate) fn of(first: (&Trials, Method), second: (&Trials, Method)) -> Self {
        let mut cells = Self::default();
        for ((_, trial), one) in first.0.range((first.1, 0)..=(first.1, u32::MAX)) {
            let Some(other) = second.0.get(&(second.1, *trial)) else { continue };
            let (count, net) = match (one.success, other.success) {
                (true, true) => (&mut cells.both, 0),
                (true, false) => (&mut cells.first_only, -1),
                (false, true) => (&mut cells.second_only, 1),
                (false, false) => (&mut cells.neither, 0),
            };
            *count += 1;
            cells.nets.insert(*trial, net);
        }
        cells
    }

    /// The worlds of both.
    pub(crate) fn plus(mut self, other: Self) -> Self {
        for (trial, net) in other.nets {
            *self.nets.entry(trial).or_default() += net;
        }
        Self {
            nets: self.nets,
            both: self.both + other.both,
            first_only: self.first_only + other.first_only,
            second_only: self.second_only + other.second_only,
            neither: self.neither + other.neither,
        }
    }

    /// Two-sided p of a sign-flip test. Null: both are equally good, so each world's sum of differences over its
    /// domains has a random sign. For one domain this is McNemar's exact test.
    pub(crate) fn p(&self) -> f64 {
        sign_flip(self.nets.values().copied())
    }

    /// Two-sided p of McNemar's exact test of the counts. It ignores what worlds share.
    pub(crate) fn mcnemar_p(&self) -> f64 {
        let signs = [(self.first_only, -1), (self.second_only, 1)];
        sign_flip(signs.into_iter().flat_map(|(count, sign)| std::iter::repeat_n(sign, count as usize)))
    }
}

/// Every pair of `methods`, in their order, over the worlds that both have played.
pub(crate) fn pairs(methods: &[Method], trials: &Trials) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (index, &first) in methods.iter().enumerate() {
        for &second in &methods[index + 1..] {
            pairs.push(Pair::new(first, second, &Cells::of((trials, first), (trials, second))));
        }
    }
    pairs
}

/// For people, to two digits. A very small value is written as "below" a limit.
pub(crate) fn probability(p: f64) -> String {
    if p < 0.001 {
        "< 0.001".into()
    } else if p < 0.1 {
        format!("{p:.3}")
    } else {
        format!("{p:.2}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TrialRecord;

    #[test]
    fn every_world_that_both_played_falls_into_one_of_four_cells() {
        let outcomes = [(true, true), (true, false), (true, false), (false, true), (false, false)];
        let mut trials = Trials::new();
        for (trial, (first, second)) in (0_u32..).zip(outcomes) {
            for (method, success) in [(Method::NoRnn, first), (Method::RnnMax, second)] {
                trials.insert((method, trial), TrialRecord { method, trial, success, ..crate::trial::tests::record() });
            }
        }
        // A world that one of them has not played yet.
        trials.insert((Method::NoRnn, 9), crate::trial::tests::record());
        let pair = &pairs(&[Method::NoRnn, Method::RnnMax], &trials)[0];
        assert_eq!((pair.both, pair.first_only, pair.second_only, pair.neither), (1, 2, 1, 1));
        assert_eq!(pair.p, 1.0);
    }

    #[test]
    fn a_world_that_is_played_in_several_domains_counts_once() {
        let cells = |nets: &[i32]| Cells {
            first_only: nets.iter().filter(|net| **net < 0).count() as u32,
            second_only: nets.iter().filter(|net| **net > 0).count() as u32,
            nets: (0..).zip(nets.iter().copied()).collect(),
            ..Cells::default()
        };
        // Alone 2 / 2^4 and 2 (1 + 3) / 2^3.
        let (d1, d2) = (cells(&[-1, -1, -1, -1, 0]), cells(&[-1, 0, 0, 1, -1]));
        assert!((d1.p() - 0.125).abs() < 1e-12 && (d2.p() - 1.0).abs() < 1e-12);
        let both = d1.plus(d2);
        assert_eq!((both.first_only, both.second_only), (6, 1));
        // Differences of 2, 1, 1, 0, 1 in one direction: 2 / 2^4, where seven worlds would give 2 (1 + 7) / 2^7.
        assert_eq!(both.nets.values().copied().collect::<Vec<_>>(), [-2, -1, -1, 0, -1]);
        assert!((both.p() - 0.125).abs() < 1e-12 && (both.mcnemar_p() - 0.125).abs() < 1e-12);
    }
}
