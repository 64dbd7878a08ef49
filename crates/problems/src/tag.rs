//! Tag: catch an opponent that runs away and is seen only in the same cell (Pineau, Gordon and Thrun, "Point-based value iteration",
//! IJCAI 2003; γ = 0.95), as in POMCP 1.0.
//!
//! 29 cells: x 0 to 9 with y 0 and 1, x 5 to 7 with y 2 to 4. Both start anywhere. A move costs 1 and stays where it is blocked; tagging
//! pays +10 in the opponent's cell and ends the episode, else costs 10. With every action the opponent stays with probability 0.2, or
//! moves away from where the agent was: 0.4 along each axis; along an axis on which both are level, 0.2 to either side; blocked moves
//! stay.

use pomdp::{ActionPrior, Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Policy, Rng, Step};
use rand::RngExt as _;

use crate::InitialState;
use crate::bits::{Actions, Advice, Knowledge};

/// γ.
pub const DISCOUNT: f64 = 0.95;
/// Cells.
pub const CELLS: u8 = 29;
/// Observation of the opponent in the agent's cell.
pub const SEEN: u8 = CELLS;
const TAG: u8 = 4;
/// Last action of a state in which none was taken yet.
const NONE: u8 = 5;

/// What can be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// y + 1.
    North,
    /// x + 1.
    East,
    /// y − 1.
    South,
    /// x − 1.
    West,
    /// Catch.
    Tag,
}

/// All actions.
pub const ACTIONS: [Action; 5] = [Action::North, Action::East, Action::South, Action::West, Action::Tag];

/// Both places, and what the agent remembers of the last step: equal in all states of a belief, carried so that policies need no
/// history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// Cell of the agent.
    pub agent: u8,
    /// Cell of the opponent.
    pub opponent: u8,
    last: u8,
    saw: bool,
}

/// The problem.
#[derive(Clone, Debug)]
pub struct Tag {
    /// Neighbour of each cell to the north, east, south and west; itself where blocked.
    neighbour: [[u8; 4]; CELLS as usize],
    /// Where the opponent goes, for each pair of agent and opponent, with probability 1/5 each.
    flight: Vec<[u8; 5]>,
    /// Whether each cell is one of the six corners.
    corner: [bool; CELLS as usize],
}

/// (x, y) of a cell.
#[must_use]
pub fn place(cell: u8) -> [i8; 2] {
    let cell = cell as i8;
    if cell < 20 { [cell % 10, cell / 10] } else { [(cell - 20) % 3 + 5, (cell - 20) / 3 + 2] }
}

/// Cell at (x, y), where there is one.
#[must_use]
pub fn cell_at([x, y]: [i8; 2]) -> Option<u8> {
    match (x, y) {
        (0..=9, 0..=1) => Some((y * 10 + x) as u8),
        (5..=7, 2..=4) => Some((20 + (y - 2) * 3 + x - 5) as u8),
        _ => None,
    }
}

const WAYS: [[i8; 2]; 4] = [[0, 1], [1, 0], [0, -1], [-1, 0]];

impl Default for Tag {
    fn default() -> Self {
        Self::new()
    }
}

impl Tag {
    /// The problem.
    #[must_use]
    pub fn new() -> Self {
        let mut neighbour = [[0; 4]; CELLS as usize];
        for (cell, ways) in (0..CELLS).zip(&mut neighbour) {
            let [x, y] = place(cell);
            *ways = WAYS.map(|[dx, dy]| cell_at([x + dx, y + dy]).unwrap_or(cell));
        }
        let flight = |agent: u8, opponent: u8| {
            let to = |way: usize| neighbour[usize::from(opponent)][way];
            let ([ax, ay], [ox, oy]) = (place(agent), place(opponent));
            // Two fifths an axis: both away from the agent, or one to either side.
            let axis = |own: i8, other: i8, plus: usize, minus: usize| match own.cmp(&other) {
                std::cmp::Ordering::Greater => [to(plus); 2],
                std::cmp::Ordering::Less => [to(minus); 2],
                std::cmp::Ordering::Equal => [to(plus), to(minus)],
            };
            let ([a, b], [c, d]) = (axis(ox, ax, 1, 3), axis(oy, ay, 0, 2));
            [opponent, a, b, c, d]
        };
        let corners = [[0, 0], [0, 1], [9, 0], [9, 1], [5, 4], [7, 4]];
        Self {
            flight: (0..CELLS)
                .flat_map(|agent| (0..CELLS).map(move |o| (agent, o)))
                .map(|(a, o)| flight(a, o))
                .collect(),
            neighbour,
            corner: std::array::from_fn(|cell| corners.contains(&place(cell as u8))),
        }
    }

    /// A state in which nothing was done yet.
    #[must_use]
    pub fn state(&self, agent: u8, opponent: u8) -> State {
        State { agent, opponent, last: NONE, saw: false }
    }

    /// What POMCP 1.0 prefers: tag in a corner where the opponent was just seen; else move, but not into a wall nor back. Empty before
    /// the first action.
    #[must_use]
    #[inline]
    pub fn preferred(&self, state: &State) -> Actions {
        let here = usize::from(state.agent);
        match state.last {
            NONE => Actions::default(),
            _ if state.saw && self.corner[here] => Actions(1 << TAG),
            last => {
                let free = |way: u8| {
                    let back = last < TAG && way == (last + 2) % 4;
                    !back && self.neighbour[here][usize::from(way)] != state.agent
                };
                Actions((0..4).fold(0, |ways, way| ways | u32::from(free(way)) << way))
            }
        }
    }
}

impl GenerativeModel for Tag {
    type State = State;
    type Action = Action;
    /// The agent's cell, or [`SEEN`] after a move into the opponent's.
    type Observation = u8;

    fn actions(&self) -> &[Action] {
        &ACTIONS
    }

    #[inline]
    fn step(&self, state: &mut State, action: &Action, rng: &mut Rng) -> Step<u8> {
        let action = *action as u8;
        (state.last, state.saw) = (action, false);
        if action == TAG && state.agent == state.opponent {
            return Step { observation: state.agent, reward: 10.0, outcome: Outcome::Terminal };
        }
        let pair = usize::from(state.agent) * usize::from(CELLS) + usize::from(state.opponent);
        state.opponent = self.flight[pair][rng.random_range(0..5_u32) as usize];
        if action == TAG {
            return Step { observation: state.agent, reward: -10.0, outcome: Outcome::Continue };
        }
        state.agent = self.neighbour[usize::from(state.agent)][usize::from(action)];
        state.saw = state.agent == state.opponent;
        let observation = if state.saw { SEEN } else { state.agent };
        Step { observation, reward: -1.0, outcome: Outcome::Continue }
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl ObservationModel for Tag {
    fn log_likelihood(&self, action: &Action, next: &State, observation: &u8) -> f64 {
        let saw = *action != Action::Tag && next.agent == next.opponent;
        let expected = if saw { SEEN } else { next.agent };
        if *observation == expected { 0.0 } else { f64::NEG_INFINITY }
    }
}

impl Discretise for Tag {
    type Key = u8;

    fn key(&self, observation: &u8) -> u8 {
        *observation
    }
}

impl InitialState for Tag {
    fn initial(&self, rng: &mut Rng) -> State {
        self.state(rng.random_range(0..CELLS), rng.random_range(0..CELLS))
    }
}

impl Perturb for Tag {
    /// Puts the opponent anywhere: the local move of POMCP 1.0. Whether it was seen is part of the memory and stays.
    fn perturb(&self, state: &mut State, rng: &mut Rng) {
        state.opponent = if state.saw { state.agent } else { rng.random_range(0..CELLS) };
    }
}

impl Policy<Tag> for Advice {
    #[inline]
    fn action(&self, model: &Tag, state: &State, rng: &mut Rng) -> Action {
        let preferred = match self.rollout {
            Knowledge::Pure | Knowledge::Legal => Actions::default(),
            Knowledge::Preferred => model.preferred(state),
        };
        if preferred == Actions::default() {
            return ACTIONS[rng.random_range(0..5_u32) as usize];
        }
        ACTIONS[preferred.choose(rng)]
    }

    fn priors(&self, model: &Tag, state: &State, priors: &mut [ActionPrior]) {
        self.write(Actions(0b11111), model.preferred(state), priors);
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed, conformance};

    use super::*;

    fn rng() -> Rng {
        Seed(1).stream(Purpose::Test, 0)
    }

    fn cell(x: i8, y: i8) -> u8 {
        cell_at([x, y]).unwrap()
    }

    #[test]
    fn it_conforms() {
        let problem = Tag::new();
        let states: Vec<State> = (0..50).map(|i| problem.initial(&mut Seed(1).stream(Purpose::Test, i))).collect();
        conformance::check_generative_model(&problem, &states, 60);
    }

    #[test]
    fn cells_and_places_agree() {
        for cell in 0..CELLS {
            assert_eq!(cell_at(place(cell)), Some(cell));
        }
        assert_eq!([cell_at([4, 2]), cell_at([8, 3]), cell_at([5, 5]), cell_at([10, 0]), cell_at([0, -1])], [None; 5]);
    }

    /// Probability of each place of the opponent, by the five equally likely draws.
    fn flight(agent: [i8; 2], opponent: [i8; 2]) -> std::collections::BTreeMap<[i8; 2], u32> {
        let pair = usize::from(cell_at(agent).unwrap()) * 29 + usize::from(cell_at(opponent).unwrap());
        let mut fifths = std::collections::BTreeMap::new();
        for to in Tag::new().flight[pair] {
            *fifths.entry(place(to)).or_insert(0) += 1;
        }
        fifths
    }

    #[test]
    fn the_opponent_runs_as_defined() {
        // Free on both axes, level on one, level on both, and against walls; counts are fifths.
        assert_eq!(flight([4, 0], [6, 1]), [([6, 1], 1), ([7, 1], 2), ([6, 2], 2)].into());
        assert_eq!(flight([6, 0], [6, 1]), [([6, 1], 1), ([6, 2], 2), ([5, 1], 1), ([7, 1], 1)].into());
        assert_eq!(flight([6, 2], [6, 2]), [([6, 2], 1), ([6, 3], 1), ([6, 1], 1), ([5, 2], 1), ([7, 2], 1)].into());
        assert_eq!(flight([5, 0], [9, 1]), [([9, 1], 5)].into());
        assert_eq!(flight([3, 0], [3, 0]), [([3, 0], 2), ([2, 0], 1), ([4, 0], 1), ([3, 1], 1)].into());
    }

    #[test]
    fn draws_follow_the_table() {
        let problem = Tag::new();
        let mut rng = rng();
        let start = problem.state(cell(4, 0), cell(6, 1));
        let mut stayed = 0;
        for _ in 0..5000 {
            let mut state = start;
            problem.step(&mut state, &Action::West, &mut rng);
            stayed += i32::from(state.opponent == start.opponent);
            assert_eq!(state.agent, cell(3, 0));
        }
        // n = 5000, p = 0.2, standard deviation 28.3; tolerance 4 of them.
        assert!((stayed - 1000).abs() < 114, "{stayed}");
    }

    #[test]
    fn moves_and_tags_pay_and_show_as_defined() {
        let problem = Tag::new();
        let mut rng = rng();
        let mut state = problem.state(cell(0, 0), cell(9, 1));
        let step = problem.step(&mut state, &Action::South, &mut rng);
        assert_eq!((step.observation, step.reward, step.outcome), (cell(0, 0), -1.0, Outcome::Continue));
        let step = problem.step(&mut state, &Action::Tag, &mut rng);
        assert_eq!((step.observation, step.reward, step.outcome), (cell(0, 0), -10.0, Outcome::Continue));
        // The opponent cannot leave its corner, so the agent meets it there.
        let mut state = problem.state(cell(8, 1), cell(9, 1));
        while state.agent != state.opponent {
            state.agent = cell(8, 1);
            problem.step(&mut state, &Action::East, &mut rng);
        }
        assert!(state.saw);
        assert_eq!(problem.log_likelihood(&Action::East, &state, &SEEN), 0.0);
        assert_eq!(problem.log_likelihood(&Action::East, &state, &state.agent), f64::NEG_INFINITY);
        let step = problem.step(&mut state, &Action::Tag, &mut rng);
        assert_eq!((step.reward, step.outcome), (10.0, Outcome::Terminal));
    }

    #[test]
    fn preferences_follow_the_last_step() {
        let problem = Tag::new();
        let bits = |ways: &[Action]| Actions(ways.iter().fold(0, |bits, way| bits | 1 << *way as u8));
        let mut state = problem.state(cell(9, 0), cell(9, 0));
        assert_eq!(problem.preferred(&state), Actions::default());
        (state.last, state.saw) = (Action::East as u8, true);
        assert_eq!(problem.preferred(&state), bits(&[Action::Tag]));
        state.saw = false;
        assert_eq!(problem.preferred(&state), bits(&[Action::North]), "not back west, not into the walls");
        (state.agent, state.saw) = (cell(6, 1), true);
        let expected = bits(&[Action::North, Action::East, Action::South]);
        assert_eq!(problem.preferred(&state), expected, "seen, but not in a corner");
    }
}
