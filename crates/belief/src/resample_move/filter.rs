//! The filter: one step of all hypotheses, then resampling and moves where too few are left.

use pomdp::{Replay, Rng, UpdateReport};
use rand::RngExt as _;

use super::config::ResampleMoveConfig;
use super::hypothesis::{Hypothesis, draw};
use super::moves::{Moved, attempt};
use crate::diagnostics::{log_effective_sample_size, log_sum_exp};
use crate::parallel::each;
use crate::{Error, Particles};

/// Draws of one possible start.
const DRAWS: usize = 1000;
/// Bisections of an exponent: more than the digits of a double.
const BISECTIONS: usize = 60;
/// Most bridges of one update.
const MOST_BRIDGES: usize = 30;

/// Iterated batch importance sampling (Chopin 2002; resample–move, Gilks and Berzuini 2001) over hypotheses about a whole episode.
///
/// Every particle is a hypothesis of [`Replay`]: classes and coordinates of the start, and coordinates of the noise of each step. An observation
/// weighs them. Where the effective sample size falls below its share, the filter resamples and moves particles by Metropolis–Hastings kernels
/// whose target is the posterior given the whole history, which each proposal replays. So parameters that the particles do not have can still be
/// found, and nothing is forgotten. An observation that leaves too few particles is taken in by powers of its likelihood (tempering; Del Moral,
/// Doucet and Jasra 2006).
///
/// The noise of a step is integrated out of its likelihood, and its draw is a function of the hypothesis's coordinates. A replay is then an
/// unbiased estimate of the likelihood by one particle with the optimal proposal, and the moves are correlated pseudo-marginal ones (Deligiannidis,
/// Doucet and Pitt 2018): their target is exact for any number of particles.
#[derive(Clone, Debug)]
pub struct ResampleMoveFilter<S> {
    config: ResampleMoveConfig,
    hypotheses: Vec<Hypothesis<S>>,
    log_weights: Vec<f64>,
}

impl<S: Clone + Send + Sync> ResampleMoveFilter<S> {
    /// A filter of an episode that has just begun.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] where a value lies outside its limits; [`Error::Empty`] where no start is possible.
    pub fn new<R: Replay<State = S>>(config: ResampleMoveConfig, episode: &R, rng: &mut Rng) -> Result<Self, Error> {
        config.validate()?;
        let drawn = each(config.particles, rng, |_, rng| (0..DRAWS).find_map(|_| draw(episode, rng)));
        let hypotheses: Vec<Hypothesis<S>> = drawn.into_iter().flatten().collect();
        if hypotheses.is_empty() {
            return Err(Error::Empty);
        }
        let log_weights = hypotheses.iter().map(|h| h.logs[0]).collect();
        let mut filter = Self { config, hypotheses, log_weights };
        filter.normalise();
        Ok(filter)
    }

    /// The belief: the hypotheses' states.
    ///
    /// # Errors
    ///
    /// Never: the weights are a distribution.
    pub fn belief(&self) -> Result<Particles<S>, Error> {
        let states = self.hypotheses.iter().map(|h| h.state.clone()).collect();
        Particles::weighted(states, self.log_weights.iter().map(|w| w.exp()).collect())
    }

    /// Takes in the last step of `episode`, which the filter has followed up to the step before.
    ///
    /// # Errors
    ///
    /// [`Error::Depleted`] where no hypothesis explains the step.
    pub fn update<R: Replay<State = S>>(&mut self, episode: &R, rng: &mut Rng) -> Result<UpdateReport, Error> {
        let step = episode.steps() - 1;
        let mut report = UpdateReport { temperature: 1.0, ..UpdateReport::default() };
        let count = self.hypotheses.len();
        self.hypotheses = each(count, rng, |index, rng| {
            let mut next = self.hypotheses[index].clone();
            next.extend(episode, step, rng);
            next
        });
        report.transitions = count;
        let last = |h: &Hypothesis<S>| h.logs[step + 1];
        let possible = self.hypotheses.iter().filter(|h| last(h) > f64::NEG_INFINITY).count();
        report.acceptance = possible as f64 / count as f64;
        if possible == 0 {
            return Err(Error::Depleted { attempts: report.transitions, diverged: 0, terminal: 0 });
        }
        let weighed = |power: f64, weights: &[f64], hypotheses: &[Hypothesis<S>]| -> Vec<f64> {
            weights.iter().zip(hypotheses).map(|(w, h)| if power == 0.0 { *w } else { w + power * last(h) }).collect()
        };
        let full = weighed(1.0, &self.log_weights, &self.hypotheses);
        report.effective_sample_size_before = log_effective_sample_size(full.iter().copied());
        let least = self.config.resample_share * count as f64;
        let budget = self.config.move_transitions;
        let (mut spent, mut tried, mut accepted) = (0, 0, 0);
        let mut reached = 0.0;
        loop {
            let power = next_power(1.0 - reached, least, |p| {
                log_effective_sample_size(weighed(p, &self.log_weights, &self.hypotheses).into_iter())
            });
            // What is left of the step comes at once where the budget is spent: weights stay right, with fewer particles behind them.
            let out_of_budget = spent >= budget || report.bridges >= MOST_BRIDGES;
            let power = if out_of_budget { 1.0 - reached } else { power };
            self.log_weights = weighed(power, &self.log_weights, &self.hypotheses);
            let total = log_sum_exp(self.log_weights.iter().copied());
            report.log_evidence += total;
            self.normalise();
            reached = if power >= 1.0 - reached { 1.0 } else { reached + power };
            let size = log_effective_sample_size(self.log_weights.iter().copied());
            let last = reached >= 1.0;
            // After bridges the particles are copies that have hardly moved.
            if size < least * (1.0 + 1e-9) || (last && report.bridges > 0) {
                self.resample(rng);
                report.resampled = true;
                for _ in 0..if last { self.config.sweeps } else { 1 } {
                    if spent >= budget {
                        break;
                    }
                    let (transitions, moved) = self.sweep(episode, reached, rng);
                    spent += transitions;
                    tried += count;
                    accepted += moved;
                }
            }
            if reached >= 1.0 {
                break;
            }
            report.bridges += 1;
        }
        report.transitions += spent;
        report.move_acceptance = if tried > 0 { accepted as f64 / tried as f64 } else { 0.0 };
        report.reinvigorated = accepted.min(count);
        report.particles = count;
        report.effective_sample_size = log_effective_sample_size(self.log_weights.iter().copied());
        Ok(report)
    }

    /// One move of every particle. Returns transitions and accepted moves.
    fn sweep<R: Replay<State = S>>(&mut self, episode: &R, exponent: f64, rng: &mut Rng) -> (usize, usize) {
        let before = &self.hypotheses;
        let moved = each(before.len(), rng, |index, rng| attempt(episode, &before[index], before, exponent, rng));
        let (mut transitions, mut accepted) = (0, 0);
        for (hypothesis, Moved { hypothesis: next, transitions: cost }) in self.hypotheses.iter_mut().zip(moved) {
            transitions += cost;
            if let Some(next) = next {
                accepted += 1;
                *hypothesis = next;
            }
        }
        (transitions, accepted)
    }

    fn normalise(&mut self) {
        let total = log_sum_exp(self.log_weights.iter().copied());
        self.log_weights.iter_mut().for_each(|w| *w -= total);
    }

    fn resample(&mut self, rng: &mut Rng) {
        let count = self.hypotheses.len();
        let chosen = systematic(&self.log_weights, count, |index| &self.hypotheses[index].classes, rng);
        self.hypotheses = chosen.into_iter().map(|index| self.hypotheses[index].clone()).collect();
        self.log_weights = vec![-(count as f64).ln(); count];
    }
}

/// Systematic resampling of `count` from weights that sum to 1, sorted by classes so that each structure gets its share to within one particle.
/// Returns indices.
pub(crate) fn systematic<'a>(
    log_weights: &[f64],
    count: usize,
    classes: impl Fn(usize) -> &'a Vec<usize>,
    rng: &mut Rng,
) -> Vec<usize> {
    let mut order: Vec<usize> = (0..log_weights.len()).collect();
    order.sort_by(|&a, &b| classes(a).cmp(classes(b)));
    let offset: f64 = rng.random();
    let mut chosen = Vec::with_capacity(count);
    let mut total = 0.0;
    for &index in &order {
        total += log_weights[index].exp() * count as f64;
        while (chosen.len() as f64) + offset < total && chosen.len() < count {
            chosen.push(index);
        }
    }
    // Rounding may leave one place.
    while chosen.len() < count {
        chosen.push(chosen[chosen.len() - 1]);
    }
    chosen
}

/// The largest power up to `most` at which the effective size is at least `least`.
fn next_power(most: f64, least: f64, size: impl Fn(f64) -> f64) -> f64 {
    if size(most) >= least {
        return most;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if size(middle) >= least { low = middle } else { high = middle }
    }
    // Impossible hypotheses alone can bring the size below: they go at once, at any power.
    if low == 0.0 { high.min(most) } else { low }
}
