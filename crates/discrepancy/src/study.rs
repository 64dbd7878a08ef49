//! The episodes that a model is fitted to, with what residuals of a right one would look like.

use nalgebra::DVector;

use crate::nominal::Engine;
use crate::simulator::{Hypothesis, Nudge, Simulator};
use crate::whitener::Whitener;

/// Residuals of some episodes, one vector each.
pub type Stack = Vec<DVector<f64>>;

/// Episodes with their whiteners.
#[derive(Debug)]
pub struct Study<'a> {
    /// Simulates.
    pub simulator: &'a Simulator<'a>,
    /// Settings of the engine.
    pub engine: Engine,
    /// Indices of the episodes.
    pub chosen: Vec<usize>,
    whiteners: Vec<Whitener>,
}

/// Standard deviation of an error that lasts, in differences of the variants below.
const ERROR_SCALE: f64 = 1.5;

/// Settings under which a right model's answers should not differ.
fn variants(engine: &Engine) -> [Engine; 5] {
    [
        Engine { refinement: 2 * engine.refinement, ..*engine },
        Engine { refinement: 3 * engine.refinement, solver_iterations: 2, ..*engine },
        Engine { solver_iterations: 2 * engine.solver_iterations, ..*engine },
        Engine { contact_frequency_hz: 3.0 * engine.contact_frequency_hz, ..*engine },
        Engine { on_points: !engine.on_points, ..*engine },
    ]
}

impl<'a> Study<'a> {
    /// Of the episodes `chosen`, with plain sensor noise.
    #[must_use]
    pub fn new(simulator: &'a Simulator<'a>, engine: Engine, chosen: Vec<usize>) -> Self {
        let plain = |index: &usize| Whitener::new(simulator.trials[*index].blocks.len(), &[]);
        let whiteners = chosen.iter().map(plain).collect();
        Self { simulator, engine, chosen, whiteners }
    }

    /// Residuals of all its episodes, standardised but not white.
    #[must_use]
    pub fn raw(&self, hypothesis: &Hypothesis) -> Vec<Vec<f64>> {
        self.simulator.residuals(hypothesis, &self.engine, Nudge::default(), &self.chosen)
    }

    /// Makes residuals white, and large ones count by their size instead of its square (Huber): half the square of the result is the loss.
    #[must_use]
    pub fn white(&self, raw: &[Vec<f64>]) -> Stack {
        self.whiteners.iter().zip(raw).map(|(whitener, raw)| whitener.apply(raw).map(huber)).collect()
    }

    /// The episodes at `places` of [`Self::chosen`] alone.
    #[must_use]
    pub fn part(&self, places: &[usize]) -> Self {
        Self {
            simulator: self.simulator,
            engine: self.engine,
            chosen: places.iter().map(|place| self.chosen[*place]).collect(),
            whiteners: places.iter().map(|place| self.whiteners[*place].clone()).collect(),
        }
    }

    /// Learns from simulations near `hypothesis` how large errors that last may be: those of the solver, and of the start.
    pub fn learn_errors(&mut self, hypothesis: &Hypothesis) {
        let simulate = |engine: &Engine, nudge| self.simulator.residuals(hypothesis, engine, nudge, &self.chosen);
        let plain = simulate(&self.engine, Nudge::default());
        let mut causes: Vec<Vec<Vec<f64>>> =
            variants(&self.engine).iter().map(|engine| simulate(engine, Nudge::default())).collect();
        let unit = |index: usize| std::array::from_fn(|i| if i == index { 1.0 } else { 0.0 });
        for index in 0..3 {
            causes.push(simulate(&self.engine, Nudge { pose: unit(index), ..Nudge::default() }));
        }
        let moving = |place: usize| self.simulator.trials[self.chosen[place]].start_stddev[2] > 0.0;
        if (0..self.chosen.len()).any(moving) {
            for index in 0..3 {
                causes.push(simulate(&self.engine, Nudge { linear: unit(index), ..Nudge::default() }));
                causes.push(simulate(&self.engine, Nudge { angular: unit(index), ..Nudge::default() }));
            }
        }
        self.whiteners = (0..self.chosen.len())
            .map(|place| {
                let columns: Vec<Vec<f64>> = causes
                    .iter()
                    .map(|cause| cause[place].iter().zip(&plain[place]).map(|(a, b)| ERROR_SCALE * (a - b)).collect())
                    .collect();
                Whitener::new(plain[place].len(), &columns)
            })
            .collect();
    }

    /// Number of residuals.
    #[must_use]
    pub fn count(&self) -> usize {
        self.chosen.iter().map(|index| self.simulator.trials[*index].blocks.len()).sum()
    }
}

/// Beyond this many standard deviations a residual is no sensor noise: a contact came earlier or later than the model has it.
const HUBER: f64 = 4.0;

/// The number whose square is twice Huber's loss.
fn huber(residual: f64) -> f64 {
    let size = residual.abs();
    if size <= HUBER { residual } else { (HUBER * (2.0 * size - HUBER)).sqrt().copysign(residual) }
}

/// Sum of squares.
#[must_use]
pub fn chi2(stack: &Stack) -> f64 {
    stack.iter().map(DVector::norm_squared).sum()
}

/// Sum of products.
#[must_use]
pub fn dot(a: &Stack, b: &Stack) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// (a − b) / by.
#[must_use]
pub fn difference(a: &Stack, b: &Stack, by: f64) -> Stack {
    a.iter().zip(b).map(|(a, b)| (a - b) / by).collect()
}
