//! The exact test of paired differences.

/// Two-sided p value of the exact sign-flip test: the probability that the sum of `differences`, each with a random sign, is as far from 0 as it
/// is or farther (Fisher's randomisation test of paired differences, 1935). Of differences of ±1 this is McNemar's exact test (1947).
#[must_use]
pub fn sign_flip(differences: impl Iterator<Item = i32>) -> f64 {
    let differences: Vec<i32> = differences.filter(|difference| *difference != 0).collect();
    let found = differences.iter().sum::<i32>().unsigned_abs() as usize;
    let reach: usize = differences.iter().map(|difference| difference.unsigned_abs() as usize).sum();
    // Probability of each sum from -reach on.
    let mut chance = vec![0.0; 2 * reach + 1];
    chance[reach] = 1.0;
    for difference in &differences {
        let step = difference.unsigned_abs() as usize;
        let one = |sum: Option<usize>| sum.and_then(|sum| chance.get(sum)).copied().unwrap_or(0.0);
        chance = (0..chance.len()).map(|sum| 0.5 * (one(sum.checked_sub(step)) + one(Some(sum + step)))).collect();
    }
    let tails = chance.iter().enumerate().filter(|(sum, _)| sum.abs_diff(reach) >= found);
    tails.map(|(_, chance)| chance).sum::<f64>().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_differences_of_one_the_p_value_is_that_of_mcnemar() {
        let mcnemar = |a: usize, b: usize| sign_flip([vec![1; a], vec![-1; b], vec![0; 7]].concat().into_iter());
        assert_eq!(mcnemar(0, 0), 1.0);
        assert_eq!(mcnemar(3, 3), 1.0);
        // 2 (1 + 10) / 2^10 and 2 / 2^5.
        assert!((mcnemar(1, 9) - 22.0 / 1024.0).abs() < 1e-12);
        assert!((mcnemar(5, 0) - 2.0 / 32.0).abs() < 1e-12);
    }

    #[test]
    fn larger_differences_weigh_more() {
        // 2, 1 and -1: |sum| is 2 or more in 6 of 8.
        assert!((sign_flip([2, 1, -1].into_iter()) - 0.75).abs() < 1e-12);
    }
}
