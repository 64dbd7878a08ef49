//! Two methods on the same worlds.

use std::collections::BTreeMap;

use agent::Method;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, DiscreteCDF as _};

use crate::TrialRecord;

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
    /// Worlds that none solved.
    pub neither: u32,
    /// Exact McNemar test, two-sided: probability of a split at least as uneven if both were as good (McNemar 1947).
    pub p: f64,
}

impl Pair {
    fn new(first: Method, second: Method, cells: Cells) -> Self {
        let Cells { both, first_only, second_only, neither } = cells;
        Self { first, second, both, first_only, second_only, neither, p: cells.p() }
    }
}

/// Trials of a run.
pub(crate) type Trials = BTreeMap<(Method, u32), TrialRecord>;

/// Numbers of worlds by which of two solved them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cells {
    pub(crate) both: u32,
    pub(crate) first_only: u32,
    pub(crate) second_only: u32,
    pub(crate) neither: u32,
}

impl Cells {
    /// Two methods, of one run or of two, over the worlds that both have played: those of the same number.
    pub(crate) fn of(first: (&Trials, Method), second: (&Trials, Method)) -> Self {
        let mut cells = Self::default();
        for ((_, trial), one) in first.0.range((first.1, 0)..=(first.1, u32::MAX)) {
            let Some(other) = second.0.get(&(second.1, *trial)) else { continue };
            match (one.success, other.success) {
                (true, true) => cells.both += 1,
                (true, false) => cells.first_only += 1,
                (false, true) => cells.second_only += 1,
                (false, false) => cells.neither += 1,
            }
        }
        cells
    }

    /// The worlds of both.
    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            both: self.both + other.both,
            first_only: self.first_only + other.first_only,
            second_only: self.second_only + other.second_only,
            neither: self.neither + other.neither,
        }
    }

    pub(crate) fn p(self) -> f64 {
        mcnemar(self.first_only, self.second_only)
    }
}

/// Every pair of `methods`, in their order, over the worlds that both have played.
pub(crate) fn pairs(methods: &[Method], trials: &Trials) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (index, &first) in methods.iter().enumerate() {
        for &second in &methods[index + 1..] {
            pairs.push(Pair::new(first, second, Cells::of((trials, first), (trials, second))));
        }
    }
    pairs
}

/// Two-sided p-value of `a` against `b` discordant pairs: twice the smaller tail of a fair coin, at most 1.
fn mcnemar(a: u32, b: u32) -> f64 {
    let coin = Binomial::new(0.5, u64::from(a + b)).expect("a half is a probability");
    (2.0 * coin.cdf(u64::from(a.min(b)))).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_p_value_is_that_of_a_fair_coin() {
        assert_eq!(mcnemar(0, 0), 1.0);
        assert_eq!(mcnemar(3, 3), 1.0);
        // 2 (1 + 10) / 2^10 and 2 / 2^5.
        assert!((mcnemar(1, 9) - 22.0 / 1024.0).abs() < 1e-12);
        assert!((mcnemar(5, 0) - 2.0 / 32.0).abs() < 1e-12);
    }

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
    fn pooled_worlds_add_up_before_they_are_tested() {
        let cells = |first_only, second_only| Cells { both: 1, first_only, second_only, neither: 2 };
        let (d1, d2) = (cells(4, 0), cells(2, 1));
        // Alone 2 / 2^4 and 2 (1 + 3) / 2^3; together 2 (1 + 7) / 2^7.
        assert!((d1.p() - 0.125).abs() < 1e-12 && (d2.p() - 1.0).abs() < 1e-12);
        let both = d1.plus(d2);
        assert_eq!(both, Cells { both: 2, first_only: 6, second_only: 1, neither: 4 });
        assert!((both.p() - 0.125).abs() < 1e-12);
    }
}
