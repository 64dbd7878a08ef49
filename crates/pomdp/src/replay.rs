//! Episodes that can be simulated again: what inference over a whole history needs.

use std::ops::Range;

use crate::Rng;

/// A discrete part of what is unknown at the start of an episode, with the coordinates that only it gives a meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    /// Prior probability of each class. They sum to 1, and factors are independent of each other.
    pub probabilities: Vec<f64>,
    /// Coordinates that a change of the class asks to draw anew.
    pub coordinates: Range<usize>,
}

/// What happened in an episode so far, as a function of everything that is unknown about it.
///
/// A hypothesis is a class of each [`Factor`], standard normal coordinates of the start, and standard normal coordinates of each step's noise. The
/// prior of the classes is that of the factors, and the prior of all coordinates N(0, I): a model maps them to its own quantities by quantile
/// functions. Coordinates that the classes do not use keep N(0, 1), so that hypotheses of different structure have one space.
pub trait Replay: Sync {
    /// State of the model.
    type State: Clone + Send + Sync;

    /// The discrete parts.
    fn factors(&self) -> &[Factor];

    /// Number of coordinates of a start.
    fn coordinates(&self) -> usize;

    /// Coordinates that belong together. Inference moves a block at a time, among other moves.
    fn blocks(&self) -> &[Range<usize>];

    /// Number of coordinates of the noise of one step.
    fn step_coordinates(&self) -> usize;

    /// Steps so far.
    fn steps(&self) -> usize;

    /// The state before the first step, and ln of the likelihood of what was seen before it. `None` where there is no such state.
    fn start(&self, classes: &[usize], coordinates: &[f64]) -> Option<(Self::State, f64)>;

    /// Leads `state` through step number `step`, from 0. Returns ln p(observation of that step | state before it), with the noise of the transition
    /// integrated out; −∞ where the step cannot have been that one. The state after it has the noise that `coordinates` choose from what the
    /// observation leaves possible.
    fn advance(&self, step: usize, state: &mut Self::State, coordinates: &[f64]) -> f64;

    /// Upper bound of what [`Self::advance`] returns for step number `step`. A tight one saves simulation: a hypothesis that cannot be accepted any
    /// more is given up.
    fn most(&self, _step: usize) -> f64 {
        f64::INFINITY
    }
}

/// An outside estimate of the posterior given the whole history so far, such as a network that was trained on complete episodes. A start is
/// that of a [`Replay`]: a class of each factor, and coordinates.
pub trait Teacher: Sync {
    /// A start drawn from the estimate; `None` where a draw is impossible.
    fn draw(&self, rng: &mut Rng) -> Option<(Vec<usize>, Vec<f64>)>;

    /// ln of the density of the estimate over that of the prior, at a start.
    fn log_ratio(&self, classes: &[usize], coordinates: &[f64]) -> f64;
}
