//! A line with a walk on top and perhaps a second body, and its exact posterior.

#![allow(dead_code, reason = "each test program uses a part of it")]

pub(crate) mod gaussian;
pub(crate) mod guess;

use std::ops::Range;

use pomdp::{Factor, Replay, Rng};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

/// Standard deviation of the second body's height.
pub(crate) const HEIGHT: f64 = 2.0;

/// x_t = x_{t−1} + slope + w, w ~ N(0, q²); y_t = x_t + height of a second body, where there is one, + v, v ~ N(0, r²). Coordinates: x_0, slope,
/// height (2 z). Class 1 has the second body. Without a walk a step has no coordinates.
pub(crate) struct Line {
    pub(crate) readings: Vec<f64>,
    pub(crate) q: f64,
    pub(crate) r: f64,
    factors: Vec<Factor>,
    blocks: Vec<Range<usize>>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    pub(crate) x: f64,
    pub(crate) slope: f64,
    pub(crate) height: f64,
}

impl Line {
    pub(crate) fn new(q: f64, r: f64, second: f64) -> Self {
        let factors = vec![Factor { probabilities: vec![1.0 - second, second], coordinates: 2..3 }];
        Self { readings: Vec::new(), q, r, factors, blocks: vec![0..2, 2..3] }
    }

    /// Prior probability of a second body.
    pub(crate) fn second(&self) -> f64 {
        self.factors[0].probabilities[1]
    }

    /// A true start, drawn from the prior.
    pub(crate) fn draw(&self, rng: &mut Rng) -> State {
        let (x, slope) = (normal(rng), normal(rng));
        let second = rng.random::<f64>() < self.second();
        State { x, slope, height: if second { HEIGHT * normal(rng) } else { 0.0 } }
    }

    /// Leads the truth through one step, and reads it.
    pub(crate) fn act(&mut self, truth: &mut State, rng: &mut Rng) {
        truth.x += truth.slope + self.q * normal(rng);
        let reading = truth.x + truth.height + self.r * normal(rng);
        self.readings.push(reading);
    }
}

pub(crate) fn normal(rng: &mut Rng) -> f64 {
    StandardNormal.sample(rng)
}

pub(crate) fn log_gaussian(error: f64, variance: f64) -> f64 {
    -0.5 * error * error / variance - 0.5 * (2.0 * std::f64::consts::PI * variance).ln()
}

impl Replay for Line {
    type State = State;

    fn factors(&self) -> &[Factor] {
        &self.factors
    }

    fn coordinates(&self) -> usize {
        3
    }

    fn blocks(&self) -> &[Range<usize>] {
        &self.blocks
    }

    fn step_coordinates(&self) -> usize {
        usize::from(self.q > 0.0)
    }

    fn steps(&self) -> usize {
        self.readings.len()
    }

    fn start(&self, classes: &[usize], z: &[f64]) -> Option<(State, f64)> {
        let height = if classes[0] == 1 { HEIGHT * z[2] } else { 0.0 };
        Some((State { x: z[0], slope: z[1], height }, 0.0))
    }

    fn advance(&self, step: usize, state: &mut State, z: &[f64]) -> f64 {
        let predicted = state.x + state.slope;
        let measured = self.readings[step] - state.height;
        let (e, s) = (self.q * self.q, self.r * self.r);
        let noise = z.first().map_or(0.0, |z| z * (e * s / (e + s)).sqrt());
        state.x = predicted + e / (e + s) * (measured - predicted) + noise;
        log_gaussian(measured - predicted, e + s)
    }

    fn most(&self, _step: usize) -> f64 {
        log_gaussian(0.0, self.q * self.q + self.r * self.r)
    }
}

/// What a Kalman filter says of (x now, x_0, slope, height), with or without the second body.
pub(crate) struct Kalman {
    pub(crate) mean: [f64; 4],
    pub(crate) covariance: [[f64; 4]; 4],
    pub(crate) log_evidence: f64,
}

/// Places in [`Kalman`].
pub(crate) const NOW: usize = 0;
pub(crate) const SLOPE: usize = 2;

impl Kalman {
    pub(crate) fn new(line: &Line, second: bool) -> Self {
        let mut mean = [0.0; 4];
        let mut p = [[0.0; 4]; 4];
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)] {
            p[i][j] = 1.0;
        }
        p[3][3] = if second { HEIGHT * HEIGHT } else { 0.0 };
        let mut log_evidence = 0.0;
        for y in &line.readings {
            mean[0] += mean[2];
            p[0] = std::array::from_fn(|j| p[0][j] + p[2][j]);
            for row in &mut p {
                row[0] += row[2];
            }
            p[0][0] += line.q * line.q;
            let gain: [f64; 4] = std::array::from_fn(|i| p[i][0] + p[i][3]);
            let variance = line.r * line.r + gain[0] + gain[3];
            let error = y - mean[0] - mean[3];
            log_evidence += log_gaussian(error, variance);
            for i in 0..4 {
                mean[i] += gain[i] / variance * error;
                for j in 0..4 {
                    p[i][j] -= gain[i] * gain[j] / variance;
                }
            }
        }
        Self { mean, covariance: p, log_evidence }
    }
}

/// The exact posterior: both Kalman filters, without and with the second body, and the probability of the latter.
pub(crate) struct Exact {
    pub(crate) parts: [Kalman; 2],
    pub(crate) second: f64,
}

impl Exact {
    pub(crate) fn new(line: &Line) -> Self {
        let parts = [Kalman::new(line, false), Kalman::new(line, true)];
        let odds = line.second() / (1.0 - line.second()) * (parts[1].log_evidence - parts[0].log_evidence).exp();
        let second = if odds.is_finite() { odds / (1.0 + odds) } else { 1.0 };
        Self { parts, second }
    }

    /// ln p of all readings.
    pub(crate) fn log_evidence(&self, line: &Line) -> f64 {
        let logs =
            [(1.0 - line.second()).ln() + self.parts[0].log_evidence, line.second().ln() + self.parts[1].log_evidence];
        let most = logs[0].max(logs[1]);
        most + logs.iter().map(|l| (l - most).exp()).sum::<f64>().ln()
    }

    /// Mean and variance of one place of [`Kalman`].
    pub(crate) fn moments(&self, place: usize) -> (f64, f64) {
        let weights = [1.0 - self.second, self.second];
        let each = || self.parts.iter().zip(weights);
        let mean: f64 = each().map(|(part, w)| w * part.mean[place]).sum();
        let variance = each().map(|(part, w)| w * (part.covariance[place][place] + (part.mean[place] - mean).powi(2)));
        (mean, variance.sum())
    }
}
