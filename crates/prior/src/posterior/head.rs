//! The density of (classes, coordinates): a softmax of the pairs of classes, then one coordinate after the other.

use std::sync::Arc;

use physics_model::theta::{NO_OBSTACLE, ObjectShape};
use pomdp::Rng;
use push_task::coordinates::{START, sleeps};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

use super::lstm::add_product;
use super::{PAIRS, Weights};

/// Limits of the ln of a component's spread.
const LOG_STDDEV: (f64, f64) = (-6.0, 3.0);

/// Weights of the head. Each coordinate has `units` hidden units of its own, which see the LSTM's output, the classes and the coordinates before it.
#[derive(Debug)]
pub(super) struct Head {
    /// Order of the coordinates.
    pub(super) order: Vec<usize>,
    /// Hidden units of a coordinate.
    pub(super) units: usize,
    /// Gaussians of a coordinate.
    pub(super) components: usize,
    /// `[top, PAIRS]` and `[PAIRS]`.
    pub(super) pairs: (Vec<f32>, Vec<f32>),
    /// From the LSTM's output to the hidden units: `[top, START units]` and `[START units]`.
    pub(super) context: (Vec<f32>, Vec<f32>),
    /// What a pair of classes adds to the hidden units: `[PAIRS, START units]`. That a coordinate is awake is in it.
    pub(super) of_pair: Vec<f32>,
    /// What a coordinate adds to the hidden units: `[START, START units]`, 0 for those that come before it.
    pub(super) of_coordinate: Vec<f32>,
    /// From the hidden units of a coordinate to weights, means and ln spreads of its Gaussians: `[START, units, 3 components]` and
    /// `[START, 3 components]`.
    pub(super) out: (Vec<f32>, Vec<f32>),
}

impl Head {
    /// Whether the classes of a pair use a coordinate.
    fn awake(pair: usize) -> impl Fn(usize) -> bool {
        let (shape, obstacle) = (pair / (NO_OBSTACLE + 1), pair % (NO_OBSTACLE + 1));
        let shapes = (ObjectShape::ALL[shape], ObjectShape::ALL.get(obstacle).copied());
        move |coordinate| !sleeps(shapes, coordinate)
    }
}

/// What the network says of the start, given the episode so far. Coordinates are those of its training distribution.
#[derive(Clone, Debug)]
pub struct StartDensity {
    weights: Arc<Weights>,
    log_pairs: [f64; PAIRS],
    hidden: Vec<f32>,
}

/// Mixture of Gaussians of one coordinate.
struct Gaussians(Vec<[f64; 3]>);

impl StartDensity {
    pub(super) fn new(weights: &Arc<Weights>, top: &[f32]) -> Self {
        let head = &weights.head;
        let mut logits = head.pairs.1.clone();
        add_product(&mut logits, top.iter(), &head.pairs.0);
        let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let sum: f64 = logits.iter().map(|logit| f64::from(logit - most).exp()).sum();
        let mut hidden = head.context.1.clone();
        add_product(&mut hidden, top.iter(), &head.context.0);
        let log_pairs = std::array::from_fn(|pair| f64::from(logits[pair] - most) - sum.ln());
        Self { weights: Arc::clone(weights), log_pairs, hidden }
    }

    /// Probability of each pair of classes: shape times the number of obstacle classes plus obstacle.
    #[must_use]
    pub fn pairs(&self) -> [f64; PAIRS] {
        self.log_pairs.map(f64::exp)
    }

    /// ln of the probability of a pair.
    #[must_use]
    pub fn log_pair(&self, pair: usize) -> f64 {
        self.log_pairs[pair]
    }

    /// Coordinates drawn given a pair of classes. What the classes do not use is N(0, 1).
    #[must_use]
    pub fn draw(&self, pair: usize, rng: &mut Rng) -> [f64; START] {
        let mut z = [0.0; START];
        self.visit(pair, |coordinate, gaussians| {
            z[coordinate] = match gaussians {
                Some(gaussians) => gaussians.draw(rng),
                None => StandardNormal.sample(rng),
            };
            z[coordinate]
        });
        z
    }

    /// ln of the density of coordinates given a pair of classes over that of N(0, I).
    ///
    /// # Panics
    ///
    /// Where there are fewer than [`START`] values.
    #[must_use]
    pub fn log_ratio(&self, pair: usize, z: &[f64]) -> f64 {
        let mut total = 0.0;
        self.visit(pair, |coordinate, gaussians| {
            let value = z[coordinate];
            total += gaussians.map_or(0.0, |gaussians| gaussians.log_ratio(value));
            value
        });
        total
    }

    /// Goes through the coordinates in the network's order. `value` gets the density of each that the classes use, and gives its value.
    fn visit(&self, pair: usize, mut value: impl FnMut(usize, Option<Gaussians>) -> f64) {
        let head = &self.weights.head;
        let all = head.units * START;
        let awake = Head::awake(pair);
        let mut hidden = self.hidden.clone();
        hidden.iter_mut().zip(&head.of_pair[pair * all..]).for_each(|(sum, of)| *sum += of);
        for &coordinate in &head.order {
            if !awake(coordinate) {
                value(coordinate, None);
                continue;
            }
            let units = hidden[coordinate * head.units..][..head.units].iter().map(|x| x.tanh()).collect::<Vec<_>>();
            let outputs = 3 * head.components;
            let mut row = head.out.1[coordinate * outputs..][..outputs].to_vec();
            let first = coordinate * head.units * outputs;
            add_product(&mut row, units.iter(), &head.out.0[first..first + head.units * outputs]);
            let z = value(coordinate, Some(Gaussians::new(&row))) as f32;
            let of = &head.of_coordinate[coordinate * all..][..all];
            hidden.iter_mut().zip(of).for_each(|(sum, of)| *sum += z * of);
        }
    }
}

impl Gaussians {
    /// From logits, means and ln spreads.
    fn new(row: &[f32]) -> Self {
        let count = row.len() / 3;
        let most = row[..count].iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let sum: f64 = row[..count].iter().map(|logit| f64::from(logit - most).exp()).sum();
        let one = |i: usize| {
            let stddev = f64::from(row[2 * count + i]).clamp(LOG_STDDEV.0, LOG_STDDEV.1).exp();
            [f64::from(row[i] - most).exp() / sum, f64::from(row[count + i]), stddev]
        };
        Self((0..count).map(one).collect())
    }

    fn draw(&self, rng: &mut Rng) -> f64 {
        let mut rest: f64 = rng.random();
        let normal: f64 = StandardNormal.sample(rng);
        let chosen = self.0.iter().find(|[weight, ..]| {
            rest -= weight;
            rest < 0.0
        });
        // Rounding left a sliver above the sum.
        let [_, mean, stddev] = chosen.or(self.0.last()).copied().unwrap_or([1.0, 0.0, 1.0]);
        mean + stddev * normal
    }

    /// ln of the density over that of N(0, 1).
    fn log_ratio(&self, z: f64) -> f64 {
        let logs = self.0.iter().map(|[weight, mean, stddev]| {
            let standard = (z - mean) / stddev;
            weight.ln() - stddev.ln() - 0.5 * standard * standard
        });
        crate::mixture::log_sum_exp(logs) + 0.5 * z * z
    }
}
