//! RockSample(n, k): a rover among rocks of which some are worth sampling (Smith and Simmons, "Heuristic search value iteration for
//! POMDPs", UAI 2004; γ = 0.95), with the layouts of POMCP 1.0.
//!
//! Moves are certain. Leaving by the east edge pays +10 and ends the episode; a move over another edge costs 100 and does nothing.
//! Sampling pays +10 for a good rock and −10 for a bad one, and makes it bad; where there is no rock it costs 100. Checking a rock at
//! Euclidean distance d (in cells) tells its kind rightly with probability (1 + 2^(−d/20)) / 2.
//!
//! Published returns on RockSample(15, 15) at 1 s a move: POMCP 15.3, DESPOT 18.4 (Somani, Ye, Hsu and Lee, NIPS 2013), AdaOPS 20.7 (Wu et al., NeurIPS 2021).

use pomdp::{ActionPrior, Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Policy, Rng, Step};
use rand::RngExt as _;

use crate::InitialState;
use crate::bits::{Actions, Advice, Knowledge};

/// γ.
pub const DISCOUNT: f64 = 0.95;
/// Distance, in cells, at which what a check tells beyond chance has halved.
const HALF_DISTANCE: f64 = 20.0;
const MOST_ROCKS: usize = 16;
/// Log-odds are kept as whole multiples of one part in this many.
const LOG_ODDS_UNIT: f64 = 1000.0;
/// First check among the actions.
const CHECK: usize = 5;
const SAMPLE: Actions = Actions(1 << 4);
const EAST: Actions = Actions(1 << 1);

/// What can be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// y + 1.
    North,
    /// x + 1; from the last column, out.
    East,
    /// y − 1.
    South,
    /// x − 1.
    West,
    /// Sample the rock here.
    Sample,
    /// Look at a rock from here.
    Check(u8),
}

/// What is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Observation {
    /// Nothing was checked.
    Nothing,
    /// The rock looks good.
    Good,
    /// The rock looks bad.
    Bad,
}

/// Where the rover is, how the rocks are, and what it saw of them. The last is a function of the history, so it is equal in all
/// states of a belief; it is carried so that policies need no history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    cell: u8,
    /// Bit per rock.
    good: u16,
    sampled: u16,
    seen: Seen,
}

/// What was measured, a bit or a number per rock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seen {
    /// Good minus bad observations.
    balance: [i8; MOST_ROCKS],
    checks: [u8; MOST_ROCKS],
    /// Rocks with more good than bad observations, and with more bad than good ones.
    liked: u16,
    disliked: u16,
    /// Rocks that were checked from their own cell, where a check is never wrong.
    certain: u16,
    /// Rocks that looked good in their last check from their own cell.
    proven: u16,
    /// ln(p / (1 − p)) for the probability p that the rock is good, from checks from other cells, in thousandths.
    log_odds: [i16; MOST_ROCKS],
    /// Rocks that need no further check: certain ones, and those with 5 checks or a balance of 2 either way.
    settled: u16,
}

impl Seen {
    /// Takes in that a rock looked good or bad in a check that is right with the probability `accuracy`.
    fn note(&mut self, rock: u8, good: bool, accuracy: f64) {
        let (seen, index, bit) = (self, usize::from(rock), 1_u16 << rock);
        seen.checks[index] = seen.checks[index].saturating_add(1);
        seen.balance[index] = seen.balance[index].saturating_add(if good { 1 } else { -1 });
        let balance = seen.balance[index];
        seen.liked = if balance > 0 { seen.liked | bit } else { seen.liked & !bit };
        seen.disliked = if balance < 0 { seen.disliked | bit } else { seen.disliked & !bit };
        if accuracy == 1.0 {
            seen.certain |= bit;
            seen.proven = if good { seen.proven | bit } else { seen.proven & !bit };
        } else {
            let shift = (LOG_ODDS_UNIT * (accuracy / (1.0 - accuracy)).ln()).round() as i16;
            let log_odds = &mut seen.log_odds[index];
            *log_odds = log_odds.saturating_add(if good { shift } else { -shift });
        }
        // A balance that falls back below 2 makes a rock worth a check again.
        let settled = seen.certain & bit != 0 || seen.checks[index] >= 5 || balance.abs() >= 2;
        seen.settled = if settled { seen.settled | bit } else { seen.settled & !bit };
    }
}

/// The problem.
#[derive(Clone, Debug)]
pub struct RockSample {
    size: u8,
    start: u8,
    rocks: Vec<[u8; 2]>,
    actions: Vec<Action>,
    /// Rock in each cell.
    rock_at: Vec<Option<u8>>,
    /// Probability of a right check, by cell and rock.
    accuracy: Vec<f64>,
    /// Rocks to the north, east, south and west of each cell.
    towards: Vec<[u16; 4]>,
}

impl RockSample {
    /// RockSample(7, 8) as in POMCP 1.0.
    #[must_use]
    pub fn standard_7_8() -> Self {
        Self::new(7, [0, 3], &[[2, 0], [0, 1], [3, 1], [6, 3], [2, 4], [3, 4], [5, 5], [1, 6]])
    }

    /// RockSample(11, 11) as in POMCP 1.0.
    #[must_use]
    pub fn standard_11_11() -> Self {
        let rocks = [[0, 3], [0, 7], [1, 8], [2, 4], [3, 3], [3, 8], [4, 3], [5, 8], [6, 1], [9, 3], [9, 9]];
        Self::new(11, [0, 5], &rocks)
    }

    /// A square with rocks in different cells drawn at random, and the start in the middle of the west edge: how POMCP 1.0 and DESPOT lay out what has no
    /// standard layout, among it RockSample(15, 15).
    ///
    /// # Panics
    ///
    /// As [`Self::new`], and with more rocks than cells.
    #[must_use]
    pub fn random(size: u8, rocks: u8, rng: &mut Rng) -> Self {
        let cells = rand::seq::index::sample(rng, usize::from(size) * usize::from(size), usize::from(rocks));
        let rocks: Vec<[u8; 2]> = cells.iter().map(|cell| [cell as u8 % size, cell as u8 / size]).collect();
        Self::new(size, [0, size / 2], &rocks)
    }

    /// A square of `size` cells a side with rocks at (x, y), y growing to the north.
    ///
    /// # Panics
    ///
    /// With more than 15 cells a side or 16 rocks, or with a rock or the start outside, or two rocks in one cell.
    #[must_use]
    pub fn new(size: u8, start: [u8; 2], rocks: &[[u8; 2]]) -> Self {
        assert!((1..=15).contains(&size), "size {size} is not between 1 and 15");
        assert!(rocks.len() <= MOST_ROCKS, "{} rocks are more than {MOST_ROCKS}", rocks.len());
        let inside = |p: &[u8; 2]| p[0] < size && p[1] < size;
        assert!(inside(&start) && rocks.iter().all(inside), "a rock or the start lies outside");
        let checks = (0..rocks.len()).map(|rock| Action::Check(rock as u8));
        let moves = [Action::North, Action::East, Action::South, Action::West, Action::Sample];
        let cells: Vec<[u8; 2]> = (0..size * size).map(|cell| [cell % size, cell / size]).collect();
        let mut rock_at = vec![None; cells.len()];
        for (rock, place) in rocks.iter().enumerate() {
            let here = &mut rock_at[usize::from(place[1] * size + place[0])];
            assert!(here.is_none(), "two rocks in cell {place:?}");
            *here = Some(rock as u8);
        }
        let accuracy = |from: &[u8; 2], rock: &[u8; 2]| {
            let distance = (f64::from(from[0]) - f64::from(rock[0])).hypot(f64::from(from[1]) - f64::from(rock[1]));
            (1.0 + (-distance / HALF_DISTANCE).exp2()) / 2.0
        };
        let where_rocks = |holds: &dyn Fn(&[u8; 2]) -> bool| {
            rocks.iter().enumerate().filter(|(_, r)| holds(r)).fold(0_u16, |bits, (index, _)| bits | 1 << index)
        };
        let towards = |c: &[u8; 2]| {
            [
                where_rocks(&|r| r[1] > c[1]),
                where_rocks(&|r| r[0] > c[0]),
                where_rocks(&|r| r[1] < c[1]),
                where_rocks(&|r| r[0] < c[0]),
            ]
        };
        Self {
            size,
            start: start[1] * size + start[0],
            rocks: rocks.to_vec(),
            actions: moves.into_iter().chain(checks).collect(),
            accuracy: cells.iter().flat_map(|c| rocks.iter().map(move |r| accuracy(c, r))).collect(),
            towards: cells.iter().map(towards).collect(),
            rock_at,
        }
    }

    /// The start with rocks of these kinds, of which nothing is known.
    #[must_use]
    pub fn state(&self, good: impl Fn(usize) -> bool) -> State {
        let good = (0..self.rocks.len()).filter(|&rock| good(rock)).fold(0, |bits, rock| bits | 1 << rock);
        let balance = [0; MOST_ROCKS];
        let (checks, log_odds) = ([0; MOST_ROCKS], [0; MOST_ROCKS]);
        let seen = Seen { balance, checks, liked: 0, disliked: 0, certain: 0, proven: 0, log_odds, settled: 0 };
        State { cell: self.start, good, sampled: 0, seen }
    }

    /// (x, y) of the rover.
    #[must_use]
    pub fn place(&self, state: &State) -> [u8; 2] {
        [state.cell % self.size, state.cell / self.size]
    }

    fn accuracy(&self, cell: u8, rock: u8) -> f64 {
        self.accuracy[usize::from(cell) * self.rocks.len() + usize::from(rock)]
    }

    fn unsampled(&self, state: &State) -> u16 {
        let all = ((1_u32 << self.rocks.len()) - 1) as u16;
        all & !state.sampled
    }

    fn rock_bit(&self, cell: u8) -> u16 {
        self.rock_at[usize::from(cell)].map_or(0, |rock| 1 << rock)
    }

    /// Moves that do not leave by a wrong edge, sampling an unsampled rock, checking unsampled rocks: what POMCP 1.0 calls legal.
    #[must_use]
    pub fn legal(&self, state: &State) -> Actions {
        let ([x, y], open) = (self.place(state), self.unsampled(state));
        let sample = u32::from(open & self.rock_bit(state.cell) != 0) << 4;
        let moves = u32::from(y + 1 < self.size) | 1 << 1 | u32::from(y > 0) << 2 | u32::from(x > 0) << 3;
        Actions(moves | sample | u32::from(open) << CHECK)
    }

    /// What POMCP 1.0 prefers: sample a rock that looks good; go east when all rocks left look bad; else move towards a rock that does not
    /// look bad or check one that is not settled. Empty where nothing of this is possible.
    #[must_use]
    #[inline]
    pub fn preferred(&self, state: &State) -> Actions {
        let open = self.unsampled(state);
        if open & state.seen.liked & self.rock_bit(state.cell) != 0 {
            return SAMPLE;
        }
        let interesting = open & !state.seen.disliked;
        if interesting == 0 {
            return EAST;
        }
        let towards = &self.towards[usize::from(state.cell)];
        let moves = (0..4).fold(0, |moves, way| moves | u32::from(interesting & towards[way] != 0) << way);
        Actions(moves | u32::from(open & !state.seen.settled) << CHECK)
    }

    /// Moves or samples; a check changes nothing here.
    #[inline]
    fn advance(&self, state: &mut State, action: Action) -> (f64, Outcome) {
        let goes_on = |reward| (reward, Outcome::Continue);
        let [x, y] = self.place(state);
        let last = self.size - 1;
        let (inside, to) = match action {
            Action::Check(_) => return goes_on(0.0),
            Action::Sample => {
                let bit = self.rock_bit(state.cell);
                if bit == 0 {
                    return goes_on(-100.0);
                }
                let good = state.good & bit != 0;
                state.good &= !bit;
                state.sampled |= bit;
                return goes_on(if good { 10.0 } else { -10.0 });
            }
            Action::East if x == last => return (10.0, Outcome::Terminal),
            Action::East => (true, state.cell + 1),
            Action::North => (y < last, state.cell.wrapping_add(self.size)),
            Action::South => (y > 0, state.cell.wrapping_sub(self.size)),
            Action::West => (x > 0, state.cell.wrapping_sub(1)),
        };
        if !inside {
            return goes_on(-100.0);
        }
        state.cell = to;
        goes_on(0.0)
    }

    fn look(&self, state: &mut State, rock: u8, rng: &mut Rng) -> Observation {
        let accuracy = self.accuracy(state.cell, rock);
        let good = (state.good >> rock & 1 == 1) == (rng.random::<f64>() < accuracy);
        state.seen.note(rock, good, accuracy);
        if good { Observation::Good } else { Observation::Bad }
    }
}

impl GenerativeModel for RockSample {
    type State = State;
    type Action = Action;
    type Observation = Observation;

    fn actions(&self) -> &[Action] {
        &self.actions
    }

    #[inline]
    fn step(&self, state: &mut State, action: &Action, rng: &mut Rng) -> Step<Observation> {
        if let Action::Check(rock) = *action {
            let observation = self.look(state, rock, rng);
            return Step { observation, reward: 0.0, outcome: Outcome::Continue };
        }
        let (reward, outcome) = self.advance(state, *action);
        Step { observation: Observation::Nothing, reward, outcome }
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl ObservationModel for RockSample {
    fn log_likelihood(&self, action: &Action, next: &State, observation: &Observation) -> f64 {
        match (action, observation) {
            (Action::Check(_), Observation::Nothing) => f64::NEG_INFINITY,
            (Action::Check(rock), seen) => {
                let accuracy = self.accuracy(next.cell, *rock);
                let right = (next.good >> rock & 1 == 1) == (*seen == Observation::Good);
                if right { accuracy.ln() } else { (1.0 - accuracy).ln() }
            }
            (_, Observation::Nothing) => 0.0,
            _ => f64::NEG_INFINITY,
        }
    }
}

impl Discretise for RockSample {
    type Key = Observation;

    fn key(&self, observation: &Observation) -> Observation {
        *observation
    }
}

impl InitialState for RockSample {
    fn initial(&self, rng: &mut Rng) -> State {
        let bits: u16 = rng.random();
        self.state(|rock| bits >> rock & 1 == 1)
    }
}

impl Perturb for RockSample {
    /// Turns one rock that was not sampled into the other kind: the local move of POMCP 1.0.
    fn perturb(&self, state: &mut State, rng: &mut Rng) {
        let open = Actions(u32::from(self.unsampled(state)));
        if open != Actions::default() {
            state.good ^= 1 << open.choose(rng);
        }
    }
}

impl Policy<RockSample> for Advice {
    #[inline]
    fn action(&self, model: &RockSample, state: &State, rng: &mut Rng) -> Action {
        let actions = match self.rollout {
            Knowledge::Pure => return model.actions[rng.random_range(0..model.actions.len())],
            Knowledge::Legal => model.legal(state),
            Knowledge::Preferred => match model.preferred(state) {
                Actions(0) => model.legal(state),
                some => some,
            },
        };
        model.actions[actions.choose(rng)]
    }

    fn priors(&self, model: &RockSample, state: &State, priors: &mut [ActionPrior]) {
        self.write(model.legal(state), model.preferred(state), priors);
    }
}

mod posterior;
mod steps;
mod tour;

pub use posterior::Posterior;
pub use steps::Steps;
pub use tour::{Plan, Tour};

#[cfg(test)]
mod tests;
