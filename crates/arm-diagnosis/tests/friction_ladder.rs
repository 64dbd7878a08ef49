//! A servo that swings a weight, with each of the six friction laws of Duclusaud and Passault (ICRA 2025): the law that was put in is named.

use std::fmt::Write as _;
use std::path::Path;

use arm_diagnosis::{Diagnosis, Log, Settings, Verdict, diagnose};

const RATE_HZ: f64 = 250.0;
const SECS: f64 = 60.0;
/// m g l, N·m, and inertia, kg·m².
const LOAD_NM: f64 = 4.0;
const INERTIA_KGM2: f64 = 0.085;

const ROBOT: &str = r#"<robot name="servo"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.2"/><mass value="2.0387"/>
<inertia ixx="0.00345" iyy="0.00345" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="servo" type="revolute">
<parent link="base"/><child link="arm"/><axis xyz="0 -1 0"/><limit lower="-3" upper="3" effort="100" velocity="20"/></joint></robot>"#;

/// Constants of a law; what it does not have is 0.
#[derive(Clone, Copy, Default)]
struct Law {
    coulomb: f64,
    viscous: f64,
    peak: f64,
    /// Shares of load where the motor drives and where the load does, at all speeds, at low speed, and of its square at low speed, 1/(N·m).
    load: [f64; 2],
    load_peak: [f64; 2],
    square: [f64; 2],
}

impl Law {
    /// Friction, N·m, at a rate and a torque that the gear passes on.
    fn friction(&self, rate: f64, passed: f64) -> f64 {
        let (way, size) = (usize::from(passed * rate < 0.0), passed.abs());
        let slow = (-(rate / 0.1).powi(2)).exp();
        let level = self.coulomb
            + self.load[way] * size
            + slow * (self.peak + self.load_peak[way] * size + self.square[way] * size * size);
        level * rate.signum() + self.viscous * rate
    }
}

/// Position, rate and acceleration: three sines, slow and fast.
fn motion(time: f64) -> [f64; 3] {
    [(0.7, 0.05, 0.3), (0.3, 0.13, 1.1), (0.12, 0.41, 2.0)].iter().fold([0.0; 3], |sum, (size, hertz, phase)| {
        let omega = std::f64::consts::TAU * hertz;
        let (sin, cos) = (omega * time + phase).sin_cos();
        [sum[0] + size * sin, sum[1] + size * omega * cos, sum[2] - size * omega * omega * sin]
    })
}

/// Uniform numbers of a fixed stream, twelve of which make a normal one.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

fn answer(folder: &Path, law: Law) -> Diagnosis {
    let header = format!(
        "version = 1\nrobot = \"robot.urdf\"\njoints = [\"servo\"]\ntip_link = \"arm\"\nperiod_secs = {}\n",
        1.0 / RATE_HZ
    );
    std::fs::write(folder.join("robot.urdf"), ROBOT).unwrap();
    std::fs::write(folder.join("log.toml"), header).unwrap();
    let mut text = String::from("time_secs,joint_0_rad,joint_0_rps,joint_torque_0_nm\n");
    let mut state = 11;
    for row in 0..(SECS * RATE_HZ) as usize {
        let time = row as f64 / RATE_HZ;
        let [angle, rate, acceleration] = motion(time);
        // The file says 2 % more mass and another inertia.
        let passed = 0.98 * LOAD_NM * angle.sin() + INERTIA_KGM2 * acceleration;
        let torque = passed + law.friction(rate, passed) + 0.02 * normal(&mut state);
        let (angle, rate) = (angle + 2e-5 * normal(&mut state), rate + 2e-3 * normal(&mut state));
        let _ = writeln!(text, "{time:.4},{angle:.6},{rate:.5},{torque:.5}");
    }
    std::fs::write(folder.join("samples.csv"), text).unwrap();
    diagnose(&Log::read(folder).unwrap(), &Settings::default()).unwrap()
}

#[test]
fn the_law_that_was_put_in_is_named() {
    let plain = Law { coulomb: 0.1, viscous: 0.12, ..Law::default() };
    let both = Law { peak: 0.1, load: [0.08; 2], load_peak: [0.1; 2], ..plain };
    let directed = Law { load: [0.12, 0.03], load_peak: [0.14, 0.03], ..both };
    let laws = [
        ("joint_friction", plain),
        ("stribeck_friction", Law { peak: 0.1, ..plain }),
        ("load_friction", Law { load: [0.08; 2], ..plain }),
        ("stribeck_load_friction", both),
        ("stribeck_directional_friction", directed),
        ("quadratic_load_friction", Law { square: [0.05, 0.08], ..directed }),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, law) in laws {
        let diagnosis = answer(folder.path(), law);
        assert_eq!(diagnosis.verdict, Verdict::Effect, "{name}: {:?}", diagnosis.considered);
        let effect = &diagnosis.effects[0];
        let joint = &effect.joints[0];
        assert_eq!((effect.name, joint.form), (name, name), "{:?}", joint.kinds);
        // Speed and load are nearly alike in one swing of a weight, so that intervals are wide: they hold what was put in, or miss it by half of their width.
        for (value, truth) in joint.parameters.iter().zip([law.coulomb, law.viscous]) {
            let [low, high] = value.interval90;
            let slack = 0.5 * (high - low) + 0.01;
            assert!((low - slack..high + slack).contains(&truth), "{name}: {:?}", joint.parameters);
        }
        // The kinds side by side: fewer values never leave less on rows that were fitted, and hardly less on others.
        let left = |wanted: &str| joint.kinds.iter().find(|kind| kind.name == wanted).map(|kind| kind.heldout_rms_nm);
        let (own, plain) = (left(name).unwrap(), left("joint_friction").unwrap());
        assert!(own < 1.05 * plain, "{name}: {:?}", joint.kinds);
        assert!(name == "joint_friction" || own < 0.8 * plain, "{name}: {:?}", joint.kinds);
    }
}
