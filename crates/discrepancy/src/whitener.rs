//! What residuals of a right model look like: sensor noise, and errors that last.
//!
//! A simulation that is right in all but what does not matter (solver settings, how well the start is known) leaves residuals that are
//! correlated all along an episode. Their covariance is D + V Vᵀ: in each column of V what one such cause of size one does, and D diagonal, 1 for
//! white sensor noise and (0.2 ‖v‖)² for what is not known of row v of V. With W = D^(−½) V and U S Qᵀ its singular values and
//! vectors, x ↦ y − U (1 − 1/√(1 + S²)) Uᵀ y with y = D^(−½) x makes them white.

use nalgebra::{DMatrix, DVector};

/// How well the course of an error that lasts is known: the rest is taken for noise.
const VAGUE: f64 = 0.2;

/// Makes the residuals of one episode white.
#[derive(Clone, Debug)]
pub struct Whitener {
    /// 1/√d of each residual; empty where all are 1.
    scale: DVector<f64>,
    directions: DMatrix<f64>,
    /// 1 − 1/√(1 + s²).
    shrink: DVector<f64>,
}

impl Whitener {
    /// With the given columns of V, each as long as the residuals.
    #[must_use]
    pub fn new(length: usize, columns: &[&[f64]]) -> Self {
        if columns.is_empty() {
            let nothing = DVector::zeros(0);
            return Self { scale: nothing.clone(), directions: DMatrix::zeros(length, 0), shrink: nothing };
        }
        let square = |i: usize| columns.iter().map(|column| column[i] * column[i]).sum::<f64>();
        let scale = DVector::from_fn(length, |i, _| (1.0 + VAGUE * VAGUE * square(i)).sqrt().recip());
        let w = DMatrix::from_fn(length, columns.len(), |i, j| scale[i] * columns[j][i]);
        // By the small Gram matrix: W is tall.
        let eigen = (w.transpose() * &w).symmetric_eigen();
        let kept: Vec<usize> = (0..columns.len()).filter(|i| eigen.eigenvalues[*i] > 1e-9).collect();
        let mut directions = DMatrix::zeros(length, kept.len());
        for (j, i) in kept.iter().enumerate() {
            directions.set_column(j, &(&w * eigen.eigenvectors.column(*i) / eigen.eigenvalues[*i].sqrt()));
        }
        let shrink =
            DVector::from_iterator(kept.len(), kept.iter().map(|i| 1.0 - 1.0 / (1.0 + eigen.eigenvalues[*i]).sqrt()));
        Self { scale, directions, shrink }
    }

    /// White residuals.
    #[must_use]
    pub fn apply(&self, mut x: DVector<f64>) -> DVector<f64> {
        if self.scale.is_empty() {
            return x;
        }
        x.component_mul_assign(&self.scale);
        let shares = self.directions.tr_mul(&x).component_mul(&self.shrink);
        x - &self.directions * shares
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_of_what_it_whitens_is_the_inverse_of_its_square() {
        let columns = [[1.0, 2.0, 0.0, -1.0], [0.5, 0.0, 3.0, 1.0]];
        let whitener = Whitener::new(4, &columns.each_ref().map(|column| &column[..]));
        let covariance = DMatrix::from_fn(4, 4, |i, j| {
            let product = columns.iter().map(|c| c[i] * c[j]).sum::<f64>();
            if i == j { 1.0 + (1.0 + VAGUE * VAGUE) * product } else { product }
        });
        let w = DMatrix::from_columns(
            &(0..4).map(|i| whitener.apply(DVector::from_fn(4, |j, _| f64::from(i == j)))).collect::<Vec<_>>(),
        );
        let identity = &w * covariance * w.transpose();
        assert!((identity - DMatrix::identity(4, 4)).amax() < 1e-12);
        assert_eq!(Whitener::new(2, &[]).apply(DVector::from_vec(vec![1.0, -2.0])).as_slice(), [1.0, -2.0]);
    }
}
