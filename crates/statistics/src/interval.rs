//! Confidence intervals of success rates.

use statrs::distribution::{ContinuousCDF as _, Normal};

/// 95 % Wilson score interval of `successes` out of `trials` (Wilson 1927); [0, 1] for no trials.
#[must_use]
pub fn wilson95(successes: u32, trials: u32) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let z = Normal::standard().inverse_cdf(0.975);
    let (n, p) = (f64::from(trials), f64::from(successes) / f64::from(trials));
    let scale = 1.0 + z * z / n;
    let center = (p + z * z / (2.0 * n)) / scale;
    let half = z / scale * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    // At the ends the formula gives 0 and 1 up to rounding.
    let low = if successes == 0 { 0.0 } else { (center - half).max(0.0) };
    let high = if successes >= trials { 1.0 } else { (center + half).min(1.0) };
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_interval_has_the_published_values() {
        // Newcombe (1998), Table I: 81/263, 15/148, 0/20, 1/29 by the score method without continuity correction.
        for (successes, trials, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let [a, b] = wilson95(successes, trials);
            assert!((a - low).abs() < 5e-5 && (b - high).abs() < 5e-5, "{successes}/{trials}: [{a}, {b}]");
        }
        assert_eq!(wilson95(0, 0), [0.0, 1.0]);
        for trials in 1..200 {
            assert_eq!((wilson95(0, trials)[0], wilson95(trials, trials)[1]), (0.0, 1.0));
        }
    }
}
