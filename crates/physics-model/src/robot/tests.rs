//! Small arms written here: what a URDF may and may not be.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::*;

/// Shoulder at 0.2 m about −y, elbow 0.5 m out about y, a finger that is locked, and a ball at the end.
const ARM: &str = r#"<robot name="small">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.25 0 0"/><mass value="2"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="finger"><collision><geometry><sphere radius="0.03"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><origin xyz="0 0 0.2"/><parent link="base"/><child link="upper"/>
    <axis xyz="0 -2 0"/><limit lower="-3" upper="3" effort="5" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><origin xyz="0.5 0 0"/><parent link="upper"/><child link="fore"/>
    <axis xyz="0 1 0"/><limit effort="5" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><origin xyz="0.3 0 0"/><parent link="fore"/><child link="finger"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.2" effort="5" velocity="1"/></joint>
</robot>"#;

fn config() -> RobotConfig {
    RobotConfig {
        name: "small".into(),
        urdf: "small.urdf".into(),
        base_link: "base".into(),
        tip_link: "fore".into(),
        tool_link: "finger".into(),
        wrist_link: "fore".into(),
        actuated_joints: vec!["shoulder".into(), "elbow".into()],
        locked_joints: BTreeMap::from([("slide".into(), 0.1)]),
        home_rad: vec![0.5, 0.5],
        tool_rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }
}

fn build(config: &RobotConfig, text: &str) -> Result<Robot, RobotError> {
    let path = Path::new("small.urdf");
    Robot::build(config, urdf_file::parse(path, text).expect("URDF"), path)
}

fn message(change: impl FnOnce(&mut RobotConfig), text: &str) -> String {
    let mut config = config();
    change(&mut config);
    build(&config, text).expect_err("an impossible arm").to_string()
}

#[test]
fn joints_about_any_axis_follow_the_closed_form() {
    let robot = build(&config(), ARM).expect("arm");
    for q in [[0.0, 0.0], [0.7, 0.2], [-1.3, 2.4_f64]] {
        let (shoulder, fore) = (q[0], q[0] - q[1]);
        let expected =
            Vector3::new(0.5 * shoulder.cos() + 0.4 * fore.cos(), 0.0, 0.2 + 0.5 * shoulder.sin() + 0.4 * fore.sin());
        let tool = robot.base_from_tool(&q);
        assert!((tool.translation.vector - expected).norm() < 1e-14, "{tool} {expected}");
        assert!(tool.rotation.angle_to(&UnitQuaternion::from_scaled_axis(Vector3::y() * -fore)) < 1e-7);
        let gravity = robot.gravity_torque(&q);
        let elbow = -9.81 * 0.2 * fore.cos();
        assert!((gravity[1] - elbow).abs() < 1e-13);
        assert!((gravity[0] - (9.81 * (2.0 * 0.25 + 0.5) * shoulder.cos() - elbow)).abs() < 1e-13);
    }
    assert_eq!(robot.tool_shapes(), [ToolShape::Ball { center_m: [0.0; 3], radius_m: 0.03 }]);
    assert!(robot.limits()[1].contains(100.0) && !robot.limits()[0].contains(3.1));
}

#[test]
fn a_push_on_the_tool_costs_the_torque_of_its_lever() {
    let robot = build(&config(), ARM).expect("arm");
    // Arm stretched along x: 10 N down at the tool, 0.9 m from the shoulder, whose axis is −y.
    let down = Vector6::new(0.0, 0.0, -10.0, 0.0, 0.0, 0.0);
    let torque = robot.contact_torque(&[0.0, 0.0], &down);
    assert!((torque[0] + 9.0).abs() < 1e-12 && (torque[1] - 4.0).abs() < 1e-12, "{torque}");
    let at = robot.contact_torque_at(&[0.0, 0.0], &Point3::new(0.8, 0.0, 0.2), &down);
    assert!((at[0] + 8.0).abs() < 1e-12 && (at[1] - 3.0).abs() < 1e-12, "{at}");
}

#[test]
fn unreachable_and_broken_targets_are_errors() {
    let robot = build(&config(), ARM).expect("arm");
    let far = Isometry3::from_parts(Translation3::new(2.0, 0.0, 0.0), UnitQuaternion::identity());
    assert!(matches!(robot.solve_ik(&[0.1, 0.1], &far), Err(IkError::NotConverged { .. })));
    assert_eq!(robot.solve_ik(&[f64::NAN, 0.1], &far), Err(IkError::NotFinite));
    let nowhere = Isometry3::from_parts(Translation3::new(f64::INFINITY, 0.0, 0.0), UnitQuaternion::identity());
    assert_eq!(robot.solve_ik(&[0.1, 0.1], &nowhere), Err(IkError::NotFinite));
}

#[test]
fn inverse_kinematics_stops_at_a_joint_limit_instead_of_leaving_it() {
    let robot = build(&config(), ARM).expect("arm");
    let start = robot.base_from_tool(&[2.9, 0.4]);
    assert_eq!(robot.solve_ik(&[2.9, 0.4], &start), Ok(vec![2.9, 0.4]), "at the target nothing moves");
    // Beyond the shoulder's limit of 3 rad; the posture 2π lower is a long way round.
    let beyond = robot.base_from_tool(&[3.1, 0.4]);
    assert!(robot.solve_ik(&[2.9, 0.4], &beyond).is_err());
    let inside = robot.base_from_tool(&[2.99, 0.6]);
    let found = robot.solve_ik(&[3.0, 0.4], &inside).expect("within the limits");
    assert!((found[0] - 2.99).abs() < 1e-5 && (found[1] - 0.6).abs() < 1e-5, "{found:?}");
}

#[test]
fn unknown_names_are_named_with_what_would_do() {
    let text = message(|c| c.actuated_joints[1] = "ellbow".into(), ARM);
    assert_eq!(
        text,
        "robot.actuated_joints has \"ellbow\": no such joint in small.urdf, expected one of elbow, shoulder, slide"
    );
    let text = message(|c| _ = c.locked_joints.insert("thumb".into(), 0.0), ARM);
    assert!(text.starts_with("robot.locked_joints has \"thumb\": no such joint"), "{text}");
    for (key, change) in [
        ("base_link", (|c: &mut RobotConfig| c.base_link = "bass".into()) as fn(&mut RobotConfig)),
        ("tip_link", |c| c.tip_link = "bass".into()),
        ("tool_link", |c| c.tool_link = "bass".into()),
        ("wrist_link", |c| c.wrist_link = "bass".into()),
    ] {
        let text = message(change, ARM);
        assert!(text.starts_with(&format!("robot.{key} = \"bass\": no such link")), "{text}");
        assert!(text.contains("fore"), "{text}");
    }
}

#[test]
fn unfit_joints_are_errors() {
    let text = message(|c| c.locked_joints.clear(), ARM);
    assert!(
        text.contains("\"slide\"") && text.contains("expected it in robot.actuated_joints, or in robot.lock"),
        "{text}"
    );
    let text = message(|c| _ = c.locked_joints.insert("slide".into(), 0.3), ARM);
    assert!(text.contains("locked at 0.3, expected 0 to 0.2"), "{text}");
    let text = message(|c| c.actuated_joints.reverse(), ARM);
    assert!(text.contains("serial chain"), "{text}");
    let text = message(|c| c.actuated_joints.truncate(1), ARM);
    assert!(text.contains("\"elbow\""), "{text}");
    let text = message(
        |c| {
            c.actuated_joints.push("slide".into());
            c.locked_joints.clear();
        },
        ARM,
    );
    assert!(text.contains("is prismatic, expected revolute or continuous"), "{text}");
    let text = message(|c| c.actuated_joints.clear(), ARM);
    assert!(text.contains("has 0 entries, expected 1 to 7 different joints"), "{text}");
}

#[test]
fn what_floats_beside_the_arm_is_left_alone_and_not_between_its_joints() {
    let cube = "<link name=\"cube\"/><link name=\"lid\"/><joint name=\"free\" type=\"floating\"><parent link=\"base\"/><child link=\"cube\"/></joint>\
                <joint name=\"hinge\" type=\"revolute\"><parent link=\"cube\"/><child link=\"lid\"/><limit upper=\"1\" velocity=\"1\"/></joint></robot>";
    let robot = build(&config(), &ARM.replace("</robot>", cube)).expect("an arm and a cube");
    assert!(robot.frame("cube").is_none() && robot.frame("lid").is_none());
    assert_eq!(robot.base_from_tool(&[0.5, 0.5]), build(&config(), ARM).unwrap().base_from_tool(&[0.5, 0.5]));
    let text = message(|c| c.locked_joints.clear(), &ARM.replace("prismatic", "floating"));
    assert!(text.contains("\"slide\" of small.urdf: is floating, expected fixed, revolute"), "{text}");
    let text = message(|_| (), &ARM.replace("\"revolute\"", "\"planar\""));
    assert!(text.contains("\"shoulder\" of small.urdf: is planar, expected revolute or continuous"), "{text}");
}

#[test]
fn impossible_values_are_errors() {
    for (from, to, says) in [
        ("<mass value=\"1\"/>", "<mass value=\"0\"/>", "no mass"),
        ("<mass value=\"1\"/>", "<mass value=\"-1\"/>", "mass -1 kg, expected 0 to 1000000"),
        ("izz=\"0.1\"", "izz=\"-0.1\"", "not positive definite"),
        ("axis xyz=\"0 1 0\"", "axis xyz=\"0 0 0\"", "expected a direction"),
        ("lower=\"-3\"", "lower=\"4\"", "expected lower below upper"),
        ("<child link=\"fore\"/>", "<child link=\"four\"/>", "does not exist"),
        ("<child link=\"fore\"/>", "<child link=\"upper\"/>", "two parent joints"),
        ("<sphere radius=\"0.03\"/>", "<box size=\"1 1 1\"/>", "box or a mesh"),
        ("<collision><geometry><sphere radius=\"0.03\"/></geometry></collision>", "", "a tool that can touch"),
    ] {
        assert!(ARM.contains(from), "{from}");
        let text = message(|_| (), &ARM.replace(from, to));
        assert!(text.contains(says) && text.contains("small.urdf"), "{says}: {text}");
    }
    assert!(message(|c| c.home_rad[0] = 3.5, ARM).contains("home_rad[0] of \"small\" is 3.5, expected -3 to 3 rad"));
    assert!(message(|c| c.home_rad.truncate(1), ARM).contains("home_rad of \"small\" has 1 entries, expected 2"));
    assert!(message(|c| c.tool_rotation[0][0] = -1.0, ARM).contains("tool_rotation"));
    assert!(message(|c| c.tool_rotation[0][0] = f64::NAN, ARM).contains("tool_rotation"));
    assert!(message(|c| c.tool_link = "upper".into(), ARM).contains("expected a link that moves with \"elbow\""));
}

fn sawyer() -> Robot {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let config = RobotConfig {
        name: "sawyer".into(),
        urdf: "assets/robots/sawyer.urdf".into(),
        base_link: "right_arm_base_link".into(),
        tip_link: "right_hand".into(),
        tool_link: "tool_center".into(),
        wrist_link: "right_hand".into(),
        actuated_joints: (0..7).map(|j| format!("right_j{j}")).collect(),
        locked_joints: BTreeMap::from([("head_pan".into(), 0.0)]),
        home_rad: vec![-0.3222, -0.7935, 0.0381, 1.9327, -0.0638, 0.4328, 3.079],
        tool_rotation: [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]],
    };
    Robot::load(&config, &root).expect("sawyer")
}

#[test]
fn the_other_joints_make_up_for_one_at_its_limit() {
    let mut robot = sawyer();
    let home = robot.home_rad.clone();
    robot.limits[0].lower_rad = home[0] - 0.05;
    robot.limits[0].upper_rad = home[0] + 0.05;
    for x in -4..=4 {
        for y in -4..=4 {
            let mut target = robot.base_from_tool(&home);
            target.translation.vector += Vector3::new(0.02 * f64::from(x), 0.04 * f64::from(y), 0.0);
            let q = robot.solve_ik(&home, &target).unwrap_or_else(|e| panic!("{x} {y}: {e}"));
            assert!(robot.limits.iter().zip(&q).all(|(limit, value)| limit.contains(*value)), "{x} {y}: {q:?}");
        }
    }
}

#[test]
fn posture_of_a_redundant_arm_does_not_drift_in_circles() {
    let robot = sawyer();
    let home = robot.base_from_tool(&robot.home_rad);
    let drift = |home_pull| {
        let options = IkOptions { home_pull, ..IkOptions::default() };
        let mut q = robot.home_rad.clone();
        for side in 0..80 {
            let (dx, dy) = [(0.0, 0.02), (0.02, 0.0), (0.0, -0.02), (-0.02, 0.0)][side % 4];
            for _ in 0..5 {
                let mut target = robot.base_from_tool(&q);
                target.rotation = home.rotation;
                target.translation.vector += Vector3::new(dx, dy, 0.0);
                q = robot.solve_ik_with(&q, &target, &options).expect("within reach");
            }
        }
        assert!((robot.base_from_tool(&q).translation.vector - home.translation.vector).norm() < 5e-5);
        q.iter().zip(&robot.home_rad).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (with, without) = (drift(IkOptions::default().home_pull), drift(0.0));
    assert!(with < 0.01 && without > 0.1, "{with} rad with the pull, {without} rad without");
}
