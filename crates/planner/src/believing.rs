//! Rollouts by an agent that does not see the state: a particle filter goes along.
//!
//! A rollout that sees the state never pays for information and expects none to be missing. The rollouts of PFT-DPW (Sunberg and Kochenderfer, ICAPS
//! 2018) act on what the agent would believe instead; this is that rollout, from a branch of the weighted tree.

use pomdp::{ObservationModel, Outcome, Policy, Rng};
use rand::RngExt as _;

use crate::rollout::{Rollout, Span};

/// As [`crate::rollout::rollout`], with actions of an agent that believes in the weighted states `belief`, none of weight zero, and learns from what
/// `state` shows. Where no state of its belief explains that, it knows the state from then on.
pub(crate) fn rollout<M, P>(
    model: &M,
    policy: &P,
    state: &mut M::State,
    mut belief: Vec<(M::State, f64)>,
    span: Span,
    rng: &mut Rng,
) -> Rollout
where
    M: ObservationModel,
    P: Policy<M> + ?Sized,
{
    let mut result = Rollout { discounted_return: 0.0, transitions: 0, outcome: Outcome::Continue };
    let (mut weight, discount, count) = (1.0, model.discount(), belief.len());
    if belief.is_empty() {
        belief.push((state.clone(), 1.0));
    }
    while result.transitions < span.actions && result.outcome == Outcome::Continue {
        let action = policy.belief_action(model, &belief, rng);
        let step = model.step(state, &action, rng);
        result.discounted_return += weight * step.reward;
        result.transitions += 1;
        result.outcome = step.outcome;
        weight *= discount;
        if step.outcome == Outcome::Continue && result.transitions < span.left {
            learn(model, &mut belief, state, &action, &step.observation, rng);
            resample(&mut belief, count, rng);
        }
    }
    if result.outcome == Outcome::Continue && result.transitions < span.left {
        result.discounted_return += weight * policy.belief_value(model, &belief, span.left - result.transitions);
    }
    result
}

/// Bayes' rule on weighted states. The likelihood of `state`, which made the observation, counts as one.
fn learn<M: ObservationModel>(
    model: &M,
    belief: &mut Vec<(M::State, f64)>,
    state: &M::State,
    action: &M::Action,
    observation: &M::Observation,
    rng: &mut Rng,
) {
    let log_reference = model.log_likelihood(action, state, observation);
    let log_reference = if log_reference.is_finite() { log_reference } else { 0.0 };
    let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
    belief.retain_mut(|(particle, weight)| {
        if model.step(particle, action, rng).outcome != Outcome::Continue {
            return false;
        }
        let log_ratio = model.log_likelihood(action, particle, observation) - log_reference;
        *weight *= if log_ratio.is_nan() { 0.0 } else { log_ratio.min(600.0).exp() } / total;
        *weight > 0.0
    });
    if belief.is_empty() {
        belief.push((state.clone(), 1.0));
    }
}

/// `count` equal weights where the effective sample size (Σw)² / Σw² is below half of that: stratified, in the order of the states.
fn resample<S: Clone>(belief: &mut Vec<(S, f64)>, count: usize, rng: &mut Rng) {
    let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
    let squares: f64 = belief.iter().map(|(_, weight)| (weight / total).powi(2)).sum();
    if 2.0 >= squares * count as f64 {
        return;
    }
    let (mut at, mut sum) = (0, belief[0].1);
    let mut drawn = Vec::with_capacity(count);
    for index in 0..count {
        let mark = (index as f64 + rng.random::<f64>()) / count as f64 * total;
        while sum <= mark && at + 1 < belief.len() {
            at += 1;
            sum += belief[at].1;
        }
        drawn.push((belief[at].0.clone(), 1.0));
    }
    *belief = drawn;
}
