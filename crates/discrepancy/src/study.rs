//! The episodes that a model is fitted to, with what residuals of a right one would look like.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::DVector;
use rayon::prelude::*;

use crate::budget::Budget;
use crate::cells::{Cells, Key, key};
use crate::clock::Clock;
use crate::likelihood::{Stack, cell_cost};
use crate::nominal::Engine;
use crate::simulator::{Hypothesis, Nudge, Simulator};
use crate::trial::{Block, Phase, groups};
use crate::whitener::Whitener;

/// Episodes with their whiteners.
#[derive(Clone, Debug)]
pub struct Study<'a> {
    /// Simulates.
    pub simulator: &'a Simulator<'a>,
    /// Settings of the engine.
    pub engine: Engine,
    /// Indices of the episodes.
    pub chosen: Vec<usize>,
    /// What its simulations are taken from; `None`: they cost nothing.
    budget: Option<&'a Budget>,
    whiteners: Vec<Whitener>,
    cells: Vec<Arc<Cells>>,
    /// What an error of the engine of size one does to the residuals of each episode, one for each of the variants.
    engine_errors: Vec<Vec<DVector<f64>>>,
}

/// Standard deviation of the start's error, in those of what is known of it, and of an error of the solver, in differences of the variants below.
const ERROR_SCALE: f64 = 1.5;
/// Slip below which a tool may let go. How much of a push it lifts or presses down where nothing slips sideways is indeterminate: an engine keeps what
/// the first touch left for good, another relaxes it.
const LETS_GO_MPS: f64 = 0.002;

/// By how much a table is higher (m), and turned about x and y (rad), at one place than at another: one standard deviation. What is thrown lands anywhere, on
/// another face each time, and neither table nor object is flat: ISO 2768-2, class K, allows 0.4 mm over 100 to 300 mm, which between two edges of an object
/// of 10 cm is a slope of some milliradians. What is pushed stays where its friction shows that better.
const UNEVEN: [f64; 3] = [0.000_2, 0.003, 0.003];

/// Settings under which a right model's answers should not differ, with the standard deviation of the error in such differences. What is thrown has no
/// tool and no sole.
fn variants(engine: &Engine, has_tool: bool) -> Vec<(Engine, f64)> {
    let mut variants = vec![
        (Engine { refinement: 2 * engine.refinement, ..*engine }, ERROR_SCALE),
        (Engine { refinement: 3 * engine.refinement, solver_iterations: 2, ..*engine }, ERROR_SCALE),
        (Engine { solver_iterations: 2 * engine.solver_iterations, ..*engine }, ERROR_SCALE),
    ];
    if has_tool {
        variants.push((Engine { on_points: !engine.on_points, ..*engine }, ERROR_SCALE));
        variants.push((Engine { tool_slip_mps: LETS_GO_MPS, ..*engine }, ERROR_SCALE));
    }
    variants
}

impl<'a> Study<'a> {
    /// Of the episodes `chosen`, with plain sensor noise.
    #[must_use]
    pub fn new(simulator: &'a Simulator<'a>, engine: Engine, chosen: Vec<usize>) -> Self {
        let plain = |index: &usize| Whitener::new(simulator.trials[*index].blocks.len(), &[]);
        let whiteners = chosen.iter().map(plain).collect();
        // What goes on is not known before a simulation: channels alone are told apart.
        let cells = |index: &usize| {
            let blocks = &simulator.trials[*index].blocks;
            let keys: Vec<Key> = blocks.iter().map(|block| key(block, Phase::FreeMotion)).collect();
            Arc::new(Cells::new(blocks, &keys))
        };
        let cells = chosen.iter().map(cells).collect();
        Self { simulator, engine, chosen, budget: None, whiteners, cells, engine_errors: Vec::new() }
    }

    /// The same with simulations that are taken from a budget.
    #[must_use]
    pub fn within(self, budget: &'a Budget) -> Self {
        Self { budget: Some(budget), ..self }
    }

    /// Whether so many more simulated episodes are within its budget.
    pub(crate) fn affords(&self, count: usize) -> bool {
        self.budget.is_none_or(|budget| budget.affords(count))
    }

    /// Whether its budget lets fits go on.
    pub(crate) fn has_fits(&self) -> bool {
        self.budget.is_none_or(Budget::has_fits)
    }

    /// Whether its budget lets a further effect be looked for.
    pub(crate) fn has_rounds(&self) -> bool {
        self.budget.is_none_or(Budget::has_rounds)
    }

    /// Takes a simulation of all its episodes from its budget.
    pub(crate) fn charge(&self) {
        if let Some(budget) = self.budget {
            self.chosen.iter().for_each(|index| budget.take(self.simulator.trials[*index].share));
        }
    }

    /// Residuals of all its episodes, standardised but not white.
    #[must_use]
    pub fn raw(&self, hypothesis: &Hypothesis) -> Vec<Vec<f64>> {
        if !self.simulator.is_ahead(hypothesis, &self.chosen) {
            self.charge();
        }
        self.simulator.residuals(hypothesis, &self.engine, Nudge::default(), &self.chosen)
    }

    /// Clocks at which what each stamps is explained best under a hypothesis, and the residuals of all episodes there, standardised but not white: one
    /// simulation, whatever the clocks.
    pub(crate) fn with_best_clocks(&self, hypothesis: &Hypothesis) -> (Vec<f64>, Vec<Vec<f64>>) {
        let clocks = self.simulator.nominal.clocks();
        if clocks == 0 {
            return (Vec::new(), self.raw(hypothesis));
        }
        self.charge();
        let grids: Vec<Vec<f64>> = Clock::ALL.iter().take(clocks).map(|clock| clock.grid()).collect();
        let scan = |index: &usize| self.simulator.scanned(hypothesis, &self.engine, *index);
        let scanned: Vec<_> = self.chosen.par_iter().map(scan).collect();
        let best = |(place, grid): (usize, &Vec<f64>)| -> usize {
            let clock = Clock::ALL[place];
            let cost = |at: usize| -> f64 {
                let episode = |(index, scanned): (&usize, &Vec<Vec<Vec<f64>>>)| {
                    let blocks = self.simulator.trials[*index].blocks.iter().zip(&scanned[place][at]);
                    let own =
                        blocks.filter(|(block, _)| clock.stamps(block.kind)).map(|(_, residual)| huber(*residual));
                    let (square, count) = own.fold((0.0, 0), |(sum, n), residual| (sum + residual * residual, n + 1));
                    cell_cost(square, count)
                };
                self.chosen.iter().zip(&scanned).map(episode).sum::<f64>() + 0.5 * grid[at] * grid[at]
            };
            let costs: Vec<f64> = (0..grid.len()).map(cost).collect();
            (0..grid.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0)
        };
        let best: Vec<usize> = grids.iter().enumerate().map(best).collect();
        // Each channel as its own clock stamps it; what none stamps is the same under all.
        let raw = |(index, scanned): (&usize, &Vec<Vec<Vec<f64>>>)| -> Vec<f64> {
            let of =
                |block: &Block| Clock::ALL.iter().take(clocks).position(|clock| clock.stamps(block.kind)).unwrap_or(0);
            let blocks = self.simulator.trials[*index].blocks.iter().map(of).enumerate();
            blocks.map(|(row, clock)| scanned[clock][best[clock]][row]).collect()
        };
        let raw = self.chosen.iter().zip(&scanned).map(raw).collect();
        (best.iter().zip(&grids).map(|(place, grid)| grid[*place]).collect(), raw)
    }

    /// Sets the clocks of a hypothesis to where what each stamps is explained best.
    pub(crate) fn set_clocks(&self, hypothesis: &mut Hypothesis) {
        if self.simulator.nominal.clocks() > 0 {
            let (clocks, _) = self.with_best_clocks(hypothesis);
            hypothesis.z[..clocks.len()].copy_from_slice(&clocks);
        }
    }

    /// Adds `sizes` of the engine's errors to residuals, makes them white, and large ones count by their size instead of its square (Huber):
    /// half the square of the result is the loss.
    #[must_use]
    pub fn white(&self, raw: &[Vec<f64>], sizes: &[f64]) -> Stack {
        let white = (self.whiteners.iter().zip(raw).enumerate()).map(|(place, (whitener, raw))| {
            let mut raw = DVector::from_column_slice(raw);
            for (error, size) in self.engine_errors.iter().zip(sizes) {
                raw.axpy(*size, &error[place], 1.0);
            }
            self.cells[place].transform(whitener.apply(raw)).map(huber)
        });
        Stack::new(white.collect(), self.cells.clone())
    }

    /// Number of the engine's errors.
    #[must_use]
    pub fn engine_errors(&self) -> usize {
        self.engine_errors.len()
    }

    /// The episodes at `places` of [`Self::chosen`] alone.
    #[must_use]
    pub fn part(&self, places: &[usize]) -> Self {
        Self {
            simulator: self.simulator,
            engine: self.engine,
            budget: self.budget,
            chosen: places.iter().map(|place| self.chosen[*place]).collect(),
            whiteners: places.iter().map(|place| self.whiteners[*place].clone()).collect(),
            cells: places.iter().map(|place| self.cells[*place].clone()).collect(),
            engine_errors: (self.engine_errors.iter())
                .map(|error| places.iter().map(|place| error[*place].clone()).collect())
                .collect(),
        }
    }

    /// Learns from simulations near `hypothesis` how large errors that last may be: those of the solver, and of the start; and which residuals share a scale.
    pub fn learn_errors(&mut self, hypothesis: &Hypothesis) {
        let simulate = |engine: &Engine, nudge| {
            self.charge();
            self.simulator.residuals(hypothesis, engine, nudge, &self.chosen)
        };
        self.charge();
        let (keys, plain): (Vec<_>, Vec<_>) =
            self.simulator.cells(hypothesis, &self.engine, &self.chosen).into_iter().unzip();
        let change = |engine: &Engine, nudge, scale: f64| -> Vec<DVector<f64>> {
            let changed = simulate(engine, nudge);
            let less = |(a, b): (&Vec<f64>, &Vec<f64>)| {
                DVector::from_iterator(a.len(), a.iter().zip(b).map(|(a, b)| scale * (a - b)))
            };
            changed.iter().zip(&plain).map(less).collect()
        };
        let engine_errors: Vec<Vec<DVector<f64>>> = (variants(&self.engine, self.simulator.nominal.has_tool()).iter())
            .map(|(engine, scale)| change(engine, Nudge::default(), *scale))
            .collect();
        let start_errors: Vec<Vec<DVector<f64>>> =
            self.starts().into_iter().map(|(nudge, scale)| change(&self.engine, nudge, scale)).collect();
        let columns = |place: usize| -> Vec<&[f64]> {
            engine_errors.iter().chain(&start_errors).map(|error| error[place].as_slice()).collect()
        };
        self.whiteners =
            (0..self.chosen.len()).map(|place| Whitener::new(plain[place].len(), &columns(place))).collect();
        // The start is another in each episode; the engine is the same in all, whatever else its errors do to a single one.
        self.engine_errors = engine_errors;
        let cells =
            |(index, keys): (&usize, &Vec<Key>)| Arc::new(Cells::new(&self.simulator.trials[*index].blocks, keys));
        self.cells = self.chosen.iter().zip(&keys).map(cells).collect();
    }

    /// Starts from which a right model's answers should not differ, with the standard deviation of the error in such differences.
    fn starts(&self) -> Vec<(Nudge, f64)> {
        let mut nudges: Vec<Nudge> = Vec::new();
        let unit = |index: usize| std::array::from_fn(|i| if i == index { 1.0 } else { 0.0 });
        nudges.extend((0..3).map(|index| Nudge { pose: unit(index), ..Nudge::default() }));
        let moving = |place: usize| self.simulator.trials[self.chosen[place]].start_stddev[2] > 0.0;
        if (0..self.chosen.len()).any(moving) {
            nudges.extend((0..3).map(|index| Nudge { linear: unit(index), ..Nudge::default() }));
            nudges.extend((0..3).map(|index| Nudge { angular: unit(index), ..Nudge::default() }));
        }
        if self.simulator.nominal.has_tool() {
            return nudges.into_iter().map(|nudge| (nudge, ERROR_SCALE)).collect();
        }
        nudges.extend((0..3).map(|index| Nudge { lift: unit(index), ..Nudge::default() }));
        let mut starts: Vec<(Nudge, f64)> = nudges.into_iter().map(|nudge| (nudge, ERROR_SCALE)).collect();
        starts.extend((0..3).map(|index| {
            let table = std::array::from_fn(|i| if i == index { UNEVEN[i] } else { 0.0 });
            (Nudge { table, ..Nudge::default() }, 1.0)
        }));
        starts
    }

    /// Simulations of each of its episodes that errors are learnt from.
    pub(crate) fn simulations_to_learn(&self) -> usize {
        1 + variants(&self.engine, self.simulator.nominal.has_tool()).len() + self.starts().len()
    }

    /// What a simulation of all its episodes costs, see [`Simulator::rollouts`].
    #[must_use]
    pub fn rollouts(&self) -> usize {
        self.simulator.cost(&self.chosen)
    }

    /// Places of the pieces of each episode.
    #[must_use]
    pub fn groups(&self) -> Vec<Range<usize>> {
        groups(self.chosen.iter().map(|index| &self.simulator.trials[*index]))
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

/// (a − b) / by.
#[must_use]
pub fn difference(a: &Stack, b: &Stack, by: f64) -> Stack {
    a.like(a.iter().zip(b.iter()).map(|(a, b)| (a - b) / by).collect())
}
