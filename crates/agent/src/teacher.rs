//! What the network says of the start of an episode, as a teacher of the belief.

use physics_model::theta::{NO_OBSTACLE, ObjectShape};
use pomdp::{Replay as _, Rng, Teacher};
use prior::posterior::{PAIRS, PosteriorNetwork, StartDensity};
use push_task::coordinates::START;
use push_task::sampling::categorical;
use push_task::{Coordinates, History};
use rand_distr::{Distribution as _, StandardNormal};

/// The network's estimate after the latest observation, corrected for how often shapes and obstacles occur in the domain, and for where its
/// distributions differ from those of the training data; without a network, the prior.
#[derive(Clone, Debug)]
pub struct Estimate<'a> {
    coordinates: Coordinates<'a>,
    count: usize,
    network: Option<Network<'a>>,
}

#[derive(Clone, Debug)]
struct Network<'a> {
    density: StartDensity,
    /// Those of the training data.
    coordinates: Coordinates<'a>,
    /// Corrected probability of each pair of classes.
    pairs: [f64; PAIRS],
    /// ln of the same over the prior.
    log_ratios: [f64; PAIRS],
}

impl<'a> Estimate<'a> {
    /// The prior.
    #[must_use]
    pub fn prior(history: &History<'a>) -> Self {
        Self { coordinates: history.start_coordinates().clone(), count: history.coordinates(), network: None }
    }

    /// What a network says that has seen the history's latest observation. The prior, where a number is known exactly: a network says nothing of
    /// such a world, as it has seen none.
    #[must_use]
    pub fn network(history: &History<'a>, network: &PosteriorNetwork) -> Self {
        let mut estimate = Self::prior(history);
        let (true, Some(density)) = (estimate.coordinates.has_density(), network.density()) else { return estimate };
        let coordinates = estimate.coordinates.with_distribution(network.distribution());
        let (here, there) = (frequencies(&estimate.coordinates), frequencies(&coordinates));
        // What does not occur in the training data has no estimate.
        let ratio = |pair: usize| if here[pair] == 0.0 || there[pair] == 0.0 { 0.0 } else { here[pair] / there[pair] };
        let joint: [f64; PAIRS] = std::array::from_fn(|pair| density.log_pair(pair).exp() * ratio(pair));
        let sum: f64 = joint.iter().sum();
        let pairs = joint.map(|probability| probability / sum);
        let log_ratios = std::array::from_fn(|pair| {
            if there[pair] == 0.0 { f64::NEG_INFINITY } else { density.log_pair(pair) - there[pair].ln() - sum.ln() }
        });
        estimate.network = Some(Network { density: density.clone(), coordinates, pairs, log_ratios });
        estimate
    }
}

impl Teacher for Estimate<'_> {
    fn draw(&self, rng: &mut Rng) -> Option<(Vec<usize>, Vec<f64>)> {
        let mut z: Vec<f64> = (0..self.count).map(|_| StandardNormal.sample(rng)).collect();
        let Some(network) = &self.network else {
            let (shapes, obstacles) = self.coordinates.class_probabilities();
            return Some((vec![categorical(shapes, rng), categorical(obstacles, rng)], z));
        };
        let pair = categorical(&network.pairs, rng);
        z[..START].copy_from_slice(&network.density.draw(pair, rng));
        // Outside the limits of the domain there is no start. Another draw in its place would have another density.
        let (z, _) = self.coordinates.translated(&network.coordinates, shapes(pair), &z)?;
        Some((classes(pair).to_vec(), z))
    }

    fn log_ratio(&self, classes: &[usize], z: &[f64]) -> f64 {
        let Some(network) = &self.network else { return 0.0 };
        let pair = classes[0] * (NO_OBSTACLE + 1) + classes[1];
        let Some((z, log_ratio)) = network.coordinates.translated(&self.coordinates, shapes(pair), z) else {
            return f64::NEG_INFINITY;
        };
        network.log_ratios[pair] + network.density.log_ratio(pair, &z) - log_ratio
    }
}

/// Prior probability of each pair of classes.
fn frequencies(coordinates: &Coordinates<'_>) -> [f64; PAIRS] {
    let (shapes, obstacles) = coordinates.class_probabilities();
    std::array::from_fn(|pair| {
        let [shape, obstacle] = classes(pair);
        shapes[shape] * obstacles[obstacle]
    })
}

/// The object's shape and the obstacle's class of a place among the pairs.
fn classes(pair: usize) -> [usize; 2] {
    [pair / (NO_OBSTACLE + 1), pair % (NO_OBSTACLE + 1)]
}

fn shapes(pair: usize) -> (ObjectShape, Option<ObjectShape>) {
    let [shape, obstacle] = classes(pair);
    (ObjectShape::ALL[shape], ObjectShape::ALL.get(obstacle).copied())
}
