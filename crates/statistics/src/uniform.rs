//! Whether counts are those of equally likely bins.

use statrs::distribution::{ChiSquared, ContinuousCDF as _};

/// Counts a bin.
const LEAST: usize = 5;

/// Probability that counts of equally likely bins differ from each other as much or more, by χ² (Pearson 1900); `None` for fewer than two bins, and for
/// fewer than five counts a bin, where χ² is no approximation.
#[must_use]
pub fn uniform_p(counts: &[usize]) -> Option<f64> {
    let total: usize = counts.iter().sum();
    let degrees = counts.len().checked_sub(1).filter(|degrees| *degrees > 0 && total >= LEAST * counts.len())?;
    let expected = total as f64 / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|count| (*count as f64 - expected).powi(2) / expected).sum();
    Some(ChiSquared::new(degrees as f64).ok()?.sf(chi2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_tables() {
        // SciPy 1.16, scipy.stats.chisquare.
        let table: [(&[usize], f64); 4] = [
            (&[5098, 4902], 0.049_995_790),
            (&[5, 8, 9, 8, 10, 20], 0.019_905_220),
            (&[19, 1, 10, 10, 10, 10, 10, 10, 10, 10], 0.062_820_718),
            (&[16, 6, 9, 12, 8, 10, 13, 5, 11, 10], 0.383_826_517),
        ];
        for (counts, p) in table {
            let found = uniform_p(counts).unwrap();
            assert!((found - p).abs() < 1e-8, "{counts:?}: {found}");
        }
        let even = uniform_p(&[7; 10]).unwrap();
        assert!((even - 1.0).abs() < 1e-12, "{even}");
        assert_eq!((uniform_p(&[]), uniform_p(&[30]), uniform_p(&[4, 5])), (None, None, None));
    }
}
