//! Maximum a posteriori fits: Levenberg–Marquardt with Broyden's updates, because a Jacobian costs a simulation of all episodes for each
//! coordinate and a step only one.

use nalgebra::{DMatrix, DVector};

use crate::candidate::Candidate;
use crate::likelihood::{self, Stack, dot, pick, weights};
use crate::linear::Linear;
use crate::model::{Model, STEP};
use crate::study::{Study, difference};

/// Steps between two fresh Jacobians, at most.
pub(crate) const STEPS: usize = 5;
/// A fresh Jacobian that gained less than this in ln posterior is not followed by another one.
const SETTLED: f64 = 1.0;
/// After a step that gains nothing the next one is damped by this at least: less leads to the same place.
const DAMPED: f64 = 0.1;
/// A Jacobian is fresh within this many steps of its finite differences.
const NEAR: f64 = 0.5;
/// A step that promises less than this in ln posterior is not made.
const WORTHWHILE: f64 = 0.05;

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fit {
    /// What was fitted.
    pub model: Model,
    /// Its coordinates.
    pub x: Vec<f64>,
    /// Residuals there, standardised but not white.
    pub raw: Vec<Vec<f64>>,
    /// White residuals there.
    pub residuals: Stack,
    /// Their derivatives by the coordinates, as finite differences there.
    pub jacobian: Vec<Stack>,
    log_evidence: f64,
}

impl Fit {
    /// With its ln evidence.
    #[must_use]
    pub fn new(model: Model, x: Vec<f64>, raw: Vec<Vec<f64>>, residuals: Stack, jacobian: Vec<Stack>) -> Self {
        let log_evidence = log_evidence(&model, &x, &residuals, &jacobian);
        Self { model, x, raw, residuals, jacobian, log_evidence }
    }

    /// Not fitted: at `x`.
    #[must_use]
    pub fn at(study: &Study, model: Model, x: Vec<f64>) -> Self {
        let raw = study.raw(&model.hypothesis(&x));
        let residuals = study.white(&raw, model.engine_errors(&x));
        let jacobian = derivatives(study, &model, &x, (&raw, &residuals));
        Self::new(model, x, raw, residuals, jacobian)
    }

    /// The same as seen by some of the episodes alone.
    #[must_use]
    pub fn part(&self, places: &[usize]) -> Self {
        let raw = places.iter().map(|place| self.raw[*place].clone()).collect();
        let jacobian = self.jacobian.iter().map(|column| pick(column, places)).collect();
        Self::new(self.model.clone(), self.x.clone(), raw, pick(&self.residuals, places), jacobian)
    }

    /// The last effect of its model, and the coordinates of that.
    #[must_use]
    pub fn added(&self) -> Option<(&Candidate, &[f64])> {
        let candidate = self.model.parts.last()?;
        Some((candidate, &self.x[self.x.len() - candidate.coordinates.len()..]))
    }

    /// −ln posterior there, but for a constant.
    #[must_use]
    pub fn cost(&self) -> f64 {
        cost(&self.x, &self.residuals)
    }

    /// Laplace's ln evidence; −∞ for a fit that failed.
    #[must_use]
    pub fn log_evidence(&self) -> f64 {
        self.log_evidence
    }
}

/// Laplace's ln evidence. A fit whose residuals or derivatives are no numbers says nothing for its model: −∞.
fn log_evidence(model: &Model, x: &[f64], residuals: &Stack, jacobian: &[Stack]) -> f64 {
    let n = x.len();
    let weights = weights(residuals);
    let hessian =
        DMatrix::from_fn(n, n, |i, j| dot(&jacobian[i], &jacobian[j], &weights) + f64::from(u8::from(i == j)));
    let Some(cholesky) = hessian.cholesky() else { return f64::NEG_INFINITY };
    let half_determinant: f64 = cholesky.l().diagonal().iter().map(|d| d.ln()).sum();
    let sides = model.one_sided() as f64 * std::f64::consts::LN_2;
    let found = -cost(x, residuals) - half_determinant + sides;
    if found.is_finite() { found } else { f64::NEG_INFINITY }
}

/// How long a fit may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// One Jacobian, some steps: good enough for a ranking. The Jacobian of the result is Broyden's.
    Quick,
    /// A fresh Jacobian where the quick one ends, and steps until nothing is to be gained.
    Full,
}

/// Where a fit begins.
#[derive(Clone, Debug)]
pub struct Begin {
    /// Coordinates.
    pub x: Vec<f64>,
    /// Residuals there, not white, where known.
    pub raw: Option<Vec<Vec<f64>>>,
    /// Derivatives there or nearby of the first coordinates, as far as known.
    pub jacobian: Vec<Stack>,
}

impl Begin {
    /// At `x`, of which nothing is known.
    #[must_use]
    pub fn at(x: &[f64]) -> Self {
        Self { x: x.to_vec(), raw: None, jacobian: Vec::new() }
    }

    /// −ln posterior there, but for a constant; ∞ where residuals are not known.
    #[must_use]
    pub fn cost(&self, study: &Study, model: &Model) -> f64 {
        let white = |raw: &Vec<Vec<f64>>| cost(&self.x, &study.white(raw, model.engine_errors(&self.x)));
        self.raw.as_ref().map_or(f64::INFINITY, white)
    }
}

/// Fits a model.
#[must_use]
pub fn fit(study: &Study, model: Model, begin: Begin, effort: Effort) -> Fit {
    let mut x = begin.x;
    let mut raw = begin.raw.unwrap_or_else(|| study.raw(&model.hypothesis(&x)));
    let mut residuals = study.white(&raw, model.engine_errors(&x));
    let mut jacobian = begin.jacobian;
    let mut fresh = jacobian.is_empty().then(|| x.clone());
    complete(study, &model, &x, (&raw, &residuals), &mut jacobian);
    let rounds = match effort {
        Effort::Quick => 1,
        Effort::Full => 3,
    };
    let simulation = study.rollouts();
    let mut before = f64::INFINITY;
    for round in 0..rounds {
        let now = cost(&x, &residuals);
        if round > 0 && (!study.has_fits() || (round > 1 && before - now < SETTLED)) {
            break;
        }
        before = now;
        if round > 0 {
            jacobian = derivatives(study, &model, &x, (&raw, &residuals));
            fresh = Some(x.clone());
        }
        let mut linear = None;
        let mut damping = 1e-3;
        let mut moved = false;
        for _ in 0..STEPS {
            // What everything else is compared with is fitted whatever it costs.
            if !model.parts.is_empty() && !study.affords(simulation) {
                break;
            }
            // After a step that was not taken nothing has changed but the damping.
            let sums = linear.get_or_insert_with(|| Linear::new(&residuals, &jacobian.iter().collect::<Vec<_>>()));
            let Some(step) = sums.minimum(&x, |index| model.range(index), damping) else { break };
            let promise = cost(&x, &residuals) - step.cost;
            // A promise that a fresh Jacobian makes is worth more than one of an old one.
            if promise < WORTHWHILE || (!moved && round > 0 && promise < 6.0 * WORTHWHILE) {
                break;
            }
            // Broyden's changes by a long step, even one that is not taken, reach farther than a finite difference.
            if step.delta.amax() >= NEAR * STEP {
                fresh = None;
            }
            let next: Vec<f64> = x.iter().zip(step.delta.iter()).map(|(x, d)| x + d).collect();
            let found_raw = study.raw(&model.hypothesis(&next));
            let found = study.white(&found_raw, model.engine_errors(&next));
            let gain = cost(&x, &residuals) - cost(&next, &found);
            moved = true;
            if gain > 0.0 {
                broyden(&model, &mut jacobian, &residuals, &found, &step.delta);
                (x, raw, residuals) = (next, found_raw, found);
                linear = None;
                damping = (damping * 0.2).max(1e-6);
            } else {
                damping = (damping * 20.0).clamp(DAMPED, 1e6);
            }
        }
        if round > 0 && !moved {
            return Fit::new(model, x, raw, residuals, jacobian);
        }
    }
    // Nearer than a finite difference reaches, Broyden's is as good as another.
    let near = fresh.is_some_and(|fresh| fresh.iter().zip(&x).all(|(a, b)| (a - b).abs() < NEAR * STEP));
    if effort == Effort::Full && !near && study.affords(model.simulated() * simulation) {
        jacobian = derivatives(study, &model, &x, (&raw, &residuals));
    }
    Fit::new(model, x, raw, residuals, jacobian)
}

/// −ln posterior but for a constant.
#[must_use]
pub fn cost(x: &[f64], residuals: &Stack) -> f64 {
    let cost = likelihood::cost(residuals) + 0.5 * x.iter().map(|x| x * x).sum::<f64>();
    // Residuals of a simulation that went astray need not be finite.
    if cost.is_nan() { f64::INFINITY } else { cost }
}

/// Finite differences at `x`.
fn derivatives(study: &Study, model: &Model, x: &[f64], at: (&[Vec<f64>], &Stack)) -> Vec<Stack> {
    let mut jacobian = Vec::new();
    complete(study, model, x, at, &mut jacobian);
    jacobian
}

/// Finite differences at `x` for the coordinates that have none yet. `at`: residuals there, as simulated and white.
fn complete(study: &Study, model: &Model, x: &[f64], at: (&[Vec<f64>], &Stack), jacobian: &mut Vec<Stack>) {
    let (raw, residuals) = at;
    for index in jacobian.len()..x.len() {
        let step = model.step(x, index);
        let mut moved = x.to_vec();
        moved[index] += step;
        let errors = model.engine_errors(&moved);
        let white = if model.is_engine_error(index) {
            study.white(raw, errors)
        } else {
            study.white(&study.raw(&model.hypothesis(&moved)), errors)
        };
        jacobian.push(difference(&white, residuals, step));
    }
}

/// The smallest change of the Jacobian that explains what a step did. What is known exactly is left as it is.
fn broyden(model: &Model, jacobian: &mut [Stack], before: &Stack, after: &Stack, delta: &DVector<f64>) {
    let unsure = |index: &usize| !model.is_engine_error(*index);
    let length = (0..delta.len()).filter(unsure).map(|index| delta[index].powi(2)).sum::<f64>();
    if length == 0.0 {
        return;
    }
    for place in 0..before.len() {
        let mut surprise = &after[place] - &before[place];
        for (column, d) in jacobian.iter().zip(delta.iter()) {
            surprise.axpy(-d, &column[place], 1.0);
        }
        for index in (0..delta.len()).filter(unsure) {
            jacobian[index][place].axpy(delta[index] / length, &surprise, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_whose_derivatives_are_no_numbers_has_no_evidence() {
        let stack = |size: f64| Stack::from(vec![DVector::from_element(20, size); 3]);
        let evidence = |residuals: Stack, jacobian: Stack| {
            Fit::new(Model::nominal(1, 0), vec![0.5], Vec::new(), residuals, vec![jacobian]).log_evidence()
        };
        // The larger the derivatives the smaller the share of the prior that fits.
        assert!(evidence(stack(1.0), stack(10.0)) < evidence(stack(1.0), stack(1.0)));
        for broken in [f64::NAN, f64::INFINITY, f64::MAX] {
            assert_eq!(evidence(stack(1.0), stack(broken)), f64::NEG_INFINITY, "{broken}");
            assert_eq!(evidence(stack(broken), stack(1.0)), f64::NEG_INFINITY, "{broken}");
        }
    }
}
