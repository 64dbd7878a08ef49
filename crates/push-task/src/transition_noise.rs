//! Noise of the transition: what the world adds to the simulated end of an action, and what an observation says about it.
//!
//! A blocked push has no exact end. The tool between object and obstacle, the solver's iterations and the tick in which the arm gives way make
//! readings jump where the object is moved by a single bit. The noise says how much. It has heavy tails, as jumps are rare and large: one
//! action in twenty has [`WIDE`] times the spread of the others.

use nalgebra::{UnitQuaternion, Vector3};
use physics_model::state::{BodyState, unit_quaternion};
use pomdp::Rng;
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::config::{NoiseConfig, SensorConfig, TransitionNoise};
use crate::sensor::{Observation, Readings};

/// Share of the actions whose noise is wide.
const WIDE_SHARE: f64 = 0.05;
/// How many times as wide their noise is.
const WIDE: f64 = 4.0;

/// Standard normal numbers that decide the noise of one action: which spread, and x, y and yaw.
pub const STEP_COORDINATES: usize = 4;

/// How far a body that nothing touches may settle in an action, m and rad: less than this is no motion.
pub(crate) const SETTLING: f64 = 2e-4;

impl TransitionNoise {
    /// Whether there is none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// That of an action: the pose of an object that was not pushed has none, nor have joint torques without contact.
    #[must_use]
    pub(crate) fn of(&self, pushed: bool) -> Self {
        if pushed { *self } else { Self { force_share: self.force_share, ..Self::default() } }
    }

    fn times(&self, factor: f64) -> Self {
        Self {
            position_m: factor * self.position_m,
            yaw_rad: factor * self.yaw_rad,
            force_share: factor * self.force_share,
            joint_torque_nm: factor * self.joint_torque_nm,
        }
    }

    /// Draws the noise of an action for the object's pose and the force readings. As many random numbers whatever their values.
    pub(crate) fn draw(
        &self,
        object: &BodyState,
        force: &[f64; 6],
        wrist: bool,
        rng: &mut Rng,
    ) -> (BodyState, [f64; 6]) {
        let wide = rng.random::<f64>() < WIDE_SHARE;
        let spread = self.times(if wide { WIDE } else { 1.0 });
        let mut normal = |stddev: f64| {
            let z: f64 = StandardNormal.sample(rng);
            stddev * z
        };
        let mut moved = *object;
        moved.position_m[0] += normal(spread.position_m);
        moved.position_m[1] += normal(spread.position_m);
        turn(&mut moved, normal(spread.yaw_rad));
        let mut read = *force;
        for (i, value) in read.iter_mut().enumerate() {
            let group = if i < 3 { &force[..3] } else { &force[3..] };
            let stddev = if wrist { spread.force_share * magnitude(group) } else { spread.joint_torque_nm };
            *value += normal(stddev);
        }
        (moved, read)
    }

    /// ln p(observation | simulated end of the action) with the noise integrated out, and the object's pose drawn from its posterior by
    /// `coordinates`, which decide the draw.
    pub(crate) fn explain(
        &self,
        sensor: &SensorConfig,
        readings: &Readings,
        object: &BodyState,
        observation: &Observation,
        coordinates: &[f64],
    ) -> (f64, BodyState) {
        if self.is_none() {
            return (sensor.log_likelihood(observation, readings, self), *object);
        }
        let wide = self.times(WIDE);
        let logs = [
            (1.0 - WIDE_SHARE).ln() + sensor.log_likelihood(observation, readings, self),
            WIDE_SHARE.ln() + sensor.log_likelihood(observation, readings, &wide),
        ];
        let most = logs[0].max(logs[1]);
        if !most.is_finite() {
            return (f64::NEG_INFINITY, *object);
        }
        let total = most + logs.iter().map(|l| (l - most).exp()).sum::<f64>().ln();
        let standard = Normal::standard();
        let is_wide = standard.cdf(coordinates[0]) < (logs[1] - total).exp();
        let spread = if is_wide { &wide } else { self };
        let z = [coordinates[1], coordinates[2], coordinates[3]];
        (total, corrected(spread, &sensor.noise, object, &readings.object, observation, z))
    }
}

fn magnitude(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Turns a body about the vertical.
fn turn(object: &mut BodyState, yaw_rad: f64) {
    if yaw_rad != 0.0 {
        let turned =
            UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, yaw_rad)) * unit_quaternion(object.orientation);
        object.orientation = [turned.i, turned.j, turned.k, turned.w];
    }
}

/// A draw of the object's pose given the simulated one, N(simulated, e²) with the transition's noise e, and the measured one, N(pose, σ²) with the
/// sensor's noise σ: for each of x, y and yaw the mean is e² / (e² + σ²) of the way to what was measured, the variance e² σ² / (e² + σ²).
/// Height, tilt and velocities stay as simulated. `read` is the simulated pose as the sensor would read it: the measurement tells how far the
/// object is from the simulation by how far it is from that. `z` are the standard normal numbers of the draw.
pub(crate) fn corrected(
    spread: &TransitionNoise,
    noise: &NoiseConfig,
    object: &BodyState,
    read: &BodyState,
    observation: &Observation,
    z: [f64; 3],
) -> BodyState {
    let mut object = *object;
    let (measured_m, measured) = observation.object_pose();
    let draw = |difference: f64, error: f64, noise: f64, z: f64| {
        let total = error.hypot(noise);
        let gain = (error / total).powi(2);
        gain * difference + z * error * noise / total
    };
    let axes = object.position_m[..2].iter_mut().zip(measured_m).zip(read.position_m).zip(z);
    for (((position, measured), read), z) in axes {
        *position += draw(measured - read, spread.position_m, noise.position_m, z);
    }
    let between = unit_quaternion(measured) * unit_quaternion(read.orientation).inverse();
    turn(&mut object, draw(between.scaled_axis().z, spread.yaw_rad, noise.orientation_rad, z[2]));
    object
}

#[cfg(test)]
mod tests;
