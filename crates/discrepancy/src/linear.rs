//! Steps of a fit, as if residuals were linear in the coordinates.
//!
//! −ln p of a cell is the logarithm of its χ² (see [`crate::likelihood`]). Least squares with the weights of before the step bound it from above, so that their
//! minimum goes about half of the way: a cell that is explained better counts more. The minimum of −ln p itself is found by least squares
//! with the weights of where the last ones led, over and over (iteratively reweighted least squares: Green, Journal of the Royal Statistical Society B 46,
//! 1984). Nothing is simulated for that: what derivatives say of a cell is summed up once.

use nalgebra::{DMatrix, DVector};

use crate::likelihood::{Stack, cell_bend, cell_cost, cell_weight};

/// Least squares at most.
const ITERATIONS: usize = 20;
/// Least squares that gain less than this in ln posterior are the last ones.
const LITTLE: f64 = 0.005;

/// Residuals that are linear in a step, summed up by cell.
pub(crate) struct Linear {
    cells: Vec<Cell>,
    coordinates: usize,
}

/// χ² after a step δ is `chi2` + 2 `slope`·δ + δᵀ `gram` δ.
struct Cell {
    episode: usize,
    count: usize,
    chi2: f64,
    slope: Vec<f64>,
    /// The lower triangle, column by column.
    gram: Vec<f64>,
}

/// Derivatives of −ln p by a step where it begins.
pub(crate) struct Derivatives {
    /// The first.
    pub(crate) slope: DVector<f64>,
    /// The second if cells kept their weights, which is never negative.
    pub(crate) gram: DMatrix<f64>,
    /// The second.
    pub(crate) hessian: DMatrix<f64>,
}

/// The best step.
pub(crate) struct Minimum {
    /// The step.
    pub(crate) delta: DVector<f64>,
    /// −ln posterior after it, but for a constant.
    pub(crate) cost: f64,
    /// Half the ln determinant of the last least squares, of the coordinates that stay within their ranges.
    pub(crate) half_determinant: f64,
}

impl Linear {
    /// Of residuals and their derivatives by the coordinates.
    pub(crate) fn new(residuals: &Stack, jacobian: &[&Stack]) -> Self {
        let n = jacobian.len();
        let mut cells: Vec<Cell> = Vec::new();
        let mut row = vec![0.0; n];
        for (episode, (residuals, of)) in residuals.episodes() {
            let first = cells.len();
            let gram = || vec![0.0; n * (n + 1) / 2];
            let empty = || Cell { episode, count: 0, chi2: 0.0, slope: vec![0.0; n], gram: gram() };
            cells.extend((0..of.count).map(|_| empty()));
            for (place, (residual, cell)) in residuals.iter().zip(&of.of).enumerate() {
                row.iter_mut().zip(jacobian).for_each(|(value, column)| *value = column[episode][place]);
                cells[first + cell].add(*residual, &row);
            }
        }
        Self { cells, coordinates: n }
    }

    /// χ² of each cell after a step, and −ln p of all, but for a constant.
    fn after(&self, delta: &DVector<f64>) -> After {
        let mut below = vec![0.0; self.coordinates];
        let chi2: Vec<f64> = self.cells.iter().map(|cell| cell.chi2_after(delta, &mut below)).collect();
        let cost = self.cells.iter().zip(&chi2).map(|(cell, chi2)| cell_cost(*chi2, cell.count)).sum();
        After { chi2, cost }
    }

    /// Weighted sums of `gram` and `slope`, with the weights of these χ².
    fn weighted(&self, chi2: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.coordinates;
        let mut slope = DVector::zeros(n);
        let mut packed = vec![0.0; n * (n + 1) / 2];
        for (cell, chi2) in self.cells.iter().zip(chi2) {
            let weight = cell_weight(*chi2, cell.count);
            slope.iter_mut().zip(&cell.slope).for_each(|(sum, slope)| *sum += weight * slope);
            packed.iter_mut().zip(&cell.gram).for_each(|(sum, product)| *sum += weight * product);
        }
        let mut gram = DMatrix::zeros(n, n);
        let mut packed = packed.iter();
        for j in 0..n {
            for (i, sum) in (j..n).zip(&mut packed) {
                gram[(i, j)] = *sum;
            }
        }
        gram.fill_upper_triangle_with_lower_triangle();
        (gram, slope)
    }

    /// What each of so many episodes or pieces says where the step begins.
    pub(crate) fn by_piece(&self, count: usize) -> Vec<Derivatives> {
        let n = self.coordinates;
        let none =
            || Derivatives { slope: DVector::zeros(n), gram: DMatrix::zeros(n, n), hessian: DMatrix::zeros(n, n) };
        let mut pieces: Vec<Derivatives> = (0..count).map(|_| none()).collect();
        for cell in &self.cells {
            let Derivatives { slope, gram, hessian } = &mut pieces[cell.episode];
            let weight = cell_weight(cell.chi2, cell.count);
            // By how much the weight falls, with half the χ².
            let bend = cell_bend(cell.chi2, cell.count);
            let mut products = cell.gram.iter();
            for j in 0..n {
                slope[j] += weight * cell.slope[j];
                for (i, product) in (j..n).zip(&mut products) {
                    gram[(i, j)] += weight * product;
                    hessian[(i, j)] += weight * product - bend * cell.slope[i] * cell.slope[j];
                }
            }
        }
        for Derivatives { gram, hessian, .. } in &mut pieces {
            gram.fill_upper_triangle_with_lower_triangle();
            hessian.fill_upper_triangle_with_lower_triangle();
        }
        pieces
    }

    /// The step from `x`, whose coordinates have prior N(0, 1), that leads to the least −ln posterior within their ranges. `damping`: by which share the diagonal of
    /// least squares is larger. `None` where residuals or derivatives are no numbers.
    pub(crate) fn minimum(&self, x: &[f64], range: impl Fn(usize) -> [f64; 2], damping: f64) -> Option<Minimum> {
        let prior = |delta: &DVector<f64>| 0.5 * x.iter().zip(delta.iter()).map(|(x, d)| (x + d).powi(2)).sum::<f64>();
        let mut delta = DVector::zeros(x.len());
        let After { mut chi2, cost } = self.after(&delta);
        let mut least = cost + prior(&delta);
        if !least.is_finite() {
            return None;
        }
        let mut half_determinant = 0.0;
        for iteration in 0..ITERATIONS {
            let (mut gram, mut slope) = self.weighted(&chi2);
            for (i, x) in x.iter().enumerate() {
                gram[(i, i)] += 1.0;
                slope[i] += x;
            }
            let (next, determinant) = bounded(x, &range, &gram, &slope, damping)?;
            let after = self.after(&next);
            let cost = after.cost + prior(&next);
            if iteration == 0 {
                half_determinant = determinant;
            }
            // Held at a border, or damped, the next step need not be better.
            if cost.is_nan() || cost >= least {
                break;
            }
            let gained = least - cost;
            (delta, chi2, least, half_determinant) = (next, after.chi2, cost, determinant);
            if gained < LITTLE {
                break;
            }
        }
        Some(Minimum { delta, cost: least, half_determinant })
    }
}

impl Cell {
    fn add(&mut self, residual: f64, row: &[f64]) {
        self.count += 1;
        self.chi2 += residual * residual;
        self.slope.iter_mut().zip(row).for_each(|(slope, a)| *slope += a * residual);
        let mut rest = self.gram.as_mut_slice();
        for (j, a) in row.iter().enumerate() {
            let column = rest.split_off_mut(..row.len() - j).unwrap_or_default();
            column.iter_mut().zip(&row[j..]).for_each(|(product, b)| *product += a * b);
        }
    }

    /// `below` is room for as many numbers as there are coordinates.
    fn chi2_after(&self, delta: &DVector<f64>, below: &mut [f64]) -> f64 {
        below.fill(0.0);
        let mut chi2 = self.chi2;
        let mut rest = self.gram.as_slice();
        for (j, d) in delta.iter().enumerate() {
            let column = rest.split_off(..delta.len() - j).unwrap_or_default();
            let own = column.first().copied().unwrap_or(0.0);
            chi2 += d * (2.0 * (self.slope[j] + below[j]) + own * d);
            // What this coordinate adds to those behind it.
            below[j..].iter_mut().zip(column).skip(1).for_each(|(sum, product)| *sum += d * product);
        }
        // Rounding may lead below 0; what is no number stays none.
        if chi2 < 0.0 { 0.0 } else { chi2 }
    }
}

/// What a step leads to.
struct After {
    chi2: Vec<f64>,
    cost: f64,
}

/// The minimum of a quadratic form within the ranges, and half the ln determinant of its free part: coordinates that it would push over a border stay there.
fn bounded(
    x: &[f64],
    range: impl Fn(usize) -> [f64; 2],
    gram: &DMatrix<f64>,
    slope: &DVector<f64>,
    damping: f64,
) -> Option<(DVector<f64>, f64)> {
    let n = x.len();
    let mut free: Vec<usize> = (0..n).collect();
    let mut delta = DVector::zeros(n);
    loop {
        let m = free.len();
        if m == 0 {
            return Some((delta, 0.0));
        }
        let a = DMatrix::from_fn(m, m, |i, j| {
            let value = gram[(free[i], free[j])];
            if i == j { value * (1.0 + damping) } else { value }
        });
        // What was held at a border moves the others' optimum.
        let b = DVector::from_fn(m, |i, _| {
            let held: f64 = (0..n).filter(|j| !free.contains(j)).map(|j| gram[(free[i], j)] * delta[j]).sum();
            -(slope[free[i]] + held)
        });
        let cholesky = a.cholesky()?;
        let solution = cholesky.solve(&b);
        let mut worst: Option<(usize, f64, f64)> = None;
        for (index, step) in free.iter().zip(solution.iter()) {
            let [low, high] = range(*index);
            let target = x[*index] + step;
            let over = (low - target).max(target - high);
            if over > 0.0 && worst.is_none_or(|(_, _, most)| over > most) {
                worst = Some((*index, target.clamp(low, high) - x[*index], over));
            }
        }
        let Some((index, held, _)) = worst else {
            free.iter().zip(solution.iter()).for_each(|(index, step)| delta[*index] = *step);
            return Some((delta, cholesky.l().diagonal().iter().map(|d| d.ln()).sum()));
        };
        delta[index] = held;
        free.retain(|other| *other != index);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::cost;

    /// Two episodes, one of which no step explains.
    fn residuals() -> (Stack, [Stack; 2]) {
        let column = |f: fn(f64) -> f64| -> Stack {
            vec![DVector::from_fn(40, |row, _| f(row as f64)), DVector::from_fn(40, |row, _| f(row as f64 + 0.5))]
                .into()
        };
        let jacobian = [column(|t| 3.0 * (0.3 * t).sin()), column(|t| (0.7 * t).cos())];
        let right = [2.0, -5.0];
        let mut residuals = column(|t| (17.0 * t).sin());
        for (column, right) in jacobian.iter().zip(right) {
            residuals[0].axpy(-right, &column[0], 1.0);
        }
        residuals[1] *= 30.0;
        (residuals, jacobian)
    }

    fn after(residuals: &Stack, jacobian: &[Stack], delta: &[f64], x: [f64; 2]) -> f64 {
        let mut moved = residuals.clone();
        for (column, d) in jacobian.iter().zip(delta) {
            moved.iter_mut().zip(column.iter()).for_each(|(r, c)| r.axpy(*d, c, 1.0));
        }
        cost(&moved) + 0.5 * x.iter().zip(delta).map(|(x, d)| (x + d).powi(2)).sum::<f64>()
    }

    #[test]
    fn one_step_leads_to_the_minimum_where_residuals_are_linear() {
        let (residuals, jacobian) = residuals();
        let x = [0.5, 0.25];
        let linear = Linear::new(&residuals, &jacobian.iter().collect::<Vec<_>>());
        let found = linear.minimum(&x, |_| [-20.0, 20.0], 0.0).unwrap();
        let at = |a: f64, b: f64| after(&residuals, &jacobian, &[a, b], x);
        let [a, b] = [found.delta[0], found.delta[1]];
        assert!((found.cost - at(a, b)).abs() < 1e-9);
        // No neighbour is better by more than what ends the search.
        for (i, j) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1)] {
            let near = at(a + 0.05 * f64::from(i), b + 0.05 * f64::from(j));
            assert!(near > found.cost - 0.02, "{i} {j}: {near}, {}", found.cost);
        }
        // The one that is explained is, though another one is far off.
        assert!((a - 2.0).abs() < 0.2 && (b + 5.0).abs() < 0.5, "{a} {b}");
    }

    #[test]
    fn what_would_leave_its_range_stays_at_the_border_and_the_others_make_up_for_it() {
        let (residuals, jacobian) = residuals();
        let linear = Linear::new(&residuals, &jacobian.iter().collect::<Vec<_>>());
        let range = |index: usize| if index == 1 { [-3.0, 3.0] } else { [-20.0, 20.0] };
        let found = linear.minimum(&[0.0, 0.0], range, 0.0).unwrap();
        assert_eq!(found.delta[1], -3.0);
        for d in [-0.1, 0.1] {
            let near = after(&residuals, &jacobian, &[found.delta[0] + d, -3.0], [0.0; 2]);
            assert!(near > found.cost - 0.02, "{near}, {}", found.cost);
        }
        assert!(linear.minimum(&[0.0, 0.0], |_| [0.0, 0.0], 0.0).unwrap().delta.norm() == 0.0);
    }

    #[test]
    fn derivatives_are_those_of_the_cost() {
        let (residuals, jacobian) = residuals();
        let linear = Linear::new(&residuals, &jacobian.iter().collect::<Vec<_>>());
        for (piece, found) in linear.by_piece(2).iter().enumerate() {
            let one = |stack: &Stack| Stack::from(vec![stack[piece].clone()]);
            let alone = Linear::new(&one(&residuals), &jacobian.each_ref().map(one).iter().collect::<Vec<_>>());
            let at = |a: f64, b: f64| alone.after(&DVector::from_vec(vec![a, b])).cost;
            let h = 1e-3;
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-3 * (1.0 + b.abs()), "{piece}: {a} {b}");
            close(found.slope[1], (at(0.0, h) - at(0.0, -h)) / (2.0 * h));
            let bent = (at(h, 0.0) - 2.0 * at(0.0, 0.0) + at(-h, 0.0)) / (h * h);
            close(found.hessian[(0, 0)], bent);
            close(found.hessian[(0, 1)], (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h * h));
            // In the one that a step explains the change of weights counts.
            assert!(piece == 1 || (found.gram[(0, 0)] - bent).abs() > 0.1 * bent.abs(), "{bent}");
        }
    }

    #[test]
    fn what_is_no_number_leads_nowhere() {
        let (residuals, jacobian) = residuals();
        let broken: Stack = vec![DVector::from_element(40, f64::NAN); 2].into();
        let leads = |residuals: &Stack, second: &Stack| {
            Linear::new(residuals, &[&jacobian[0], second]).minimum(&[0.0; 2], |_| [-1.0, 1.0], 0.0).is_some()
        };
        assert!(leads(&residuals, &jacobian[1]));
        assert!(!leads(&residuals, &broken));
        let mut astray = residuals.clone();
        astray[1][7] = f64::NAN;
        assert!(!leads(&astray, &jacobian[1]));
    }
}
