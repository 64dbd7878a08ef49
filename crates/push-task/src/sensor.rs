//! Observations: continuous values for the network, their 8-bit subset for the search tree.

use nalgebra::{UnitQuaternion, Vector3};
use physics_model::state::{BodyState, unit_quaternion};
use pomdp::Rng;
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::config::{ForceSensing, SensorConfig, TransitionNoise};

/// Largest index of a discretised value: 8 bits.
const BINS: f64 = 255.0;
/// Range of discretised positions, ±m.
const POSITION_RANGE_M: f64 = 10.0;
/// Range of discretised orientations, ±rad.
const ORIENTATION_RANGE_RAD: f64 = 2.0 * std::f64::consts::PI;
/// Range of discretised forces, ±N.
const FORCE_RANGE_N: f64 = 500.0;
/// Range of discretised joint torques, ±N·m.
const TORQUE_RANGE_NM: f64 = 160.0;
/// Most values in a key: 3 torques, 3 positions, 3 angles.
const KEY_LEN: usize = 9;

/// Continuous observation after an action.
///
/// Sawyer (20): joint positions (7, rad), wrist force (3, N) and torque (3, N·m), object pose (7).
/// Jaco (13): joint torques (6, N·m), object pose (7). The pose is position (m, base frame) and unit quaternion x, y, z, w with w ≥ 0.
/// Force and torque are means over the action: what the environment exerts on the hand, in the axes and at the origin of the wrist
/// frame. Joint torques are means over the action of what the motors give: M(q) q̈ + C(q, q̇) q̇ + g(q) − Jᵀ wrench.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observation(pub Vec<f64>);

impl Observation {
    /// Measured pose of the object.
    ///
    /// # Panics
    ///
    /// If the observation has fewer than 7 values.
    #[must_use]
    pub fn object_pose(&self) -> ([f64; 3], [f64; 4]) {
        let v = &self.0[self.0.len() - 7..];
        ([v[0], v[1], v[2]], [v[3], v[4], v[5], v[6]])
    }
}

/// 8-bit observation: Sawyer 3 wrist forces and object position; Jaco the 3 distal joint torques, object position and roll,
/// pitch, yaw. Unused places are 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ObservationKey(pub [u8; KEY_LEN]);

/// What the sensors would say without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// Joint positions, rad.
    pub joints_rad: Vec<f64>,
    /// Wrist force (N) and torque (N·m), or joint torques (N·m) in the first places.
    pub force: [f64; 6],
    /// The object.
    pub object: BodyState,
}

/// Names of the observed values for an arm of `joints` joints.
#[must_use]
pub fn observation_names(sensing: ForceSensing, joints: usize) -> Vec<String> {
    let mut names = match sensing {
        ForceSensing::Wrist => {
            let mut names: Vec<String> = (0..joints).map(|j| format!("joint_{j}_rad")).collect();
            names.extend(["wrist_fx_n", "wrist_fy_n", "wrist_fz_n"].map(String::from));
            names.extend(["wrist_tx_nm", "wrist_ty_nm", "wrist_tz_nm"].map(String::from));
            names
        }
        ForceSensing::JointTorques => (0..joints).map(|j| format!("joint_torque_{j}_nm")).collect(),
    };
    names.extend(["object_x_m", "object_y_m", "object_z_m"].map(String::from));
    names.extend(["object_qx", "object_qy", "object_qz", "object_qw"].map(String::from));
    names
}

impl SensorConfig {
    /// Noisy observation of `readings`. Draws as many random numbers whatever the values are.
    #[must_use]
    pub fn observe(&self, readings: &Readings, rng: &mut Rng) -> Observation {
        let noise = &self.noise;
        let mut normal = |stddev: f64| {
            let z: f64 = StandardNormal.sample(rng);
            stddev * z
        };
        let mut values = Vec::with_capacity(readings.joints_rad.len() + 13);
        match self.force {
            ForceSensing::Wrist => {
                values.extend(readings.joints_rad.iter().map(|q| q + normal(noise.joint_rad)));
                values.extend(readings.force[..3].iter().map(|f| f + normal(noise.force_n)));
                values.extend(readings.force[3..].iter().map(|t| t + normal(noise.torque_nm)));
            }
            ForceSensing::JointTorques => {
                let torques = &readings.force[..readings.joints_rad.len()];
                values.extend(torques.iter().map(|t| t + normal(noise.joint_torque_nm)));
            }
        }
        values.extend(readings.object.position_m.iter().map(|p| p + normal(noise.position_m)));
        let turn =
            Vector3::new(normal(noise.orientation_rad), normal(noise.orientation_rad), normal(noise.orientation_rad));
        let measured = UnitQuaternion::from_scaled_axis(turn) * unit_quaternion(readings.object.orientation);
        // A rotation has two quaternions: the one with w ≥ 0 is reported.
        let sign = if measured.w < 0.0 { -1.0 } else { 1.0 };
        values.extend([measured.i, measured.j, measured.k, measured.w].map(|v| sign * v));
        Observation(values)
    }

    /// What noise-free sensors would report.
    #[must_use]
    pub fn noise_free(&self, readings: &Readings) -> Observation {
        let mut values = match self.force {
            ForceSensing::Wrist => [readings.joints_rad.as_slice(), &readings.force].concat(),
            ForceSensing::JointTorques => readings.force[..readings.joints_rad.len()].to_vec(),
        };
        values.extend(readings.object.position_m);
        let [x, y, z, w] = readings.object.orientation;
        let sign = if w < 0.0 { -1.0 } else { 1.0 };
        values.extend([x, y, z, w].map(|v| sign * v));
        Observation(values)
    }

    /// Class of `observation` in the search tree.
    #[must_use]
    pub fn key(&self, observation: &Observation, joints: usize) -> ObservationKey {
        let values = &observation.0;
        let mut key = [0; KEY_LEN];
        let (position, orientation) = observation.object_pose();
        for (slot, p) in key[3..6].iter_mut().zip(position) {
            *slot = discretise(p, POSITION_RANGE_M);
        }
        match self.force {
            ForceSensing::Wrist => {
                for (slot, f) in key[..3].iter_mut().zip(&values[joints..joints + 3]) {
                    *slot = discretise(*f, FORCE_RANGE_N);
                }
            }
            ForceSensing::JointTorques => {
                for (slot, t) in key[..3].iter_mut().zip(&values[joints - 3..joints]) {
                    *slot = discretise(*t, TORQUE_RANGE_NM);
                }
                let (roll, pitch, yaw) = unit_quaternion(orientation).euler_angles();
                for (slot, angle) in key[6..].iter_mut().zip([roll, pitch, yaw]) {
                    *slot = discretise(angle, ORIENTATION_RANGE_RAD);
                }
            }
        }
        ObservationKey(key)
    }

    /// Upper bound of [`Self::log_likelihood`] for an arm of `joints` joints.
    #[must_use]
    pub fn most_log_likelihood(&self, joints: usize) -> f64 {
        let noise = &self.noise;
        let joints = joints as f64;
        let pose = 3.0 * noise.position_m.ln() + 3.0 * noise.orientation_rad.ln();
        let (count, force) = match self.force {
            ForceSensing::Wrist => {
                (joints + 6.0, joints * noise.joint_rad.ln() + 3.0 * noise.force_n.ln() + 3.0 * noise.torque_nm.ln())
            }
            ForceSensing::JointTorques => (joints, joints * noise.joint_torque_nm.ln()),
        };
        -pose - force - 0.5 * (count + 6.0) * (2.0 * std::f64::consts::PI).ln()
    }

    /// ln p(observation | readings): Gaussian noise on every value, and on some that of the transition.
    #[must_use]
    pub fn log_likelihood(&self, observation: &Observation, readings: &Readings, error: &TransitionNoise) -> f64 {
        let noise = &self.noise;
        let values = &observation.0;
        let joints = readings.joints_rad.len();
        let mut total = 0.0;
        let mut add = |error: f64, stddev: f64| {
            let z = error / stddev;
            total -= 0.5 * z * z + stddev.ln() + 0.5 * (2.0 * std::f64::consts::PI).ln();
        };
        match self.force {
            ForceSensing::Wrist => {
                for (value, q) in values.iter().zip(&readings.joints_rad) {
                    add(value - q, noise.joint_rad);
                }
                let magnitude = |from: usize| readings.force[from..from + 3].iter().map(|f| f * f).sum::<f64>().sqrt();
                for (from, stddev) in [(0, noise.force_n), (3, noise.torque_nm)] {
                    let stddev = stddev.hypot(error.force_share * magnitude(from));
                    for (value, force) in values[joints + from..].iter().zip(&readings.force[from..from + 3]) {
                        add(value - force, stddev);
                    }
                }
            }
            ForceSensing::JointTorques => {
                let stddev = noise.joint_torque_nm.hypot(error.joint_torque_nm);
                for (value, torque) in values.iter().zip(&readings.force[..joints]) {
                    add(value - torque, stddev);
                }
            }
        }
        let (position, orientation) = observation.object_pose();
        let horizontal = noise.position_m.hypot(error.position_m);
        let stddevs = [horizontal, horizontal, noise.position_m];
        for ((value, p), stddev) in position.iter().zip(readings.object.position_m).zip(stddevs) {
            add(value - p, stddev);
        }
        let turn = unit_quaternion(orientation) * unit_quaternion(readings.object.orientation).inverse();
        let stddevs = [noise.orientation_rad, noise.orientation_rad, noise.orientation_rad.hypot(error.yaw_rad)];
        for (component, stddev) in turn.scaled_axis().iter().zip(stddevs) {
            add(*component, stddev);
        }
        total
    }
}

/// Index 0 to 255 of `value`, clipped to ±`range`: ⌊255 (value + range) / (2 range)⌋.
///
/// The paper says "clipped and mapped to indices 0 to N" and leaves the rounding open. Rounding to the nearest would put an edge at exactly
/// 0, where every force without contact and every roll and pitch of a standing object lie: sensor noise would then toss a coin for each
/// of them. Rounding down puts 0 into the middle of class 127.
#[must_use]
fn discretise(value: f64, range: f64) -> u8 {
    let share = (value.clamp(-range, range) + range) / (2.0 * range);
    // NaN becomes 0 by Rust's casting rule; diverged worlds never get here with one.
    (share * BINS).floor() as u8
}

#[cfg(test)]
pub(crate) mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;
    use crate::config::NoiseConfig;

    /// The arms' noise.
    pub(crate) const NOISE: NoiseConfig = NoiseConfig {
        joint_rad: 0.001,
        force_n: 0.5,
        torque_nm: 0.05,
        joint_torque_nm: 0.1,
        position_m: 0.002,
        orientation_rad: 0.01,
    };

    fn sensor(force: ForceSensing) -> SensorConfig {
        SensorConfig { force, large_force_limit: 100.0, noise: NOISE }
    }

    fn readings(joints: usize) -> Readings {
        Readings {
            joints_rad: vec![0.1; joints],
            force: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            object: BodyState::at_rest([0.5, -0.1, 0.04], 3.0),
        }
    }

    #[test]
    fn ranges_map_to_8_bits_as_published() {
        assert_eq!(discretise(-10.0, 10.0), 0);
        assert_eq!(discretise(10.0, 10.0), 255);
        assert_eq!(discretise(1e9, 10.0), 255);
        assert_eq!(discretise(0.0, 500.0), 127);
        // One step is 20/255 m, and 0 lies in the middle of one.
        assert_eq!([discretise(-0.039, 10.0), discretise(0.039, 10.0)], [127, 127]);
        assert_eq!([discretise(-0.04, 10.0), discretise(0.04, 10.0)], [126, 128]);
    }

    #[test]
    fn observations_have_20_and_13_values_and_name_them() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for (sensing, joints, count) in [(ForceSensing::Wrist, 7, 20), (ForceSensing::JointTorques, 6, 13)] {
            let observation = sensor(sensing).observe(&readings(joints), &mut rng);
            assert_eq!(observation.0.len(), count);
            assert_eq!(observation_names(sensing, joints).len(), count);
        }
    }

    #[test]
    fn key_holds_forces_and_position_or_distal_torques_and_pose() {
        let wrist = sensor(ForceSensing::Wrist);
        let mut values = vec![0.0; 20];
        values[7] = 500.0;
        values[13] = -10.0;
        values[19] = 1.0;
        assert_eq!(wrist.key(&Observation(values), 7).0, [255, 127, 127, 0, 127, 127, 0, 0, 0]);
        let torques = sensor(ForceSensing::JointTorques);
        let mut values = vec![0.0; 13];
        values[3] = 160.0;
        values[5] = -160.0;
        values[11] = 1.0; // z: half a turn of yaw.
        values[12] = 0.0;
        let key = torques.key(&Observation(values), 6).0;
        assert_eq!(key[..6], [255, 127, 0, 127, 127, 127]);
        assert_eq!(key[8], 191, "yaw of π on ±2π is three quarters of the way");
    }

    #[test]
    fn noise_leaves_an_untouched_arm_in_its_class() {
        for (sensing, joints) in [(ForceSensing::Wrist, 7), (ForceSensing::JointTorques, 6)] {
            let sensor = sensor(sensing);
            let mut quiet = readings(joints);
            // Mid-bin positions and torques: what is tested is that zero forces, roll and pitch are not at an edge.
            quiet.force = [0.0; 6];
            quiet.object = BodyState::at_rest([0.0, 0.0, 0.0], 0.0);
            let expected = sensor.key(&sensor.noise_free(&quiet), joints);
            let mut rng = Seed(4).stream(Purpose::Test, 0);
            let same = (0..1000).filter(|_| sensor.key(&sensor.observe(&quiet, &mut rng), joints) == expected).count();
            // Half a class of angle is 2.46 standard deviations of the orientation noise: 0.986³ = 0.958 for the Jaco's three angles. At
            // an edge it would be an eighth.
            assert!(same >= 930, "{same} of 1000 for {sensing:?}");
        }
    }

    #[test]
    fn likelihood_is_the_density_of_the_noise() {
        let sensor = sensor(ForceSensing::Wrist);
        let truth = readings(7);
        let mut rng = Seed(2).stream(Purpose::Test, 0);
        // E[ln p] of a Gaussian of dimension d with the 20 → 19 free values: −d/2 (1 + ln 2π) − Σ ln σ.
        let n = 2000;
        let mean = (0..n)
            .map(|_| sensor.log_likelihood(&sensor.observe(&truth, &mut rng), &truth, &TransitionNoise::default()))
            .sum::<f64>()
            / f64::from(n);
        let log_stddevs = 7.0 * 0.001_f64.ln()
            + 3.0 * 0.5_f64.ln()
            + 3.0 * 0.05_f64.ln()
            + 3.0 * 0.002_f64.ln()
            + 3.0 * 0.01_f64.ln();
        let expected = -19.0 / 2.0 * (1.0 + (2.0 * std::f64::consts::PI).ln()) - log_stddevs;
        // Stddev of ln p is sqrt(d / 2) = 3.1: four standard errors.
        assert!((mean - expected).abs() < 4.0 * 3.1 / f64::from(n).sqrt(), "{mean} {expected}");
    }

    #[test]
    fn likelihood_with_an_error_of_the_model_is_the_density_of_error_and_noise() {
        let sensor = sensor(ForceSensing::Wrist);
        let simulated = readings(7);
        let error = TransitionNoise { position_m: 0.003, yaw_rad: 0.02, force_share: 0.3, joint_torque_nm: 1.0 };
        let mut rng = Seed(3).stream(Purpose::Test, 0);
        let size = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let shares = [0.3 * size(&simulated.force[..3]), 0.3 * size(&simulated.force[3..])];
        let n = 2000;
        let mut total = 0.0;
        for _ in 0..n {
            let mut truth = simulated.clone();
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            for (i, force) in truth.force.iter_mut().enumerate() {
                *force += shares[i / 3] * normal();
            }
            truth.object.position_m[0] += 0.003 * normal();
            truth.object.position_m[1] += 0.003 * normal();
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 0.02 * normal()));
            let turned = turn * unit_quaternion(truth.object.orientation);
            truth.object.orientation = [turned.i, turned.j, turned.k, turned.w];
            total += sensor.log_likelihood(&sensor.observe(&truth, &mut rng), &simulated, &error);
        }
        let mean = total / f64::from(n);
        let log_stddevs = 7.0 * 0.001_f64.ln()
            + 3.0 * 0.5_f64.hypot(shares[0]).ln()
            + 3.0 * 0.05_f64.hypot(shares[1]).ln()
            + 2.0 * 0.002_f64.hypot(0.003).ln()
            + 0.002_f64.ln()
            + 2.0 * 0.01_f64.ln()
            + 0.01_f64.hypot(0.02).ln();
        let expected = -19.0 / 2.0 * (1.0 + (2.0 * std::f64::consts::PI).ln()) - log_stddevs;
        assert!((mean - expected).abs() < 4.0 * 3.1 / f64::from(n).sqrt(), "{mean} {expected}");
    }
}
