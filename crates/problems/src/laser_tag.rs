//! LaserTag: catch an opponent that runs away, with a laser that measures how far eight ways are clear (Somani, Ye, Hsu and Lee, "DESPOT: online
//! POMDP planning with regularization", NIPS 2013), as in the experiments of Sunberg and Kochenderfer, "Online algorithms for POMDPs with continuous
//! state, action, and observation spaces", ICAPS 2018.
//!
//! The numbers are those of the code that the published returns come from, zsunberg/LaserTag.jl. γ = 0.95. The floor has 11 × 7 cells, of which 8 are
//! blocked, others in each episode. Both start anywhere, even in a blocked cell, and the agent does not know where it is. A move costs 1 and
//! stays where it is blocked; tagging pays +10 in the opponent's cell and ends the episode, else it costs 10. With every action the opponent moves away from
//! where the agent was: 0.4 along each axis; along an axis on which both are level, 0.2 to either side; else, and where blocked, it stays.
//!
//! Then eight lasers read max(0, ⌊d − |n|⌋), with n normal of standard deviation 2.5 and d the clear cells up to a wall, a blocked cell or
//! the opponent, plus one; on diagonals √2 times that. In the opponent's cell all read −1.
//!
//! Published returns of 1,000 episodes at 1 s a move: DESPOT −8.9 ± 0.2, POMCPOW −10.3 ± 0.2, QMDP −10.5 ± 0.2.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use pomdp::{Discretise, GenerativeModel, ObservationModel, Outcome, Rng, Step};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use statrs::function::erf::erf;

use crate::InitialState;
use crate::finite::{self, Finite, Successor};
pub use crate::tag::{ACTIONS, Action};

/// γ.
pub const DISCOUNT: f64 = 0.95;
/// Columns.
pub const WIDTH: u8 = 11;
/// Rows.
pub const HEIGHT: u8 = 7;
/// Cells.
pub const CELLS: u8 = WIDTH * HEIGHT;
/// Blocked cells of the published floors.
pub const BLOCKED: usize = 8;
/// Standard deviation of a laser, cells.
pub const NOISE: f64 = 2.5;
/// North, east, south, west, then the diagonals from north-east clockwise.
const WAYS: [(i8, i8); 8] = [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)];
/// Most clear cells in one way.
const MOST_CLEAR: usize = WIDTH as usize - 1;

/// What the lasers read, in the order north, east, south, west, north-east, south-east, south-west, north-west.
pub type Reading = [i8; 8];

/// Reading in the opponent's cell.
pub const SAME_CELL: Reading = [-1; 8];

/// Both cells: x + 11 y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// Cell of the agent.
    pub agent: u8,
    /// Cell of the opponent.
    pub opponent: u8,
}

/// The problem on one floor.
#[derive(Clone, Debug)]
pub struct LaserTag {
    /// Neighbour of each cell to the north, east, south and west; itself where blocked.
    neighbour: Vec<[u8; 4]>,
    /// Clear cells in the eight ways, for each agent and opponent.
    clear: Vec<[u8; 8]>,
    /// ln p(reading | clear cells), straight and diagonal.
    log_straight: Vec<Vec<f64>>,
    log_diagonal: Vec<Vec<f64>>,
}

fn place(cell: u8) -> (i8, i8) {
    ((cell % WIDTH) as i8, (cell / WIDTH) as i8)
}

/// The cell that many steps on, if it is on the floor.
fn ahead(cell: u8, (dx, dy): (i8, i8), steps: i8) -> Option<u8> {
    let (x, y) = place(cell);
    let (x, y) = (x + steps * dx, y + steps * dy);
    let inside = (0..WIDTH as i8).contains(&x) && (0..HEIGHT as i8).contains(&y);
    inside.then(|| y as u8 * WIDTH + x as u8)
}

/// Distance that a laser without noise reads.
fn distance(clear: u8, way: usize) -> f64 {
    (f64::from(clear) + 1.0) * if way < 4 { 1.0 } else { SQRT_2 }
}

/// ln p(reading) for the distance `d`: P(r ≤ d − |n| < r + 1) from 1 on, the rest at 0.
fn log_readings(d: f64) -> Vec<f64> {
    // P(|n| ≤ x) of the noise.
    let within = |x: f64| erf(x.max(0.0) / NOISE * FRAC_1_SQRT_2);
    let probability = |r: f64| if r == 0.0 { 1.0 - within(d - 1.0) } else { within(d - r) - within(d - r - 1.0) };
    (0..=MOST_CLEAR + 6).map(|r| probability(r as f64).ln()).collect()
}

impl LaserTag {
    /// A floor with these cells blocked, (x, y) from (0, 0) to (10, 6), y growing to the north.
    ///
    /// # Panics
    ///
    /// Where a blocked cell lies outside.
    #[must_use]
    pub fn new(blocked: &[[u8; 2]]) -> Self {
        assert!(blocked.iter().all(|b| b[0] < WIDTH && b[1] < HEIGHT), "a blocked cell lies outside: {blocked:?}");
        let blocked: Vec<u8> = blocked.iter().map(|b| b[1] * WIDTH + b[0]).collect();
        let open = |cell: &u8| !blocked.contains(cell);
        let step = |cell: u8, way: usize| ahead(cell, WAYS[way], 1).filter(open).unwrap_or(cell);
        let neighbour = (0..CELLS).map(|cell| std::array::from_fn(|way| step(cell, way))).collect();
        let sees = |agent: u8, opponent: u8, way: usize| {
            let through = |steps: &i8| ahead(agent, WAYS[way], *steps).filter(open).is_some_and(|c| c != opponent);
            (1..).take_while(through).count() as u8
        };
        let pairs = (0..CELLS).flat_map(|agent| (0..CELLS).map(move |opponent| (agent, opponent)));
        let clear = pairs.map(|(agent, opponent)| std::array::from_fn(|way| sees(agent, opponent, way))).collect();
        let readings = |way| (0..=MOST_CLEAR as u8).map(|clear| log_readings(distance(clear, way))).collect();
        Self { neighbour, clear, log_straight: readings(0), log_diagonal: readings(4) }
    }

    /// A floor as in the published experiments: [`BLOCKED`] cells drawn without replacement.
    #[must_use]
    pub fn random(rng: &mut Rng) -> Self {
        let cells = rand::seq::index::sample(rng, usize::from(CELLS), BLOCKED);
        let blocked: Vec<[u8; 2]> = cells.iter().map(|c| [c as u8 % WIDTH, c as u8 / WIDTH]).collect();
        Self::new(&blocked)
    }

    fn clear(&self, state: &State) -> [u8; 8] {
        self.clear[self.index(state)]
    }

    fn observe(&self, state: &State, rng: &mut Rng) -> Reading {
        if state.agent == state.opponent {
            return SAME_CELL;
        }
        let clear = self.clear(state);
        std::array::from_fn(|way| {
            let noise: f64 = StandardNormal.sample(rng);
            (distance(clear[way], way) - (NOISE * noise).abs()).floor().max(0.0) as i8
        })
    }

    /// Where the opponent goes: up to four neighbours with their probabilities; it stays with what is left.
    fn flight(&self, state: &State) -> [(u8, f64); 4] {
        let ((ax, ay), (ox, oy)) = (place(state.agent), place(state.opponent));
        let weight = |away: i8| match away {
            0 => 0.2,
            1.. => 0.4,
            _ => 0.0,
        };
        let away = [oy - ay, ox - ax, ay - oy, ax - ox].map(i8::signum);
        std::array::from_fn(|way| (self.neighbour[usize::from(state.opponent)][way], weight(away[way])))
    }
}

impl GenerativeModel for LaserTag {
    type State = State;
    type Action = Action;
    type Observation = Reading;

    fn actions(&self) -> &[Action] {
        &ACTIONS
    }

    fn step(&self, state: &mut State, action: &Action, rng: &mut Rng) -> Step<Reading> {
        finite::step(self, state, action, rng, |next, rng| self.observe(next, rng))
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl ObservationModel for LaserTag {
    fn log_likelihood(&self, _action: &Action, next: &State, observation: &Reading) -> f64 {
        let same = next.agent == next.opponent;
        if same || *observation == SAME_CELL {
            return if same && *observation == SAME_CELL { 0.0 } else { f64::NEG_INFINITY };
        }
        let clear = self.clear(next);
        let log = |way: usize| {
            let table = if way < 4 { &self.log_straight } else { &self.log_diagonal };
            let readings = &table[usize::from(clear[way])];
            usize::try_from(observation[way]).ok().and_then(|r| readings.get(r)).copied().unwrap_or(f64::NEG_INFINITY)
        };
        (0..8).map(log).sum()
    }
}

impl Finite for LaserTag {
    fn states(&self) -> usize {
        usize::from(CELLS) * usize::from(CELLS)
    }

    fn index(&self, state: &State) -> usize {
        usize::from(state.agent) * usize::from(CELLS) + usize::from(state.opponent)
    }

    fn state(&self, index: usize) -> State {
        let cells = usize::from(CELLS);
        State { agent: (index / cells) as u8, opponent: (index % cells) as u8 }
    }

    fn successors(&self, state: &State, action: &Action, mut visit: impl FnMut(Successor<State>)) {
        let same = state.agent == state.opponent;
        if *action == Action::Tag && same {
            return visit(Successor { probability: 1.0, state: *state, reward: 10.0, outcome: Outcome::Terminal });
        }
        let (agent, reward) = match action {
            Action::Tag => (state.agent, -10.0),
            _ => (self.neighbour[usize::from(state.agent)][*action as usize], -1.0),
        };
        let mut leads = |opponent, probability| {
            visit(Successor { probability, state: State { agent, opponent }, reward, outcome: Outcome::Continue });
        };
        let mut stays = 1.0;
        for (opponent, probability) in self.flight(state) {
            if probability > 0.0 && opponent != state.opponent {
                stays -= probability;
                leads(opponent, probability);
            }
        }
        leads(state.opponent, stays);
    }

    fn initial_distribution(&self) -> Vec<(State, f64)> {
        let states = self.states();
        (0..states).map(|index| (self.state(index), 1.0 / states as f64)).collect()
    }
}

impl Discretise for LaserTag {
    type Key = Reading;

    fn key(&self, observation: &Reading) -> Reading {
        *observation
    }
}

impl InitialState for LaserTag {
    fn initial(&self, rng: &mut Rng) -> State {
        State { agent: rng.random_range(0..CELLS), opponent: rng.random_range(0..CELLS) }
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed, conformance};

    use super::*;
    use crate::episode;
    use crate::finite::tests::check_finite;
    use crate::finite::{ExactBelief, FullInformation};

    /// The fixed floor of DESPOT's code, with (x, y) counted from 0.
    fn floor() -> LaserTag {
        LaserTag::new(&[[4, 6], [1, 5], [3, 2], [2, 1], [3, 1], [7, 1], [9, 1], [3, 0]])
    }

    fn at(agent: [u8; 2], opponent: [u8; 2]) -> State {
        State { agent: agent[1] * WIDTH + agent[0], opponent: opponent[1] * WIDTH + opponent[0] }
    }

    #[test]
    fn it_conforms() {
        let states = [at([0, 0], [5, 5]), at([10, 6], [10, 5]), at([4, 4], [4, 4]), at([3, 2], [8, 1])];
        conformance::check_generative_model(&floor(), &states, 60);
        conformance::check_observation_model(&floor(), &states, 200);
        conformance::check_discretise(&floor(), &states, 60);
        check_finite(&floor(), &states);
    }

    #[test]
    fn lasers_stop_before_walls_blocked_cells_and_the_opponent() {
        // From (4, 4): north one cell below the blocked (4, 6), east six, south and west four to the walls; the diagonals end at the walls after two, two
        // (the next is the blocked (7, 1)), four and two.
        assert_eq!(floor().clear(&at([4, 4], [9, 5])), [1, 6, 4, 4, 2, 2, 4, 2]);
        // The opponent in the east and one in the north-west.
        assert_eq!(floor().clear(&at([4, 4], [7, 4]))[1], 2);
        assert_eq!(floor().clear(&at([4, 4], [3, 5]))[7], 0);
    }

    #[test]
    fn readings_have_the_published_probabilities() {
        // By hand with Φ: straight, two cells clear (d = 3): P(0) = 2 Φ(−0.8) = 0.423711, P(1) = 2 (Φ(0.8) − Φ(0.4)) = 0.265446,
        // P(2) = 2 (Φ(0.4) − ½) = 0.310843. Diagonal, none clear (d = 1.41421): P(0) = 2 Φ(−0.165685) = 0.868405, P(1) = 0.131595.
        let close = |readings: &[f64], expected: &[f64]| {
            for (reading, probability) in expected.iter().enumerate() {
                assert!((readings[reading].exp() - probability).abs() < 1e-5, "{reading}: {}", readings[reading].exp());
            }
            assert!((readings.iter().map(|log| log.exp()).sum::<f64>() - 1.0).abs() < 1e-12);
        };
        let floor = floor();
        close(&floor.log_straight[2], &[0.423_711, 0.265_446, 0.310_843, 0.0]);
        close(&floor.log_diagonal[0], &[0.868_405, 0.131_595, 0.0]);
        // And simulated ones follow them: n = 4000, tolerance 4 standard deviations.
        let (state, mut rng) = (at([4, 4], [7, 4]), Seed(1).stream(Purpose::Test, 0));
        let mut counts = [0.0_f64; 4];
        (0..4000).for_each(|_| counts[floor.observe(&state, &mut rng)[1] as usize] += 1.0);
        for (count, p) in counts.into_iter().zip([0.423_711_f64, 0.265_446, 0.310_843, 0.0]) {
            assert!((count - 4000.0 * p).abs() <= 4.0 * (4000.0 * p * (1.0 - p)).sqrt(), "{counts:?}");
        }
    }

    #[test]
    fn the_opponent_runs_away() {
        let ends = |state: State, action: Action| {
            let mut found = Vec::new();
            floor().successors(&state, &action, |s| found.push((place(s.state.opponent), s.probability, s.reward)));
            found
        };
        // East of the agent and level with it.
        let run = ends(at([4, 4], [6, 4]), Action::East);
        assert_eq!(run.iter().map(|e| e.0).collect::<Vec<_>>(), [(6, 5), (7, 4), (6, 3), (6, 4)]);
        assert!(run.iter().zip([0.2, 0.4, 0.2, 0.2]).all(|(e, p)| (e.1 - p).abs() < 1e-12 && e.2 == -1.0), "{run:?}");
        // In the corner it stays, whatever the agent does.
        assert_eq!(ends(at([4, 4], [10, 6]), Action::Tag), [((10, 6), 1.0, -10.0)]);
        assert_eq!(ends(at([4, 4], [4, 4]), Action::Tag), [((4, 4), 1.0, 10.0)]);
    }

    #[test]
    fn floors_are_drawn_with_eight_different_blocked_cells() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for _ in 0..20 {
            let floor = LaserTag::random(&mut rng);
            // A blocked cell is the neighbour of no other cell.
            let entered = (0..CELLS)
                .filter(|&c| (0..CELLS).any(|from| from != c && floor.neighbour[usize::from(from)].contains(&c)));
            assert!(entered.count() <= usize::from(CELLS) - BLOCKED);
        }
    }

    #[test]
    fn qmdp_returns_what_was_published() {
        // Published: −10.55 ± 0.19 (1,000 episodes, 100,000 particles). Here 200 episodes on ten floors; tolerance 4 standard errors of the difference.
        let mut played = Vec::new();
        for group in 0..10 {
            let model = LaserTag::random(&mut Seed(2).stream(Purpose::Test, group));
            let known = FullInformation::solve(&model, 1e-6);
            for item in 0..20 {
                let mut rng = Seed(3).stream(Purpose::Test, 20 * group + item);
                let (start, belief) = (model.initial(&mut rng), ExactBelief::initial(&model));
                let learn = |belief: ExactBelief<State>, action: &Action, seen: &Reading, _: &mut Rng| {
                    belief.update(&model, action, seen).expect("the truth explains what it shows")
                };
                let decide = |belief: &ExactBelief<State>, _| known.qmdp(&model, belief);
                played.push(episode::play_with(&model, start, belief, 100, &mut rng, decide, learn).discounted_return);
            }
        }
        let (mean, error) = episode::mean_and_error(&played);
        assert!((mean + 10.55).abs() < 4.0 * error.hypot(0.19), "{mean} ± {error}");
    }
}
