//! Gaussian-process regression: a baseline that corrects a simulation and names nothing.
//!
//! Equations 2.25 (prediction) and 2.30 (evidence) of Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), with the covariance
//! s² (1 + exp(−‖x − x'‖² / (2 d ℓ²)) + λ δ) of standardised inputs x of d dimensions. Length ℓ and noise λ are those of a grid that make the
//! evidence largest, the scale s² follows from them: yᵀ K⁻¹ y / n.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Lengths that are tried, in standard deviations of an input times √d.
const LENGTHS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Noise that is tried, as a share of s².
const NOISES: [f64; 5] = [0.001, 0.01, 0.1, 1.0, 10.0];

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
    /// ln evidence at its hyperparameters, with s² at its best.
    pub log_evidence: f64,
}

impl GaussianProcess {
    /// Of targets y at inputs x, all inputs as long as the first; `None` where there are none, or where the targets are 0.
    #[must_use]
    pub fn fit(x: &[Vec<f64>], y: &[f64]) -> Option<Self> {
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
        let mut best: Option<Self> = None;
        for length in LENGTHS {
            let smooth = squares.map(|square| covariance(square, length, dimensions));
            for noise in NOISES {
                let mut all = smooth.clone();
                all.set_diagonal(&all.diagonal().add_scalar(noise));
                let Some(cholesky) = Cholesky::new(all) else { continue };
                let shares = cholesky.solve(&y);
                let scale = y.dot(&shares) / count;
                let half_determinant = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
                let log_evidence = -0.5 * count * (scale.ln() + 1.0 + std::f64::consts::TAU.ln()) - half_determinant;
                if log_evidence.is_finite() && best.as_ref().is_none_or(|best| log_evidence > best.log_evidence) {
                    let (centre, inverse_scale) = (centre.clone(), inverse_scale.clone());
                    best = Some(Self { centre, inverse_scale, inputs: inputs.clone(), length, shares, log_evidence });
                }
            }
        }
        best
    }

    /// Posterior mean at an input.
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> f64 {
        let x = standardised(x, &self.centre, &self.inverse_scale);
        let covariances = self.inputs.iter().map(|other| covariance((other - &x).norm_squared(), self.length, x.len()));
        covariances.zip(self.shares.iter()).map(|(covariance, share)| covariance * share).sum()
    }
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
        let x: Vec<Vec<f64>> = (0..8_u32).map(|i| vec![0.3 * f64::from(i), f64::from(i * i % 5)]).collect();
        let y: Vec<f64> = x.iter().map(|x| (2.0 * x[0]).sin() + 0.1 * x[1] + 0.5).collect();
        let process = GaussianProcess::fit(&x, &y).unwrap();
        assert_eq!(process.length, 1.0);
        assert!((process.log_evidence + 6.155_555_594_5).abs() < 1e-8, "{}", process.log_evidence);
        for (input, mean) in [([0.4, 2.0], 1.569_165_82), ([3.0, 1.0], -0.640_544_15)] {
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
        let y: Vec<f64> = (0..200).map(|_| rng.random_range(-1.7..1.7)).collect();
        let process = GaussianProcess::fit(&x, &y).unwrap();
        for at in [-0.9, 0.0, 0.9] {
            assert!(process.predict(&[at, 3.0]).abs() < 0.4);
            assert_eq!(process.predict(&[at, 3.0]), process.predict(&[at, 7.0]));
        }
        assert!(GaussianProcess::fit(&[], &[]).is_none());
        assert!(GaussianProcess::fit(&x, &[0.0; 200]).is_none());
    }
}
