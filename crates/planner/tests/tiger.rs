//! POMCP against the exact values of Tiger (Kaelbling, Littman and Cassandra 1998; γ = 0.95).
//!
//! The belief is the number k of growls from the left minus those from the right, so a policy can be evaluated exactly over all
//! observations: the only randomness left is the planner's, and a loss is a wrong decision, not noise of the evaluation.

use planner::{Budget, Config, Exploration, Pomcp, RolloutDepth};
use pomdp::{Belief, Discretise, GenerativeModel, Outcome, Purpose, Rng, Seed, Step, UniformPolicy, conformance};
use rand::RngExt as _;

const DISCOUNT: f64 = 0.95;
const HEARS_RIGHT: f64 = 0.85;
/// Optimal values from k = 0 for horizons 1 to 5, as published in BENCHMARKS.md to four digits.
const OPTIMAL: [f64; 5] = [-1.0, -1.95, 2.3098, 1.7955, 2.7631];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Action {
    Listen,
    OpenLeft,
    OpenRight,
}

struct Tiger {
    ends_on_open: bool,
}

/// Whether the tiger is on the left.
type State = bool;

impl GenerativeModel for Tiger {
    type State = State;
    type Action = Action;
    type Observation = bool;

    fn actions(&self) -> &[Action] {
        &[Action::Listen, Action::OpenLeft, Action::OpenRight]
    }

    fn step(&self, left: &mut State, action: &Action, rng: &mut Rng) -> Step<bool> {
        let eaten = match action {
            Action::Listen => {
                let observation = if rng.random_bool(HEARS_RIGHT) { *left } else { !*left };
                return Step { observation, reward: -1.0, outcome: Outcome::Continue };
            }
            Action::OpenLeft => *left,
            Action::OpenRight => !*left,
        };
        *left = rng.random();
        let outcome = if self.ends_on_open { Outcome::Terminal } else { Outcome::Continue };
        Step { observation: rng.random(), reward: if eaten { -100.0 } else { 10.0 }, outcome }
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl Discretise for Tiger {
    type Key = bool;

    fn key(&self, observation: &bool) -> bool {
        *observation
    }
}

/// P(tiger left) after k more growls from the left than from the right.
fn left_given(k: i32) -> f64 {
    1.0 / (1.0 + ((1.0 - HEARS_RIGHT) / HEARS_RIGHT).powi(k))
}

struct Growls(i32);

impl Belief for Growls {
    type State = State;

    fn sample(&self, rng: &mut Rng) -> &State {
        if rng.random_bool(left_given(self.0)) { &true } else { &false }
    }
}

/// Exact Q(k, action), given the value of what follows as a function of (observation, k).
fn action_value(tiger: &Tiger, k: i32, action: Action, next: &mut dyn FnMut(bool, i32) -> f64) -> f64 {
    let left = left_given(k);
    let eaten = match action {
        Action::Listen => {
            let hears_left = left * HEARS_RIGHT + (1.0 - left) * (1.0 - HEARS_RIGHT);
            return -1.0 + DISCOUNT * (hears_left * next(true, k + 1) + (1.0 - hears_left) * next(false, k - 1));
        }
        Action::OpenLeft => left,
        Action::OpenRight => 1.0 - left,
    };
    let reward = 10.0 - 110.0 * eaten;
    if tiger.ends_on_open { reward } else { reward + DISCOUNT * 0.5 * (next(true, 0) + next(false, 0)) }
}

/// Optimal value by dynamic programming over k.
fn optimal(tiger: &Tiger, horizon: i32) -> f64 {
    let mut values = vec![0.0; 2 * horizon as usize + 3];
    let index = |k: i32| (k + horizon + 1) as usize;
    for remaining in 1..=horizon {
        let reach = horizon - remaining;
        let previous = values.clone();
        for k in -reach..=reach {
            let value = |a: &Action| action_value(tiger, k, *a, &mut |_, k| previous[index(k)]);
            values[index(k)] = tiger.actions().iter().map(value).fold(f64::NEG_INFINITY, f64::max);
        }
    }
    values[index(0)]
}

fn planner(factor: f64, simulations: usize, depth: usize) -> Pomcp<Tiger> {
    let exploration = Exploration::ReturnRange(factor);
    let budget = Budget::Simulations(simulations);
    Pomcp::new(Config { budget, exploration, depth, rollout_depth: RolloutDepth::Full }).unwrap()
}

/// With the restarting problem's wide rollouts (about 500 from best to worst) this factor decides rightly for every one of the
/// seeds 1 to 4 from 2^15 simulations on; 1.0 needs more than 2^17, and 0.2 is trapped by a lucky first opening.
const FACTOR: f64 = 0.4;

#[test]
fn the_test_problem_has_the_published_optimal_values() {
    let restarting = Tiger { ends_on_open: false };
    for (horizon, value) in (1..).zip(OPTIMAL) {
        assert!((optimal(&restarting, horizon) - value).abs() < 5e-5, "horizon {horizon}");
    }
    assert!((optimal(&restarting, 10) - 6.6934).abs() < 5e-5);
    assert!((optimal(&Tiger { ends_on_open: true }, 200) - 3.7702).abs() < 5e-5);
    conformance::check_generative_model(&restarting, &[true, false], 50);
    conformance::check_generative_model(&Tiger { ends_on_open: true }, &[true, false], 50);
}

#[test]
fn the_policy_of_fresh_searches_is_optimal_for_horizons_one_to_five() {
    fn value(tiger: &Tiger, k: i32, remaining: usize) -> f64 {
        if remaining == 0 {
            return 0.0;
        }
        let mut rng = Seed(1).stream(Purpose::Search, 0);
        let report = planner(FACTOR, 1 << 16, remaining).search(tiger, &Growls(k), &UniformPolicy, remaining, &mut rng);
        action_value(tiger, k, report.action, &mut |_, k| value(tiger, k, remaining - 1))
    }
    let tiger = Tiger { ends_on_open: false };
    for (horizon, optimal) in (1..).zip(OPTIMAL) {
        let value = value(&tiger, 0, horizon);
        // Published to four digits: the policy loses nothing.
        assert!((value - optimal).abs() < 5e-5, "horizon {horizon}: {value} instead of {optimal}");
    }
}

#[test]
fn the_policy_of_a_pruned_tree_is_optimal_for_horizons_one_to_five() {
    /// Action after a history of observations, by planning, acting and pruning all along it.
    fn action(tiger: &Tiger, history: &[(bool, i32)], horizon: usize) -> Action {
        let mut rng = Seed(1).stream(Purpose::Search, 0);
        let mut planner = planner(FACTOR, 1 << 16, horizon);
        let mut report = planner.search(tiger, &Growls(0), &UniformPolicy, horizon, &mut rng);
        for (step, (observation, k)) in (1..).zip(history) {
            planner.prune(&report.action, observation);
            report = planner.search(tiger, &Growls(*k), &UniformPolicy, horizon - step, &mut rng);
            assert!(report.reused > 1000, "{} visits kept after {history:?}", report.reused);
        }
        report.action
    }
    fn value(tiger: &Tiger, history: &[(bool, i32)], horizon: usize) -> f64 {
        if history.len() == horizon {
            return 0.0;
        }
        let k = history.last().map_or(0, |&(_, k)| k);
        let action = action(tiger, history, horizon);
        action_value(tiger, k, action, &mut |observation, k| {
            value(tiger, &[history, &[(observation, k)]].concat(), horizon)
        })
    }
    let tiger = Tiger { ends_on_open: false };
    for (horizon, optimal) in (1..).zip(OPTIMAL) {
        let value = value(&tiger, &[], horizon);
        assert!((value - optimal).abs() < 5e-5, "horizon {horizon}: {value} instead of {optimal}");
    }
}

#[test]
fn the_policy_ending_on_open_reaches_the_value_of_the_infinite_horizon() {
    // Returns span 110 here: c = 110. Listening once more at |k| = 2 is worth only 0.54, hence the many simulations (seeds 1 to 4
    // all decide rightly from 2^21 on). Every k beyond ±3 opens under the optimal policy and is never reached.
    let tiger = Tiger { ends_on_open: true };
    let bound = 3;
    let decide = |k: i32| {
        let mut rng = Seed(1).stream(Purpose::Search, 0);
        planner(1.0, 1 << 21, 30).search(&tiger, &Growls(k), &UniformPolicy, 30, &mut rng).action
    };
    let actions: Vec<Action> = (-bound..=bound).map(decide).collect();
    let index = |k: i32| (k.clamp(-bound, bound) + bound) as usize;
    let mut values = vec![0.0; actions.len()];
    for _ in 0..300 {
        let previous = values.clone();
        for k in -bound..=bound {
            values[index(k)] = action_value(&tiger, k, actions[index(k)], &mut |_, k| previous[index(k)]);
        }
    }
    assert!((values[index(0)] - 3.7702).abs() < 5e-5, "{} by {actions:?}", values[index(0)]);
}

/// A root value averages over the exploration below it, so it is a biased estimate of V* that rises to it.
///
/// Null: E[value] ≤ V*, so the mean of n = 8 seeds lies above V* by at most 3 standard errors; and the loss vanishes: 16 times the
/// simulations leave less than a third of it (a constant bias would leave all of it), and less than 2 points of the 500 that
/// returns span.
#[test]
fn root_values_rise_to_the_optimal_values() {
    let tiger = Tiger { ends_on_open: false };
    for (horizon, optimal) in (1..).zip(OPTIMAL) {
        let loss_and_error = |simulations| {
            let value = |seed| {
                let mut rng = Seed(seed).stream(Purpose::Search, 0);
                let mut planner = planner(FACTOR, simulations, horizon);
                let report = planner.search(&tiger, &Growls(0), &UniformPolicy, horizon, &mut rng);
                report.actions.iter().map(|a| a.value).fold(f64::NEG_INFINITY, f64::max)
            };
            let values: Vec<f64> = (1..=8).map(value).collect();
            let mean = values.iter().sum::<f64>() / 8.0;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 7.0;
            (optimal - mean, (variance / 8.0).sqrt())
        };
        let (early, _) = loss_and_error(1 << 14);
        let (late, error) = loss_and_error(1 << 18);
        // 5e-5: the published values are rounded.
        assert!(late > -3.0 * error - 5e-5, "horizon {horizon}: {late} ± {error} above the optimum");
        assert!(late <= early / 3.0 + 5e-5 && late < 2.0, "horizon {horizon}: loss {early} became {late}");
    }
}
