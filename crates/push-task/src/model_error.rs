//! The object's pose after an action, between what the model simulated and what was measured.

use nalgebra::{UnitQuaternion, Vector3};
use physics_model::state::BodyState;
use physics_model::state::unit_quaternion;
use pomdp::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::config::{ModelErrorConfig, NoiseConfig};
use crate::model::Particle;
use crate::sensor::Observation;

/// A draw of the object's pose given the simulated one, N(simulated, e²) with the model's error e, and the measured one, N(pose, σ²) with the
/// sensor's noise σ: for each of x, y and yaw the mean is e² / (e² + σ²) of the way to what was measured, the variance e² σ² / (e² + σ²).
/// Height, tilt and velocities stay as simulated.
pub(crate) fn corrected(
    error: &ModelErrorConfig,
    noise: &NoiseConfig,
    particle: &Particle,
    observation: &Observation,
    rng: &mut Rng,
) -> BodyState {
    let mut object = particle.state.object;
    let (measured_m, measured) = observation.object_pose();
    let mut draw = |difference: f64, error: f64, noise: f64| {
        let z: f64 = StandardNormal.sample(rng);
        let total = error.hypot(noise);
        let gain = (error / total).powi(2);
        gain * difference + z * error * noise / total
    };
    for (simulated, measured) in object.position_m[..2].iter_mut().zip(measured_m) {
        *simulated += draw(measured - *simulated, error.position_m, noise.position_m);
    }
    let turn = unit_quaternion(measured) * unit_quaternion(object.orientation).inverse();
    let yaw_rad = draw(turn.scaled_axis().z, error.yaw_rad, noise.orientation_rad);
    if yaw_rad != 0.0 {
        let turned =
            UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, yaw_rad)) * unit_quaternion(object.orientation);
        object.orientation = [turned.i, turned.j, turned.k, turned.w];
    }
    object
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;
    use crate::sensor::tests::NOISE;
    use crate::state::State;
    use physics_model::theta::{ObjectShape, ObjectTheta, Theta};

    fn simulated() -> Particle {
        let object = ObjectTheta {
            shape: ObjectShape::Box,
            mass_kg: 0.5,
            com_m: [0.0; 3],
            friction: 0.4,
            size_m: [0.08, 0.08, 0.08],
        };
        let state =
            State { joints_rad: vec![0.0; 7], object: BodyState::at_rest([0.5, 0.1, 0.04], 0.3), obstacle: None };
        Particle::new(state, Theta { object, obstacle: None, effects: vec![] })
    }

    /// 4 mm and 0.02 rad beside the simulation.
    fn measured() -> Observation {
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.32);
        Observation(vec![0.504, 0.096, 0.045, turned.i, turned.j, turned.k, turned.w])
    }

    #[test]
    fn corrected_poses_have_the_posterior_of_two_gaussians() {
        let error = ModelErrorConfig { position_m: 0.004, yaw_rad: 0.005, ..ModelErrorConfig::default() };
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let n = 4000;
        let draws: Vec<[f64; 3]> = (0..n)
            .map(|_| {
                let object = corrected(&error, &NOISE, &simulated(), &measured(), &mut rng);
                assert_eq!(object.position_m[2], 0.04);
                let yaw = unit_quaternion(object.orientation).euler_angles().2;
                [object.position_m[0], object.position_m[1], yaw]
            })
            .collect();
        // Gains 16/20 and 25/125; standard deviations e σ / √(e² + σ²).
        let (near_m, near_rad) = (0.004 * 0.002 / 0.004_f64.hypot(0.002), 0.005 * 0.01 / 0.005_f64.hypot(0.01));
        for (axis, (mean, stddev)) in
            [(0.5 + 0.8 * 0.004, near_m), (0.1 - 0.8 * 0.004, near_m), (0.3 + 0.2 * 0.02, near_rad)]
                .into_iter()
                .enumerate()
        {
            let found = draws.iter().map(|d| d[axis]).sum::<f64>() / f64::from(n);
            let variance = draws.iter().map(|d| (d[axis] - found).powi(2)).sum::<f64>() / f64::from(n);
            assert!((found - mean).abs() < 4.0 * stddev / f64::from(n).sqrt(), "axis {axis}: {found} {mean}");
            // Four standard errors of a variance are 4 √(2 / n) = 9 %.
            assert!((variance / stddev.powi(2) - 1.0).abs() < 0.09, "axis {axis}: {variance}");
        }
    }

    #[test]
    fn an_exact_model_is_not_corrected() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let object = corrected(&ModelErrorConfig::default(), &NOISE, &simulated(), &measured(), &mut rng);
        assert_eq!(object, simulated().state.object);
    }
}
