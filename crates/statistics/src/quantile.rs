//! Quantiles by three definitions (Hyndman and Fan, "Sample quantiles in statistical packages", The American Statistician 50(4), 1996).

/// The quantile at `level` in [0, 1] by linear interpolation between order statistics (Hyndman and Fan's type 7); `None` without values. Sorts
/// the values.
#[must_use]
pub fn quantile(values: &mut [f64], level: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = values.len().checked_sub(1)? as f64 * level;
    let (low, high) = (values[at.floor() as usize], values[at.ceil() as usize]);
    Some(low + at.fract() * (high - low))
}

/// The quantile at `level` in [0, 1] by the nearest rank (type 1): one of the values; `None` where there are none.
#[must_use]
pub fn nearest_rank(values: impl IntoIterator<Item = f64>, level: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    let rank = (level * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1).min(sorted.len()).checked_sub(1)?).copied()
}

/// Of values with their weights, in ascending order of the values: the first one up to which at least the share `level` of a total weight of 1
/// lies; `None` without values.
#[must_use]
pub fn weighted_quantile(sorted: &[(f64, f64)], level: f64) -> Option<f64> {
    let mut sum = 0.0;
    let found = sorted.iter().find(|(_, weight)| {
        sum += weight;
        // Weights sum to 1 up to rounding.
        sum >= level - 1e-12
    });
    found.or(sorted.last()).map(|(value, _)| *value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_the_values_that_enclose_them() {
        let at = |level| quantile(&mut [4.0, 1.0, 3.0, 2.0], level).unwrap();
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(at), [1.0, 1.75, 2.5, 3.25, 4.0]);
        assert_eq!(quantile(&mut [7.0], 0.9), Some(7.0));
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    #[test]
    fn the_nearest_rank_is_one_of_the_values() {
        let at = |level| nearest_rank([3.0, 1.0, 2.0, 4.0], level).unwrap();
        assert_eq!([0.0, 0.25, 0.26, 0.5, 1.0].map(at), [1.0, 1.0, 2.0, 2.0, 4.0]);
        assert_eq!(nearest_rank([], 0.5), None);
    }

    #[test]
    fn weighted_quantiles_go_by_weight() {
        let values = [(1.0, 0.1), (2.0, 0.5), (3.0, 0.4)];
        let at = |level| weighted_quantile(&values, level).unwrap();
        assert_eq!([0.05, 0.1, 0.5, 0.7, 1.0].map(at), [1.0, 1.0, 2.0, 3.0, 3.0]);
        assert_eq!(weighted_quantile(&[], 0.5), None);
    }
}
