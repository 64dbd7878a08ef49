//! RockSample(7, 8) against the traits of `pomdp` (Smith and Simmons, UAI 2004; γ = 0.95).
//!
//! A rover samples good rocks for +10 each and leaves by the east edge for +10. A bad rock costs 10, a wrong move 100. Looking at a rock tells
//! its kind, the better the nearer it is.

use pomdp::rand::RngExt as _;
use pomdp::{ActionPrior, Discretise, GenerativeModel, Outcome, Perturb, Policy, Rng, Step};

const ROCKS: [[i32; 2]; 8] = [[2, 0], [0, 1], [3, 1], [6, 3], [2, 4], [3, 4], [5, 5], [1, 6]];
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    Move([i32; 2]),
    Sample,
    Check(usize),
}

/// Where the rover is, and which rocks are good. The kinds of the rocks are the unknown that the belief learns.
#[derive(Clone)]
pub struct State {
    pub rover: [i32; 2],
    pub good: [bool; 8],
}

pub struct RockSample(Vec<Action>);

impl RockSample {
    pub fn new() -> Self {
        let moves = [[0, 1], [1, 0], [0, -1], [-1, 0]].map(Action::Move);
        Self(moves.into_iter().chain([Action::Sample]).chain((0..ROCKS.len()).map(Action::Check)).collect())
    }
}

impl GenerativeModel for RockSample {
    type State = State;
    type Action = Action;
    type Observation = bool; // whether a checked rock looks good

    fn actions(&self) -> &[Action] {
        &self.0
    }

    fn step(&self, state: &mut State, action: &Action, rng: &mut Rng) -> Step<bool> {
        let mut looks_good = false;
        let (reward, outcome) = match *action {
            Action::Move(by) => {
                let [x, y] = [state.rover[0] + by[0], state.rover[1] + by[1]];
                match (x, (0..7).contains(&x) && (0..7).contains(&y)) {
                    (7, _) => (10.0, Outcome::Terminal),
                    (_, false) => (-100.0, Outcome::Continue),
                    (_, true) => {
                        state.rover = [x, y];
                        (0.0, Outcome::Continue)
                    }
                }
            }
            Action::Sample => match ROCKS.iter().position(|rock| *rock == state.rover) {
                Some(rock) if std::mem::take(&mut state.good[rock]) => (10.0, Outcome::Continue),
                Some(_) => (-10.0, Outcome::Continue),
                None => (-100.0, Outcome::Continue),
            },
            Action::Check(rock) => {
                let [dx, dy] = [0, 1].map(|axis| f64::from(ROCKS[rock][axis] - state.rover[axis]));
                let right = rng.random_bool((1.0 + 0.5_f64.powf(dx.hypot(dy) / 20.0)) / 2.0);
                looks_good = state.good[rock] == right;
                (0.0, Outcome::Continue)
            }
        };
        Step { observation: looks_good, reward, outcome }
    }

    fn discount(&self) -> f64 {
        0.95
    }
}

impl Discretise for RockSample {
    type Key = bool;

    fn key(&self, looks_good: &bool) -> bool {
        *looks_good
    }
}

impl Perturb for RockSample {
    /// Reinvigoration: one rock of a hypothesis may be of the other kind.
    fn perturb(&self, state: &mut State, rng: &mut Rng) {
        let rock = rng.random_range(0..ROCKS.len());
        state.good[rock] = !state.good[rock];
    }
}

/// What the planner is told. Rollouts go east and sample good rocks on the way. No move runs into a wall, and only rocks are sampled.
pub struct East;

impl Policy<RockSample> for East {
    fn action(&self, _: &RockSample, state: &State, _: &mut Rng) -> Action {
        let good_here = ROCKS.iter().zip(state.good).any(|(rock, good)| good && *rock == state.rover);
        if good_here { Action::Sample } else { Action::Move([1, 0]) }
    }

    fn priors(&self, model: &RockSample, state: &State, priors: &mut [ActionPrior]) {
        for (action, prior) in model.actions().iter().zip(priors) {
            prior.legal = match *action {
                Action::Move([x, y]) => state.rover[0] + x >= 0 && (0..7).contains(&(state.rover[1] + y)),
                Action::Sample => ROCKS.contains(&state.rover),
                Action::Check(_) => true,
            };
        }
    }
}
