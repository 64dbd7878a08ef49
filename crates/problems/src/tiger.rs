//! Tiger: two doors, a tiger behind one of them, and ears (Kaelbling, Littman and Cassandra, "Planning and acting in partially
//! observable stochastic domains", 1998; γ = 0.95).
//!
//! The belief is the number k of growls from the left minus those from the right, so values can be computed exactly.

use pomdp::{Belief, Discretise, GenerativeModel, ObservationModel, Outcome, Rng, Step};
use rand::RngExt as _;

use crate::InitialState;

/// γ.
pub const DISCOUNT: f64 = 0.95;
/// Probability that a growl comes from the tiger's door.
pub const HEARS_RIGHT: f64 = 0.85;
/// Optimal values of the restarting problem from an even belief: horizon and value, rounded to four digits.
pub const OPTIMAL: [(usize, f64); 7] =
    [(1, -1.0), (2, -1.95), (3, 2.3098), (4, 1.7955), (5, 2.7631), (10, 6.6934), (20, 11.8796)];
/// Optimal value of the restarting problem over the infinite horizon, from an even belief.
pub const OPTIMAL_INFINITE: f64 = 19.3714;
/// Optimal value of the problem that ends when a door is opened, over the infinite horizon, from an even belief.
pub const OPTIMAL_ENDING: f64 = 3.7702;

/// Listen for −1, open the tiger's door for −100 or the other for +10.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiger {
    /// Whether an opened door ends the episode, or a new tiger is placed at random.
    pub ends_on_open: bool,
}

/// What can be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Hear a growl, from the right door with probability 0.85.
    Listen,
    /// Open the left door.
    OpenLeft,
    /// Open the right door.
    OpenRight,
}

impl GenerativeModel for Tiger {
    /// Whether the tiger is on the left.
    type State = bool;
    type Action = Action;
    /// Whether a growl came from the left; a coin toss after a door was opened.
    type Observation = bool;

    fn actions(&self) -> &[Action] {
        &[Action::Listen, Action::OpenLeft, Action::OpenRight]
    }

    fn step(&self, left: &mut bool, action: &Action, rng: &mut Rng) -> Step<bool> {
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

impl ObservationModel for Tiger {
    fn log_likelihood(&self, action: &Action, left: &bool, growl_left: &bool) -> f64 {
        match action {
            Action::Listen if left == growl_left => HEARS_RIGHT.ln(),
            Action::Listen => (1.0 - HEARS_RIGHT).ln(),
            Action::OpenLeft | Action::OpenRight => 0.5_f64.ln(),
        }
    }
}

impl Discretise for Tiger {
    type Key = bool;

    fn key(&self, observation: &bool) -> bool {
        *observation
    }
}

impl InitialState for Tiger {
    fn initial(&self, rng: &mut Rng) -> bool {
        rng.random()
    }
}

/// The belief after k more growls from the left than from the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Growls(pub i32);

impl Growls {
    /// P(tiger left).
    #[must_use]
    pub fn left(self) -> f64 {
        1.0 / (1.0 + ((1.0 - HEARS_RIGHT) / HEARS_RIGHT).powi(self.0))
    }
}

impl Belief for Growls {
    type State = bool;

    fn sample(&self, rng: &mut Rng) -> &bool {
        if rng.random_bool(self.left()) { &true } else { &false }
    }
}

impl Tiger {
    /// Exact Q(k, action), given the value of what follows as a function of (observation, k).
    pub fn action_value(&self, belief: Growls, action: Action, next: &mut dyn FnMut(bool, i32) -> f64) -> f64 {
        let left = belief.left();
        let eaten = match action {
            Action::Listen => {
                let hears_left = left * HEARS_RIGHT + (1.0 - left) * (1.0 - HEARS_RIGHT);
                let (after_left, after_right) = (next(true, belief.0 + 1), next(false, belief.0 - 1));
                return -1.0 + DISCOUNT * (hears_left * after_left + (1.0 - hears_left) * after_right);
            }
            Action::OpenLeft => left,
            Action::OpenRight => 1.0 - left,
        };
        let reward = 10.0 - 110.0 * eaten;
        if self.ends_on_open { reward } else { reward + DISCOUNT * 0.5 * (next(true, 0) + next(false, 0)) }
    }

    /// Exact optimal value of `horizon` actions from an even belief, by dynamic programming over k.
    #[must_use]
    pub fn optimal(&self, horizon: usize) -> f64 {
        let span = i32::try_from(horizon).unwrap_or(i32::MAX / 4);
        let mut values = vec![0.0; 2 * horizon + 3];
        let index = |k: i32| (k + span + 1) as usize;
        for remaining in 1..=span {
            let reach = span - remaining;
            let previous = values.clone();
            for k in -reach..=reach {
                let value = |a: &Action| self.action_value(Growls(k), *a, &mut |_, k| previous[index(k)]);
                values[index(k)] = self.actions().iter().map(value).fold(f64::NEG_INFINITY, f64::max);
            }
        }
        values[index(0)]
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed, conformance};

    use super::*;

    const RESTARTING: Tiger = Tiger { ends_on_open: false };
    const ENDING: Tiger = Tiger { ends_on_open: true };

    #[test]
    fn the_problem_has_the_published_optimal_values() {
        for (horizon, value) in OPTIMAL {
            assert!((RESTARTING.optimal(horizon) - value).abs() < 5e-5, "horizon {horizon}");
        }
        assert!((RESTARTING.optimal(400) - OPTIMAL_INFINITE).abs() < 5e-5);
        assert!((ENDING.optimal(200) - OPTIMAL_ENDING).abs() < 5e-5);
    }

    #[test]
    fn it_conforms() {
        conformance::check_generative_model(&RESTARTING, &[true, false], 50);
        conformance::check_generative_model(&ENDING, &[true, false], 50);
    }

    #[test]
    fn growls_come_as_often_as_their_likelihood_says() {
        // Null: right with probability 0.85. n = 10,000, standard deviation 35.7; tolerance 4 of them.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for tiger in [true, false] {
            let right = (0..10_000).filter(|_| {
                let step = RESTARTING.step(&mut tiger.clone(), &Action::Listen, &mut rng);
                assert_eq!((step.reward, step.outcome), (-1.0, Outcome::Continue));
                step.observation == tiger
            });
            assert!((right.count() as f64 - 8500.0).abs() < 143.0);
            let log = |growl| RESTARTING.log_likelihood(&Action::Listen, &tiger, &growl);
            assert!(
                (log(tiger).exp() - 0.85).abs() < 1e-12 && (log(true).exp() + log(false).exp() - 1.0).abs() < 1e-12
            );
        }
    }

    #[test]
    fn a_door_pays_and_restarts_or_ends() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut placed_left = 0;
        for _ in 0..1000 {
            let mut left = true;
            let step = RESTARTING.step(&mut left, &Action::OpenLeft, &mut rng);
            assert_eq!((step.reward, step.outcome), (-100.0, Outcome::Continue));
            placed_left += i32::from(left);
            let step = ENDING.step(&mut true.clone(), &Action::OpenRight, &mut rng);
            assert_eq!((step.reward, step.outcome), (10.0, Outcome::Terminal));
        }
        // n = 1000, standard deviation 15.8.
        assert!((placed_left - 500).abs() < 64, "{placed_left}");
    }
}
