//! How good a particle approximation is.

/// (Σw)² / Σw²: the number of equally weighted particles that would be worth as much (Kong, Liu and Wong 1994).
///
/// Zero where all weights are zero.
///
/// # Example
///
/// ```
/// assert_eq!(belief::effective_sample_size(&[0.25; 4]), 4.0);
/// assert_eq!(belief::effective_sample_size(&[1.0, 0.0]), 1.0);
/// ```
#[must_use]
pub fn effective_sample_size(weights: &[f64]) -> f64 {
    let largest = weights.iter().fold(0.0_f64, |a, &b| a.max(b));
    if largest == 0.0 {
        return 0.0;
    }
    // Scaled by the largest, so that the squares of tiny weights do not underflow.
    let (sum, squares) = weights.iter().map(|w| w / largest).fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
    sum * sum / squares
}

/// ln Σ exp(x), by way of the largest so that nothing overflows or all underflows; −∞ for an empty or impossible sum.
pub(crate) fn log_sum_exp(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + logs.map(|x| (x - largest).exp()).sum::<f64>().ln()
}

/// [`effective_sample_size`] of weights given by their logarithms.
pub(crate) fn log_effective_sample_size(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let sum = log_sum_exp(logs.clone());
    if sum == f64::NEG_INFINITY { 0.0 } else { (-log_sum_exp(logs.map(|x| 2.0 * (x - sum)))).exp() }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_closed_form_holds() {
        // (4 + 2)² / (16 + 4): exact in binary, scaled or not.
        assert_eq!(effective_sample_size(&[4.0, 2.0]), 1.8);
        assert_eq!(effective_sample_size(&[0.0, 0.0]), 0.0);
    }

    #[test]
    fn tiny_weights_do_not_underflow() {
        assert_eq!(effective_sample_size(&[1e-200; 5]), 5.0);
    }

    #[test]
    fn logarithms_far_from_zero_are_summed() {
        for shift in [-1e5, 0.0, 1e5] {
            let logs = [4.0_f64.ln() + shift, 2.0_f64.ln() + shift, f64::NEG_INFINITY];
            assert!((log_sum_exp(logs.into_iter()) - 6.0_f64.ln() - shift).abs() < 1e-10);
            assert!((log_effective_sample_size(logs.into_iter()) - 1.8).abs() < 1e-9);
        }
        assert_eq!(log_sum_exp([f64::NEG_INFINITY; 2].into_iter()), f64::NEG_INFINITY);
        assert_eq!(log_effective_sample_size([f64::NEG_INFINITY; 2].into_iter()), 0.0);
    }

    proptest! {
        #[test]
        fn it_lies_between_one_and_the_count_and_ignores_scale(
            weights in prop::collection::vec(1e-6..1.0_f64, 1..50),
            scale in 1e-100..1e100_f64,
        ) {
            let size = effective_sample_size(&weights);
            prop_assert!(size > 1.0 - 1e-9 && size < weights.len() as f64 + 1e-9);
            let scaled: Vec<f64> = weights.iter().map(|w| w * scale).collect();
            prop_assert!((effective_sample_size(&scaled) / size - 1.0).abs() < 1e-9);
        }
    }
}
