//! A hidden Markov model of three states, two actions and two observations.

use pomdp::{Discretise, GenerativeModel, ObservationModel, Outcome, Partition, Perturb, Rng, StaticParameters, Step};
use rand::RngExt as _;

/// Number of hidden states.
pub const STATES: usize = 3;
/// P(s' | s) for each action.
const TRANSITION: [[[f64; STATES]; STATES]; 2] =
    [[[0.7, 0.2, 0.1], [0.1, 0.6, 0.3], [0.25, 0.25, 0.5]], [[0.1, 0.8, 0.1], [0.3, 0.1, 0.6], [0.9, 0.05, 0.05]]];

/// The model; its state is the index of the hidden state.
#[derive(Clone, Debug)]
pub struct Hmm {
    /// P(o | s').
    pub emission: [[f64; 2]; STATES],
}

impl Hmm {
    /// Observations that tell a little about the state.
    #[must_use]
    pub fn vague() -> Self {
        Self { emission: [[0.9, 0.1], [0.5, 0.5], [0.2, 0.8]] }
    }

    /// Observation 1 comes almost only from state 2.
    #[must_use]
    pub fn sharp() -> Self {
        Self { emission: [[0.999, 0.001], [0.99, 0.01], [0.05, 0.95]] }
    }

    /// Posterior and evidence by Bayes' rule.
    #[must_use]
    pub fn bayes(&self, prior: [f64; STATES], action: usize, observation: usize) -> ([f64; STATES], f64) {
        let joint: [f64; STATES] = std::array::from_fn(|next| {
            let predicted: f64 = (0..STATES).map(|s| prior[s] * TRANSITION[action][s][next]).sum();
            predicted * self.emission[next][observation]
        });
        let evidence = joint.iter().sum();
        (joint.map(|p| p / evidence), evidence)
    }
}

fn draw(probabilities: &[f64], rng: &mut Rng) -> usize {
    let mut rest: f64 = rng.random();
    for (index, p) in probabilities.iter().enumerate() {
        rest -= p;
        if rest < 0.0 {
            return index;
        }
    }
    probabilities.len() - 1
}

impl GenerativeModel for Hmm {
    type State = usize;
    type Action = usize;
    type Observation = usize;

    fn actions(&self) -> &[usize] {
        &[0, 1]
    }

    fn step(&self, state: &mut usize, action: &usize, rng: &mut Rng) -> Step<usize> {
        *state = draw(&TRANSITION[*action][*state], rng);
        Step { observation: draw(&self.emission[*state], rng), reward: 0.0, outcome: Outcome::Continue }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl ObservationModel for Hmm {
    fn log_likelihood(&self, _action: &usize, next: &usize, observation: &usize) -> f64 {
        self.emission[*next][*observation].ln()
    }
}

impl Discretise for Hmm {
    type Key = usize;

    fn key(&self, observation: &usize) -> usize {
        *observation
    }
}

impl Perturb for Hmm {
    fn perturb(&self, _state: &mut usize, _rng: &mut Rng) {}
}

impl StaticParameters for Hmm {
    type Structure = ();

    fn structure(&self, _state: &usize) {}

    fn parameters(&self, _state: &usize) -> Vec<f64> {
        Vec::new()
    }

    fn with_parameters(&self, state: &usize, _parameters: &[f64]) -> Option<usize> {
        Some(*state)
    }
}

impl Partition for Hmm {
    type Cell = usize;

    fn cell(&self, state: &usize) -> usize {
        *state
    }
}
