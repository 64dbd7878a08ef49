//! What the network says of the start of an episode, as a teacher of the belief.

use physics_model::theta::{NO_OBSTACLE, ObjectShape};
use pomdp::{Replay as _, Rng, Teacher};
use prior::Suggester;
use push_task::sampling::categorical;
use push_task::{Coordinates, History, Particle};
use rand_distr::{Distribution as _, StandardNormal};

/// Pairs of classes, of the object's shape and the obstacle.
const CLASSES: usize = ObjectShape::ALL.len() * (NO_OBSTACLE + 1);

/// The network's estimate after the latest observation, corrected for how often shapes and obstacles occur in the domain; without a network, the
/// prior.
#[derive(Clone, Debug)]
pub struct Estimate<'a> {
    coordinates: Coordinates<'a>,
    count: usize,
    network: Option<Network>,
}

#[derive(Clone, Debug)]
struct Network {
    suggester: Suggester,
    /// Corrected probability of each pair of classes.
    classes: [f64; CLASSES],
    /// ln of the class ratio's mean, its normaliser.
    log_mean_ratio: f64,
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
    pub fn network(history: &History<'a>, suggester: &Suggester) -> Self {
        let mut estimate = Self::prior(history);
        if !estimate.coordinates.has_density() {
            return estimate;
        }
        let joint: [f64; CLASSES] = std::array::from_fn(|index| {
            let classes = pair(index);
            suggester.class_probability(classes) * estimate.class_ratio(suggester, classes)
        });
        let mean: f64 = joint.iter().sum();
        let classes = joint.map(|probability| probability / mean);
        estimate.network = Some(Network { suggester: suggester.clone(), classes, log_mean_ratio: mean.ln() });
        estimate
    }

    /// How many times as often as in the training data these classes occur.
    fn class_ratio(&self, suggester: &Suggester, [shape, obstacle]: [usize; 2]) -> f64 {
        let (shapes, obstacles) = self.coordinates.class_probabilities();
        let here = shapes[shape] * obstacles[obstacle];
        // What does not occur here may not occur in the training data either.
        if here == 0.0 { 0.0 } else { here / suggester.class_frequency([shape, obstacle]) }
    }
}

impl Teacher<Particle> for Estimate<'_> {
    fn draw(&self, rng: &mut Rng) -> Option<(Vec<usize>, Vec<f64>)> {
        let mut z: Vec<f64> = (0..self.count).map(|_| StandardNormal.sample(rng)).collect();
        let table_m = self.coordinates.model().config().world.table_height_m;
        let Some(network) = &self.network else {
            let (shapes, obstacles) = self.coordinates.class_probabilities();
            return Some((vec![categorical(shapes, rng), categorical(obstacles, rng)], z));
        };
        let classes = pair(categorical(&network.classes, rng));
        let draw = network.suggester.sample_raw_given(classes, table_m, rng)?;
        // Outside the limits of the domain there is no start. Another draw in its place would have another density.
        self.coordinates.invert(&draw, &mut z)?;
        Some((classes.to_vec(), z))
    }

    fn log_ratio(&self, start: &Particle) -> f64 {
        let Some(network) = &self.network else { return 0.0 };
        let mobility = self.coordinates.model().config().world.obstacle_mobility;
        let log_density = network.suggester.log_density_of_start(mobility, start);
        log_density + self.class_ratio(&network.suggester, start.theta.classes()).ln()
            - network.log_mean_ratio
            - self.coordinates.log_density(start)
    }
}

/// The object's shape and the obstacle's class of a place among the pairs.
fn pair(index: usize) -> [usize; 2] {
    [index / (NO_OBSTACLE + 1), index % (NO_OBSTACLE + 1)]
}
