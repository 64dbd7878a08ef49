//! Some exact steps before a plan.

use pomdp::{Outcome, Policy, Rng};

use super::{Action, DISCOUNT, RockSample, State};

/// Takes the best action by its expected reward and the value of what follows: of one step fewer, and after the last one of the [`super::Plan`].
///
/// Moves are certain and rocks are independent, so an action has at most two outcomes whose probabilities are known: nothing is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Steps(pub usize);

impl Policy<RockSample> for Steps {
    fn action(&self, model: &RockSample, state: &State, _rng: &mut Rng) -> Action {
        best(model, state, self.0).0
    }
}

/// The best action and its value; the plan's own action where none is better.
fn best(model: &RockSample, state: &State, steps: usize) -> (Action, f64) {
    let plan = model.plan(state);
    if steps == 0 {
        return (plan.first, plan.value);
    }
    let legal = model.legal(state);
    let others =
        model.actions.iter().enumerate().filter(|(index, _)| legal.contains(*index)).map(|(_, action)| *action);
    let start = (plan.first, action_value(model, state, plan.first, steps));
    others.filter(|action| *action != plan.first).fold(start, |best, action| {
        let value = action_value(model, state, action, steps);
        if value > best.1 { (action, value) } else { best }
    })
}

/// Expected reward of an action, and of what follows.
fn action_value(model: &RockSample, state: &State, action: Action, steps: usize) -> f64 {
    let later = |next: &State| DISCOUNT * best(model, next, steps - 1).1;
    if let Action::Check(rock) = action {
        let (chance, accuracy) = (model.chance(state, usize::from(rock)), model.accuracy(state.cell, rock));
        let looks_good = chance * accuracy + (1.0 - chance) * (1.0 - accuracy);
        let outcome = |good: bool, probability: f64| {
            if probability == 0.0 {
                return 0.0;
            }
            let mut next = *state;
            next.seen.note(rock, good, accuracy);
            probability * later(&next)
        };
        return outcome(true, looks_good) + outcome(false, 1.0 - looks_good);
    }
    let mut next = *state;
    let (reward, outcome) = model.advance(&mut next, action);
    // What `advance` pays for a sample is of the kind that only the state knows.
    let reward = match model.rock_at[usize::from(state.cell)] {
        Some(rock) if action == Action::Sample => 10.0 * (2.0 * model.chance(state, usize::from(rock)) - 1.0),
        _ => reward,
    };
    reward + if outcome == Outcome::Continue { later(&next) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use pomdp::{GenerativeModel as _, Purpose, Seed};

    use super::*;
    use crate::InitialState as _;

    #[test]
    fn a_step_looks_before_it_walks_by_the_formula() {
        // One rock two cells ahead, the edge two cells behind it. By hand: a check from here is right with probability q. If the rock looks good the rover
        // samples it at once or checks it there, if it looks bad it checks it there or leaves: the plan after a check with Bayes' probabilities.
        let model = RockSample::new(5, [0, 2], &[[2, 2]]);
        let state = model.state(|_| true);
        let q = (1.0 + 2_f64.powf(-2.0 / 20.0)) / 2.0;
        let leaving = 10.0 * DISCOUNT.powi(2);
        let at_rock = |p: f64| {
            let blind = 10.0 * (2.0 * p - 1.0) + DISCOUNT * leaving;
            let careful = DISCOUNT * (p * (10.0 + DISCOUNT * leaving) + (1.0 - p) * leaving);
            blind.max(careful)
        };
        // Log-odds are kept to a thousandth.
        let after = |p: f64| (10.0 * DISCOUNT.powi(4)).max(DISCOUNT.powi(2) * at_rock(p));
        let by_hand = DISCOUNT * 0.5 * (after(q) + after(1.0 - q));
        let found = action_value(&model, &state, Action::Check(0), 1);
        assert!((found - by_hand).abs() < 1e-2, "{found} {by_hand}");
        // A move earns nothing and comes to the plan from the next cell.
        let mut next = state;
        model.step(&mut next, &Action::East, &mut Seed(1).stream(Purpose::Test, 0));
        let moved = action_value(&model, &state, Action::East, 1);
        assert!((moved - DISCOUNT * model.plan(&next).value()).abs() < 1e-12);
        // A sample at the rock is worth what is known of it, whatever the state hides.
        let there = RockSample::new(5, [2, 2], &[[2, 2]]);
        let [good, bad] = [true, false].map(|kind| action_value(&there, &there.state(|_| kind), Action::Sample, 1));
        assert!((good - bad).abs() < 1e-12 && (good - DISCOUNT * leaving).abs() < 1e-12, "{good} {bad}");
    }

    #[test]
    fn only_what_was_seen_counts() {
        // On the way of episodes the kinds of the rocks are turned over: action and value stay. Without a step it is the plan.
        let model = RockSample::standard_7_8();
        for item in 0..4 {
            let mut rng = Seed(2).stream(Purpose::Test, item);
            let mut state = model.initial(&mut rng);
            for _ in 0..12 {
                let found = best(&model, &state, 1);
                let hidden = State { good: !state.good & model.unsampled(&state), ..state };
                assert_eq!(best(&model, &hidden, 1), found);
                assert_eq!(Steps(0).action(&model, &state, &mut rng), model.plan(&state).first);
                let step = model.step(&mut state, &found.0, &mut rng);
                if step.outcome != Outcome::Continue {
                    break;
                }
            }
        }
    }
}
