//! Artificial noise of particle reinvigoration: zero-mean Gaussian noise on every uncertain value, kept in its range.

use physics_model::state::BodyState;
use physics_model::theta::{ObjectShape, standard_com_m};
use pomdp::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::config::PerturbConfig;
use crate::model::Particle;

/// Smallest size and mass that noise may lead to.
const SMALLEST_SIZE_M: f64 = 0.01;
const SMALLEST_MASS_KG: f64 = 0.01;
/// Standard deviation of noise on an effect's parameter, as a share of its plausible range.
const EFFECT_SHARE: f64 = 0.1;
/// Heights within this distance of the resting height count as resting on the table, m.
const RESTING_TOLERANCE_M: f64 = 0.005;

/// Adds noise to object, obstacle and Θ; the joint positions are known and stay. What rests on the table goes on resting there when
/// its height changes.
pub(crate) fn perturb(config: &PerturbConfig, table_height_m: f64, particle: &mut Particle, rng: &mut Rng) {
    let theta = &mut particle.theta;
    let o = &mut theta.object;
    let resting = rests(table_height_m, o.shape, o.size_m, &particle.state.object);
    o.mass_kg = noisy_mass(o.mass_kg, config.mass_share, rng);
    o.friction = (o.friction + normal(config.friction, rng)).clamp(0.0, 1.0);
    noisy_sizes(o.shape, &mut o.size_m, config.size_m, rng);
    let half = o.shape.half_extents_m(o.size_m);
    for (com, half) in o.com_m.iter_mut().zip(half) {
        *com = (*com + normal(config.com_m, rng)).clamp(-0.9 * half, 0.9 * half);
    }
    o.com_m = standard_com_m(o.shape, o.com_m);
    noisy_body(config, &mut particle.state.object, rng);
    if resting {
        particle.state.object.position_m[2] = table_height_m + o.shape.half_height_m(o.size_m);
    }
    for effect in &mut theta.effects {
        let parameter = effect.parameter.parameter();
        let ([from, to], [low, high]) = (parameter.plausible, parameter.limits);
        effect.value = (effect.value + normal(EFFECT_SHARE * (to - from), rng)).clamp(low, high);
    }
    if let (Some(o), Some(body)) = (&mut theta.obstacle, &mut particle.state.obstacle) {
        let resting = rests(table_height_m, o.shape, o.size_m, body);
        o.mass_kg = noisy_mass(o.mass_kg, config.mass_share, rng);
        noisy_sizes(o.shape, &mut o.size_m, config.size_m, rng);
        noisy_body(config, body, rng);
        if resting {
            body.position_m[2] = table_height_m + o.shape.half_height_m(o.size_m);
        }
    }
}

fn normal(stddev: f64, rng: &mut Rng) -> f64 {
    let z: f64 = StandardNormal.sample(rng);
    stddev * z
}

fn rests(table_height_m: f64, shape: ObjectShape, size_m: [f64; 3], body: &BodyState) -> bool {
    (body.position_m[2] - table_height_m - shape.half_height_m(size_m)).abs() < RESTING_TOLERANCE_M
}

fn noisy_mass(mass_kg: f64, share: f64, rng: &mut Rng) -> f64 {
    (mass_kg * (1.0 + normal(share, rng))).max(SMALLEST_MASS_KG)
}

fn noisy_sizes(shape: ObjectShape, size_m: &mut [f64; 3], stddev_m: f64, rng: &mut Rng) {
    for size in &mut size_m[..shape.size_count()] {
        *size = (*size + normal(stddev_m, rng)).max(SMALLEST_SIZE_M);
    }
}

fn noisy_body(config: &PerturbConfig, body: &mut BodyState, rng: &mut Rng) {
    for axis in 0..2 {
        body.position_m[axis] += normal(config.position_m, rng);
    }
    let (sin, cos) = (normal(config.yaw_rad, rng) / 2.0).sin_cos();
    let [x, y, z, w] = body.orientation;
    // (0, 0, sin, cos) ⊗ (x, y, z, w): a turn about the vertical of the base frame.
    body.orientation = [cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z];
    for v in &mut body.linear_mps[..2] {
        *v += normal(config.linear_mps, rng);
    }
    for v in &mut body.angular_rps {
        *v += normal(config.angular_rps, rng);
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;
    use crate::state::State;
    use physics_model::theta::{ObjectTheta, Theta};

    #[test]
    fn noise_has_the_stated_width_and_keeps_the_object_on_the_table() {
        let config = PerturbConfig {
            position_m: 0.01,
            yaw_rad: 0.1,
            linear_mps: 0.01,
            angular_rps: 0.1,
            mass_share: 0.2,
            com_m: 0.005,
            friction: 0.1,
            size_m: 0.005,
        };
        let particle = Particle::new(
            State { joints_rad: vec![0.0; 7], object: BodyState::at_rest([0.5, 0.0, -0.06], 0.4), obstacle: None },
            Theta {
                object: ObjectTheta {
                    shape: ObjectShape::Box,
                    mass_kg: 0.5,
                    com_m: [0.0; 3],
                    friction: 0.5,
                    size_m: [0.08; 3],
                },
                obstacle: None,
                effects: Vec::new(),
            },
        );
        let mut rng = Seed(3).stream(Purpose::Test, 0);
        let n = 4000;
        let (mut x, mut yaw, mut mass) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let mut p = particle.clone();
            perturb(&config, -0.1, &mut p, &mut rng);
            x += (p.state.object.position_m[0] - 0.5).powi(2);
            yaw += (p.state.object.yaw_rad() - 0.4).powi(2);
            mass += (p.theta.object.mass_kg - 0.5).powi(2);
            let rest = -0.1 + p.theta.object.size_m[2] / 2.0;
            assert!((p.state.object.position_m[2] - rest).abs() < 1e-12);
            assert!((0.0..=1.0).contains(&p.theta.object.friction));
        }
        // A variance from n draws is within 4 · sqrt(2 / n) = 9 % of the truth.
        for (sum, stddev) in [(x, 0.01), (yaw, 0.1), (mass, 0.1)] {
            let ratio = sum / f64::from(n) / (stddev * stddev);
            assert!((ratio - 1.0).abs() < 0.09, "{ratio} for {stddev}");
        }
    }
}
