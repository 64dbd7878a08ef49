//! Gaussians over starts, and what lies between two of them.

use pomdp::Rng;

use super::{Kalman, log_gaussian, normal};

pub(crate) type Matrix = [[f64; 3]; 3];

/// A Gaussian over the first `size` coordinates (x_0, slope, height / 2), by mean and Cholesky factor; the others keep the prior.
#[derive(Clone)]
pub(crate) struct Gaussian {
    pub(crate) size: usize,
    pub(crate) mean: [f64; 3],
    pub(crate) factor: Matrix,
}

impl Gaussian {
    /// What a Kalman filter says of the start; `unit` is a coordinate's.
    pub(crate) fn of(kalman: &Kalman, size: usize, unit: [f64; 3]) -> Self {
        let covariance = square(|i, j| kalman.covariance[1 + i][1 + j] / (unit[i] * unit[j]));
        Self { size, mean: std::array::from_fn(|i| kalman.mean[1 + i] / unit[i]), factor: cholesky(&covariance, size) }
    }

    pub(crate) fn log_density(&self, z: [f64; 3]) -> f64 {
        let mut standard = [0.0; 3];
        let mut total = 0.0;
        for i in 0..self.size {
            let rest: f64 = (0..i).map(|j| self.factor[i][j] * standard[j]).sum();
            standard[i] = (z[i] - self.mean[i] - rest) / self.factor[i][i];
            total += log_gaussian(standard[i], 1.0) - self.factor[i][i].ln();
        }
        total
    }

    pub(crate) fn draw(&self, rng: &mut Rng) -> Vec<f64> {
        let standard: [f64; 3] = std::array::from_fn(|_| normal(rng));
        let correlated = |i: usize| self.mean[i] + (0..=i).map(|j| self.factor[i][j] * standard[j]).sum::<f64>();
        (0..3).map(|i| if i < self.size { correlated(i) } else { standard[i] }).collect()
    }

    pub(crate) fn covariance(&self) -> Matrix {
        square(|i, j| (0..self.size).map(|k| self.factor[i][k] * self.factor[j][k]).sum())
    }

    /// a^(1 − power) b^power, normalised, and ln of its integral.
    pub(crate) fn between(a: &Self, b: &Self, power: f64) -> (Self, f64) {
        let (size, shares) = (a.size, [1.0 - power, power]);
        let precisions = [a, b].map(|part| inverse(&part.covariance(), size));
        let sum = square(|i, j| shares[0] * precisions[0][i][j] + shares[1] * precisions[1][i][j]);
        let weighted: [f64; 3] = std::array::from_fn(|i| {
            let of =
                |part: &Self, precision: &Matrix| -> f64 { (0..size).map(|j| precision[i][j] * part.mean[j]).sum() };
            shares[0] * of(a, &precisions[0]) + shares[1] * of(b, &precisions[1])
        });
        let covariance = inverse(&sum, size);
        let mean = std::array::from_fn(|i| (0..size).map(|j| covariance[i][j] * weighted[j]).sum());
        let between = Self { size, mean, factor: cholesky(&covariance, size) };
        // The quotient is the same at every point.
        let at = shares[0] * a.log_density(mean) + shares[1] * b.log_density(mean);
        let log_integral = at - between.log_density(mean);
        (between, log_integral)
    }
}

fn square(entry: impl Fn(usize, usize) -> f64) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The lower triangular L with L Lᵀ = `matrix`, of its first `size` rows.
fn cholesky(matrix: &Matrix, size: usize) -> Matrix {
    let mut factor = [[0.0_f64; 3]; 3];
    for i in 0..size {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| factor[i][k] * factor[j][k]).sum::<f64>();
            factor[i][j] = if i == j { rest.sqrt() } else { rest / factor[j][j] };
        }
    }
    factor
}

/// The inverse of the first `size` rows of a symmetric positive `matrix`: Gauss and Jordan, no pivots needed.
fn inverse(matrix: &Matrix, size: usize) -> Matrix {
    let (mut left, mut right) = (*matrix, square(|i, j| f64::from(u8::from(i == j))));
    for pivot in 0..size {
        let scale = left[pivot][pivot];
        for j in 0..size {
            left[pivot][j] /= scale;
            right[pivot][j] /= scale;
        }
        for i in (0..size).filter(|i| *i != pivot) {
            let times = left[i][pivot];
            for j in 0..size {
                left[i][j] -= times * left[pivot][j];
                right[i][j] -= times * right[pivot][j];
            }
        }
    }
    right
}
