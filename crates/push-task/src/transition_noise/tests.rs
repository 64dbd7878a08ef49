//! Draws of the noise, and what an observation says of it.

use physics_model::state::BodyState;
use pomdp::{Purpose, Seed};

use super::*;
use crate::config::ForceSensing;
use crate::sensor::tests::NOISE;

const SPREAD: TransitionNoise =
    TransitionNoise { position_m: 0.004, yaw_rad: 0.005, force_share: 0.3, joint_torque_nm: 0.2 };
/// Variance of a draw over that of a narrow one: one in twenty is four times as wide.
const MIXED: f64 = 0.95 + 0.05 * 16.0;

fn sensor(force: ForceSensing) -> SensorConfig {
    SensorConfig { force, large_force_limit: 100.0, noise: NOISE }
}

fn simulated(force: ForceSensing) -> Readings {
    let joints = if force == ForceSensing::Wrist { 7 } else { 6 };
    Readings {
        joints_rad: vec![0.1; joints],
        force: [3.0, -4.0, 12.0, 0.2, 0.3, -0.6],
        object: BodyState::at_rest([0.5, 0.1, 0.04], 0.3),
    }
}

/// 4 mm and 0.02 rad beside the simulation.
fn measured() -> Observation {
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.32);
    Observation(vec![0.504, 0.096, 0.045, turned.i, turned.j, turned.k, turned.w])
}

fn plane(object: &BodyState) -> [f64; 3] {
    [object.position_m[0], object.position_m[1], object.yaw_rad()]
}

fn normals<const N: usize>(rng: &mut Rng) -> [f64; N] {
    std::array::from_fn(|_| StandardNormal.sample(rng))
}

/// Mean of `values`, and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// Null: the mean is `expected`. Tolerance: four standard errors.
fn assert_mean(values: &[f64], expected: f64, what: &str) {
    let (mean, error) = mean_and_error(values);
    assert!((mean - expected).abs() < 4.0 * error, "{what}: {mean} ± {error} for {expected}");
}

#[test]
fn corrected_poses_have_the_posterior_of_two_gaussians() {
    let spread = TransitionNoise { position_m: 0.004, yaw_rad: 0.005, ..TransitionNoise::default() };
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let (n, simulated) = (4000, simulated(ForceSensing::Wrist).object);
    let draws: Vec<[f64; 3]> = (0..n)
        .map(|_| {
            let object = corrected(&spread, &NOISE, &simulated, &simulated, &measured(), normals(&mut rng));
            assert_eq!(object.position_m[2], 0.04);
            plane(&object)
        })
        .collect();
    // Gains 16/20 and 25/125; standard deviations e σ / √(e² + σ²).
    let (near_m, near_rad) = (0.004 * 0.002 / 0.004_f64.hypot(0.002), 0.005 * 0.01 / 0.005_f64.hypot(0.01));
    let expected = [(0.5 + 0.8 * 0.004, near_m), (0.1 - 0.8 * 0.004, near_m), (0.3 + 0.2 * 0.02, near_rad)];
    for (axis, (mean, stddev)) in expected.into_iter().enumerate() {
        let found = draws.iter().map(|d| d[axis]).sum::<f64>() / f64::from(n);
        let variance = draws.iter().map(|d| (d[axis] - found).powi(2)).sum::<f64>() / f64::from(n);
        assert!((found - mean).abs() < 4.0 * stddev / f64::from(n).sqrt(), "axis {axis}: {found} {mean}");
        // Four standard errors of a variance are 4 √(2 / n) = 9 %.
        assert!((variance / stddev.powi(2) - 1.0).abs() < 0.09, "axis {axis}: {variance}");
    }
}

#[test]
fn an_exact_model_is_not_corrected() {
    let sensor = sensor(ForceSensing::Wrist);
    let readings = simulated(ForceSensing::Wrist);
    let observation = sensor.observe(&readings, &mut Seed(1).stream(Purpose::Test, 0));
    let none = TransitionNoise::default();
    let (log, object) = none.explain(&sensor, &readings, &readings.object, &observation, &[1.0, 2.0, 3.0, 4.0]);
    assert_eq!(object, readings.object);
    assert_eq!(log, sensor.log_likelihood(&observation, &readings, &none));
}

#[test]
fn draws_are_explained_by_their_density() {
    // For densities g and p and draws of p, E[g / p] = 1. g are the two parts of the mixture: a wrong share, width or spread of either shows.
    let n = 20_000;
    for force in [ForceSensing::Wrist, ForceSensing::JointTorques] {
        let (sensor, readings) = (sensor(force), simulated(force));
        let mut rng = Seed(2).stream(Purpose::Test, 0);
        let (mut narrow, mut wide, mut logs) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..n {
            let (object, force) =
                SPREAD.draw(&readings.object, &readings.force, sensor.force == ForceSensing::Wrist, &mut rng);
            let disturbed = Readings { object, force, ..readings.clone() };
            let observation = sensor.observe(&disturbed, &mut rng);
            let (log, _) = SPREAD.explain(&sensor, &readings, &readings.object, &observation, &[0.0; 4]);
            narrow.push((sensor.log_likelihood(&observation, &readings, &SPREAD) - log).exp());
            wide.push((sensor.log_likelihood(&observation, &readings, &SPREAD.times(WIDE)) - log).exp());
            logs.push(log);
        }
        assert_mean(&narrow, 1.0, "narrow part");
        assert_mean(&wide, 1.0, "wide part");
        let expected: Vec<f64> = (0..n).map(|_| reference(force, &mut rng)).collect();
        let differences: Vec<f64> = logs.iter().zip(&expected).map(|(a, b)| a - b).collect();
        assert_mean(&differences, 0.0, "mean log likelihood");
    }
}

/// ln of the mixture's density at a draw of it, without the code under test: independent Gaussians whose common spread is narrow or wide.
fn reference(force: ForceSensing, rng: &mut Rng) -> f64 {
    // Standard deviation of the sensor, and of the noise.
    let mut parts = vec![(0.002, 0.004), (0.002, 0.004), (0.002, 0.0), (0.01, 0.0), (0.01, 0.0), (0.01, 0.005)];
    match force {
        ForceSensing::Wrist => {
            parts.extend([(0.001, 0.0); 7]);
            parts.extend([(0.5, 0.3 * 13.0); 3]);
            parts.extend([(0.05, 0.3 * 0.7); 3]);
        }
        ForceSensing::JointTorques => parts.extend([(0.1, 0.2); 6]),
    }
    let drawn = if rng.random::<f64>() < 0.05 { 4.0 } else { 1.0 };
    let values: Vec<f64> = parts
        .iter()
        .map(|(sensor, noise): &(f64, f64)| {
            let [z] = normals(rng);
            sensor.hypot(drawn * noise) * z
        })
        .collect();
    let log = |scale: f64, share: f64| {
        let each = parts.iter().zip(&values).map(|((sensor, noise), value)| {
            let stddev = sensor.hypot(scale * noise);
            -0.5 * (value / stddev).powi(2) - stddev.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
        });
        share.ln() + each.sum::<f64>()
    };
    let (a, b): (f64, f64) = (log(1.0, 0.95), log(4.0, 0.05));
    a.max(b) + (-(a - b).abs()).exp().ln_1p()
}

#[test]
fn explained_poses_are_distributed_like_drawn_ones() {
    // If a pose is drawn given the observation of a drawn one, it lies about the simulation and about the observation as that one does.
    let (sensor, readings) = (sensor(ForceSensing::Wrist), simulated(ForceSensing::Wrist));
    let mut rng = Seed(3).stream(Purpose::Test, 0);
    let simulated = plane(&readings.object);
    let mut squares: [[Vec<f64>; 2]; 3] = Default::default();
    for _ in 0..20_000 {
        let (object, force) = SPREAD.draw(&readings.object, &readings.force, true, &mut rng);
        let observation = sensor.observe(&Readings { object, force, ..readings.clone() }, &mut rng);
        let coordinates: [f64; STEP_COORDINATES] = normals(&mut rng);
        let (_, explained) = SPREAD.explain(&sensor, &readings, &readings.object, &observation, &coordinates);
        assert_eq!(explained.position_m[2], readings.object.position_m[2], "height stays as simulated");
        let (position_m, orientation) = observation.object_pose();
        let seen = plane(&BodyState { orientation, ..BodyState::at_rest(position_m, 0.0) });
        for (axis, [about_simulated, about_seen]) in squares.iter_mut().enumerate() {
            let pose = plane(&explained)[axis];
            about_simulated.push((pose - simulated[axis]).powi(2));
            about_seen.push((pose - seen[axis]).powi(2));
        }
    }
    for (axis, (noise, sensor)) in [(0.004_f64, 0.002_f64), (0.004, 0.002), (0.005, 0.01)].into_iter().enumerate() {
        assert_mean(&squares[axis][0], noise.powi(2) * MIXED, "about the simulation");
        assert_mean(&squares[axis][1], sensor.powi(2), "about the observation");
    }
}

#[test]
fn a_pose_that_is_read_beside_where_it_is_is_corrected_where_it_is() {
    // The sensor reads 1 cm and 0.1 rad beside the object. A measurement that says just that leaves the mean where the simulation is.
    let sensor = sensor(ForceSensing::Wrist);
    let object = simulated(ForceSensing::Wrist).object;
    let read = BodyState::at_rest([0.51, 0.1, 0.04], 0.4);
    let readings = Readings { object: read, ..simulated(ForceSensing::Wrist) };
    let (_, explained) = SPREAD.explain(&sensor, &readings, &object, &sensor.noise_free(&readings), &[0.0; 4]);
    for (found, expected) in plane(&explained).iter().zip(plane(&object)) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

#[test]
fn an_action_without_contact_moves_nothing() {
    let readings = simulated(ForceSensing::JointTorques);
    let quiet = SPREAD.of(false);
    let mut rng = Seed(4).stream(Purpose::Test, 0);
    for _ in 0..100 {
        assert_eq!(quiet.draw(&readings.object, &readings.force, false, &mut rng), (readings.object, readings.force));
    }
    // The wrist's reading has noise as a share of itself: none where there is no force.
    assert_eq!(quiet.draw(&readings.object, &[0.0; 6], true, &mut rng), (readings.object, [0.0; 6]));
    assert_eq!(SPREAD.of(true), SPREAD);
}

#[test]
fn a_draw_takes_as_many_random_numbers_whatever_the_spread_is() {
    use rand::Rng as _;
    let readings = simulated(ForceSensing::Wrist);
    let next = |noise: TransitionNoise| {
        let mut rng = Seed(5).stream(Purpose::Test, 0);
        let _ = noise.draw(&readings.object, &readings.force, true, &mut rng);
        rng.next_u64()
    };
    assert_eq!(next(SPREAD), next(SPREAD.of(false)));
}
