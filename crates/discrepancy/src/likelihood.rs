//! How improbable residuals are, if contacts may go another way than their model.
//!
//! White residuals of a right model have variance 1. The contacts of a real table, and those of any other engine, rise, let go and come back in other
//! ticks than the simulated ones, and what is touched may go another way. Such errors are large in some channels, phases and time scales of some episodes, and say
//! nothing about the rest. The n residuals of each cell (see [`crate::cells`]) therefore follow Student's multivariate distribution with ν = max(n, 8) degrees of
//! freedom, one scale for all of them: with χ² their sum of squares, −ln p = (ν + n)/2 ln(1 + χ² / ν) but for a constant. Near χ² = n this is
//! ½ χ², as for normal residuals; a cell that no model explains has little say.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use nalgebra::DVector;

use crate::cells::Cells;

/// Degrees of freedom, at least: how far a cell of few residuals may be off is not known from these alone.
const LEAST_FREEDOM: f64 = 8.0;

/// White residuals of some episodes, one vector each.
#[derive(Clone, Debug, Default)]
pub struct Stack {
    episodes: Vec<DVector<f64>>,
    cells: Vec<Arc<Cells>>,
}

impl Stack {
    /// With the cells of each episode.
    #[must_use]
    pub fn new(episodes: Vec<DVector<f64>>, cells: Vec<Arc<Cells>>) -> Self {
        Self { episodes, cells }
    }

    /// Other numbers in the same cells.
    #[must_use]
    pub fn like(&self, episodes: Vec<DVector<f64>>) -> Self {
        Self { episodes, cells: self.cells.clone() }
    }

    /// −ln p of each episode, but for a constant.
    #[must_use]
    pub fn costs(&self) -> Vec<f64> {
        self.sums().map(|sums| sums.iter().map(|(chi2, count)| cell_cost(*chi2, *count)).sum()).collect()
    }

    /// The cells of each episode, and χ² and number of residuals of each cell.
    pub(crate) fn by_cell(&self) -> impl Iterator<Item = (&Cells, Vec<(f64, usize)>)> + '_ {
        self.cells.iter().map(AsRef::as_ref).zip(self.sums())
    }

    /// The residuals of each episode with its cells, counted.
    pub(crate) fn episodes(&self) -> impl Iterator<Item = (usize, (&DVector<f64>, &Cells))> + '_ {
        self.episodes.iter().zip(self.cells.iter().map(AsRef::as_ref)).enumerate()
    }

    /// χ² and number of residuals of each cell, episode by episode.
    fn sums(&self) -> impl Iterator<Item = Vec<(f64, usize)>> + '_ {
        self.episodes.iter().zip(&self.cells).map(|(residuals, cells)| {
            let mut sums = vec![(0.0, 0); cells.count];
            for (residual, cell) in residuals.iter().zip(&cells.of) {
                sums[*cell].0 += residual * residual;
                sums[*cell].1 += 1;
            }
            sums
        })
    }
}

impl Deref for Stack {
    type Target = [DVector<f64>];

    fn deref(&self) -> &Self::Target {
        &self.episodes
    }
}

impl DerefMut for Stack {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.episodes
    }
}

/// One cell an episode, whose residuals are independent.
impl FromIterator<DVector<f64>> for Stack {
    fn from_iter<T: IntoIterator<Item = DVector<f64>>>(episodes: T) -> Self {
        let episodes: Vec<DVector<f64>> = episodes.into_iter().collect();
        let one = |residuals: &DVector<f64>| Arc::new(Cells::one(residuals.len()));
        Self { cells: episodes.iter().map(one).collect(), episodes }
    }
}

impl From<Vec<DVector<f64>>> for Stack {
    fn from(episodes: Vec<DVector<f64>>) -> Self {
        episodes.into_iter().collect()
    }
}

/// Mean square of the white residuals of a right model.
pub const NOISE_FLOOR: f64 = 1.0;

/// Those at `places`.
#[must_use]
pub fn pick(stack: &Stack, places: &[usize]) -> Stack {
    let episodes = places.iter().map(|place| stack[*place].clone()).collect();
    Stack::new(episodes, places.iter().map(|place| stack.cells[*place].clone()).collect())
}

/// −ln p of all episodes, but for a constant.
#[must_use]
pub fn cost(stack: &Stack) -> f64 {
    stack.costs().iter().sum()
}

/// −ln p of a cell with this sum of squares.
#[must_use]
pub(crate) fn cell_cost(chi2: f64, count: usize) -> f64 {
    let n = count as f64;
    let freedom = n.max(LEAST_FREEDOM);
    0.5 * (freedom + n) * (chi2 / freedom).ln_1p()
}

/// The weight of its residuals in a step of least squares: −ln p has the derivative `weight` · residual.
#[must_use]
pub(crate) fn cell_weight(chi2: f64, count: usize) -> f64 {
    let n = count as f64;
    let freedom = n.max(LEAST_FREEDOM);
    (1.0 + n / freedom) / (1.0 + chi2 / freedom)
}

/// By how much the weight falls with half the χ²: with the slope s of that, −ln p has the second derivative `weight` · gram − `bend` · s sᵀ.
#[must_use]
pub(crate) fn cell_bend(chi2: f64, count: usize) -> f64 {
    let n = count as f64;
    let freedom = n.max(LEAST_FREEDOM);
    2.0 * cell_weight(chi2, count) / (freedom + chi2)
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
    // Of a single one nothing is odd.
    let odd = (ODD * values.len() as f64).ceil() as usize;
    values.truncate((values.len() - odd).max(1));
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The weight of each residual, see [`cell_weight`].
#[must_use]
pub fn weights(stack: &Stack) -> Vec<DVector<f64>> {
    let one = |(chi2, count): (f64, usize)| cell_weight(chi2, count);
    (stack.sums().zip(&stack.cells))
        .map(|(sums, cells)| {
            let weights: Vec<f64> = sums.into_iter().map(one).collect();
            DVector::from_iterator(cells.of.len(), cells.of.iter().map(|cell| weights[*cell]))
        })
        .collect()
}

/// Sum of weighted products.
#[must_use]
pub fn dot(a: &[DVector<f64>], b: &[DVector<f64>], weights: &[DVector<f64>]) -> f64 {
    a.iter().zip(b).zip(weights).map(|((a, b), weights)| product(a, b, weights)).sum()
}

/// The same of one episode.
#[must_use]
pub fn product(a: &DVector<f64>, b: &DVector<f64>, weights: &DVector<f64>) -> f64 {
    a.iter().zip(b.iter()).zip(weights.iter()).map(|((a, b), weight)| weight * a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_one_it_is_the_normal_likelihood_and_far_out_a_logarithm() {
        let at = |chi2: f64| cell_cost(chi2, 1000);
        assert!((at(1001.0) - at(1000.0) - 0.5).abs() < 1e-3);
        // From 100 to 50 standard deviations: n ln 4 instead of 3 750 000.
        assert!((at(1e7) - at(2.5e6) - 1000.0 * 4.0_f64.ln()).abs() < 1.0);
    }

    #[test]
    fn weights_are_those_of_the_gradient_in_every_cell() {
        let residuals = vec![DVector::from_vec(vec![3.0, -1.0, 0.5]), DVector::from_vec(vec![0.1, 0.2])];
        let cells =
            [vec![0, 1, 0], vec![0, 0]].map(|of| Cells { count: 1 + of.iter().max().unwrap(), of, ..Cells::default() });
        let stack = Stack::new(residuals, cells.map(Arc::new).to_vec());
        let weights = weights(&stack);
        for (episode, row) in [(0, 0), (0, 1), (0, 2), (1, 1)] {
            let mut moved = stack.clone();
            moved[episode][row] += 1e-6;
            let slope = (cost(&moved) - cost(&stack)) / 1e-6;
            assert!((slope - weights[episode][row] * stack[episode][row]).abs() < 1e-5, "{slope}");
        }
        let ones: Vec<_> = weights.iter().map(|w| DVector::from_element(w.len(), 1.0)).collect();
        assert!((dot(&stack, &stack, &ones) - 10.3).abs() < 1e-12);
    }

    #[test]
    fn a_cell_that_no_model_explains_leaves_the_others_their_say() {
        let cells = || vec![Arc::new(Cells { of: vec![0, 0, 1, 1], count: 2, ..Cells::default() })];
        let with = |force: f64, place: f64| {
            cost(&Stack::new(vec![DVector::from_vec(vec![force, force, place, place])], cells()))
        };
        // Whatever the force does, the place says as much.
        assert!((with(100.0, 3.0) - with(100.0, 1.0) - (with(1.0, 3.0) - with(1.0, 1.0))).abs() < 1e-9);
        // In one cell it would be lost.
        let one = |force: f64, place: f64| cost(&vec![DVector::from_vec(vec![force, force, place, place])].into());
        assert!(one(100.0, 3.0) - one(100.0, 1.0) < 0.01);
    }
}
