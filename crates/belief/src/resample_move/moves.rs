//! Metropolis–Hastings moves whose target is the posterior given the whole history.

use pomdp::{Replay, Rng};
use rand::RngExt as _;

use super::hypothesis::{Hypothesis, Replayed, class, normal, replay};

/// Kinds of moves with their shares.
const DIFFERENCE: f64 = 0.4;
const BLOCK: f64 = 0.3;
const REDRAW: f64 = 0.2;
/// Largest step of a difference, as a share of 2.38 / √(2 d), the best for Gaussians (ter Braak 2006).
const SPREADS: [f64; 3] = [0.3, 0.7, 1.0];
/// Noise on a difference, so that no coordinate is stuck where all agree.
const JITTER: f64 = 0.02;
/// Steps of moves that are reversible for the prior.
const STEPS: [f64; 4] = [0.1, 0.3, 0.6, 1.0];

/// What a proposal changes.
pub(crate) struct Proposal {
    pub(crate) classes: Vec<usize>,
    pub(crate) start: Vec<f64>,
    pub(crate) noise: Vec<f64>,
    /// ln of prior × reverse proposal over prior × proposal.
    pub(crate) log_ratio: f64,
}

/// What one move came to.
pub(crate) struct Moved<S> {
    /// Where it was accepted.
    pub(crate) hypothesis: Option<Hypothesis<S>>,
    pub(crate) transitions: usize,
}

/// Tries one move of `current`. `others` is the population that differences are taken from.
pub(crate) fn attempt<R: Replay>(
    episode: &R,
    current: &Hypothesis<R::State>,
    others: &[Hypothesis<R::State>],
    exponent: f64,
    rng: &mut Rng,
) -> Moved<R::State> {
    let Some(Proposal { classes, start, noise, log_ratio }) = propose(episode, current, others, rng) else {
        return Moved { hypothesis: None, transitions: 0 };
    };
    let least = current.log_likelihood(exponent) + rng.random::<f64>().ln() - log_ratio;
    let Replayed { hypothesis, transitions } = replay(episode, (classes, start, noise), exponent, least);
    Moved { hypothesis, transitions }
}

/// A change of `current`; `None` where this kind of change is impossible.
pub(crate) fn propose<R: Replay>(
    episode: &R,
    current: &Hypothesis<R::State>,
    others: &[Hypothesis<R::State>],
    rng: &mut Rng,
) -> Option<Proposal> {
    let kind: f64 = rng.random();
    if kind < DIFFERENCE {
        difference(current, others, rng)
    } else if kind < DIFFERENCE + BLOCK {
        block(episode, current, rng)
    } else if kind < DIFFERENCE + BLOCK + REDRAW && !episode.factors().is_empty() {
        redraw(episode, current, rng)
    } else {
        refresh(current, rng)
    }
}

/// Differential evolution (ter Braak 2006): along the difference of two others of the same classes.
fn difference<S>(current: &Hypothesis<S>, others: &[Hypothesis<S>], rng: &mut Rng) -> Option<Proposal> {
    let mut other = || {
        (0..20).find_map(|_| {
            let other = &others[rng.random_range(0..others.len())];
            (other.classes == current.classes).then_some(&other.start)
        })
    };
    let (a, b) = (other()?, other()?);
    let share = [0.2, 0.5, 1.0][rng.random_range(0..3)];
    let spread = SPREADS[rng.random_range(0..SPREADS.len())];
    let mut start = current.start.clone();
    let chosen: Vec<usize> = (0..start.len()).filter(|_| rng.random::<f64>() < share).collect();
    let scale = spread * 2.38 / (2.0 * chosen.len().max(1) as f64).sqrt();
    for &i in &chosen {
        start[i] += scale * (a[i] - b[i]) + JITTER * normal(rng);
    }
    let half_square = |z: &[f64]| 0.5 * z.iter().map(|z| z * z).sum::<f64>();
    let log_ratio = half_square(&current.start) - half_square(&start);
    Some(Proposal { classes: current.classes.clone(), start, noise: current.noise.clone(), log_ratio })
}

/// Preconditioned Crank–Nicolson (Cotter, Roberts, Stuart and White 2013): reversible for N(0, I).
fn towards_prior(values: &mut [f64], step: f64, rng: &mut Rng) {
    let kept = (1.0 - step * step).sqrt();
    values.iter_mut().for_each(|z| *z = kept * *z + step * normal(rng));
}

fn block<R: Replay>(episode: &R, current: &Hypothesis<R::State>, rng: &mut Rng) -> Option<Proposal> {
    let blocks = episode.blocks();
    if blocks.is_empty() {
        return None;
    }
    let mut start = current.start.clone();
    let step = STEPS[rng.random_range(0..STEPS.len())];
    towards_prior(&mut start[blocks[rng.random_range(0..blocks.len())].clone()], step, rng);
    Some(Proposal { classes: current.classes.clone(), start, noise: current.noise.clone(), log_ratio: 0.0 })
}

/// Draws a class and what belongs to it anew from the prior.
fn redraw<R: Replay>(episode: &R, current: &Hypothesis<R::State>, rng: &mut Rng) -> Option<Proposal> {
    let factors = episode.factors();
    let index = rng.random_range(0..factors.len());
    let factor = &factors[index];
    let mut classes = current.classes.clone();
    let mut start = current.start.clone();
    classes[index] = class(&factor.probabilities, rng);
    let step = if rng.random::<f64>() < 0.5 { 1.0 } else { 0.3 };
    towards_prior(&mut start[factor.coordinates.clone()], step, rng);
    Some(Proposal { classes, start, noise: current.noise.clone(), log_ratio: 0.0 })
}

/// Other noise of the steps.
fn refresh<S>(current: &Hypothesis<S>, rng: &mut Rng) -> Option<Proposal> {
    if current.noise.is_empty() {
        return None;
    }
    let mut noise = current.noise.clone();
    let step = STEPS[rng.random_range(0..STEPS.len())];
    towards_prior(&mut noise, step, rng);
    Some(Proposal { classes: current.classes.clone(), start: current.start.clone(), noise, log_ratio: 0.0 })
}
