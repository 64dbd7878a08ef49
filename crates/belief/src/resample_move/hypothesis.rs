//! A hypothesis about a whole episode.

use pomdp::{Replay, Rng, Teacher};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

/// A hypothesis about an episode, with the state that it leads to.
#[derive(Clone, Debug)]
pub(crate) struct Hypothesis<S> {
    /// Class of each factor.
    pub(crate) classes: Vec<usize>,
    /// Coordinates of the start.
    pub(crate) start: Vec<f64>,
    /// Coordinates of the noise of the steps so far, one after the other.
    pub(crate) noise: Vec<f64>,
    /// ln likelihood of what was seen before the first step, then of each step.
    pub(crate) logs: Vec<f64>,
    /// State after the last step.
    pub(crate) state: S,
}

/// What [`replay`] came to.
pub(crate) struct Replayed<S> {
    pub(crate) hypothesis: Option<Hypothesis<S>>,
    pub(crate) transitions: usize,
}

/// One standard normal number.
pub(crate) fn normal(rng: &mut Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A class drawn from probabilities that sum to 1.
pub(crate) fn class(probabilities: &[f64], rng: &mut Rng) -> usize {
    let mut rest: f64 = rng.random();
    for (class, probability) in probabilities.iter().enumerate() {
        rest -= probability;
        if rest < 0.0 {
            return class;
        }
    }
    // Rounding left a sliver above the sum.
    probabilities.iter().rposition(|p| *p > 0.0).unwrap_or(0)
}

/// A draw from the prior before the first step; `None` where it is impossible.
pub(crate) fn draw<R: Replay>(episode: &R, rng: &mut Rng) -> Option<Hypothesis<R::State>> {
    let classes: Vec<usize> = episode.factors().iter().map(|factor| class(&factor.probabilities, rng)).collect();
    let start: Vec<f64> = (0..episode.coordinates()).map(|_| normal(rng)).collect();
    let (state, log) = episode.start(&classes, &start)?;
    Some(Hypothesis { classes, start, noise: Vec::new(), logs: vec![log], state })
}

impl<S> Hypothesis<S> {
    /// Σ ln likelihood, the last step to the power `exponent`.
    pub(crate) fn log_likelihood(&self, exponent: f64) -> f64 {
        let (last, before) = self.logs.split_last().expect("there is what was seen before the first step");
        before.iter().sum::<f64>() + if exponent == 0.0 { 0.0 } else { exponent * last }
    }

    /// What a teacher says of its start.
    pub(crate) fn log_ratio(&self, teacher: &impl Teacher) -> f64 {
        teacher.log_ratio(&self.classes, &self.start)
    }

    /// Leads the hypothesis through one more step.
    pub(crate) fn extend<R: Replay<State = S>>(&mut self, episode: &R, step: usize, rng: &mut Rng) {
        let noise: Vec<f64> = (0..episode.step_coordinates()).map(|_| normal(rng)).collect();
        self.logs.push(finite(episode.advance(step, &mut self.state, &noise)));
        self.noise.extend(noise);
    }
}

/// The hypothesis of these coordinates, led through all steps, the last one to the power `exponent`. `None` as soon as Σ ln likelihood cannot
/// exceed `least` any more.
pub(crate) fn replay<R: Replay>(
    episode: &R,
    (classes, start, noise): (Vec<usize>, Vec<f64>, Vec<f64>),
    exponent: f64,
    least: f64,
) -> Replayed<R::State> {
    let steps = episode.steps();
    let given_up = |transitions| Replayed { hypothesis: None, transitions };
    let Some((mut state, log)) = episode.start(&classes, &start) else { return given_up(0) };
    let power = |step: usize| if step + 1 == steps { exponent } else { 1.0 };
    let mut rest: f64 = (0..steps).map(|step| power(step) * episode.most(step)).sum();
    let mut logs = Vec::with_capacity(steps + 1);
    logs.push(log);
    let mut total = log;
    let count = episode.step_coordinates();
    for step in 0..steps {
        let noise = &noise[step * count..(step + 1) * count];
        if total + rest <= least {
            return given_up(step);
        }
        rest -= power(step) * episode.most(step);
        let log = finite(episode.advance(step, &mut state, noise));
        if log == f64::NEG_INFINITY && power(step) > 0.0 {
            return given_up(step + 1);
        }
        total += power(step) * log;
        logs.push(log);
    }
    if total <= least {
        return given_up(steps);
    }
    Replayed { hypothesis: Some(Hypothesis { classes, start, noise, logs, state }), transitions: steps }
}

/// NaN and +∞ are broken likelihoods: such a hypothesis must not win.
fn finite(log: f64) -> f64 {
    if log < f64::INFINITY { log } else { f64::NEG_INFINITY }
}
