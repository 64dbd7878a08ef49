//! Standard normal coordinates of everything that is unknown at the start of an episode.
//!
//! Every number of Θ and of the first poses is a quantile function of one coordinate z ~ N(0, 1): of a truncated Gaussian, of a Gamma
//! distribution, cut where the distribution is cut. A kernel that is right for N(0, I) is then right for the prior, atoms and limits
//! included. All structures share the coordinates: what a shape does not use sleeps, and keeps its distribution (Godsill, "On the
//! relationship between Markov chain Monte Carlo methods for model uncertainty", JCGS 10(2), 2001). So a change of shape needs no Jacobian.

use physics_model::state::BodyState;
use physics_model::theta::{NO_OBSTACLE, ObjectShape, ObjectTheta, ObstacleTheta, Theta, standard_com_m};
use pomdp::Rng;
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use statrs::distribution::{ContinuousCDF as _, Gamma, Normal};
use statrs::function::gamma::ln_gamma;

use crate::model::{Particle, PushModel, gaussian};
use crate::sampling::{GammaMean, OBJECT_MASS_KG, OBSTACLE_MASS_KG, TruncatedNormal, WorldDistribution, separate};
use crate::sampling::{SizeDistribution, effects};
use crate::sensor::Observation;
use crate::state::State;

/// Coordinates of the object: ln mass, friction, centre of mass (3), sizes (3), x, y, yaw.
pub const OBJECT: std::ops::Range<usize> = 0..11;
/// Coordinates of the obstacle: mass, sizes (3), x, y, yaw.
pub const OBSTACLE: std::ops::Range<usize> = 11..18;
/// Number of coordinates of object and obstacle. Those of unknown parameters of effects follow.
pub const START: usize = 18;

/// Whether the shapes of object and obstacle do not use a coordinate of the first [`START`].
#[must_use]
pub fn sleeps((shape, obstacle): (ObjectShape, Option<ObjectShape>), coordinate: usize) -> bool {
    match coordinate {
        // The frame of a sphere is turned so that its centre of mass lies below its centre.
        2 | 3 => shape == ObjectShape::Sphere,
        5..8 => coordinate - 5 >= shape.size_count(),
        11..START => {
            obstacle.is_none_or(|shape| (12..15).contains(&coordinate) && coordinate - 12 >= shape.size_count())
        }
        _ => false,
    }
}

/// Distribution of what one coordinate stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part<'a> {
    Normal(&'a TruncatedNormal),
    Mass(&'a GammaMean),
}

impl Part<'_> {
    fn value(self, z: f64) -> f64 {
        match self {
            Self::Normal(normal) => self::normal(normal, z),
            Self::Mass(gamma) => mass(gamma, z),
        }
    }

    /// `None` outside its limits.
    fn coordinate(self, value: f64) -> Option<f64> {
        match self {
            Self::Normal(normal) => coordinate(normal, value),
            Self::Mass(gamma) => mass_coordinate(gamma, value),
        }
    }

    fn log_density(self, value: f64) -> f64 {
        match self {
            Self::Normal(normal) => normal.log_density(value),
            Self::Mass(gamma) => log_mass_density(gamma, value),
        }
    }
}

/// The prior of an episode that began with an observation, as a function of standard normal coordinates.
#[derive(Clone, Debug)]
pub struct Coordinates<'a> {
    model: &'a PushModel,
    /// The distribution, with the object's pose given the first measurement of it.
    prior: WorldDistribution,
    joints_rad: Vec<f64>,
    first: Observation,
}

impl<'a> Coordinates<'a> {
    /// The prior `distribution` of an episode that begins at `joints_rad`, rad, with an observation.
    #[must_use]
    pub fn new(
        model: &'a PushModel,
        distribution: &WorldDistribution,
        joints_rad: &[f64],
        first: &Observation,
    ) -> Self {
        let (position, orientation) = model.unread_pose(first.object_pose());
        let noise = &model.config().sensor.noise;
        let mut prior = distribution.clone();
        let object = &mut prior.object;
        object.x_m = given(&object.x_m, position[0], noise.position_m);
        object.y_m = given(&object.y_m, position[1], noise.position_m);
        let yaw = BodyState { orientation, ..BodyState::at_rest(position, 0.0) }.yaw_rad();
        object.yaw_rad = given(&object.yaw_rad, yaw, noise.orientation_rad);
        Self { model, prior, joints_rad: joints_rad.to_vec(), first: first.clone() }
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &'a PushModel {
        self.model
    }

    /// Probabilities of the object's shapes, and of the obstacle's classes.
    #[must_use]
    pub fn class_probabilities(&self) -> (&[f64], &[f64]) {
        (&self.prior.object.shape, &self.prior.obstacle.shape)
    }

    /// Number of coordinates.
    #[must_use]
    pub fn count(&self) -> usize {
        START + effects::count(&self.prior.effects)
    }

    /// The hypothesis of these shapes at `z`, and ln p of the first measured height; `None` where it is no possible world.
    ///
    /// # Panics
    ///
    /// Where there are fewer values than [`Self::count`].
    #[must_use]
    pub fn start(&self, (shape, obstacle): (ObjectShape, Option<ObjectShape>), z: &[f64]) -> Option<(Particle, f64)> {
        let world = &self.model.config().world;
        let table_m = world.table_height_m;
        let d = &self.prior.object;
        let size_m = sizes(&d.size_m, shape, &z[5..8]);
        let mass_kg = mass(&d.mass_kg, z[0]).clamp(OBJECT_MASS_KG[0], OBJECT_MASS_KG[1]);
        let half_m = shape.half_extents_m(size_m);
        // At most a quarter of the size from the centre, as in `WorldDistribution::sample`.
        let com_m = std::array::from_fn(|i| normal(&d.com_m[i], z[2 + i]).clamp(-half_m[i] / 2.0, half_m[i] / 2.0));
        let com_m = standard_com_m(shape, com_m);
        let friction = normal(&d.friction, z[1]);
        let position_m = [normal(&d.x_m, z[8]), normal(&d.y_m, z[9]), table_m + shape.half_height_m(size_m)];
        let object = BodyState::at_rest(position_m, normal(&d.yaw_rad, z[10]));

        let b = &self.prior.obstacle;
        let o = &z[OBSTACLE];
        let obstacle = obstacle.map(|shape| {
            let size_m = sizes(&b.size_m, shape, &o[1..4]);
            let mass_kg = mass(&b.mass_kg, o[0]).clamp(OBSTACLE_MASS_KG[0], OBSTACLE_MASS_KG[1]);
            let position_m = [normal(&b.x_m, o[4]), normal(&b.y_m, o[5]), table_m + shape.half_height_m(size_m)];
            (ObstacleTheta { shape, mass_kg, size_m }, BodyState::at_rest(position_m, normal(&b.yaw_rad, o[6])))
        });
        let (obstacle_theta, obstacle_state) = obstacle.unzip();
        let theta = Theta {
            object: ObjectTheta { shape, mass_kg, com_m, friction, size_m },
            obstacle: obstacle_theta,
            effects: effects::at(&self.prior.effects, z[START..].iter().map(|z| uniform(*z))),
        };
        let state = State { joints_rad: self.joints_rad.clone(), object, obstacle: obstacle_state };
        let mut particle = Particle::new(state, theta);
        if self.model.config().task.goal.contains(position_m) || !separate(self.model, &particle) {
            return None;
        }
        self.model.displace(&mut particle);
        self.model.check(&particle).ok()?;
        let stddev = self.model.config().sensor.noise.position_m;
        let error_m = self.first.object_pose().0[2] - self.model.readings(&particle).object.position_m[2];
        Some((particle, gaussian(error_m, stddev)))
    }
}

impl Coordinates<'_> {
    /// The same episode with another distribution of worlds.
    #[must_use]
    pub fn with_distribution(&self, distribution: &WorldDistribution) -> Self {
        Self::new(self.model, distribution, &self.joints_rad, &self.first)
    }

    /// Coordinates here of what has the coordinates `z` in `other`, and Σ ln (density there / density here) of the numbers behind them.
    /// Coordinates of the same distribution stay. `None` where the start lies outside the distribution here.
    #[must_use]
    pub fn translated(
        &self,
        other: &Self,
        shapes: (ObjectShape, Option<ObjectShape>),
        z: &[f64],
    ) -> Option<(Vec<f64>, f64)> {
        let (mut own, mut log_ratio) = (z.to_vec(), 0.0);
        for (index, z) in own.iter_mut().enumerate().take(START).filter(|(index, _)| !sleeps(shapes, *index)) {
            let (here, there) = (self.part(shapes, index), other.part(shapes, index));
            if here != there {
                let value = there.value(*z);
                *z = here.coordinate(value)?;
                log_ratio += there.log_density(value) - here.log_density(value);
            }
        }
        Some((own, log_ratio))
    }

    /// What an awake coordinate of the first [`START`] stands for. That of a centre of mass is before its limits.
    fn part(&self, (shape, obstacle): (ObjectShape, Option<ObjectShape>), index: usize) -> Part<'_> {
        let (d, b) = (&self.prior.object, &self.prior.obstacle);
        let of_obstacle = || b.size_m.parts_of(obstacle.expect("an obstacle that is none has no awake coordinate"));
        match index {
            0 => Part::Mass(&d.mass_kg),
            1 => Part::Normal(&d.friction),
            2..5 => Part::Normal(&d.com_m[index - 2]),
            5..8 => Part::Normal(&d.size_m.parts_of(shape)[index - 5]),
            8 => Part::Normal(&d.x_m),
            9 => Part::Normal(&d.y_m),
            10 => Part::Normal(&d.yaw_rad),
            11 => Part::Mass(&b.mass_kg),
            12..15 => Part::Normal(&of_obstacle()[index - 12]),
            15 => Part::Normal(&b.x_m),
            16 => Part::Normal(&b.y_m),
            _ => Part::Normal(&b.yaw_rad),
        }
    }

    /// Whether no number of a start is known exactly, so that all have a density.
    #[must_use]
    pub fn has_density(&self) -> bool {
        let (d, b) = (&self.prior.object, &self.prior.obstacle);
        let of_object = d.com_m.iter().chain([&d.friction, &d.x_m, &d.y_m, &d.yaw_rad]).chain(d.size_m.parts());
        let obstacle = b.shape[..NO_OBSTACLE].iter().any(|probability| *probability > 0.0);
        let of_obstacle = b.size_m.parts().chain([&b.x_m, &b.y_m, &b.yaw_rad]).filter(|_| obstacle);
        of_object.chain(of_obstacle).all(|part| part.stddev > 0.0)
    }

    /// All coordinates of a start: the inverse of [`Self::start`]. What a start does not show is drawn from its prior given what it shows: where the
    /// centre of mass met its limit, which of two signs, and what its shapes do not use. `None` outside the distribution.
    #[must_use]
    pub fn of(&self, start: &Particle, rng: &mut Rng) -> Option<Vec<f64>> {
        let (object, body) = (&start.theta.object, &start.state.object);
        let obstacle = start.theta.obstacle.as_ref().zip(start.state.obstacle.as_ref());
        let shapes = (object.shape, obstacle.map(|(theta, _)| theta.shape));
        let half_m = object.shape.half_extents_m(object.size_m);
        let sign = if object.shape == ObjectShape::Sphere && rng.random::<bool>() { -1.0 } else { 1.0 };
        let mut z: Vec<f64> = (0..self.count()).map(|_| StandardNormal.sample(rng)).collect();
        for index in (0..START).filter(|index| !sleeps(shapes, *index)) {
            let part = self.part(shapes, index);
            let of_obstacle = |value: &dyn Fn(&ObstacleTheta, &BodyState) -> f64| {
                obstacle.map_or(f64::NAN, |(theta, body)| value(theta, body))
            };
            let value = match index {
                0 => object.mass_kg,
                1 => object.friction,
                2..5 => sign * object.com_m[index - 2],
                5..8 => object.size_m[index - 5],
                8 | 9 => body.position_m[index - 8],
                10 => body.yaw_rad(),
                11 => of_obstacle(&|theta, _| theta.mass_kg),
                12..15 => of_obstacle(&|theta, _| theta.size_m[index - 12]),
                15 | 16 => of_obstacle(&|_, body| body.position_m[index - 15]),
                _ => of_obstacle(&|_, body| body.yaw_rad()),
            };
            z[index] = part.coordinate(value)?;
            if (2..5).contains(&index) && value.abs() >= half_m[index - 2] / 2.0 {
                z[index] = cut_off(z[index], value > 0.0, rng);
            }
        }
        Some(z)
    }
}

/// z of a value that was cut at a limit, drawn from what was cut off above or below `z`.
fn cut_off(z: f64, above: bool, rng: &mut Rng) -> f64 {
    let (low, high) = if above { (uniform(z), 1.0) } else { (0.0, uniform(z)) };
    standard_quantile(low + (high - low) * rng.random::<f64>())
}

/// ln of the density of ln mass.
fn log_mass_density(distribution: &GammaMean, mass_kg: f64) -> f64 {
    if !(mass_kg.is_finite() && mass_kg > 0.0) {
        return f64::NEG_INFINITY;
    }
    let (k, rate) = (distribution.shape, distribution.shape / distribution.mean);
    k * (rate * mass_kg).ln() - rate * mass_kg - ln_gamma(k)
}

fn mass_coordinate(distribution: &GammaMean, mass_kg: f64) -> Option<f64> {
    if !(mass_kg.is_finite() && mass_kg > 0.0) {
        return None;
    }
    let gamma = Gamma::new(distribution.shape, distribution.shape / distribution.mean).ok()?;
    Some(standard_quantile(gamma.cdf(mass_kg)))
}

/// z of a value of a truncated Gaussian; `None` outside its limits.
fn coordinate(distribution: &TruncatedNormal, value: f64) -> Option<f64> {
    if !(distribution.low..=distribution.high).contains(&value) {
        return None;
    }
    let Ok(normal) = Normal::new(distribution.mean, distribution.stddev) else { return Some(0.0) };
    let (a, b) = (normal.cdf(distribution.low), normal.cdf(distribution.high));
    Some(standard_quantile((normal.cdf(value) - a) / (b - a)))
}

fn standard_quantile(u: f64) -> f64 {
    Normal::standard().inverse_cdf(u.clamp(1e-12, 1.0 - 1e-12))
}

/// A truncated Gaussian given a measurement with Gaussian noise: the product of both, with the same limits. A measurement far outside them
/// is taken for itself, as a distribution that contradicts it says nothing.
fn given(prior: &TruncatedNormal, measured: f64, noise: f64) -> TruncatedNormal {
    if prior.stddev == 0.0 || noise == 0.0 || measured < prior.low - 4.0 * noise || measured > prior.high + 4.0 * noise
    {
        let (low, high) = (measured - 4.0 * noise, measured + 4.0 * noise);
        return TruncatedNormal { mean: measured, stddev: noise, low, high };
    }
    let (a, b) = (prior.stddev.powi(-2), noise.powi(-2));
    let mean = (a * prior.mean + b * measured) / (a + b);
    TruncatedNormal { mean, stddev: (a + b).sqrt().recip(), ..*prior }
}

/// Φ(z).
fn uniform(z: f64) -> f64 {
    Normal::standard().cdf(z)
}

fn normal(distribution: &TruncatedNormal, z: f64) -> f64 {
    distribution.quantile(uniform(z))
}

fn mass(distribution: &GammaMean, z: f64) -> f64 {
    // The ends have no finite quantile.
    let u = uniform(z).clamp(1e-12, 1.0 - 1e-12);
    let gamma = Gamma::new(distribution.shape, 1.0).expect("gamma parameters are positive");
    distribution.mean / distribution.shape * gamma.inverse_cdf(u)
}

fn sizes(distribution: &SizeDistribution, shape: ObjectShape, z: &[f64]) -> [f64; 3] {
    let mut size_m = [0.0; 3];
    for ((slot, part), z) in size_m.iter_mut().zip(distribution.parts_of(shape)).zip(z) {
        *slot = normal(part, *z);
    }
    size_m
}
