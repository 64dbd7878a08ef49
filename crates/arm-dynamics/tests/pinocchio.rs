//! Poses and torques of a drawn arm against Pinocchio's: `tests/peers/arms/pinocchio_arm.py make`.

use std::path::Path;

use arm_dynamics::{Arm, GRAVITY, Mass, Selection};

const TOLERANCE: f64 = 1e-9;

fn arm() -> Arm {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/arm.urdf");
    let joints = (0..8).map(|i| format!("joint{i}")).collect();
    Arm::load(&path, &Selection { joints: Some(joints), tip: Some("flange".into()) }).unwrap()
}

/// Rows of 8 positions, rates, accelerations and torques, then place and quaternion of the flange.
fn reference() -> Vec<Vec<f64>> {
    let rows = include_str!("data/reference.csv").lines().skip(1);
    rows.map(|row| row.split(',').map(|value| value.parse().unwrap()).collect()).collect()
}

#[test]
fn torques_and_poses_are_those_of_pinocchio() {
    let arm = arm();
    assert!(arm.joints()[2].slides && arm.joints()[5].upper.is_infinite());
    assert!(arm.notes().iter().any(|note| note.contains("grip")), "{:?}", arm.notes());
    let rows = reference();
    assert_eq!(rows.len(), 20);
    for row in rows {
        let (q, rate, acceleration, torque) = (&row[..8], &row[8..16], &row[16..24], &row[24..32]);
        let found = arm.inverse_dynamics(q, rate, acceleration, &GRAVITY);
        for (found, expected) in found.iter().zip(torque) {
            assert!((found - expected).abs() < TOLERANCE, "{found} {expected}");
        }
        let pose = arm.base_from_tip(q);
        assert!((pose.translation.vector - nalgebra::Vector3::from_row_slice(&row[32..35])).amax() < TOLERANCE);
        let turn = nalgebra::Vector4::from_row_slice(&row[35..]);
        assert!((pose.rotation.coords - turn).amax().min((pose.rotation.coords + turn).amax()) < TOLERANCE);
    }
}

#[test]
fn torques_are_linear_in_the_ten_numbers_of_each_mass() {
    let arm = arm();
    for row in reference() {
        let motion = arm.motion(&row[..8], &row[8..16], &row[16..24], &GRAVITY);
        let whole = motion.torques();
        let mut sum = [0.0; arm_dynamics::MOST_JOINTS];
        for (link, mass) in arm.masses().enumerate() {
            for (column, number) in motion.regressor(link).iter().zip(mass.numbers()) {
                sum.iter_mut().zip(column).for_each(|(sum, torque)| *sum += torque * number);
            }
        }
        for (sum, whole) in sum.iter().zip(&whole) {
            assert!((sum - whole).abs() < TOLERANCE * whole.abs().max(1.0), "{sum} {whole}");
        }
    }
    // Twice all masses, twice all torques.
    let masses: Vec<Mass> = arm.masses().map(|mass| mass.joined(mass)).collect();
    let (q, zero) = (vec![0.3; 8], vec![0.0; 8]);
    let [once, twice] = [&arm, &arm.with_masses(&masses)].map(|arm| arm.inverse_dynamics(&q, &zero, &zero, &GRAVITY));
    once.iter().zip(&twice).for_each(|(once, twice)| assert!((2.0 * once - twice).abs() < TOLERANCE));
}

#[test]
fn the_longest_chain_is_the_arm_and_what_cannot_be_one_is_refused_in_a_sentence() {
    let refused = |text: &str, selection: &Selection| {
        let path = Path::new("arm.urdf");
        let urdf = urdf_file::parse(path, text).unwrap();
        Arm::new(&urdf, path, selection).unwrap_err().to_string()
    };
    let link = |name: &str| format!("<link name=\"{name}\"/>");
    let joint = |name: &str, kind: &str, parent: &str, child: &str| {
        format!("<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>")
    };
    let robot = |parts: &[String]| format!("<robot name=\"r\">{}</robot>", parts.concat());
    let two = robot(&[
        link("a"),
        link("b"),
        link("c"),
        joint("left", "continuous", "a", "b"),
        joint("right", "continuous", "a", "c"),
    ]);
    assert!(refused(&two, &Selection::default()).contains("name the joints of the arm"));
    let joints =
        |names: &[&str]| Selection { joints: Some(names.iter().map(ToString::to_string).collect()), tip: None };
    assert!(refused(&two, &joints(&["left", "right"])).contains("expected a serial chain"));
    assert!(refused(&two, &joints(&["middle"])).contains("no such joint, expected some of left, right"));
    let roots = robot(&[link("a"), link("b")]);
    assert!(refused(&roots, &Selection::default()).contains("expected one root link, found 2: a, b"));
    let circle = robot(&[link("a"), link("b"), joint("one", "fixed", "a", "b"), joint("two", "fixed", "b", "a")]);
    assert!(refused(&circle, &Selection::default()).contains("loop"));
    assert!(refused("<robot name=\"r\"/>", &Selection::default()).contains("no links"));
    for (limit, expected) in [
        ("lower=\"1\" upper=\"-1\"", "limit is 1 to -1, expected lower below upper"),
        ("lower=\"-1\" upper=\"1\" velocity=\"-2\"", "limit of velocity is -2, expected a number of at least 0"),
        ("lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"-2\"", "limit of effort is -2, expected a number"),
    ] {
        let limited = joint("one", "revolute", "a", "b").replace("</joint>", &format!("<limit {limit}/></joint>"));
        let message = refused(&robot(&[link("a"), link("b"), limited]), &Selection::default());
        assert!(message.contains(expected), "{message}");
    }
    let tip = Selection { joints: Some(vec!["left".into()]), tip: Some("c".into()) };
    assert!(refused(&two, &tip).contains("tip_link = \"c\": expected a link that moves with \"left\""));
}
