//! Distributions of Θ and of the initial state: truncated Gaussian, Gamma and categorical draws.

use physics_model::state::BodyState;
use physics_model::theta::{ObjectShape, ObjectTheta, ObstacleTheta, Theta, standard_com_m};
use pomdp::Rng;
use rand::RngExt as _;
use rand_distr::{Distribution as _, Gamma};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous as _, ContinuousCDF as _, Normal};

pub use self::effects::EffectDistributions;
use crate::model::{Particle, PushModel};
use crate::state::State;

pub mod effects;

/// Drawn masses are kept in these ranges, kg: a Gamma distribution has no largest value, and the solver no use for a gram.
pub(crate) const OBJECT_MASS_KG: [f64; 2] = [0.02, 20.0];
pub(crate) const OBSTACLE_MASS_KG: [f64; 2] = [0.02, 200.0];
/// Draws of one world that may fail the checks before the distribution is called impossible.
const MOST_DRAWS: usize = 1000;

/// Gaussian cut off at `low` and `high`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-quantity" = true))]
pub struct TruncatedNormal {
    /// Mean before cutting.
    pub mean: f64,
    /// Standard deviation before cutting; 0 gives the mean.
    pub stddev: f64,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl TruncatedNormal {
    /// One draw, by inversion of the distribution function: one random number a draw.
    #[must_use]
    pub fn sample(&self, rng: &mut Rng) -> f64 {
        self.quantile(rng.random())
    }

    /// The value below which a draw lies with probability `u` in [0, 1].
    #[must_use]
    pub fn quantile(&self, u: f64) -> f64 {
        let Ok(normal) = Normal::new(self.mean, self.stddev) else {
            return self.mean.clamp(self.low, self.high);
        };
        let (a, b) = (normal.cdf(self.low), normal.cdf(self.high));
        normal.inverse_cdf(a + u * (b - a)).clamp(self.low, self.high)
    }

    /// ln of the density of [`Self::sample`]; −∞ outside the limits, and +∞ at the mean if there is no spread.
    #[must_use]
    pub fn log_density(&self, value: f64) -> f64 {
        if !(self.low..=self.high).contains(&value) {
            return f64::NEG_INFINITY;
        }
        let Ok(normal) = Normal::new(self.mean, self.stddev) else {
            return if value == self.mean.clamp(self.low, self.high) { f64::INFINITY } else { f64::NEG_INFINITY };
        };
        normal.ln_pdf(value) - (normal.cdf(self.high) - normal.cdf(self.low)).ln()
    }

    /// What is wrong with the parameters, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let finite = [self.mean, self.stddev, self.low, self.high].iter().all(|v| v.is_finite());
        if !finite || self.stddev < 0.0 || self.low > self.high {
            return Some(format!("expected finite values, stddev >= 0 and low <= high, found {}", self.text()));
        }
        let reachable = self.mean + 6.0 * self.stddev >= self.low && self.mean - 6.0 * self.stddev <= self.high;
        (!reachable).then(|| format!("expected a mean within 6 stddev of [low, high], found {}", self.text()))
    }

    /// As scenario files have it.
    fn text(&self) -> String {
        let Self { mean, stddev, low, high } = self;
        format!("{{ mean = {mean}, stddev = {stddev}, low = {low}, high = {high} }}")
    }
}

/// Gamma distribution by mean and shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-quantity" = true))]
pub struct GammaMean {
    /// Mean.
    pub mean: f64,
    /// Shape k; the standard deviation is mean / √k.
    #[schemars(extend("x-unit" = ""))]
    pub shape: f64,
}

impl GammaMean {
    /// One draw.
    ///
    /// # Panics
    ///
    /// If the parameters are not positive; scenario loading refuses those.
    #[must_use]
    pub fn sample(&self, rng: &mut Rng) -> f64 {
        Gamma::new(self.shape, self.mean / self.shape).expect("gamma parameters are positive").sample(rng)
    }

    /// What is wrong with the parameters, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let good = |v: f64| v.is_finite() && v > 0.0;
        let Self { mean, shape } = self;
        let bad = !(good(*mean) && good(*shape));
        bad.then(|| format!("expected mean > 0 and shape > 0, found {{ mean = {mean}, shape = {shape} }}"))
    }
}

/// Sizes for each shape, m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SizeDistribution {
    /// Box: full lengths x, y, z.
    pub r#box: [TruncatedNormal; 3],
    /// Cylinder: radius, height.
    pub cylinder: [TruncatedNormal; 2],
    /// Sphere: radius.
    pub sphere: [TruncatedNormal; 1],
}

impl SizeDistribution {
    fn sample(&self, shape: ObjectShape, rng: &mut Rng) -> [f64; 3] {
        let mut size = [0.0; 3];
        for (slot, part) in size.iter_mut().zip(self.parts_of(shape)) {
            *slot = part.sample(rng);
        }
        size
    }

    /// Those of one shape.
    pub(crate) fn parts_of(&self, shape: ObjectShape) -> &[TruncatedNormal] {
        match shape {
            ObjectShape::Box => &self.r#box,
            ObjectShape::Cylinder => &self.cylinder,
            ObjectShape::Sphere => &self.sphere,
        }
    }

    pub(crate) fn parts(&self) -> impl Iterator<Item = &TruncatedNormal> {
        self.r#box.iter().chain(&self.cylinder).chain(&self.sphere)
    }
}

/// Distribution of the target object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjectDistribution {
    /// Probabilities of box, cylinder, sphere.
    pub shape: [f64; 3],
    /// Mass, kg.
    pub mass_kg: GammaMean,
    /// Centre of mass, m, each axis; limited to a quarter of the size along it.
    pub com_m: [TruncatedNormal; 3],
    /// Friction coefficient.
    pub friction: TruncatedNormal,
    /// Sizes.
    pub size_m: SizeDistribution,
    /// Centre x, m, base frame.
    pub x_m: TruncatedNormal,
    /// Centre y, m, base frame.
    pub y_m: TruncatedNormal,
    /// Yaw, rad.
    pub yaw_rad: TruncatedNormal,
}

/// Distribution of the obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleDistribution {
    /// Probabilities of box, cylinder, sphere, none.
    pub shape: [f64; 4],
    /// Mass, kg.
    pub mass_kg: GammaMean,
    /// Sizes.
    pub size_m: SizeDistribution,
    /// Centre x, m, base frame.
    pub x_m: TruncatedNormal,
    /// Centre y, m, base frame.
    pub y_m: TruncatedNormal,
    /// Yaw, rad.
    pub yaw_rad: TruncatedNormal,
}

/// Distribution of worlds: Θ and initial state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldDistribution {
    /// Target object.
    pub object: ObjectDistribution,
    /// Obstacle.
    pub obstacle: ObstacleDistribution,
    /// Unknown parameters of effects, none in most scenarios.
    #[serde(default, skip_serializing_if = "EffectDistributions::is_empty")]
    pub effects: EffectDistributions,
}

impl WorldDistribution {
    /// What is wrong with the parameters, if anything: the key and what was expected.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let (o, b) = (&self.object, &self.obstacle);
        for (key, weights) in [("object.shape", &o.shape[..]), ("obstacle.shape", &b.shape[..])] {
            let good = weights.iter().all(|w| w.is_finite() && *w >= 0.0);
            if !good || (weights.iter().sum::<f64>() - 1.0).abs() > 1e-9 {
                return Some(format!("{key}: expected probabilities that sum to 1, found {weights:?}"));
            }
        }
        let named = |key: &str, problem: Option<String>| problem.map(|p| format!("{key}: {p}"));
        let normals = [
            ("object.friction", &o.friction),
            ("object.x_m", &o.x_m),
            ("object.y_m", &o.y_m),
            ("object.yaw_rad", &o.yaw_rad),
            ("obstacle.x_m", &b.x_m),
            ("obstacle.y_m", &b.y_m),
            ("obstacle.yaw_rad", &b.yaw_rad),
        ];
        normals
            .iter()
            .find_map(|(key, d)| named(key, d.problem()))
            .or_else(|| o.com_m.iter().find_map(|d| named("object.com_m", d.problem())))
            .or_else(|| o.size_m.parts().find_map(|d| named("object.size_m", d.problem())))
            .or_else(|| b.size_m.parts().find_map(|d| named("obstacle.size_m", d.problem())))
            .or_else(|| named("object.mass_kg", o.mass_kg.problem()))
            .or_else(|| named("obstacle.mass_kg", b.mass_kg.problem()))
            .or_else(|| {
                let heavy = o.mass_kg.mean > OBJECT_MASS_KG[1] / 2.0 || b.mass_kg.mean > OBSTACLE_MASS_KG[1] / 2.0;
                heavy.then(|| "mass_kg.mean: expected at most 10 kg for the object and 100 kg for the obstacle".into())
            })
            .or_else(|| {
                let size_low = o.size_m.parts().chain(b.size_m.parts()).any(|d| d.low <= 0.0);
                size_low.then(|| "size_m: expected sizes above 0".into())
            })
            .or_else(|| {
                let f = &o.friction;
                (f.low < 0.0 || f.high > 1.0).then(|| "object.friction: expected a range within [0, 1]".into())
            })
            .or_else(|| effects::problem(&self.effects))
    }

    /// Draws Θ and the poses; nothing is checked for overlap.
    #[must_use]
    pub fn sample(&self, joints_rad: &[f64], table_height_m: f64, rng: &mut Rng) -> Particle {
        let d = &self.object;
        let shape = ObjectShape::ALL[categorical(&d.shape, rng)];
        let size_m = d.size_m.sample(shape, rng);
        let mass_kg = d.mass_kg.sample(rng).clamp(OBJECT_MASS_KG[0], OBJECT_MASS_KG[1]);
        let com: [f64; 3] = std::array::from_fn(|axis| d.com_m[axis].sample(rng));
        let extent = match shape {
            ObjectShape::Box => size_m,
            ObjectShape::Cylinder => [2.0 * size_m[0], 2.0 * size_m[0], size_m[1]],
            ObjectShape::Sphere => [2.0 * size_m[0]; 3],
        };
        let com_m = std::array::from_fn(|axis| com[axis].clamp(-extent[axis] / 4.0, extent[axis] / 4.0));
        let com_m = standard_com_m(shape, com_m);
        let friction = d.friction.sample(rng);
        let position = [d.x_m.sample(rng), d.y_m.sample(rng), table_height_m + shape.half_height_m(size_m)];
        let object = BodyState::at_rest(position, d.yaw_rad.sample(rng));

        let b = &self.obstacle;
        let class = categorical(&b.shape, rng);
        let obstacle = ObjectShape::ALL.get(class).map(|&shape| {
            let size_m = b.size_m.sample(shape, rng);
            let mass_kg = b.mass_kg.sample(rng).clamp(OBSTACLE_MASS_KG[0], OBSTACLE_MASS_KG[1]);
            let position = [b.x_m.sample(rng), b.y_m.sample(rng), table_height_m + shape.half_height_m(size_m)];
            (ObstacleTheta { shape, mass_kg, size_m }, BodyState::at_rest(position, b.yaw_rad.sample(rng)))
        });
        let (obstacle_theta, obstacle_state) = obstacle.unzip();
        let effects = effects::sample(&self.effects, rng);
        Particle::new(
            State { joints_rad: joints_rad.to_vec(), object, obstacle: obstacle_state },
            Theta {
                object: ObjectTheta { shape, mass_kg, com_m, friction, size_m },
                obstacle: obstacle_theta,
                effects,
            },
        )
    }

    /// Draws until the world is possible and the object does not start in the goal region.
    ///
    /// Returns `None` where a thousand draws in a row were impossible: the distribution contradicts the task.
    #[must_use]
    pub fn sample_possible(&self, model: &PushModel, joints_rad: &[f64], rng: &mut Rng) -> Option<Particle> {
        let config = model.config();
        (0..MOST_DRAWS).find_map(|_| {
            let particle = self.sample(joints_rad, config.world.table_height_m, rng);
            let at_goal = config.task.goal.contains(particle.state.object.position_m);
            (!at_goal && separate(model, &particle)).then_some(particle)
        })
    }
}

/// A start is possible if no two bodies overlap at all. Soft contacts allow some overlap later, so each body is grown by that
/// allowance first.
pub(crate) fn separate(model: &PushModel, particle: &Particle) -> bool {
    let mut grown = particle.clone();
    let margin = 2.0 * physics_model::feasible::OVERLAP_LIMIT_M;
    let grow = |shape: ObjectShape, size_m: &mut [f64; 3]| match shape {
        ObjectShape::Box => {
            size_m[0] += margin;
            size_m[1] += margin;
        }
        ObjectShape::Cylinder | ObjectShape::Sphere => size_m[0] += margin / 2.0,
    };
    grow(grown.theta.object.shape, &mut grown.theta.object.size_m);
    if let Some(obstacle) = &mut grown.theta.obstacle {
        grow(obstacle.shape, &mut obstacle.size_m);
        if obstacle.shape == ObjectShape::Sphere
            && let Some(body) = &mut grown.state.obstacle
        {
            body.position_m[2] += margin / 2.0;
        }
    }
    if grown.theta.object.shape == ObjectShape::Sphere {
        grown.state.object.position_m[2] += margin / 2.0;
    }
    model.check(&grown).is_ok()
}

/// An index drawn with probabilities that sum to 1.
#[must_use]
pub fn categorical(weights: &[f64], rng: &mut Rng) -> usize {
    let mut u: f64 = rng.random();
    for (index, weight) in weights.iter().enumerate() {
        u -= weight;
        if u < 0.0 {
            return index;
        }
    }
    // Rounding left a sliver above the sum of the weights.
    weights.iter().rposition(|w| *w > 0.0).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    #[test]
    fn truncated_normal_has_the_mean_of_the_closed_form() {
        let d = TruncatedNormal { mean: 0.4, stddev: 0.2, low: 0.3, high: 1.0 };
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let n = 20_000;
        let mean = (0..n).map(|_| d.sample(&mut rng)).inspect(|v| assert!((0.3..=1.0).contains(v))).sum::<f64>()
            / f64::from(n);
        // μ + σ (φ(α) − φ(β)) / (Φ(β) − Φ(α)), α = −0.5, β = 3.
        let phi = |z: f64| (-z * z / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let standard = Normal::new(0.0, 1.0).unwrap();
        let expected = 0.4 + 0.2 * (phi(-0.5) - phi(3.0)) / (standard.cdf(3.0) - standard.cdf(-0.5));
        assert!((mean - expected).abs() < 4.0 * 0.2 / f64::from(n).sqrt(), "{mean} {expected}");
    }

    #[test]
    fn categorical_follows_its_weights_and_never_draws_a_zero() {
        let mut rng = Seed(2).stream(Purpose::Test, 0);
        let mut counts = [0_u32; 4];
        for _ in 0..8000 {
            counts[categorical(&[0.5, 0.0, 0.25, 0.25], &mut rng)] += 1;
        }
        assert_eq!(counts[1], 0);
        assert!((f64::from(counts[0]) - 4000.0).abs() < 4.0 * 45.0, "{counts:?}");
    }

    #[test]
    fn gamma_has_the_stated_mean() {
        let d = GammaMean { mean: 0.5, shape: 4.0 };
        let mut rng = Seed(3).stream(Purpose::Test, 0);
        let n = 10_000;
        let mean = (0..n).map(|_| d.sample(&mut rng)).sum::<f64>() / f64::from(n);
        assert!((mean - 0.5).abs() < 4.0 * 0.25 / f64::from(n).sqrt(), "{mean}");
    }
}
