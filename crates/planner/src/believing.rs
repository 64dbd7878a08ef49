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

#[cfg(test)]
mod tests {
    use pomdp::{GenerativeModel, Purpose, Seed, Step};

    use super::*;

    /// A coin lies under a cup. A look costs 1 and tells its side, rightly with the given probability; a guess pays 10 or costs 10 and ends it.
    struct Coin(f64);

    #[derive(Clone, Copy, PartialEq, Debug)]
    enum Action {
        Look,
        Guess(bool),
    }

    impl GenerativeModel for Coin {
        type State = bool;
        type Action = Action;
        type Observation = bool;

        fn actions(&self) -> &[Action] {
            &[Action::Look, Action::Guess(false), Action::Guess(true)]
        }

        fn step(&self, heads: &mut bool, action: &Action, rng: &mut Rng) -> Step<bool> {
            let observation = *heads == rng.random_bool(self.0);
            match action {
                Action::Look => Step { observation, reward: -1.0, outcome: Outcome::Continue },
                Action::Guess(side) => {
                    Step { observation, reward: if side == heads { 10.0 } else { -10.0 }, outcome: Outcome::Terminal }
                }
            }
        }

        fn discount(&self) -> f64 {
            0.5
        }
    }

    impl ObservationModel for Coin {
        fn log_likelihood(&self, _action: &Action, heads: &bool, observation: &bool) -> f64 {
            if heads == observation { self.0.ln() } else { (1.0 - self.0).ln() }
        }
    }

    /// Guesses once it is sure.
    struct Careful;

    impl Policy<Coin> for Careful {
        fn action(&self, _model: &Coin, heads: &bool, _rng: &mut Rng) -> Action {
            Action::Guess(*heads)
        }

        fn belief_action(&self, _model: &Coin, belief: &[(bool, f64)], _rng: &mut Rng) -> Action {
            let sure = belief.iter().all(|(heads, _)| *heads == belief[0].0);
            if sure { Action::Guess(belief[0].0) } else { Action::Look }
        }

        fn leaf_value(&self, _model: &Coin, heads: &bool, _actions_left: usize) -> f64 {
            if *heads { 8.0 } else { 4.0 }
        }
    }

    fn run(model: &Coin, belief: &[(bool, f64)], actions: usize, left: usize) -> Rollout {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        rollout(model, &Careful, &mut true, belief.to_vec(), Span { actions, left }, &mut rng)
    }

    #[test]
    fn the_agent_of_a_rollout_pays_for_what_it_does_not_know() {
        // A sure look, then a right guess: −1 + 10/2. A policy that saw the state would earn 10.
        let even = [(true, 1.0), (false, 1.0)];
        let expected = Rollout { discounted_return: 4.0, transitions: 2, outcome: Outcome::Terminal };
        assert_eq!(run(&Coin(1.0), &even, 9, 9), expected);
        // Who is sure and wrong loses; who believes in nothing knows the state.
        assert_eq!(run(&Coin(1.0), &[(false, 1.0)], 9, 9).discounted_return, -10.0);
        assert_eq!(run(&Coin(1.0), &[], 9, 9).discounted_return, 10.0);
    }

    #[test]
    fn a_cut_rollout_adds_the_value_of_what_is_believed() {
        let uneven = [(true, 3.0), (false, 1.0)];
        assert_eq!(run(&Coin(1.0), &uneven, 0, 9).discounted_return, 0.75 * 8.0 + 0.25 * 4.0);
        assert_eq!(run(&Coin(1.0), &uneven, 1, 9).discounted_return, -1.0 + 0.5 * 8.0, "after a sure look");
        assert_eq!(run(&Coin(1.0), &uneven, 1, 1).discounted_return, -1.0, "nothing is left at the horizon");
    }

    #[test]
    fn weights_follow_bayes_rule() {
        let mut belief = vec![(true, 1.0), (false, 3.0)];
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        learn(&Coin(0.8), &mut belief, &true, &Action::Look, &true, &mut rng);
        // Odds 1 : 3, times 0.8 : 0.2.
        assert_eq!((belief[0].0, belief[1].0), (true, false));
        assert!((belief[0].1 / belief[1].1 - 4.0 / 3.0).abs() < 1e-12, "{belief:?}");
        learn(&Coin(1.0), &mut belief, &true, &Action::Look, &true, &mut rng);
        assert_eq!(belief.len(), 1, "what cannot be is not believed");
        learn(&Coin(1.0), &mut belief, &false, &Action::Look, &false, &mut rng);
        assert_eq!(belief, [(false, 1.0)], "where nothing explains an observation, the state does");
    }

    #[test]
    fn a_belief_of_few_is_made_as_many_in_proportion() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut belief = vec![(1, 0.75), (2, 0.25)];
        resample(&mut belief, 8, &mut rng);
        assert_eq!(belief.iter().map(|b| b.0).collect::<Vec<_>>(), [1, 1, 1, 1, 1, 1, 2, 2], "stratified");
        let even = vec![(1, 0.5), (2, 0.5), (3, 0.5)];
        belief.clone_from(&even);
        resample(&mut belief, 4, &mut rng);
        assert_eq!(belief, even, "three of four are enough");
    }
}
