//! VDP Tag: catch a target that drifts along the Van der Pol oscillator, past four barriers, as in the experiments of Sunberg and Kochenderfer, "Online
//! algorithms for POMDPs with continuous state, action, and observation spaces", ICAPS 2018.
//!
//! The numbers are those of the code that the published returns come from, zsunberg/VDPTag2.jl. γ = 0.95. The agent starts at the origin, the target
//! anywhere in [−4, 4]². A step lasts 0.5 s. The target follows ẋ = μ (x − x³/3 − y), ẏ = x / μ with μ = 2 (five Runge–Kutta steps of
//! 0.1 s), plus normal noise of standard deviation 0.05 in x and y. The agent goes 0.5 m in the direction of its choice, or up to the first of four walls, which lie on the axes
//! from 0.2 m to 3 m off the origin. They do not stop the target.
//!
//! A step costs 1, and 5 more where the agent looks. A target within 0.1 m is caught for +100, and the episode ends. Eight beams of 45° ([`crate::beams`])
//! read the distance in the target's beam and 1 m in the others, with noise of standard deviation 5 m; 0.1 m in the target's beam where the agent looks.
//!
//! Actions are continuous: a step takes any, and [`VdpTag::with_actions`] names those that a search may choose from. Published searches draw some 30 at random in
//! each node, the first at the root of which makes for where the target will be.
//!
//! Published returns of 1,000 episodes at 1 s a move: POMCPOW 29.3 ± 0.8, PFT-DPW 27.2 ± 0.8. Always making for where a random particle will be returned
//! −17.1 ± 0.4; making for where the mean will be, and looking while √det of the targets' covariance is above 0.01 m², −2.7 ± 1.2.

use std::f64::consts::TAU;

use pomdp::{GenerativeModel, ObservationModel, Outcome, Policy, Rng, Step};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

use crate::InitialState;
use crate::beams::{Beams, Reading, beam_of};

/// γ.
pub const DISCOUNT: f64 = 0.95;
/// What the agent goes in a step, m.
const STRIDE: f64 = 0.5;
/// Distance at which the target is caught, m.
const CAUGHT: f64 = 0.1;
/// μ of the oscillator.
const MU: f64 = 2.0;
/// Steps of the integration, s, and how many there are.
const PERIOD_SECS: f64 = 0.1;
const STEPS: usize = 5;
/// Standard deviation of the target's drift in a step, m.
const DRIFT: f64 = 0.05;
/// √det of the covariance of the target above which [`Chase`] looks, m².
const UNSURE: f64 = 0.01;
/// Begin and length of the walls along the axes, m.
const WALLS: (f64, f64) = (0.2, 2.8);

/// A step in a direction, rad from the x axis to the y axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Action {
    /// Whether the agent pays for a sharp measurement.
    pub look: bool,
    /// Direction of the step, rad.
    pub angle: f64,
}

/// Both places, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// The agent.
    pub agent: [f64; 2],
    /// The target.
    pub target: [f64; 2],
}

impl State {
    fn relative(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.target[axis] - self.agent[axis])
    }
}

/// The problem, with the actions that a search may choose from.
#[derive(Clone, Debug)]
pub struct VdpTag {
    actions: Vec<Action>,
}

fn flow([x, y]: [f64; 2]) -> [f64; 2] {
    [MU * (x - x.powi(3) / 3.0 - y), x / MU]
}

/// Where the target will be after a step, but for its drift, m.
#[must_use]
pub fn carried(target: [f64; 2]) -> [f64; 2] {
    let along = |place: [f64; 2], by: f64, slope: [f64; 2]| [place[0] + by * slope[0], place[1] + by * slope[1]];
    (0..STEPS).fold(target, |place, _| {
        let first = flow(place);
        let second = flow(along(place, 0.5 * PERIOD_SECS, first));
        let third = flow(along(place, 0.5 * PERIOD_SECS, second));
        let fourth = flow(along(place, PERIOD_SECS, third));
        let mean = [0, 1].map(|axis| first[axis] + 2.0 * (second[axis] + third[axis]) + fourth[axis]);
        along(place, PERIOD_SECS / 6.0, mean)
    })
}

/// Where a step from `from` ends, m: at its end, or at the first wall.
fn walked(from: [f64; 2], angle: f64) -> [f64; 2] {
    let step = [STRIDE * angle.cos(), STRIDE * angle.sin()];
    let mut share = 1.0_f64;
    for axis in [0, 1] {
        // The walls of this axis are crossed where the other coordinate is zero.
        let across = 1 - axis;
        if step[across] == 0.0 {
            continue;
        }
        let crossing = -from[across] / step[across];
        let off = (from[axis] + crossing * step[axis]).abs();
        if (0.0..share).contains(&crossing) && (WALLS.0..=WALLS.0 + WALLS.1).contains(&off) {
            // A little before the wall, so that the next step starts on this side of it.
            share = (crossing - 2.0 * f64::EPSILON).min(share);
        }
    }
    [from[0] + share * step[0], from[1] + share * step[1]]
}

fn beams(action: &Action, next: &State) -> Beams {
    let relative @ [x, y] = next.relative();
    let noise = if action.look { 0.1 } else { 5.0 };
    Beams { active: Some(beam_of(relative)), seen: (x.hypot(y), noise), others: (1.0, 5.0) }
}

/// The action without a look that makes for where a target will be.
#[must_use]
pub fn towards(agent: [f64; 2], target: [f64; 2]) -> Action {
    let [x, y] = carried(target);
    Action { look: false, angle: (y - agent[1]).atan2(x - agent[0]) }
}

impl VdpTag {
    /// The problem with these actions to choose from.
    ///
    /// # Panics
    ///
    /// Without an action.
    #[must_use]
    pub fn with_actions(actions: Vec<Action>) -> Self {
        assert!(!actions.is_empty(), "a search needs an action to choose");
        Self { actions }
    }
}

impl GenerativeModel for VdpTag {
    type State = State;
    type Action = Action;
    type Observation = Reading;

    fn actions(&self) -> &[Action] {
        &self.actions
    }

    fn step(&self, state: &mut State, action: &Action, rng: &mut Rng) -> Step<Reading> {
        let drifts: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(rng));
        let [x, y] = carried(state.target);
        *state =
            State { agent: walked(state.agent, action.angle), target: [x + DRIFT * drifts[0], y + DRIFT * drifts[1]] };
        let [x, y] = state.relative();
        let caught = x.hypot(y) < CAUGHT;
        let reward = if caught { 100.0 } else { -1.0 } - if action.look { 5.0 } else { 0.0 };
        let outcome = if caught { Outcome::Terminal } else { Outcome::Continue };
        Step { observation: beams(action, state).sample(rng), reward, outcome }
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl ObservationModel for VdpTag {
    fn log_likelihood(&self, action: &Action, next: &State, observation: &Reading) -> f64 {
        beams(action, next).log_density(observation)
    }
}

impl InitialState for VdpTag {
    fn initial(&self, rng: &mut Rng) -> State {
        State { agent: [0.0; 2], target: [0, 1].map(|_| rng.random_range(-4.0..4.0)) }
    }
}

/// Any direction, and a look in half of the steps: the rollouts of the published experiments.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wander;

impl Policy<VdpTag> for Wander {
    fn action(&self, _model: &VdpTag, _state: &State, rng: &mut Rng) -> Action {
        Action { look: rng.random(), angle: TAU * rng.random::<f64>() }
    }
}

/// Makes for where the target will be. It looks at the target's place. On a belief it makes for where the mean will be, and pays for a look while √det of the
/// covariance of the targets is above 0.01 m²: the better of the published simple policies.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chase;

impl Policy<VdpTag> for Chase {
    fn action(&self, _model: &VdpTag, state: &State, _rng: &mut Rng) -> Action {
        towards(state.agent, state.target)
    }

    fn belief_action(&self, _model: &VdpTag, belief: &[(State, f64)], _rng: &mut Rng) -> Action {
        let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
        let mean = |of: &dyn Fn(&State) -> f64| belief.iter().map(|(s, weight)| weight * of(s)).sum::<f64>() / total;
        let [x, y] = [0, 1].map(|axis| mean(&|s| s.target[axis]));
        let covariance = |i: usize, j: usize| mean(&|s| (s.target[i] - [x, y][i]) * (s.target[j] - [x, y][j]));
        let determinant = covariance(0, 0) * covariance(1, 1) - covariance(0, 1).powi(2);
        Action { look: determinant.max(0.0).sqrt() > UNSURE, ..towards(belief[0].0.agent, [x, y]) }
    }
}

#[cfg(test)]
mod tests;
