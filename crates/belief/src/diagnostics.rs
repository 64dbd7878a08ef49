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
