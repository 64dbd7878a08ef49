//! Two structures with static parameters, a deterministic step and a noisy observation: the pushing task in small, with exact posteriors.
//!
//! A thing is either `Stiff` (it moves by an unknown share of the action: one parameter) or `Loose` (an unknown offset and share: two). The
//! observation is its displacement with Gaussian noise. Given the structure this is Bayesian linear regression.

use pomdp::{GenerativeModel, ObservationModel, Outcome, Partition, Perturb, Rng, StaticParameters, Step};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

/// Which structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Displacement = θ₀ · action.
    Stiff,
    /// Displacement = θ₀ + θ₁ · action.
    Loose,
}

/// Structure, parameters, and the last displacement.
#[derive(Clone, Debug, PartialEq)]
pub struct Thing {
    /// Structure.
    pub kind: Kind,
    /// θ: one value for [`Kind::Stiff`], two for [`Kind::Loose`].
    pub theta: Vec<f64>,
    /// Displacement by the last action.
    pub displacement: f64,
}

/// The problem with its prior.
#[derive(Clone, Debug)]
pub struct StaticParameter {
    /// Standard deviation of the observation noise.
    pub noise_stddev: f64,
    /// Prior probability of [`Kind::Stiff`].
    pub stiff: f64,
    /// Parameters outside ±`bound` are impossible; the exact posteriors do not know of it.
    pub bound: f64,
}

/// Mean and standard deviation of each parameter before the first observation.
const STIFF_PRIOR: [(f64, f64); 1] = [(1.0, 0.5)];
const LOOSE_PRIOR: [(f64, f64); 2] = [(0.3, 0.5), (0.6, 0.4)];

/// Exact posterior of one structure: mean and covariance of θ (the second row unused for [`Kind::Stiff`]), and ln evidence so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exact {
    /// Mean.
    pub mean: [f64; 2],
    /// Covariance.
    pub covariance: [[f64; 2]; 2],
    /// ln p(observations | structure).
    pub log_evidence: f64,
}

impl StaticParameter {
    /// A draw from the prior.
    pub fn sample(&self, rng: &mut Rng) -> Thing {
        let kind = if rng.random_bool(self.stiff) { Kind::Stiff } else { Kind::Loose };
        let mut theta = Vec::new();
        for (mean, stddev) in prior(kind) {
            let z: f64 = StandardNormal.sample(rng);
            theta.push(mean + stddev * z);
        }
        Thing { kind, theta, displacement: 0.0 }
    }

    /// ln prior density of the structure and its parameters.
    #[must_use]
    pub fn log_prior(&self, thing: &Thing) -> f64 {
        let of_kind = if thing.kind == Kind::Stiff { self.stiff } else { 1.0 - self.stiff };
        let normal = |(x, (mean, stddev)): (&f64, &(f64, f64))| {
            -0.5 * ((x - mean) / stddev).powi(2) - stddev.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
        };
        of_kind.ln() + thing.theta.iter().zip(prior(thing.kind)).map(normal).sum::<f64>()
    }

    /// Exact posterior of `kind` after (action, observation) pairs: recursive least squares.
    #[must_use]
    pub fn exact(&self, kind: Kind, history: &[(f64, f64)]) -> Exact {
        let mut exact = Exact { mean: [0.0; 2], covariance: [[0.0; 2]; 2], log_evidence: 0.0 };
        for (i, (mean, stddev)) in prior(kind).iter().enumerate() {
            exact.mean[i] = *mean;
            exact.covariance[i][i] = stddev * stddev;
        }
        for (action, observation) in history {
            let row = if kind == Kind::Stiff { [*action, 0.0] } else { [1.0, *action] };
            let cross: [f64; 2] = std::array::from_fn(|i| (0..2).map(|j| exact.covariance[i][j] * row[j]).sum());
            let variance = row[0] * cross[0] + row[1] * cross[1] + self.noise_stddev.powi(2);
            let error = observation - row[0] * exact.mean[0] - row[1] * exact.mean[1];
            exact.log_evidence -= 0.5 * (error * error / variance + (2.0 * std::f64::consts::PI * variance).ln());
            for i in 0..2 {
                exact.mean[i] += cross[i] / variance * error;
                for j in 0..2 {
                    exact.covariance[i][j] -= cross[i] * cross[j] / variance;
                }
            }
        }
        exact
    }

    /// Posterior probability of [`Kind::Stiff`] and ln evidence after (action, observation) pairs.
    #[must_use]
    pub fn stiff_posterior(&self, history: &[(f64, f64)]) -> (f64, f64) {
        let stiff = self.stiff.ln() + self.exact(Kind::Stiff, history).log_evidence;
        let loose = (1.0 - self.stiff).ln() + self.exact(Kind::Loose, history).log_evidence;
        let largest = stiff.max(loose);
        let total = largest + ((stiff - largest).exp() + (loose - largest).exp()).ln();
        ((stiff - total).exp(), total)
    }
}

fn prior(kind: Kind) -> &'static [(f64, f64)] {
    match kind {
        Kind::Stiff => &STIFF_PRIOR,
        Kind::Loose => &LOOSE_PRIOR,
    }
}

impl GenerativeModel for StaticParameter {
    type State = Thing;
    type Action = f64;
    type Observation = f64;

    fn actions(&self) -> &[f64] {
        &[-1.0, 0.5, 1.0, 2.0]
    }

    fn step(&self, thing: &mut Thing, action: &f64, rng: &mut Rng) -> Step<f64> {
        thing.displacement = match thing.kind {
            Kind::Stiff => thing.theta[0] * action,
            Kind::Loose => thing.theta[0] + thing.theta[1] * action,
        };
        let z: f64 = StandardNormal.sample(rng);
        Step {
            observation: thing.displacement + self.noise_stddev * z,
            reward: 0.0,
            outcome: if thing.displacement.is_finite() { Outcome::Continue } else { Outcome::Diverged },
        }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl ObservationModel for StaticParameter {
    fn log_likelihood(&self, _action: &f64, next: &Thing, observation: &f64) -> f64 {
        let z = (observation - next.displacement) / self.noise_stddev;
        -0.5 * z * z - self.noise_stddev.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
    }
}

impl Perturb for StaticParameter {
    fn perturb(&self, thing: &mut Thing, rng: &mut Rng) {
        for x in &mut thing.theta {
            let z: f64 = StandardNormal.sample(rng);
            *x += 0.05 * z;
        }
    }
}

impl StaticParameters for StaticParameter {
    type Structure = Kind;

    fn structure(&self, thing: &Thing) -> Kind {
        thing.kind
    }

    fn parameters(&self, thing: &Thing) -> Vec<f64> {
        thing.theta.clone()
    }

    fn with_parameters(&self, thing: &Thing, parameters: &[f64]) -> Option<Thing> {
        let possible = parameters.iter().all(|x| x.abs() <= self.bound);
        possible.then(|| Thing { theta: parameters.to_vec(), ..thing.clone() })
    }
}

impl Partition for StaticParameter {
    type Cell = Vec<i64>;

    fn cell(&self, thing: &Thing) -> Vec<i64> {
        thing.theta.iter().map(|x| (x / 0.1).floor() as i64).collect()
    }
}
