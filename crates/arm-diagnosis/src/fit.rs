//! Bayesian linear regression with normal priors: coefficients, their covariance, the evidence, and what further columns would add to it in closed form
//! (for example Bishop 2006, section 3.5).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::design::{Columns, Rows};
use crate::features::Catalogue;
use crate::masses::{MassFactors, stddevs};

/// A fitted set of columns.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// Places of the columns.
    pub(crate) columns: Vec<usize>,
    pub(crate) coefficients: DVector<f64>,
    cholesky: Cholesky<f64, Dyn>,
    /// ln of the density of the target, but for what all sets share.
    pub(crate) log_evidence: f64,
}

impl Fit {
    /// Columns of `all` at `columns`, with prior standard deviations `stddevs`.
    pub(crate) fn new(all: &Columns, columns: Vec<usize>, stddevs: &[f64]) -> Option<Self> {
        let count = columns.len();
        let mut information = DMatrix::identity(count, count);
        // In units of the prior: then the prior's part is the identity, whatever the units of a column.
        for i in 0..count {
            for j in 0..=i {
                let value = all.product(columns[i], columns[j]) * stddevs[i] * stddevs[j];
                information[(i, j)] += value;
                information[(j, i)] = information[(i, j)];
            }
        }
        let right = DVector::from_fn(count, |i, _| all.with_target(columns[i]) * stddevs[i]);
        let cholesky = Cholesky::new(information)?;
        let scaled = cholesky.solve(&right);
        let log_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|value| 2.0 * value.ln()).sum();
        let squares: f64 = all.target.values.iter().map(|value| value * value).sum();
        let log_evidence = 0.5 * (right.dot(&scaled) - squares - log_determinant);
        let coefficients = DVector::from_fn(count, |i, _| scaled[i] * stddevs[i]);
        Some(Self { columns, coefficients, cholesky, log_evidence })
    }

    /// The same with nuisances no further from the nominal model than three standard deviations of their priors.
    pub(crate) fn plausible(&self, catalogue: &Catalogue, factors: &MassFactors) -> Self {
        const MOST: f64 = 3.0;
        let mut fit = self.clone();
        let spreads = stddevs(catalogue, &self.columns, factors);
        for ((column, coefficient), stddev) in self.columns.iter().zip(fit.coefficients.iter_mut()).zip(spreads) {
            if catalogue.nuisances.contains(column) {
                *coefficient = coefficient.clamp(-MOST * stddev, MOST * stddev);
            }
        }
        fit
    }

    /// Values that the log, rather than the priors, determines: the trace of (A − 1) A⁻¹, with A in units of the prior.
    pub(crate) fn effective(&self) -> f64 {
        self.columns.len() as f64 - self.cholesky.inverse().trace()
    }

    /// Target less columns, fitted rows, in units of the discrepancy.
    pub(crate) fn left(&self, all: &Columns, rows: &Rows) -> Vec<f64> {
        let mut left = all.target.values.clone();
        for (place, coefficient) in self.columns.iter().zip(self.coefficients.iter()) {
            let column = &all.white[*place];
            let start = column.joint.map_or(0, |joint| rows.of(joint).start);
            for (value, change) in left[start..].iter_mut().zip(&column.values) {
                *value -= coefficient * change;
            }
        }
        left
    }

    /// What columns, with their prior standard deviations, would add to ln evidence, and their coefficients with standard deviations.
    pub(crate) fn gain(&self, all: &Columns, stddevs: &[f64], added: &[(usize, f64)]) -> Option<(f64, Vec<[f64; 2]>)> {
        let count = added.len();
        let cross = DMatrix::from_fn(self.columns.len(), count, |i, j| {
            all.product(self.columns[i], added[j].0) * stddevs[i] * added[j].1
        });
        let mut information =
            DMatrix::from_fn(count, count, |i, j| all.product(added[i].0, added[j].0) * added[i].1 * added[j].1);
        information -= cross.transpose() * self.cholesky.solve(&cross);
        for i in 0..count {
            information[(i, i)] += 1.0;
        }
        let explained = |column: usize| -> f64 {
            self.columns
                .iter()
                .zip(self.coefficients.iter())
                .map(|(own, coefficient)| all.product(column, *own) * coefficient)
                .sum()
        };
        let right = DVector::from_fn(count, |i, _| (all.with_target(added[i].0) - explained(added[i].0)) * added[i].1);
        let cholesky = Cholesky::new(information)?;
        let scaled = cholesky.solve(&right);
        let log_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|value| 2.0 * value.ln()).sum();
        let inverse = cholesky.inverse();
        let coefficients = (0..count).map(|i| [scaled[i] * added[i].1, inverse[(i, i)].sqrt() * added[i].1]).collect();
        Some((0.5 * (right.dot(&scaled) - log_determinant), coefficients))
    }

    /// Covariance of the coefficients.
    pub(crate) fn covariance(&self, stddevs: &[f64]) -> DMatrix<f64> {
        let inverse = self.cholesky.inverse();
        DMatrix::from_fn(self.columns.len(), self.columns.len(), |i, j| inverse[(i, j)] * stddevs[i] * stddevs[j])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_column_adds_is_the_difference_of_two_fits() {
        let wave = |k: f64| (0..40).map(|i| (k * f64::from(i)).sin()).collect::<Vec<_>>();
        let target = (0..40).map(|i| 0.7 * (0.37 * f64::from(i)).sin() + 0.2 * (0.9 * f64::from(i)).cos()).collect();
        let all = Columns::for_tests(vec![wave(0.1), wave(0.37), wave(0.9)], target);
        let stddevs = [2.0, 0.5, 3.0];
        let two = Fit::new(&all, vec![0, 1], &stddevs[..2]).unwrap();
        let three = Fit::new(&all, vec![0, 1, 2], &stddevs).unwrap();
        let (gain, coefficients) = two.gain(&all, &stddevs[..2], &[(2, 3.0)]).unwrap();
        assert!((gain - (three.log_evidence - two.log_evidence)).abs() < 1e-9);
        assert!((coefficients[0][0] - three.coefficients[2]).abs() < 1e-9);
        assert!((coefficients[0][1].powi(2) - three.covariance(&stddevs)[(2, 2)]).abs() < 1e-9);
        assert!(three.effective() > 1.0 && three.effective() < 3.0);
    }

    #[test]
    fn evidence_of_one_column_follows_its_closed_form() {
        // y ~ N(0, 1 + s² x xᵀ): ln p = −½ (yᵀy − s² (xᵀy)² / (1 + s² xᵀx) + ln(1 + s² xᵀx)).
        let all = Columns::for_tests(vec![vec![1.0, 2.0]], vec![0.5, -1.0]);
        let fit = Fit::new(&all, vec![0], &[3.0]).unwrap();
        let (xx, xy, yy) = (5.0, -1.5, 1.25);
        let expected = -0.5 * (yy - 9.0 * xy * xy / (1.0 + 9.0 * xx) + (1.0_f64 + 9.0 * xx).ln());
        assert!((fit.log_evidence - expected).abs() < 1e-12);
    }
}
