//! Standard normal coordinates of everything that is unknown at the start of an episode.
//!
//! Every number of Θ and of the first poses is a quantile function of one coordinate z ~ N(0, 1): of a truncated Gaussian, of a Gamma
//! distribution, cut where the distribution is cut. A kernel that is right for N(0, I) is then right for the prior, atoms and limits
//! included. All structures share the coordinates: what a shape does not use sleeps, and keeps its distribution (Godsill, "On the
//! relationship between Markov chain Monte Carlo methods for model uncertainty", JCGS 10(2), 2001). So a change of shape needs no Jacobian.

use physics_model::config::ObstacleMobility;
use physics_model::state::BodyState;
use physics_model::theta::{NO_OBSTACLE, ObjectShape, ObjectTheta, ObstacleTheta, Theta, standard_com_m};
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
/// First coordinate of unknown parameters of effects.
const EFFECTS: usize = 18;

/// The prior of an episode that began with an observation, as a function of standard normal coordinates.
#[derive(Clone, Debug)]
pub struct Coordinates<'a> {
    model: &'a PushModel,
    /// The distribution, with the object's pose given the first measurement of it.
    prior: WorldDistribution,
    joints_rad: Vec<f64>,
    /// Measured height of the object's centre, m.
    height_m: f64,
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
        Self { model, prior, joints_rad: joints_rad.to_vec(), height_m: first.object_pose().0[2] }
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
        EFFECTS + effects::count(&self.prior.effects)
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
            effects: effects::at(&self.prior.effects, z[EFFECTS..].iter().map(|z| uniform(*z))),
        };
        let state = State { joints_rad: self.joints_rad.clone(), object, obstacle: obstacle_state };
        let mut particle = Particle::new(state, theta);
        if self.model.config().task.goal.contains(position_m) || !separate(self.model, &particle) {
            return None;
        }
        self.model.displace(&mut particle);
        self.model.check(&particle).ok()?;
        let stddev = self.model.config().sensor.noise.position_m;
        let error_m = self.height_m - self.model.readings(&particle).object.position_m[2];
        Some((particle, gaussian(error_m, stddev)))
    }
}

impl Coordinates<'_> {
    /// ln of the prior's density at a start, over shapes, ln masses, friction and sizes, and the place (x, y, yaw) of an obstacle that cannot
    /// move: what a network can say of it. Centre of mass and the object's pose are left out. So are the mass of what cannot move, and the
    /// place of what can: a network says where it is now, which need not be where it was. −∞ outside the distribution.
    #[must_use]
    pub fn log_density(&self, start: &Particle) -> f64 {
        let (d, b) = (&self.prior.object, &self.prior.obstacle);
        let theta = &start.theta;
        let [shape, obstacle] = theta.classes();
        let parts = |sizes: &SizeDistribution, shape: ObjectShape, size_m: [f64; 3]| -> f64 {
            sizes.parts_of(shape).iter().zip(size_m).map(|(part, size)| part.log_density(size)).sum()
        };
        let object = &theta.object;
        let mut total = d.shape[shape].ln() + b.shape[obstacle].ln();
        total += log_mass_density(&d.mass_kg, object.mass_kg) + d.friction.log_density(object.friction);
        total += parts(&d.size_m, object.shape, object.size_m);
        if let (Some(o), Some(body)) = (&theta.obstacle, &start.state.obstacle) {
            total += parts(&b.size_m, o.shape, o.size_m);
            total += match self.model.config().world.obstacle_mobility {
                ObstacleMobility::Movable => log_mass_density(&b.mass_kg, o.mass_kg),
                ObstacleMobility::Fixed => {
                    let [x, y, _] = body.position_m;
                    b.x_m.log_density(x) + b.y_m.log_density(y) + b.yaw_rad.log_density(body.yaw_rad())
                }
            };
        }
        total
    }

    /// Whether [`Self::log_density`] is a density: none of the numbers that it counts is known exactly.
    #[must_use]
    pub fn has_density(&self) -> bool {
        let (d, b) = (&self.prior.object, &self.prior.obstacle);
        let obstacle = b.shape[..NO_OBSTACLE].iter().any(|probability| *probability > 0.0);
        let place = [&b.x_m, &b.y_m, &b.yaw_rad];
        let of_obstacle = b.size_m.parts().chain(place).filter(|_| obstacle);
        d.size_m.parts().chain([&d.friction]).chain(of_obstacle).all(|part| part.stddev > 0.0)
    }

    /// Coordinates of what [`Self::log_density`] counts, into `z`; the others stay. `None` outside the distribution.
    #[must_use]
    pub fn invert(&self, start: &Particle, z: &mut [f64]) -> Option<()> {
        let (d, b) = (&self.prior.object, &self.prior.obstacle);
        let object = &start.theta.object;
        z[0] = mass_coordinate(&d.mass_kg, object.mass_kg)?;
        z[1] = coordinate(&d.friction, object.friction)?;
        for (i, part) in d.size_m.parts_of(object.shape).iter().enumerate() {
            z[5 + i] = coordinate(part, object.size_m[i])?;
        }
        if let (Some(o), Some(body)) = (&start.theta.obstacle, &start.state.obstacle) {
            let z = &mut z[OBSTACLE];
            for (i, part) in b.size_m.parts_of(o.shape).iter().enumerate() {
                z[1 + i] = coordinate(part, o.size_m[i])?;
            }
            match self.model.config().world.obstacle_mobility {
                ObstacleMobility::Movable => z[0] = mass_coordinate(&b.mass_kg, o.mass_kg)?,
                ObstacleMobility::Fixed => {
                    z[4] = coordinate(&b.x_m, body.position_m[0])?;
                    z[5] = coordinate(&b.y_m, body.position_m[1])?;
                    z[6] = coordinate(&b.yaw_rad, body.yaw_rad())?;
                }
            }
        }
        Some(())
    }
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
