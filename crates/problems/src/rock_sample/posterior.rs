//! The exact belief: rocks are independent, so it is a probability a rock.

use pomdp::Rng;
use rand::RngExt as _;

use super::{Action, MOST_ROCKS, Observation, RockSample, State};
use crate::Particles;

/// What is known after a history: all of the state but the kinds of the rocks, and the probability that each is good.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posterior {
    known: State,
    good: [f64; MOST_ROCKS],
}

impl Posterior {
    /// Before the first action every rock is good with probability one half.
    #[must_use]
    pub fn initial(model: &RockSample) -> Self {
        Self { known: model.state(|_| false), good: [0.5; MOST_ROCKS] }
    }

    /// Probability that a rock is good.
    #[must_use]
    pub fn good(&self, rock: usize) -> f64 {
        self.good[rock]
    }

    /// After an action of an episode that goes on, and its observation: Bayes' rule for the rock that was checked; a sampled rock is bad.
    #[must_use]
    pub fn update(mut self, model: &RockSample, action: &Action, observation: &Observation) -> Self {
        if let Action::Check(rock) = *action {
            let accuracy = model.accuracy(self.known.cell, rock);
            let seen_good = *observation == Observation::Good;
            let (if_good, if_bad) = if seen_good { (accuracy, 1.0 - accuracy) } else { (1.0 - accuracy, accuracy) };
            let good = &mut self.good[usize::from(rock)];
            *good = *good * if_good / (*good * if_good + (1.0 - *good) * if_bad);
            self.known.seen.note(rock, seen_good, accuracy);
        } else {
            let bit = model.rock_bit(self.known.cell);
            if *action == Action::Sample && bit != 0 {
                self.good[bit.trailing_zeros() as usize] = 0.0;
            }
            // Nothing else of a step is random or depends on the kinds.
            model.advance(&mut self.known, *action);
        }
        self
    }

    /// `count` independent draws of the state.
    #[must_use]
    pub fn particles(&self, model: &RockSample, count: usize, rng: &mut Rng) -> Particles<State> {
        let mut draw = || {
            let rocks = 0..model.rocks.len();
            let good = rocks.fold(0, |bits, rock| bits | u16::from(rng.random::<f64>() < self.good[rock]) << rock);
            State { good, ..self.known }
        };
        Particles::new((0..count).map(|_| draw()).collect())
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{GenerativeModel as _, Purpose, Seed};

    use super::*;
    use crate::InitialState as _;

    #[test]
    fn probabilities_follow_bayes_rule() {
        // Two checks of rock 0 from √13 cells off that agree: odds (p / (1 − p))²; a third that does not: p / (1 − p).
        let model = RockSample::standard_7_8();
        let accuracy = (1.0 + 2_f64.powf(-13_f64.sqrt() / 20.0)) / 2.0;
        let odds = accuracy / (1.0 - accuracy);
        let check = |belief: Posterior, seen| belief.update(&model, &Action::Check(0), &seen);
        let twice = check(check(Posterior::initial(&model), Observation::Good), Observation::Good);
        assert!((twice.good(0) - odds * odds / (1.0 + odds * odds)).abs() < 1e-12 && twice.good(1) == 0.5);
        assert!((check(twice, Observation::Bad).good(0) - accuracy).abs() < 1e-12);
    }

    #[test]
    fn what_is_known_is_what_the_true_state_says() {
        // A random walk of checks, moves and samples: cell, sampled rocks and measurements are those of the world.
        let model = RockSample::standard_7_8();
        for item in 0..20 {
            let mut rng = Seed(1).stream(Purpose::Test, item);
            let mut state = model.initial(&mut rng);
            let mut belief = Posterior::initial(&model);
            for _ in 0..60 {
                let action = model.actions()[rng.random_range(0..model.actions().len())];
                let step = model.step(&mut state, &action, &mut rng);
                if step.outcome != pomdp::Outcome::Continue {
                    break;
                }
                belief = belief.update(&model, &action, &step.observation);
                assert_eq!(State { good: state.good, ..belief.known }, state);
                // A rock that was checked from its own cell or sampled is certain, and so it is in the world.
                for rock in 0..8 {
                    let (p, good) = (belief.good(rock), state.good >> rock & 1 == 1);
                    assert!(if good { p > 0.0 } else { p < 1.0 });
                }
            }
        }
    }

    #[test]
    fn draws_have_the_stated_probabilities() {
        // n = 8192; tolerance 4 binomial standard deviations.
        let model = RockSample::standard_7_8();
        let belief = Posterior::initial(&model).update(&model, &Action::Check(3), &Observation::Bad);
        let drawn = belief.particles(&model, 8192, &mut Seed(1).stream(Purpose::Test, 0));
        for rock in 0..8 {
            let (p, count) = (belief.good(rock), drawn.states().iter().filter(|s| s.good >> rock & 1 == 1).count());
            assert!((count as f64 - 8192.0 * p).abs() <= 4.0 * (8192.0 * p * (1.0 - p)).sqrt(), "{rock}: {count}");
        }
        assert!(drawn.states().iter().all(|s| s.seen == belief.known.seen));
    }
}
