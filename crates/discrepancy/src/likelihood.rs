//! How improbable residuals are, if an episode may go another way than its model.
//!
//! White residuals of a right model have variance 1. Where a contact went another way, they have not, whatever the rest of the model is worth. The
//! n residuals of an episode therefore follow Student's distribution with n degrees of freedom, one scale for all of them: with χ² their sum of
//! squares, −ln p = n ln(1 + χ² / n) but for a constant. Near χ² = n this is ½ χ², as for normal residuals; an episode that no model
//! explains has little say about what the others show.

use nalgebra::DVector;

/// White residuals of some episodes, one vector each.
pub type Stack = Vec<DVector<f64>>;

/// Mean square of the white residuals of a right model.
pub const NOISE_FLOOR: f64 = 1.0;

/// Those at `places`.
#[must_use]
pub fn pick(stack: &Stack, places: &[usize]) -> Stack {
    places.iter().map(|place| stack[*place].clone()).collect()
}

/// −ln p of all episodes, but for a constant.
#[must_use]
pub fn cost(stack: &Stack) -> f64 {
    stack.iter().map(|residuals| episode_cost(residuals.norm_squared(), residuals.len())).sum()
}

/// −ln p of an episode with this sum of squares.
#[must_use]
pub fn episode_cost(chi2: f64, count: usize) -> f64 {
    let n = count.max(1) as f64;
    n * (chi2 / n).ln_1p()
}

/// Mean square of residuals.
#[must_use]
pub fn mean_square(residuals: &[DVector<f64>]) -> f64 {
    let count: usize = residuals.iter().map(DVector::len).sum();
    residuals.iter().map(DVector::norm_squared).sum::<f64>() / count.max(1) as f64
}

/// Mean square of an episode that is explained.
const EXPLAINED: f64 = 1.4;

/// Whether a model explains an episode.
#[must_use]
pub fn explained(residuals: &DVector<f64>) -> bool {
    residuals.norm_squared() < EXPLAINED * residuals.len() as f64
}

/// Share of episodes that may go another way than any model.
const ODD: f64 = 0.25;

/// The mean of all but the largest `ODD` of them: an odd episode is not explained by the truth either.
#[must_use]
pub fn trimmed_mean(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.truncate(values.len() - (ODD * values.len() as f64).ceil() as usize);
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The weight of each episode in a step of least squares: −ln p has the derivative `weight` · residual.
#[must_use]
pub fn weights(stack: &Stack) -> Vec<f64> {
    stack.iter().map(|residuals| 2.0 / (1.0 + residuals.norm_squared() / residuals.len().max(1) as f64)).collect()
}

/// Sum of weighted products.
#[must_use]
pub fn dot(a: &Stack, b: &Stack, weights: &[f64]) -> f64 {
    a.iter().zip(b).zip(weights).map(|((a, b), weight)| weight * a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_one_it_is_the_normal_likelihood_and_far_out_a_logarithm() {
        let at = |chi2: f64| episode_cost(chi2, 1000);
        assert!((at(1001.0) - at(1000.0) - 0.5).abs() < 1e-3);
        // From 100 to 50 standard deviations: n ln 4 instead of 3 750 000.
        assert!((at(1e7) - at(2.5e6) - 1000.0 * 4.0_f64.ln()).abs() < 1.0);
    }

    #[test]
    fn weights_are_those_of_the_gradient() {
        let stack = vec![DVector::from_vec(vec![3.0, -1.0, 0.5]), DVector::from_vec(vec![0.1, 0.2])];
        let weights = weights(&stack);
        for (episode, row) in [(0, 0), (0, 2), (1, 1)] {
            let mut moved = stack.clone();
            moved[episode][row] += 1e-6;
            let slope = (cost(&moved) - cost(&stack)) / 1e-6;
            assert!((slope - weights[episode] * stack[episode][row]).abs() < 1e-5, "{slope}");
        }
        assert_eq!(dot(&stack, &stack, &[1.0, 0.0]), 10.25);
    }
}
