//! What a belief says about the static parameters: structures, their probabilities, and a Gaussian for each.

use pomdp::{Rng, StaticParameters};
use rand::RngExt as _;

use super::gaussian::Gaussian;

/// Draws of one possible state before the old one is kept.
const REDRAWS: usize = 5;

/// Weighted states with their structures and parameters.
pub(crate) struct Prediction<M: StaticParameters> {
    pub(crate) states: Vec<M::State>,
    /// Normalised, all positive.
    pub(crate) weights: Vec<f64>,
    /// Distinct structures, in order.
    pub(crate) structures: Vec<M::Structure>,
    /// Index of each state's structure.
    pub(crate) kinds: Vec<usize>,
    /// Probability of each structure.
    pub(crate) mass: Vec<f64>,
    thetas: Vec<Vec<f64>>,
    fits: Vec<Gaussian>,
}

impl<M: StaticParameters> Prediction<M> {
    /// Structures and parameters of `states`. `weights` are positive and sum to 1.
    pub(crate) fn new(model: &M, states: Vec<M::State>, weights: Vec<f64>) -> Self {
        let of_each: Vec<M::Structure> = states.iter().map(|s| model.structure(s)).collect();
        let mut structures = of_each.clone();
        structures.sort();
        structures.dedup();
        let kinds: Vec<usize> =
            of_each.iter().map(|s| structures.binary_search(s).expect("it is among them")).collect();
        let thetas: Vec<Vec<f64>> = states.iter().map(|s| model.parameters(s)).collect();
        let mut mass = vec![0.0; structures.len()];
        weights.iter().zip(&kinds).for_each(|(w, &kind)| mass[kind] += w);
        let fit = |kind| {
            let members: Vec<usize> = (0..states.len()).filter(|&i| kinds[i] == kind).collect();
            let points: Vec<&[f64]> = members.iter().map(|&i| thetas[i].as_slice()).collect();
            let member_weights: Vec<f64> = members.iter().map(|&i| weights[i]).collect();
            Gaussian::fit(&points, &member_weights)
        };
        let fits = (0..structures.len()).map(fit).collect();
        Self { states, weights, structures, kinds, mass, thetas, fits }
    }

    pub(crate) fn theta(&self, index: usize) -> &[f64] {
        &self.thetas[index]
    }

    /// a θ + (1 − a) θ̄ of a state's structure: where Liu and West put its kernel.
    pub(crate) fn centre(&self, index: usize, a: f64) -> Vec<f64> {
        let mean = &self.fits[self.kinds[index]].mean;
        self.thetas[index].iter().zip(mean).map(|(x, m)| a * x + (1.0 - a) * m).collect()
    }

    /// Mean of a structure's parameters.
    pub(crate) fn mean(&self, kind: usize) -> &[f64] {
        &self.fits[kind].mean
    }

    /// The Gaussian of a structure, around `centre` and `scale` times as wide.
    pub(crate) fn around(&self, kind: usize, centre: &[f64], scale: f64, rng: &mut Rng) -> Vec<f64> {
        self.fits[kind].around(centre, scale, rng)
    }

    /// The state drawn from its Liu–West kernel, and whether it has changed. It stays the same if no draw is possible.
    pub(crate) fn smoothed(&self, model: &M, index: usize, (a, h): (f64, f64), rng: &mut Rng) -> (M::State, bool) {
        let state = &self.states[index];
        if h > 0.0 && !self.thetas[index].is_empty() {
            let centre = self.centre(index, a);
            for _ in 0..REDRAWS {
                let theta = self.around(self.kinds[index], &centre, h, rng);
                if let Some(moved) = model.with_parameters(state, &theta) {
                    return (moved, true);
                }
            }
        }
        (state.clone(), false)
    }

    /// ln of the density of the parameters `theta` of structure `kind`: its probability times its Gaussian.
    pub(crate) fn log_density(&self, kind: usize, theta: &[f64]) -> f64 {
        self.mass[kind].ln() + self.fits[kind].log_density(theta)
    }

    /// The states of each structure, ready for [`Neighbours::companion`].
    pub(crate) fn neighbours(&self) -> Vec<Neighbours> {
        let of_kind = |kind: usize| {
            let fit = &self.fits[kind];
            let members: Vec<usize> = (0..self.states.len()).filter(|&i| self.kinds[i] == kind).collect();
            let weights: Vec<f64> = members.iter().map(|&i| self.weights[i]).collect();
            let d = fit.mean.len() as f64;
            // Silverman (1986), equation 4.14, for the effective number of states.
            let width = (4.0 / ((d + 2.0) * crate::effective_sample_size(&weights))).powf(1.0 / (d + 4.0)).min(1.0);
            let whitened = members.iter().map(|&i| fit.whitened(&self.thetas[i], &fit.mean)).collect();
            Neighbours {
                fit: fit.clone(),
                members,
                log_weights: weights.iter().map(|w| w.ln()).collect(),
                whitened,
                width,
            }
        };
        (0..self.structures.len()).map(of_kind).collect()
    }
}

/// The states of one structure, by their parameters.
pub(crate) struct Neighbours {
    fit: Gaussian,
    members: Vec<usize>,
    log_weights: Vec<f64>,
    whitened: Vec<Vec<f64>>,
    /// Bandwidth in units of the structure's Gaussian.
    width: f64,
}

impl Neighbours {
    /// A state to put the parameters `theta` on, drawn by weight and by nearness in the parameters. So the rest of the
    /// state keeps what the belief says about it given the parameters.
    pub(crate) fn companion(&self, theta: &[f64], rng: &mut Rng) -> usize {
        let z = self.fit.whitened(theta, &self.fit.mean);
        let near = |(log_weight, other): (&f64, &Vec<f64>)| {
            let squared: f64 = z.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum();
            log_weight - 0.5 * squared / (self.width * self.width)
        };
        let logs: Vec<f64> = self.log_weights.iter().zip(&self.whitened).map(near).collect();
        let total = crate::diagnostics::log_sum_exp(logs.iter().copied());
        let mut rest: f64 = rng.random();
        for (index, log) in self.members.iter().zip(&logs) {
            rest -= (log - total).exp();
            if rest < 0.0 {
                return *index;
            }
        }
        self.members[self.members.len() - 1]
    }
}
