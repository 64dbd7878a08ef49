//! What a model explains better than another: episode by episode, in slow errors, in forces.

use std::ops::Range;

use nalgebra::DVector;

use crate::likelihood::{Stack, cell_cost};

/// Octave of wavelets (see [`crate::cells`]) from which errors are slow: those that compare eight blocks with the next eight, and slower ones.
const SLOW: u32 = 3;

/// Sums over the episodes that two models were compared in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gains {
    /// ln(sum of squares without / with) of each episode.
    drops: Vec<f64>,
    /// Gain of each episode in ln p.
    episodes: Vec<f64>,
    /// Number of residuals.
    residuals: usize,
    /// Gain in ln p by forces and torques.
    pub(crate) force: f64,
    /// Number and sums of squares of slow errors, without and with.
    slow: (usize, [f64; 2]),
}

impl Gains {
    /// Adds the episodes of which `groups` are the pieces.
    pub(crate) fn add(&mut self, before: &Stack, after: &Stack, groups: &[Range<usize>]) {
        for group in groups {
            let square = |stack: &Stack| stack[group.clone()].iter().map(DVector::norm_squared).sum::<f64>();
            let [without, with] = [before, after].map(|stack| square(stack) + f64::MIN_POSITIVE);
            self.drops.push((without / with).ln());
            self.residuals += before[group.clone()].iter().map(DVector::len).sum::<usize>();
        }
        let mut pieces = Vec::new();
        for ((cells, before), (_, after)) in before.by_cell().zip(after.by_cell()) {
            let mut gained = 0.0;
            for (cell, ((without, count), (with, _))) in before.into_iter().zip(after).enumerate() {
                let gain = cell_cost(without, count) - cell_cost(with, count);
                gained += gain;
                let Some((kind, octave)) = cells.channels.get(cell) else { continue };
                if kind.is_force() {
                    self.force += gain;
                }
                if *octave >= SLOW {
                    let (n, [a, b]) = &mut self.slow;
                    (*n, *a, *b) = (*n + count, *a + without, *b + with);
                }
            }
            pieces.push(gained);
        }
        self.episodes.extend(groups.iter().map(|group| pieces[group.clone()].iter().sum::<f64>()));
    }

    /// Mean of ln(error without / with) over the episodes, in its standard errors.
    pub(crate) fn drop_steadiness(&self) -> f64 {
        steadiness(&self.drops)
    }

    /// ln(slow errors without / with), beside as much noise as there is of them.
    pub(crate) fn slow_drop(&self) -> f64 {
        let (count, [without, with]) = self.slow;
        let noise = count.max(1) as f64;
        ((without + noise) / (with + noise)).ln()
    }

    /// Mean gain of a residual in ln p.
    pub(crate) fn of_residual(&self) -> f64 {
        self.episodes.iter().sum::<f64>() / self.residuals.max(1) as f64
    }

    /// The median episode's gain in ln p.
    pub(crate) fn median(&self) -> f64 {
        let mut sorted = self.episodes.clone();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len() / 2;
        match sorted.len() {
            0 => 0.0,
            n if n % 2 == 0 => 0.5 * (sorted[middle - 1] + sorted[middle]),
            _ => sorted[middle],
        }
    }
}

/// Mean over its standard error; 0 of fewer than two.
fn steadiness(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if values.len() < 2 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // What no episode tells from another is steady: a hundredth.
    mean / ((square / n).sqrt() + 0.01)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::cells::Cells;
    use crate::trial::Kind;

    #[test]
    fn steadiness_is_a_mean_in_its_standard_errors() {
        // Mean 5, standard deviation √(16/3), error √(4/3).
        assert!((steadiness(&[3.0, 7.0, 3.0, 7.0]) - 5.0 / ((4.0_f64 / 3.0).sqrt() + 0.01)).abs() < 1e-12);
        assert_eq!(steadiness(&[4.0]), 0.0);
        assert!(steadiness(&[-1.0, -3.0]) < 0.0);
    }

    #[test]
    fn what_is_explained_shows_where_it_is() {
        // Per episode two quick readings of a force and two slow ones of a place.
        let channels = vec![(Kind::WristForce, 0), (Kind::ObjectPosition, SLOW)];
        let cells = Arc::new(Cells { of: vec![0, 0, 1, 1], count: 2, channels, ..Cells::default() });
        let stack = |force: f64, place: [f64; 3]| {
            let episode = |place: f64| DVector::from_vec(vec![force, force, place, place]);
            Stack::new(place.map(episode).to_vec(), vec![cells.clone(); 3])
        };
        let gains = |before: &Stack, after: &Stack| {
            let mut gains = Gains::default();
            gains.add(before, after, &[0..1, 1..2, 2..3]);
            gains
        };
        let found = gains(&stack(2.0, [3.0; 3]), &stack(2.0, [1.0, 1.0, 3.0]));
        // The place is explained in two of three episodes, the force in none.
        assert!(found.force == 0.0 && found.median() > 1.0 && found.of_residual() > 0.0);
        // (6 · 9 + 6) / (4 · 1 + 2 · 9 + 6).
        assert!((found.slow_drop() - (60.0_f64 / 28.0).ln()).abs() < 1e-12);
        let drop = (26.0_f64 / 10.0).ln();
        assert!((found.drop_steadiness() - steadiness(&[drop, drop, 0.0])).abs() < 1e-12);
        let other = gains(&stack(3.0, [1.0; 3]), &stack(1.0, [1.0; 3]));
        assert!(other.force > 0.0 && other.slow_drop() == 0.0);
        // The other way all signs turn.
        let worse = gains(&stack(1.0, [1.0; 3]), &stack(3.0, [3.0; 3]));
        assert!(worse.force < 0.0 && worse.median() < 0.0 && worse.slow_drop() < 0.0 && worse.drop_steadiness() < 0.0);
    }
}
