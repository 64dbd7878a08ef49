//! Problems with a finite number of states: exact beliefs, and what a state is worth to somebody who knows it.
//!
//! Published results are limited by the size of a particle filter as well as by the search. A problem that lists its next states needs no particles: its
//! belief follows Bayes' rule. [`FullInformation`] is the value of a leaf in the experiments of Sunberg and Kochenderfer (ICAPS 2018), where it is
//! called `FOValue(ValueIterationSolver())`, and QMDP is its best action on average (Littman, Cassandra and Kaelbling 1995).

use std::collections::BTreeMap;

use pomdp::{Belief, ObservationModel, Outcome, Rng, Step};
use rand::RngExt as _;

mod lookahead;
mod value;

pub use lookahead::Lookahead;
pub use value::{FullInformation, PricedUncertainty};

/// One way that a step can end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Successor<S> {
    /// Its probability.
    pub probability: f64,
    /// The next state.
    pub state: S,
    /// Reward of the step.
    pub reward: f64,
    /// Whether the episode goes on.
    pub outcome: Outcome,
}

/// A model whose states, next states and initial states can be listed.
pub trait Finite: ObservationModel {
    /// Number of states.
    fn states(&self) -> usize;

    /// Number of a state, below [`Self::states`].
    fn index(&self, state: &Self::State) -> usize;

    /// State of this number.
    fn state(&self, index: usize) -> Self::State;

    /// Calls `visit` for everything that a step can lead to. The probabilities are positive and sum to one.
    fn successors(&self, state: &Self::State, action: &Self::Action, visit: impl FnMut(Successor<Self::State>));

    /// Initial states with their probabilities.
    fn initial_distribution(&self) -> Vec<(Self::State, f64)>;
}

/// Steps a finite model: draws one of its successors, then the observation.
pub(crate) fn step<M: Finite>(
    model: &M,
    state: &mut M::State,
    action: &M::Action,
    rng: &mut Rng,
    observe: impl FnOnce(&M::State, &mut Rng) -> M::Observation,
) -> Step<M::Observation> {
    let mut mark = rng.random::<f64>();
    let mut drawn: Option<Successor<M::State>> = None;
    model.successors(state, action, |successor| {
        // Rounding may leave a mark above the sum: then the last successor stays.
        if mark >= 0.0 {
            mark -= successor.probability;
            drawn = Some(successor);
        }
    });
    let Successor { state: next, reward, outcome, .. } = drawn.expect("a step leads somewhere");
    *state = next;
    Step { observation: observe(state, rng), reward, outcome }
}

/// Draws an initial state of a finite model.
pub(crate) fn draw_initial<M: Finite>(model: &M, rng: &mut Rng) -> M::State {
    ExactBelief::initial(model).sample(rng).clone()
}

/// The distribution over states by Bayes' rule.
#[derive(Clone, Debug, PartialEq)]
pub struct ExactBelief<S> {
    states: Vec<S>,
    /// Sums of the probabilities up to and including each state; the last one is the total, one to rounding.
    cumulative: Vec<f64>,
}

impl<S: Clone> ExactBelief<S> {
    /// The belief before the first action.
    pub fn initial<M: Finite<State = S>>(model: &M) -> Self {
        Self::of(model.initial_distribution())
    }

    fn of(weighted: Vec<(S, f64)>) -> Self {
        let mut total = 0.0;
        let (mut states, mut cumulative) = (Vec::new(), Vec::new());
        for (state, probability) in weighted.into_iter().filter(|(_, p)| *p > 0.0) {
            total += probability;
            states.push(state);
            cumulative.push(total);
        }
        Self { states, cumulative }
    }

    /// The belief after `action` and `observation` in an episode that goes on. `None` where no state explains them.
    #[must_use]
    pub fn update<M: Finite<State = S>>(
        &self,
        model: &M,
        action: &M::Action,
        observation: &M::Observation,
    ) -> Option<Self> {
        given(model, self.predicted(model, action).1, action, observation).map(Self::of)
    }

    /// Expected reward of `action`, and the states after it in an episode that goes on. Their probabilities sum to that of going on.
    fn predicted<M: Finite<State = S>>(&self, model: &M, action: &M::Action) -> (f64, Vec<(S, f64)>) {
        let (mut reward, mut predicted) = (0.0, BTreeMap::<usize, (S, f64)>::new());
        for (state, probability) in self.probabilities() {
            model.successors(state, action, |next| {
                reward += probability * next.probability * next.reward;
                if next.outcome == Outcome::Continue {
                    let entry = predicted.entry(model.index(&next.state));
                    entry.or_insert_with(|| (next.state, 0.0)).1 += probability * next.probability;
                }
            });
        }
        (reward, predicted.into_values().collect())
    }

    /// States that are possible, with their probabilities.
    pub fn probabilities(&self) -> impl Iterator<Item = (&S, f64)> {
        let mut before = 0.0;
        self.states
            .iter()
            .zip(&self.cumulative)
            .map(move |(state, &sum)| (state, sum - std::mem::replace(&mut before, sum)))
    }
}

/// Predicted states with their probabilities after an observation. `None` where none explains it.
fn given<M: Finite>(
    model: &M,
    predicted: Vec<(M::State, f64)>,
    action: &M::Action,
    observation: &M::Observation,
) -> Option<Vec<(M::State, f64)>> {
    let logs: Vec<f64> = predicted.iter().map(|(s, _)| model.log_likelihood(action, s, observation)).collect();
    // Likelihoods relative to the largest one: eight sharp beams would leave the range of numbers.
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return None;
    }
    let mut weighted: Vec<(M::State, f64)> =
        predicted.into_iter().zip(logs).map(|((state, p), log)| (state, p * (log - most).exp())).collect();
    let total: f64 = weighted.iter().map(|(_, p)| p).sum();
    weighted.iter_mut().for_each(|(_, p)| *p /= total);
    (total > 0.0).then_some(weighted)
}

impl<S> Belief for ExactBelief<S> {
    type State = S;

    fn sample(&self, rng: &mut Rng) -> &S {
        let last = self.states.len() - 1;
        let mark = rng.random::<f64>() * self.cumulative[last];
        &self.states[self.cumulative.partition_point(|&sum| sum <= mark).min(last)]
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use pomdp::{GenerativeModel, Policy, Purpose, Seed};

    use super::*;

    /// Indices and states match, successors sum to one, and steps follow them.
    ///
    /// Null: a step leads to each successor with the stated probability. n = 2000 a state and action; tolerance 5 standard deviations.
    pub(crate) fn check_finite<M: Finite<State: PartialEq + std::fmt::Debug, Action: std::fmt::Debug>>(
        model: &M,
        states: &[M::State],
    ) {
        let total: f64 = model.initial_distribution().iter().map(|(_, p)| p).sum();
        assert!((total - 1.0).abs() < 1e-12, "initial probabilities sum to {total}");
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for state in states {
            assert_eq!(model.state(model.index(state)), *state);
            for action in model.actions() {
                let mut ends: Vec<Successor<M::State>> = Vec::new();
                model.successors(state, action, |next| {
                    match ends.iter_mut().find(|e| e.state == next.state && e.outcome == next.outcome) {
                        Some(end) => end.probability += next.probability,
                        None => ends.push(next),
                    }
                });
                let total: f64 = ends.iter().map(|e| e.probability).sum();
                assert!((total - 1.0).abs() < 1e-12, "{state:?} {action:?}: {total}");
                let mut counts = vec![0.0; ends.len()];
                for _ in 0..2000 {
                    let mut next = state.clone();
                    let step = model.step(&mut next, action, &mut rng);
                    let end = ends.iter().position(|e| e.state == next && e.outcome == step.outcome);
                    let end = end.unwrap_or_else(|| panic!("{state:?} {action:?} led to {next:?}"));
                    assert_eq!(step.reward, ends[end].reward);
                    counts[end] += 1.0;
                }
                for (end, count) in ends.iter().zip(&counts) {
                    let (mean, variance) =
                        (2000.0 * end.probability, 2000.0 * end.probability * (1.0 - end.probability));
                    assert!(
                        (count - mean).abs() <= 5.0 * variance.sqrt() + 1e-9,
                        "{state:?} {action:?} {end:?}: {count}"
                    );
                }
            }
        }
    }

    /// Two rooms; a door leads on in half of the tries and pays 1, staying pays 0.4, and what is heard is the room with probability 0.8.
    pub(crate) struct Rooms;

    impl GenerativeModel for Rooms {
        type State = bool;
        type Action = bool;
        type Observation = bool;

        fn actions(&self) -> &[bool] {
            &[false, true]
        }

        fn step(&self, state: &mut bool, action: &bool, rng: &mut Rng) -> Step<bool> {
            step(self, state, action, rng, |next, rng| *next == rng.random_bool(0.8))
        }

        fn discount(&self) -> f64 {
            0.5
        }
    }

    impl ObservationModel for Rooms {
        fn log_likelihood(&self, _action: &bool, next: &bool, observation: &bool) -> f64 {
            if next == observation { 0.8_f64.ln() } else { 0.2_f64.ln() }
        }
    }

    impl Finite for Rooms {
        fn states(&self) -> usize {
            2
        }

        fn index(&self, state: &bool) -> usize {
            usize::from(*state)
        }

        fn state(&self, index: usize) -> bool {
            index == 1
        }

        fn successors(&self, state: &bool, action: &bool, mut visit: impl FnMut(Successor<bool>)) {
            if !*action {
                return visit(Successor { probability: 1.0, state: *state, reward: 0.4, outcome: Outcome::Continue });
            }
            let on = if *state { Outcome::Terminal } else { Outcome::Continue };
            visit(Successor { probability: 0.5, state: true, reward: 1.0, outcome: on });
            visit(Successor { probability: 0.5, state: *state, reward: 0.0, outcome: Outcome::Continue });
        }

        fn initial_distribution(&self) -> Vec<(bool, f64)> {
            vec![(false, 0.75), (true, 0.25)]
        }
    }

    #[test]
    fn steps_follow_the_listed_successors() {
        check_finite(&Rooms, &[false, true]);
    }

    #[test]
    fn beliefs_follow_bayes_rule() {
        let belief = ExactBelief::initial(&Rooms);
        // The door: 0.375 stay in the first room, 0.375 go on to the second, where 0.125 stay and 0.125 end. Heard: the second.
        let after = belief.update(&Rooms, &true, &true).unwrap();
        let found: Vec<(bool, f64)> = after.probabilities().map(|(s, p)| (*s, p)).collect();
        let (first, second) = (0.375 * 0.2, 0.5 * 0.8);
        assert!(found[0].0 != found[1].0 && (found[1].1 - second / (first + second)).abs() < 1e-12, "{found:?}");
        // Draws follow the probabilities: n = 4000, tolerance 4 standard deviations.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let share = (0..4000).filter(|_| *after.sample(&mut rng)).count() as f64 / 4000.0;
        assert!((share - found[1].1).abs() < 4.0 * (found[1].1 * found[0].1 / 4000.0_f64).sqrt());
    }

    #[test]
    fn a_belief_is_worth_one_action_before_the_state_is_known() {
        // max_a Σ b(s) Q(s, a), which is at most Σ b(s) max_a Q(s, a).
        let known = FullInformation::solve(&Rooms, 1e-12);
        let belief = [(false, 3.0), (true, 1.0)];
        let mean = |action: bool| {
            let value = |state: bool| known.action_values(&Rooms, &state)[usize::from(action)];
            0.75 * value(false) + 0.25 * value(true)
        };
        let value = known.belief_value(&Rooms, &belief, 9);
        assert!((value - mean(false).max(mean(true))).abs() < 1e-12);
        assert!(value <= 0.75 * known.value(&Rooms, &false) + 0.25 * known.value(&Rooms, &true) + 1e-12);
        let exact = ExactBelief::of(vec![(false, 0.75), (true, 0.25)]);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        assert_eq!(known.belief_action(&Rooms, &belief, &mut rng), known.qmdp(&Rooms, &exact));
    }

    #[test]
    fn what_no_state_explains_has_no_belief() {
        // In the third step of the chain the observation has probability zero everywhere.
        let only = ExactBelief::of(vec![(true, 1.0)]);
        struct Deaf;
        impl GenerativeModel for Deaf {
            type State = bool;
            type Action = bool;
            type Observation = bool;
            fn actions(&self) -> &[bool] {
                &[false]
            }
            fn step(&self, state: &mut bool, _action: &bool, _rng: &mut Rng) -> Step<bool> {
                Step { observation: *state, reward: 0.0, outcome: Outcome::Continue }
            }
            fn discount(&self) -> f64 {
                1.0
            }
        }
        impl ObservationModel for Deaf {
            fn log_likelihood(&self, _action: &bool, next: &bool, observation: &bool) -> f64 {
                if next == observation { 0.0 } else { f64::NEG_INFINITY }
            }
        }
        impl Finite for Deaf {
            fn states(&self) -> usize {
                2
            }
            fn index(&self, state: &bool) -> usize {
                usize::from(*state)
            }
            fn state(&self, index: usize) -> bool {
                index == 1
            }
            fn successors(&self, state: &bool, _action: &bool, mut visit: impl FnMut(Successor<bool>)) {
                visit(Successor { probability: 1.0, state: *state, reward: 0.0, outcome: Outcome::Continue });
            }
            fn initial_distribution(&self) -> Vec<(bool, f64)> {
                vec![(true, 1.0)]
            }
        }
        assert_eq!(only.update(&Deaf, &false, &false), None);
        assert_eq!(only.update(&Deaf, &false, &true), Some(only));
    }

    #[test]
    fn values_of_known_states_solve_bellmans_equation() {
        // Staying for ever is worth 0.4 / (1 − 0.5) = 0.8. From the second room the door is worth 0.5 + 0.5 · 0.5 v: v = max(0.8, 2/3). From the
        // first one 0.5 (1 + 0.5 · 0.8) + 0.25 v: v = 0.7 / 0.75 = 14/15.
        let solution = FullInformation::solve(&Rooms, 1e-12);
        assert!((solution.value(&Rooms, &true) - 0.8).abs() < 1e-9);
        assert!((solution.value(&Rooms, &false) - 14.0 / 15.0).abs() < 1e-9);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        assert!(solution.action(&Rooms, &false, &mut rng) && !solution.action(&Rooms, &true, &mut rng));
        // Mean values of the door: 0.9 of 14/15 and 0.1 of 0.5 + 0.25 · 0.8 against staying: 0.4 + 0.5 · (0.9 · 14/15 + 0.1 · 0.8).
        assert!(solution.qmdp(&Rooms, &ExactBelief::of(vec![(false, 0.9), (true, 0.1)])));
        assert!(!solution.qmdp(&Rooms, &ExactBelief::of(vec![(false, 0.1), (true, 0.9)])));
    }
}
