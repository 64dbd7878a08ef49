//! From the prediction to the posterior over bridges, where one step would leave too few particles.

use pomdp::Rng;
use rand::RngExt as _;

use super::round::{Offers, Posterior, Round, Trackable, Walker, mixture};
use super::simulate::{Simulated, each};
use crate::diagnostics::{log_effective_sample_size, log_sum_exp};
use crate::resample::{resample, resample_with_shares};

/// Share of the first draws that follows the prediction whatever the pilot run says: no state's weight exceeds 1 over it.
const UNGUIDED_SHARE: f64 = 0.1;
/// Exponents that are looked at before bisection.
const GRID: usize = 16;
const BISECTIONS: usize = 30;
/// First step of the moves, as a share of the kernel's width.
const FIRST_STEP: f64 = 0.7;

/// Walkers with ln weights before the likelihood.
type Weighted<S> = (Vec<Walker<S>>, Vec<f64>);

/// φ ln g, where an impossible observation stays impossible at φ = 0.
fn tempered(exponent: f64, log_likelihood: f64) -> f64 {
    if log_likelihood == f64::NEG_INFINITY { log_likelihood } else { exponent * log_likelihood }
}

/// Largest exponent in (0, `most`] at which `size` reaches `wanted`; the best of a grid where none does.
fn exponent(most: f64, wanted: f64, size: impl Fn(f64) -> f64) -> f64 {
    if size(most) >= wanted {
        return most;
    }
    // A geometric grid: likelihoods of many sensors need exponents of a thousandth.
    let mut above = most;
    let mut best = (0.0, most);
    for _ in 0..2 * GRID {
        let candidate = above / 2.0;
        let reached = size(candidate);
        if reached >= wanted {
            let (mut low, mut high) = (candidate, above);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                if size(middle) >= wanted { low = middle } else { high = middle }
            }
            return low;
        }
        if reached > best.0 {
            best = (reached, candidate);
        }
        above = candidate;
    }
    best.1
}

/// Sequential Monte Carlo over the exponents of the likelihood (Del Moral, Doucet and Jasra 2006; Neal 2001) with kernels before the step.
///
/// `None` where nothing can be simulated any more, or nothing explains the observation.
pub(crate) fn temper<M: Trackable>(
    round: &mut Round<'_, M>,
    pilot: &[Walker<M::State>],
    offers: &Offers<M::State>,
    rng: &mut Rng,
) -> Option<Posterior<M::State>> {
    let (mut walkers, mut log_weights) = first_stage(round, pilot, offers, rng)?;
    let shrinkage = round.config.shrinkage();
    let (mut reached, mut log_evidence) = (0.0_f64, 0.0);
    let (mut bridges, mut step, mut fresh) = (0, FIRST_STEP, false);
    let (mut tried, mut accepted) = (0_usize, 0_usize);
    loop {
        let likelihoods = || walkers.iter().map(|w| w.log_likelihood);
        let at = |by: f64| log_weights.iter().zip(likelihoods()).map(move |(w, l)| w + tempered(by, l));
        let wanted = round.config.tempering_share * walkers.len() as f64;
        let by = exponent(1.0 - reached, wanted, |by| log_effective_sample_size(at(by)));
        let gained = log_sum_exp(at(by));
        if gained == f64::NEG_INFINITY {
            return None;
        }
        log_evidence += gained;
        let last = by >= 1.0 - reached;
        reached = if last { 1.0 } else { reached + by };
        log_weights = at(by).map(|w| w - gained).collect();
        let weights: Vec<f64> = log_weights.iter().map(|w| w.exp()).collect();
        if last && crate::effective_sample_size(&weights) >= round.config.resample_share * walkers.len() as f64 {
            break;
        }
        let count = if last { round.wanted(&weights, &walkers, rng) } else { walkers.len() };
        let affordable = round.config.max_transitions.saturating_sub(round.tally.transitions);
        if bridges == round.config.max_bridges || count > affordable {
            let at_end = log_weights.iter().zip(likelihoods()).map(|(w, l)| w + tempered(1.0 - reached, l));
            log_evidence += log_sum_exp(at_end);
            break;
        }
        let drawn = resample(&weights, &round.kinds(&walkers), round.prediction.mass.len(), count, round.quota(), rng);
        walkers = drawn.iter().map(|&(index, _)| walkers[index].clone()).collect();
        log_weights = drawn.iter().map(|&(_, weight)| weight.ln()).collect();
        let moves =
            each(walkers.len(), rng, |index, rng| attempt(round, &walkers[index], reached, step, shrinkage, rng));
        let (mut tried_now, mut accepted_now) = (0, 0);
        for (walker, attempt) in walkers.iter_mut().zip(moves) {
            tried_now += 1;
            let Some(attempt) = attempt else { continue };
            round.tally.add(&attempt.simulated);
            if attempt.accepted {
                accepted_now += 1;
                let Simulated { next, log_likelihood, .. } = attempt.simulated;
                *walker = Walker { theta: attempt.theta, next, log_likelihood, ..*walker };
            }
        }
        (tried, accepted) = (tried + tried_now, accepted + accepted_now);
        let share = accepted_now as f64 / tried_now as f64;
        step = if share > 0.4 {
            (1.5 * step).min(1.0)
        } else if share < 0.2 {
            step / 1.5
        } else {
            step
        };
        bridges += 1;
        if last {
            fresh = true;
            break;
        }
    }
    let moved = if shrinkage.1 > 0.0 { walkers.iter().filter(|w| !w.theta.is_empty()).count() } else { 0 };
    let move_acceptance = if tried == 0 { 0.0 } else { accepted as f64 / tried as f64 };
    Some(Posterior {
        walkers,
        log_weights,
        log_evidence,
        bridges,
        temperature: reached,
        move_acceptance,
        moved,
        resampled: true,
        fresh,
    })
}

/// Walkers and ln weights that stand for the smoothed prediction, drawn where the pilot run found the observation likely: the first stage of
/// an auxiliary particle filter (Pitt and Shephard 1999; Liu and West 2001).
fn first_stage<M: Trackable>(
    round: &mut Round<'_, M>,
    pilot: &[Walker<M::State>],
    offers: &Offers<M::State>,
    rng: &mut Rng,
) -> Option<Weighted<M::State>> {
    let prior = &round.prediction.weights;
    let at = |by: f64| prior.iter().zip(pilot).map(move |(w, p)| w.ln() + tempered(by, p.log_likelihood));
    let by = exponent(1.0, round.config.tempering_share * prior.len() as f64, |by| log_effective_sample_size(at(by)));
    let total = log_sum_exp(at(by));
    let guided: Vec<f64> = if total == f64::NEG_INFINITY {
        prior.clone()
    } else {
        at(by).zip(prior).map(|(log, w)| (1.0 - UNGUIDED_SHARE) * (log - total).exp() + UNGUIDED_SHARE * w).collect()
    };
    let affordable = round.config.max_transitions.saturating_sub(round.tally.transitions);
    let count = round.wanted(&guided, pilot, rng).max(prior.len()).min(round.config.particles_max);
    if count > affordable {
        return None;
    }
    let (kinds, structures) = (&round.prediction.kinds, round.prediction.mass.len());
    let (drawn, new_weights) = resample_with_shares(&guided, kinds, structures, count, round.quota(), rng);
    // Probability that a draw is this state, over the state's own probability.
    let favour = |i: usize| guided[i] / (drawn.len() as f64 * new_weights[kinds[i]]) / prior[i];
    let simulated = each(drawn.len(), rng, |at, rng| {
        let (start, _) = round.prediction.smoothed(round.model, drawn[at].0, round.config.shrinkage(), rng);
        let theta = round.model.parameters(&start);
        let log_ratio = round.log_ratio(drawn[at].0, &theta, Some(&start));
        (theta, log_ratio, round.step(start, rng))
    });
    // The balance of prediction and proposals is a function of the parameters alone, so that it sums to one whichever state they go with.
    let share = offers.drawn as f64 / (drawn.len() + offers.drawn) as f64;
    let drawn_share = (1.0 - share).ln() - (drawn.len() as f64).ln();
    let mut log_weights = Vec::with_capacity(drawn.len() + offers.walkers.len());
    let mut walkers = Vec::with_capacity(log_weights.capacity());
    for (&(ancestor, _), (theta, log_ratio, simulated)) in drawn.iter().zip(simulated) {
        round.tally.add(&simulated);
        log_weights.push(drawn_share - favour(ancestor).ln() - mixture(share, log_ratio));
        let Simulated { next, log_likelihood, .. } = simulated;
        walkers.push(Walker { ancestor, proposed: false, theta, next, log_likelihood });
    }
    for (walker, &log_ratio) in offers.walkers.iter().zip(&offers.log_ratios) {
        log_weights.push(share.ln() - (offers.drawn as f64).ln() - mixture(share, log_ratio));
        walkers.push(walker.clone());
    }
    Some((walkers, log_weights))
}

struct Attempt<S> {
    theta: Vec<f64>,
    simulated: Simulated<S>,
    accepted: bool,
}

/// A Metropolis–Hastings move of the parameters before the step, with the step simulated anew.
///
/// The proposal is reversible for the walker's own Gaussian (preconditioned Crank–Nicolson; Cotter, Roberts, Stuart and White 2013), which
/// is its kernel or, for an outside proposal, its structure's whole Gaussian, and for the model's transition: what remains of the
/// acceptance ratio is (g* / g)^φ.
fn attempt<M: Trackable>(
    round: &Round<'_, M>,
    walker: &Walker<M::State>,
    exponent: f64,
    step: f64,
    (a, h): (f64, f64),
    rng: &mut Rng,
) -> Option<Attempt<M::State>> {
    let prediction = round.prediction;
    let kind = prediction.kinds[walker.ancestor];
    let state = &prediction.states[walker.ancestor];
    let (theta, start) = if walker.theta.is_empty() {
        (Vec::new(), state.clone())
    } else {
        let (centre, width) = if walker.proposed {
            (prediction.mean(kind).to_vec(), 1.0)
        } else {
            (prediction.centre(walker.ancestor, a), h)
        };
        let kept = (1.0 - step * step).sqrt();
        let towards: Vec<f64> = centre.iter().zip(&walker.theta).map(|(c, x)| c + kept * (x - c)).collect();
        let theta = prediction.around(kind, &towards, step * width, rng);
        let start = round.model.with_parameters(state, &theta)?;
        (theta, start)
    };
    let simulated = round.step(start, rng);
    let gain = tempered(exponent, simulated.log_likelihood) - tempered(exponent, walker.log_likelihood);
    let accepted = simulated.log_likelihood > f64::NEG_INFINITY && rng.random::<f64>().ln() < gain;
    Some(Attempt { theta, simulated, accepted })
}
