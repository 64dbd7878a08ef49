//! The Gaussian that has the mean and covariance of weighted points.

use pomdp::Rng;
use rand_distr::{Distribution as _, StandardNormal};

/// Smallest share of a coordinate's variance that the coordinates before it may leave unexplained in a covariance that counts as regular.
const REGULAR: f64 = 1e-9;

/// Gaussian in d coordinates. Some may be certain (variance 0).
#[derive(Clone, Debug)]
pub(crate) struct Gaussian {
    pub(crate) mean: Vec<f64>,
    /// Lower triangle L of L Lᵀ = covariance, row by row.
    factor: Vec<f64>,
}

impl Gaussian {
    /// Moments of `points` with `weights`, whose sum is positive. Too few points for a covariance give a diagonal one.
    pub(crate) fn fit(points: &[&[f64]], weights: &[f64]) -> Self {
        let d = points[0].len();
        let total: f64 = weights.iter().sum();
        let mut mean = vec![0.0; d];
        for (point, w) in points.iter().zip(weights) {
            mean.iter_mut().zip(*point).for_each(|(m, x)| *m += w / total * x);
        }
        let mut covariance = vec![0.0; d * d];
        for (point, w) in points.iter().zip(weights) {
            for i in 0..d {
                for j in 0..=i {
                    covariance[i * d + j] += w / total * (point[i] - mean[i]) * (point[j] - mean[j]);
                }
            }
        }
        let factor = cholesky(&covariance, d).unwrap_or_else(|| {
            let diagonal = |at: usize| if at / d == at % d { covariance[at].sqrt() } else { 0.0 };
            (0..d * d).map(diagonal).collect()
        });
        Self { mean, factor }
    }

    /// `centre` + `scale` L z, where z is standard normal.
    pub(crate) fn around(&self, centre: &[f64], scale: f64, rng: &mut Rng) -> Vec<f64> {
        let d = centre.len();
        let z: Vec<f64> = (0..d).map(|_| StandardNormal.sample(rng)).collect();
        (0..d).map(|i| centre[i] + scale * (0..=i).map(|j| self.factor[i * d + j] * z[j]).sum::<f64>()).collect()
    }

    /// L⁻¹ (x − `centre`); coordinates that are certain give 0 where they agree, else infinity.
    pub(crate) fn whitened(&self, x: &[f64], centre: &[f64]) -> Vec<f64> {
        let d = x.len();
        let mut z = vec![0.0; d];
        for i in 0..d {
            let explained: f64 = (0..i).map(|j| self.factor[i * d + j] * z[j]).sum();
            let rest = x[i] - centre[i] - explained;
            let stddev = self.factor[i * d + i];
            let agrees = rest.abs() <= 1e-9 * (1.0 + x[i].abs());
            z[i] = if stddev > 0.0 {
                rest / stddev
            } else if agrees {
                0.0
            } else {
                f64::INFINITY
            };
        }
        z
    }

    /// ln of the density at `x`. Coordinates that are certain must agree, and count nothing then.
    pub(crate) fn log_density(&self, x: &[f64]) -> f64 {
        let d = x.len();
        let z = self.whitened(x, &self.mean);
        let uncertain = |i: &usize| self.factor[i * d + i] > 0.0;
        let constant = 0.5 * (2.0 * std::f64::consts::PI).ln();
        let volume: f64 = (0..d).filter(uncertain).map(|i| self.factor[i * d + i].ln() + constant).sum();
        -0.5 * z.iter().map(|z| z * z).sum::<f64>() - volume
    }
}

/// Cholesky factor of a covariance given by its lower triangle; `None` where it is (nearly) singular.
fn cholesky(covariance: &[f64], d: usize) -> Option<Vec<f64>> {
    let mut factor = vec![0.0; d * d];
    for i in 0..d {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| factor[i * d + k] * factor[j * d + k]).sum();
            let rest = covariance[i * d + j] - sum;
            if i != j {
                factor[i * d + j] = rest / factor[j * d + j];
            } else if rest > REGULAR * covariance[i * d + i] {
                factor[i * d + i] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(factor)
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    #[test]
    fn draws_have_the_moments_of_the_points_and_the_density_is_theirs() {
        let points: [&[f64]; 4] = [&[0.0, 1.0], &[2.0, 4.0], &[1.0, 0.0], &[3.0, 2.0]];
        let weights = [1.0, 2.0, 3.0, 2.0];
        let fit = Gaussian::fit(&points, &weights);
        // By hand, in 64ths: see the values.
        assert_eq!(fit.mean, [1.625, 1.625]);
        let [xx, yy, xy] = [63.0 / 64.0, 159.0 / 64.0, 55.0 / 64.0];
        let direct = |x: f64, y: f64| {
            let (dx, dy, det) = (x - 1.625, y - 1.625, xx * yy - xy * xy);
            let quadratic = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det;
            -0.5 * quadratic - 0.5 * det.ln() - (2.0 * std::f64::consts::PI).ln()
        };
        assert!((fit.log_density(&[0.3, 2.0]) - direct(0.3, 2.0)).abs() < 1e-12);
        // Null: the draws' second moments, n = 40,000. The relative standard error of a variance is √(2/n); that of the
        // covariance is at most that of the geometric mean. Tolerance: 4 of them, 2.8 %.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut sums = [0.0; 3];
        for _ in 0..40_000 {
            let v = fit.around(&fit.mean, 1.0, &mut rng);
            let (dx, dy) = (v[0] - 1.625, v[1] - 1.625);
            [dx * dx, dy * dy, dx * dy].iter().zip(&mut sums).for_each(|(m, s)| *s += m / 40_000.0);
        }
        assert!((sums[0] / xx - 1.0).abs() < 0.029 && (sums[1] / yy - 1.0).abs() < 0.029, "{sums:?}");
        assert!((sums[2] - xy).abs() < 0.029 * (xx * yy).sqrt(), "{sums:?}");
    }

    #[test]
    fn certain_coordinates_stay_and_few_points_give_a_diagonal() {
        let fit = Gaussian::fit(&[&[1.0, 5.0], &[3.0, 5.0]], &[1.0, 1.0]);
        let mut rng = Seed(1).stream(Purpose::Test, 1);
        assert_eq!(fit.around(&[2.0, 5.0], 1.0, &mut rng)[1], 5.0);
        let standard = -0.5 * (2.0 * std::f64::consts::PI).ln();
        assert!((fit.log_density(&[2.0, 5.0]) - standard).abs() < 1e-12);
        assert_eq!(fit.log_density(&[2.0, 5.1]), f64::NEG_INFINITY);
        let line = Gaussian::fit(&[&[1.0, 1.0], &[3.0, 3.0]], &[1.0, 1.0]);
        assert!((line.log_density(&[2.0, 2.0]) - 2.0 * standard).abs() < 1e-12);
    }
}
