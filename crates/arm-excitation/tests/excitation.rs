//! Motions of a small arm: that they keep the limits, what they tell, and that this is so by another way.

use std::path::Path;

use arm_dynamics::{Arm, GRAVITY, Selection};
use arm_excitation::{Error, Excitation, Question, Settings, excitation};
use nalgebra::DMatrix;

/// Three links of 0.4 m that turn about z, y and y, half a metre above the floor.
const URDF: &str = r#"<robot name="three"><link name="base"/>
<link name="a"><inertial><origin xyz="0 0 0.1"/><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="1.5"/><inertia ixx="0.002" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="c"><inertial><origin xyz="0.2 0 0"/><mass value="1"/><inertia ixx="0.001" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="2" effort="40"/></joint>
<joint name="lift" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/><limit lower="-1.5" upper="1.2" velocity="2" effort="40"/></joint>
<joint name="bend" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit velocity="3" effort="9"/></joint>
<joint name="end" type="fixed"><parent link="c"/><child link="tip"/><origin xyz="0.4 0 0"/></joint></robot>"#;

fn arm() -> Arm {
    let path = Path::new("three.urdf");
    Arm::new(&urdf_file::parse(path, URDF).unwrap(), path, &Selection::default()).unwrap()
}

fn found(settings: &Settings) -> Excitation {
    excitation(&arm(), settings, |_, _, _| {}).unwrap()
}

fn settings(question: Question) -> Settings {
    Settings { question, seconds: 8.0, tries: 600, ..Settings::default() }
}

#[test]
fn a_motion_keeps_the_limits_and_the_same_seed_gives_the_same() {
    let arm = arm();
    let excitation = found(&settings(Question::All));
    for i in 0..=800 {
        let samples = excitation.motion.at(0.01 * f64::from(i));
        let q: Vec<f64> = samples.iter().map(|sample| sample.position).collect();
        let rates: Vec<f64> = samples.iter().map(|sample| sample.rate).collect();
        let accelerations: Vec<f64> = samples.iter().map(|sample| sample.acceleration).collect();
        let torques = arm.inverse_dynamics(&q, &rates, &accelerations, &GRAVITY);
        for ((joint, sample), torque) in arm.joints().iter().zip(&samples).zip(&torques) {
            assert!((joint.lower..=joint.upper).contains(&sample.position), "{}: {sample:?}", joint.name);
            assert!(sample.rate.abs() <= 0.5 * joint.velocity * 1.01, "{}: {sample:?}", joint.name);
            assert!(torque.abs() <= 0.82 * joint.effort, "{}: {torque} N m", joint.name);
        }
        assert!(arm.base_from_tip(&q).translation.z > 0.05, "the tip at {:?}", arm.base_from_tip(&q).translation);
    }
    assert_eq!(excitation.motion, found(&settings(Question::All)).motion);
    let other = found(&Settings { seed: 2, ..settings(Question::All) });
    assert_ne!(excitation.motion, other.motion);
}

#[test]
fn it_tells_more_than_random_motions_and_each_question_has_its_own() {
    let friction = found(&settings(Question::Friction));
    let best = friction.random_nats.last().copied().unwrap();
    assert!(friction.nats > best + 1.0, "{} for {best}", friction.nats);
    assert_eq!(friction.spreads.len(), 6);
    assert!(friction.spreads.iter().all(|spread| spread.after < spread.before && spread.name.contains("friction")));
    let payload = found(&settings(Question::Payload));
    assert_eq!(payload.spreads.len(), 10);
    let masses = found(&settings(Question::Masses));
    assert!(masses.spreads.len() == 30 && masses.spreads.iter().all(|spread| !spread.name.contains("payload")));
    let all = found(&settings(Question::All));
    assert!(all.nats > friction.nats && all.nats > payload.nats, "{} {} {}", all.nats, friction.nats, payload.nats);
}

/// The same information by way of the readings: ½ ln |N + X S² Xᵀ| of all numbers less that of the numbers that are not asked for.
#[test]
fn information_is_that_of_the_readings_too() {
    let arm = arm();
    let excitation = found(&settings(Question::TorqueOffset));
    let spreads = &excitation.spreads;
    // Typical torques, by way of the spreads before; links are 0.2, 0.4 and 0.4 m long.
    let scale: Vec<f64> = spreads.iter().map(|spread| spread.before / 0.2).collect();
    let inertia: Vec<f64> =
        found(&settings(Question::MotorInertia)).spreads.iter().map(|spread| spread.before).collect();
    let length = [0.2, 0.4, 0.4];
    let rate = [2.0, 2.0, 3.0];
    let total: f64 = arm.masses().map(|mass| mass.mass_kg).sum();
    let readings = 80;
    let (mut others, mut asked): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    let each = |column: &dyn Fn(usize) -> [f64; 3]| -> Vec<f64> {
        let rows = (0..readings).flat_map(|reading| {
            column(reading).into_iter().zip(&scale).map(|(t, s)| t / (0.02 * s)).collect::<Vec<_>>()
        });
        rows.collect()
    };
    let samples = |reading: usize| excitation.motion.at((reading as f64 + 0.5) * 0.1);
    let state =
        |reading: usize| samples(reading).iter().map(|s| [s.position, s.rate, s.acceleration]).collect::<Vec<_>>();
    let regressor = |reading: usize, link: usize, number: usize| -> [f64; 3] {
        let state = state(reading);
        let of = |i: usize| state.iter().map(|joint| joint[i]).collect::<Vec<f64>>();
        let torques = arm.motion(&of(0), &of(1), &of(2), &GRAVITY).regressor(link)[number];
        [torques[0], torques[1], torques[2]]
    };
    let size = |number: usize, length: f64| length.powi([0, 1, 1, 1, 2, 2, 2, 2, 2, 2][number]);
    for (link, mass) in arm.masses().enumerate() {
        let weight = 0.1 * mass.mass_kg.max(0.02 * total / 3.0);
        for number in 0..10 {
            others.push(each(&|reading| {
                regressor(reading, link, number).map(|t| t * weight * size(number, length[link]))
            }));
        }
    }
    for number in 0..10 {
        let wide = size(number, 1.0 / 3.0);
        others.push(each(&|reading| regressor(reading, 2, number).map(|t| t * 0.1 * total * wide)));
    }
    let torques = |reading: usize| -> [f64; 3] {
        let state = state(reading);
        let of = |i: usize| state.iter().map(|joint| joint[i]).collect::<Vec<f64>>();
        let all = arm.inverse_dynamics(&of(0), &of(1), &of(2), &GRAVITY);
        [all[0], all[1], all[2]]
    };
    for (joint, scale) in scale.iter().enumerate() {
        let only = |value: &dyn Fn(usize) -> f64, before: f64| {
            each(&|reading| std::array::from_fn(|j| if j == joint { before * value(reading) } else { 0.0 }))
        };
        let before = 0.2 * scale;
        let rate = rate[joint];
        others.push(only(&|reading| (samples(reading)[joint].rate / (0.01 * rate)).tanh(), before));
        others.push(only(&|reading| samples(reading)[joint].rate, before / rate));
        others.push(only(&|reading| samples(reading)[joint].acceleration, inertia[joint]));
        others.push(only(&|reading| torques(reading)[joint], 0.3));
        asked.push(only(&|_| 1.0, before));
    }
    let half_log_determinant = |columns: &[Vec<f64>]| -> f64 {
        let x = DMatrix::from_fn(3 * readings, columns.len(), |row, column| columns[column][row]);
        let covariance = &x * x.transpose() + DMatrix::identity(3 * readings, 3 * readings);
        let factor = covariance.cholesky().unwrap();
        factor.l_dirty().diagonal().iter().map(|value| value.ln()).sum()
    };
    let rest = half_log_determinant(&others);
    others.extend(asked);
    let expected = half_log_determinant(&others) - rest;
    assert!((excitation.nats - expected).abs() < 1e-4 * expected, "{} for {expected}", excitation.nats);
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |settings: &Settings| excitation(&arm(), settings, |_, _, _| {}).unwrap_err();
    for wrong in [
        Settings { seconds: 0.5, ..Settings::default() },
        Settings { seconds: f64::NAN, ..Settings::default() },
        Settings { speed: 0.0, ..Settings::default() },
        Settings { radius_m: -0.1, ..Settings::default() },
        Settings { floor_m: Some(f64::INFINITY), ..Settings::default() },
        Settings { tries: 63, ..Settings::default() },
    ] {
        assert!(matches!(refused(&wrong), Error::Setting(_)), "{wrong:?}");
    }
    // A motor that cannot hold its link.
    let path = Path::new("weak.urdf");
    let weak = URDF.replace(r#"velocity="3" effort="9""#, r#"velocity="3" effort="0.01""#);
    let weak = Arm::new(&urdf_file::parse(path, &weak).unwrap(), path, &Selection::default()).unwrap();
    let error = excitation(&weak, &Settings { tries: 100, ..Settings::default() }, |_, _, _| {}).unwrap_err();
    assert!(matches!(&error, Error::Limits { why, .. } if why.contains("torque")), "{error}");
    let light = URDF
        .replace(r#"<mass value="2"/>"#, r#"<mass value="0"/>"#)
        .replace(r#"<mass value="1.5"/>"#, r#"<mass value="0"/>"#);
    let light = light.replace(r#"<mass value="1"/>"#, r#"<mass value="0"/>"#);
    if let Ok(light) = urdf_file::parse(path, &light).map(|urdf| Arm::new(&urdf, path, &Selection::default())) {
        let refused = light.map(|arm| excitation(&arm, &Settings::default(), |_, _, _| {}));
        assert!(!matches!(refused, Ok(Ok(_))), "{refused:?}");
    }
    // A floor above the arm.
    let high = Settings { floor_m: Some(2.0), tries: 100, ..Settings::default() };
    let error = refused(&high);
    assert!(matches!(&error, Error::Limits { why, .. } if why.contains("floor")), "{error}");
}
