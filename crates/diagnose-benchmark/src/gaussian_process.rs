//! Gaussian-process regression: a baseline that corrects a simulation and names nothing.
//!
//! Equation 2.25 (prediction) of Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), with the covariance
//! s² (1 + exp(−‖x − x'‖² / (2 d ℓ²)) + λ δ) of standardised inputs x of d dimensions; s does not matter to the mean. Length ℓ and noise λ are those
//! of a grid that predict whole groups best that were left out (section 5.4.2 there, of groups in place of points: what is left of group g is
//! (K⁻¹)_gg⁻¹ (K⁻¹ y)_g). Neighbours in a group err alike, so that evidence, or leaving out points, would take what only that group has for a rule.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// Lengths that are tried, in standard deviations of an input times √d.
const LENGTHS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Noise that is tried, as a share of s².
const NOISES: [f64; 7] = [0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0];

/// A fitted process.
#[derive(Clone, Debug)]
pub struct GaussianProcess {
    centre: Vec<f64>,
    /// Inverse standard deviations; 0 for an input that does not vary.
    inverse_scale: Vec<f64>,
    inputs: Vec<DVector<f64>>,
    length: f64,
    /// K⁻¹ y.
    shares: DVector<f64>,
    /// Mean square of what is left of the targets of a group that was left out.
    pub left_out: f64,
}

impl GaussianProcess {
    /// Of targets y at inputs x, all inputs as long as the first, in groups that follow one another (`groups`: the number of each point's). `None`
    /// where there are none, or where groups that are left out are predicted no better than by 0.
    #[must_use]
    pub fn fit(x: &[Vec<f64>], y: &[f64], groups: &[usize]) -> Option<Self> {
        let dimensions = x.first()?.len();
        let count = x.len() as f64;
        let mean = |of: &dyn Fn(&Vec<f64>) -> f64| x.iter().map(of).sum::<f64>() / count;
        let centre: Vec<f64> = (0..dimensions).map(|i| mean(&|x| x[i])).collect();
        let inverse_scale: Vec<f64> = (0..dimensions)
            .map(|i| {
                let stddev = mean(&|x| (x[i] - centre[i]).powi(2)).sqrt();
                if stddev > f64::EPSILON * centre[i].abs().max(1.0) { stddev.recip() } else { 0.0 }
            })
            .collect();
        let inputs: Vec<DVector<f64>> = x.iter().map(|x| standardised(x, &centre, &inverse_scale)).collect();
        let squares = DMatrix::from_fn(x.len(), x.len(), |i, j| (&inputs[i] - &inputs[j]).norm_squared());
        let y = DVector::from_column_slice(y);
        let mut best = (y.norm_squared() / count, None);
        for length in LENGTHS {
            let eigen = squares.map(|square| covariance(square, length, dimensions)).symmetric_eigen();
            for noise in NOISES {
                let (shares, squared) = left_out(&eigen, noise, &y, groups)?;
                if squared / count < best.0 {
                    best = (squared / count, Some((length, shares)));
                }
            }
        }
        let (left_out, Some((length, shares))) = best else { return None };
        Some(Self { centre, inverse_scale, inputs, length, shares, left_out })
    }

    /// Posterior mean at an input.
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> f64 {
        let x = standardised(x, &self.centre, &self.inverse_scale);
        let covariances = self.inputs.iter().map(|other| covariance((other - &x).norm_squared(), self.length, x.len()));
        covariances.zip(self.shares.iter()).map(|(covariance, share)| covariance * share).sum()
    }
}

/// K⁻¹ y, and the sum of squares of what is left of each group by what the others say of it.
fn left_out(
    eigen: &SymmetricEigen<f64, nalgebra::Dyn>,
    noise: f64,
    y: &DVector<f64>,
    groups: &[usize],
) -> Option<(DVector<f64>, f64)> {
    // Rounding makes the least eigenvalues of a smooth covariance slightly negative.
    let inverse = eigen.eigenvalues.map(|value| (value.max(0.0) + noise).recip());
    let shares = &eigen.eigenvectors * eigen.eigenvectors.tr_mul(y).component_mul(&inverse);
    let mut sum = 0.0;
    let mut first = 0;
    for group in groups.chunk_by(|a, b| a == b) {
        let rows = eigen.eigenvectors.rows(first, group.len());
        let scaled = DMatrix::from_fn(group.len(), y.len(), |i, j| rows[(i, j)] * inverse[j]);
        let own = Cholesky::new(scaled * rows.transpose())?;
        sum += own.solve(&shares.rows(first, group.len()).into_owned()).norm_squared();
        first += group.len();
    }
    Some((shares, sum))
}

fn standardised(x: &[f64], centre: &[f64], inverse_scale: &[f64]) -> DVector<f64> {
    DVector::from_iterator(x.len(), x.iter().zip(centre).zip(inverse_scale).map(|((x, c), scale)| (x - c) * scale))
}

fn covariance(square: f64, length: f64, dimensions: usize) -> f64 {
    1.0 + (-0.5 * square / (length * length * dimensions as f64)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_process_of_scikit_learn() {
        // tests/peers/gaussian_process.py.
        let x: Vec<Vec<f64>> = (0..9_u32).map(|i| vec![0.3 * f64::from(i), f64::from(i * i % 5)]).collect();
        let y: Vec<f64> = x.iter().map(|x| (2.0 * x[0]).sin() + 0.1 * x[1] + 0.5).collect();
        let process = GaussianProcess::fit(&x, &y, &[0, 0, 0, 1, 1, 2, 2, 2, 2]).unwrap();
        assert_eq!(process.length, 0.5);
        assert!((process.left_out - 0.396_494_479_82).abs() < 1e-8, "{}", process.left_out);
        for (input, mean) in [([0.4, 2.0], 1.412_488_87), ([3.0, 1.0], 0.509_855_95)] {
            let found = process.predict(&input);
            assert!((found - mean).abs() < 1e-7, "{found}");
        }
    }

    #[test]
    fn noise_is_not_learnt_and_inputs_that_never_change_do_not_count() {
        use pomdp::{Purpose, Seed};
        use rand::RngExt as _;
        let mut rng = Seed(1).stream(Purpose::World, 0);
        let x: Vec<Vec<f64>> = (0..200).map(|_| vec![rng.random_range(-1.0..1.0), 3.0]).collect();
        let y: Vec<f64> = x.iter().map(|x| x[0] + rng.random_range(-0.7..0.7)).collect();
        let groups: Vec<usize> = (0..200).map(|i| i / 20).collect();
        let process = GaussianProcess::fit(&x, &y, &groups).unwrap();
        for at in [-0.9, 0.0, 0.9] {
            assert!((process.predict(&[at, 3.0]) - at).abs() < 0.2, "{at}: {}", process.predict(&[at, 3.0]));
            assert_eq!(process.predict(&[at, 3.0]), process.predict(&[at, 7.0]));
        }
        assert!(GaussianProcess::fit(&[], &[], &[]).is_none());
        assert!(GaussianProcess::fit(&x, &[0.0; 200], &groups).is_none());
    }

    #[test]
    fn what_each_group_has_for_itself_is_not_learnt() {
        // Each group at its own place with its own offset, to either side in turn.
        let x: Vec<Vec<f64>> = (0..80_u32).map(|i| vec![f64::from(i / 10), 0.01 * f64::from(i % 10)]).collect();
        let groups: Vec<usize> = (0..80).map(|i| i / 10).collect();
        let y: Vec<f64> = groups.iter().map(|group| if group % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let process = GaussianProcess::fit(&x, &y, &groups);
        assert!(process.is_none_or(|process| process.predict(&[3.0, 0.05]).abs() < 0.2));
    }
}
