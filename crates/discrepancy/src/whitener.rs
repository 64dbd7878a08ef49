//! What residuals of a right model look like: sensor noise, and errors that last.
//!
//! A simulation that is right in all but what does not matter (solver settings, how well the start is known) leaves residuals that are
//! correlated all along an episode. Their covariance is I + V Vᵀ: white sensor noise, and in each column of V what one such cause of size one
//! does. With D U Qᵀ the singular values and left vectors of V, x ↦ x − U (1 − 1/√(1 + D²)) Uᵀ x makes them white.

use nalgebra::{DMatrix, DVector};

/// Makes the residuals of one episode white.
#[derive(Clone, Debug)]
pub struct Whitener {
    directions: DMatrix<f64>,
    /// 1 − 1/√(1 + d²).
    shrink: DVector<f64>,
}

impl Whitener {
    /// With the given columns of V, each as long as the residuals.
    #[must_use]
    pub fn new(length: usize, columns: &[Vec<f64>]) -> Self {
        if columns.is_empty() {
            return Self { directions: DMatrix::zeros(length, 0), shrink: DVector::zeros(0) };
        }
        let v = DMatrix::from_fn(length, columns.len(), |i, j| columns[j][i]);
        // By the small Gram matrix: V is tall.
        let eigen = (v.transpose() * &v).symmetric_eigen();
        let kept: Vec<usize> = (0..columns.len()).filter(|i| eigen.eigenvalues[*i] > 1e-9).collect();
        let mut directions = DMatrix::zeros(length, kept.len());
        for (j, i) in kept.iter().enumerate() {
            directions.set_column(j, &(&v * eigen.eigenvectors.column(*i) / eigen.eigenvalues[*i].sqrt()));
        }
        let shrink =
            DVector::from_iterator(kept.len(), kept.iter().map(|i| 1.0 - 1.0 / (1.0 + eigen.eigenvalues[*i]).sqrt()));
        Self { directions, shrink }
    }

    /// White residuals.
    #[must_use]
    pub fn apply(&self, residuals: &[f64]) -> DVector<f64> {
        let x = DVector::from_column_slice(residuals);
        if self.shrink.is_empty() {
            return x;
        }
        let shares = self.directions.tr_mul(&x).component_mul(&self.shrink);
        x - &self.directions * shares
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_of_what_it_whitens_is_the_inverse_of_its_square() {
        let columns = [vec![1.0, 2.0, 0.0, -1.0], vec![0.5, 0.0, 3.0, 1.0]];
        let whitener = Whitener::new(4, &columns);
        let covariance =
            DMatrix::from_fn(4, 4, |i, j| f64::from(i == j) + columns.iter().map(|c| c[i] * c[j]).sum::<f64>());
        let w = DMatrix::from_columns(
            &(0..4)
                .map(|i| whitener.apply(DVector::from_fn(4, |j, _| f64::from(i == j)).as_slice()))
                .collect::<Vec<_>>(),
        );
        let identity = &w * covariance * w.transpose();
        assert!((identity - DMatrix::identity(4, 4)).amax() < 1e-12);
        assert_eq!(Whitener::new(2, &[]).apply(&[1.0, -2.0]).as_slice(), [1.0, -2.0]);
    }
}
