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
    fn new(first: Method, second: Method, outcomes: impl Iterator<Item = (bool, bool)>) -> Self {
        let mut pair = Self { first, second, both: 0, first_only: 0, second_only: 0, neither: 0, p: 1.0 };
        for outcome in outcomes {
            let count = match outcome {
                (true, true) => &mut pair.both,
                (true, false) => &mut pair.first_only,
                (false, true) => &mut pair.second_only,
                (false, false) => &mut pair.neither,
            };
            *count += 1;
        }
        pair.p = mcnemar(pair.first_only, pair.second_only);
        pair
    }
}

/// Every pair of `methods`, in their order, over the worlds that both have played.
pub(crate) fn pairs(methods: &[Method], trials: &BTreeMap<(Method, u32), TrialRecord>) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (index, &first) in methods.iter().enumerate() {
        for &second in &methods[index + 1..] {
            let played = trials.range((first, 0)..=(first, u32::MAX));
            let outcomes = played.filter_map(|((_, trial), one)| {
                let other = trials.get(&(second, *trial))?;
                Some((one.success, other.success))
            });
            pairs.push(Pair::new(first, second, outcomes));
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
    fn every_world_falls_into_one_of_four_cells() {
        let outcomes = [(true, true), (true, false), (true, false), (false, true), (false, false)];
        let pair = Pair::new(Method::NoRnn, Method::RnnMax, outcomes.into_iter());
        assert_eq!((pair.both, pair.first_only, pair.second_only, pair.neither), (1, 2, 1, 1));
        assert_eq!(pair.p, 1.0);
    }
}
