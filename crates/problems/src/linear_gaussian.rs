//! A scalar linear-Gaussian system and its Kalman filter.

use pomdp::{GenerativeModel, ObservationModel, Outcome, Partition, Rng, StaticParameters, Step};
use rand_distr::{Distribution as _, StandardNormal};

/// x' = gain · x + action + process noise; o = x' + observation noise.
#[derive(Clone, Debug)]
pub struct LinearGaussian {
    /// Factor of the state.
    pub gain: f64,
    /// Standard deviation of the process noise.
    pub process_stddev: f64,
    /// Standard deviation of the observation noise.
    pub observation_stddev: f64,
}

/// A Gaussian by mean and variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

impl Gaussian {
    /// ln of the density at `x`.
    #[must_use]
    pub fn log_density(&self, x: f64) -> f64 {
        -0.5 * ((x - self.mean).powi(2) / self.variance + (2.0 * std::f64::consts::PI * self.variance).ln())
    }

    /// One draw.
    pub fn sample(&self, rng: &mut Rng) -> f64 {
        let z: f64 = StandardNormal.sample(rng);
        self.mean + self.variance.sqrt() * z
    }
}

impl LinearGaussian {
    /// Posterior and ln evidence (Kalman 1960).
    #[must_use]
    pub fn kalman(&self, prior: Gaussian, action: f64, observation: f64) -> (Gaussian, f64) {
        let mean = self.gain * prior.mean + action;
        let variance = self.gain.powi(2) * prior.variance + self.process_stddev.powi(2);
        let expected = Gaussian { mean, variance: variance + self.observation_stddev.powi(2) };
        let weight = variance / expected.variance;
        let posterior = Gaussian { mean: mean + weight * (observation - mean), variance: (1.0 - weight) * variance };
        (posterior, expected.log_density(observation))
    }
}

impl GenerativeModel for LinearGaussian {
    type State = f64;
    type Action = f64;
    type Observation = f64;

    fn actions(&self) -> &[f64] {
        &[-1.0, 0.0, 1.0]
    }

    fn step(&self, state: &mut f64, action: &f64, rng: &mut Rng) -> Step<f64> {
        let mut noise = |stddev: f64| {
            let z: f64 = StandardNormal.sample(rng);
            stddev * z
        };
        *state = self.gain * *state + action + noise(self.process_stddev);
        Step { observation: *state + noise(self.observation_stddev), reward: 0.0, outcome: Outcome::Continue }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl ObservationModel for LinearGaussian {
    fn log_likelihood(&self, _action: &f64, next: &f64, observation: &f64) -> f64 {
        Gaussian { mean: *next, variance: self.observation_stddev.powi(2) }.log_density(*observation)
    }
}

impl StaticParameters for LinearGaussian {
    type Structure = ();

    fn structure(&self, _state: &f64) {}

    fn parameters(&self, _state: &f64) -> Vec<f64> {
        Vec::new()
    }

    fn with_parameters(&self, state: &f64, _parameters: &[f64]) -> Option<f64> {
        Some(*state)
    }
}

impl Partition for LinearGaussian {
    type Cell = i64;

    fn cell(&self, state: &f64) -> i64 {
        (state / (2.0 * self.observation_stddev)).floor() as i64
    }
}
