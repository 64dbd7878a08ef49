//! Both arms against reference vectors of pinocchio 4.1.0, and inverse kinematics over their published workspaces.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};
use physics_model::robot::{FrameId, Robot, RobotConfig, RobotError, ToolShape};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The `[robot]` table of the shipped scenario.
fn config(name: &str) -> RobotConfig {
    let file = root().join(format!("scenarios/robots/{name}.toml"));
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut table: toml::Table = toml::from_str(&text).expect("TOML");
    table.remove("robot").expect("[robot]").try_into().expect("robot configuration")
}

fn load(name: &str) -> Robot {
    Robot::load(&config(name), &root()).unwrap_or_else(|e| panic!("{e}"))
}

struct Reference {
    q: Vec<f64>,
    position: Vector3<f64>,
    orientation: UnitQuaternion<f64>,
    jacobian: DMatrix<f64>,
    gravity: Vec<f64>,
    mass: DMatrix<f64>,
}

fn references(name: &str, joints: usize) -> Vec<Reference> {
    let file = format!("{}/tests/data/{name}_reference.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(file).expect("reference vectors");
    let rows = text.lines().skip(1).map(|line| {
        let values: Vec<f64> = line.split(',').skip(1).map(|v| v.parse().expect("number")).collect();
        let mut rest = values.as_slice();
        let mut take = |n: usize| {
            let (head, tail) = rest.split_at(n);
            rest = tail;
            head.to_vec()
        };
        let q = take(joints);
        let position = Vector3::from_column_slice(&take(3));
        let r = take(4);
        let orientation = UnitQuaternion::from_quaternion(Quaternion::new(r[3], r[0], r[1], r[2]));
        let jacobian = DMatrix::from_row_slice(6, joints, &take(6 * joints));
        let gravity = take(joints);
        let upper = take(joints * (joints + 1) / 2);
        assert!(rest.is_empty(), "{} values too many", rest.len());
        let mut mass = DMatrix::zeros(joints, joints);
        let mut next = upper.into_iter();
        for row in 0..joints {
            for column in row..joints {
                mass[(row, column)] = next.next().expect("value");
                mass[(column, row)] = mass[(row, column)];
            }
        }
        Reference { q, position, orientation, jacobian, gravity, mass }
    });
    rows.collect()
}

/// Largest deviations over all vectors: position, orientation, Jacobian, gravity torque, mass matrix.
fn deviations(name: &str) -> [f64; 5] {
    let robot = load(name);
    let n = robot.joint_count();
    let references = references(name, n);
    assert_eq!(references.len(), 25);
    let mut worst = [0.0_f64; 5];
    for reference in &references {
        let pose = robot.base_from_tip(&reference.q);
        let turn =
            (pose.rotation.to_rotation_matrix().matrix() - reference.orientation.to_rotation_matrix().matrix()).amax();
        let jacobian = robot.jacobian(&reference.q, robot.tip());
        let gravity = robot.gravity_torque(&reference.q);
        let mass = robot.mass_matrix(&reference.q);
        let found = [
            (pose.translation.vector - reference.position).amax(),
            turn,
            (jacobian.columns(0, n) - &reference.jacobian).amax(),
            (0..n).map(|j| (gravity[j] - reference.gravity[j]).abs()).fold(0.0, f64::max),
            (mass.view((0, 0), (n, n)) - &reference.mass).amax(),
        ];
        for (worst, found) in worst.iter_mut().zip(found) {
            assert!(found.is_finite());
            *worst = worst.max(found);
        }
    }
    worst
}

#[test]
fn sawyer_agrees_with_its_reference_vectors() {
    let worst = deviations("sawyer");
    println!("sawyer {worst:?}");
    assert!(worst.iter().zip([1e-12, 1e-12, 1e-12, 1e-6, 1e-6]).all(|(w, limit)| *w < limit), "{worst:?}");
}

#[test]
fn jaco_agrees_with_its_reference_vectors() {
    let worst = deviations("jaco");
    println!("jaco {worst:?}");
    assert!(worst.iter().zip([1e-12, 1e-12, 1e-12, 1e-10, 1e-10]).all(|(w, limit)| *w < limit), "{worst:?}");
}

#[test]
fn jacobian_of_the_tool_agrees_with_finite_differences() {
    let step = 1e-6;
    for name in ["sawyer", "jaco"] {
        let robot = load(name);
        for reference in references(name, robot.joint_count()) {
            let jacobian = robot.jacobian(&reference.q, robot.tool());
            for j in 0..robot.joint_count() {
                let at = |sign: f64| {
                    let mut q = reference.q.clone();
                    q[j] += sign * step;
                    robot.base_from_tool(&q)
                };
                let (low, high) = (at(-1.0), at(1.0));
                let linear = (high.translation.vector - low.translation.vector) / (2.0 * step);
                let angular = (high.rotation * low.rotation.inverse()).scaled_axis() / (2.0 * step);
                let found = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
                assert!((jacobian.column(j) - found).amax() < 1e-8, "{name} joint {j}");
            }
        }
    }
}

#[test]
fn gravity_torque_is_the_slope_of_potential_energy() {
    let step = 1e-5;
    for name in ["sawyer", "jaco"] {
        let robot = load(name);
        for reference in references(name, robot.joint_count()) {
            let gravity = robot.gravity_torque(&reference.q);
            for j in 0..robot.joint_count() {
                let at = |sign: f64| {
                    let mut q = reference.q.clone();
                    q[j] += sign * step;
                    robot.potential_energy(&q)
                };
                let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
                assert!((gravity[j] - slope).abs() < 1e-7, "{name} joint {j}: {} {slope}", gravity[j]);
            }
        }
    }
}

#[test]
fn contact_torque_of_a_shifted_wrench_is_that_of_the_tool() {
    for name in ["sawyer", "jaco"] {
        let robot = load(name);
        let q = robot.home_rad();
        let tool = robot.base_from_tool(q).translation.vector;
        let (force, torque) = (Vector3::new(12.0, -7.0, 3.0), Vector3::new(0.3, 0.8, -0.4));
        let point = tool + Vector3::new(0.02, -0.01, 0.015);
        let moved = torque + (point - tool).cross(&force);
        let at_tool = robot.contact_torque(q, &Vector6::new(force.x, force.y, force.z, moved.x, moved.y, moved.z));
        let wrench = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
        let at_point = robot.contact_torque_at(q, &point.into(), &wrench);
        assert!((at_tool - at_point).amax() < 1e-12);
        assert!(at_tool.amax() > 1.0);
    }
}

/// The rectangle of `[workspace]` in the robot facts: x and y range and height of the tool, m, base frame.
struct Workspace {
    x: [f64; 2],
    y: [f64; 2],
    z: f64,
}

fn workspace(name: &str) -> Workspace {
    match name {
        "sawyer" => Workspace { x: [0.33, 0.73], y: [-0.5, 0.5], z: -0.05 },
        _ => Workspace { x: [0.35, 0.57], y: [-0.38, 0.38], z: 0.05 },
    }
}

fn target(robot: &Robot, position: [f64; 3]) -> Isometry3<f64> {
    let r = robot.tool_rotation();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| r[i][j]));
    let position = Vector3::from(position);
    Isometry3::from_parts(Translation3::from(position), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn assert_solved(robot: &Robot, q: &[f64], target: &Isometry3<f64>) {
    let found = robot.base_from_tool(q);
    let distance = (found.translation.vector - target.translation.vector).norm();
    // Not angle_to, whose acos is blind below 1e-8.
    let angle = (found.rotation * target.rotation.inverse()).scaled_axis().norm();
    assert!(distance < 1e-5 && angle < 1e-4, "{distance} m, {angle} rad");
    for (limit, value) in robot.limits().iter().zip(q) {
        assert!(limit.contains(*value), "{value} outside {limit:?}");
    }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Points of a 1 cm raster, each row in the opposite direction of the last.
fn raster(name: &str) -> Vec<[f64; 3]> {
    let Workspace { x, y, z } = workspace(name);
    let count = |range: [f64; 2]| ((range[1] - range[0]) / 0.01).round() as usize;
    let mut points = Vec::new();
    for row in 0..=count(x) {
        for column in 0..=count(y) {
            let column = if row % 2 == 0 { column } else { count(y) - column };
            points.push([x[0] + 0.01 * row as f64, y[0] + 0.01 * column as f64, z]);
        }
    }
    points
}

fn every_point_is_solved(name: &str, points: usize) {
    let robot = load(name);
    let raster = raster(name);
    assert_eq!(raster.len(), points, "as many as the published grid");
    let mut warm = robot.solve_ik(robot.home_rad(), &target(&robot, raster[0])).expect("first point");
    let (mut largest_step, mut largest_branch) = (0.0_f64, 0.0_f64);
    for point in &raster {
        let target = target(&robot, *point);
        let cold = robot.solve_ik(robot.home_rad(), &target).unwrap_or_else(|e| panic!("{name} cold {point:?}: {e}"));
        let next = robot.solve_ik(&warm, &target).unwrap_or_else(|e| panic!("{name} warm {point:?}: {e}"));
        assert_solved(&robot, &cold, &target);
        assert_solved(&robot, &next, &target);
        largest_step = largest_step.max(largest_difference(&warm, &next));
        largest_branch = largest_branch.max(largest_difference(&cold, &next));
        warm = next;
    }
    println!(
        "{name}: largest joint step per cm {largest_step:.3} rad, warm and cold differ by {largest_branch:.3} rad"
    );
    // The facts give 0.16 and 0.095 rad for neighbours; more would be a change of branch.
    assert!(largest_step < 0.25, "{largest_step}");
    assert!(largest_branch < 1.0, "{largest_branch}");
}

#[test]
fn sawyer_reaches_every_point_of_its_workspace() {
    every_point_is_solved("sawyer", 4141);
}

#[test]
fn jaco_reaches_every_point_of_its_workspace() {
    every_point_is_solved("jaco", 1771);
}

/// Straight chains of 2 cm moves through the middle of the workspace, up to its border and back, plus one move up and down.
#[test]
fn chains_of_moves_arrive_and_come_back() {
    for name in ["sawyer", "jaco"] {
        let robot = load(name);
        let Workspace { x, y, z } = workspace(name);
        let middle = [(x[0] + x[1]) / 2.0, (y[0] + y[1]) / 2.0, z];
        let start = robot.solve_ik(robot.home_rad(), &target(&robot, middle)).expect("middle");
        let mut drift = 0.0_f64;
        for direction in 0..8 {
            let (sin, cos) = (f64::from(direction) * std::f64::consts::FRAC_PI_4).sin_cos();
            let mut way = Vec::new();
            loop {
                let length = 0.02 * (way.len() + 1) as f64;
                let point = [middle[0] + length * cos, middle[1] + length * sin, z];
                if point[0] < x[0] || point[0] > x[1] || point[1] < y[0] || point[1] > y[1] {
                    break;
                }
                way.push(point);
            }
            assert!(way.len() >= 5, "{name} {direction}");
            let back: Vec<[f64; 3]> = way.iter().rev().skip(1).copied().chain([middle]).collect();
            let hop = [[middle[0], middle[1], z + 0.02], middle];
            let mut q = start.clone();
            for point in way.into_iter().chain(back).chain(hop) {
                let target = target(&robot, point);
                let next = robot.solve_ik(&q, &target).unwrap_or_else(|e| panic!("{name} {point:?}: {e}"));
                assert_solved(&robot, &next, &target);
                assert!(largest_difference(&q, &next) < 0.4, "{name} {point:?}: {q:?} {next:?}");
                q = next;
            }
            drift = drift.max(largest_difference(&q, &start));
        }
        println!("{name}: posture after the way there and back differs by {drift:.4} rad");
        assert!(drift < if robot.joint_count() > 6 { 0.2 } else { 1e-4 }, "{name} {drift}");
    }
}

fn frame(robot: &Robot, name: &str) -> FrameId {
    robot.frame(name).unwrap_or_else(|| panic!("{name}"))
}

#[test]
fn sawyer_touches_with_its_ball_and_stem() {
    let robot = load("sawyer");
    let [ToolShape::Capsule { a_m, b_m, radius_m }, ToolShape::Ball { center_m, radius_m: ball }] = robot.tool_shapes()
    else {
        panic!("{:?}", robot.tool_shapes())
    };
    assert_eq!((*center_m, *ball, *radius_m), ([0.0; 3], 0.025, 0.012));
    let ends = [a_m[2], b_m[2]];
    assert!((ends[0] + 0.138).abs() < 1e-12 && ends[1].abs() < 1e-12, "{ends:?}");
    let q = robot.home_rad();
    let wrist_from_tool = robot.base_from_link(q, frame(&robot, "right_hand")).inv_mul(&robot.base_from_tool(q));
    assert!((wrist_from_tool.translation.vector - Vector3::new(0.0, 0.0, 0.15)).norm() < 1e-12);
    assert_eq!(robot.base_from_wrist(q), robot.base_from_link(q, frame(&robot, "right_hand")));
}

#[test]
fn jaco_touches_with_its_hand_and_open_fingers() {
    let robot = load("jaco");
    let shapes = robot.tool_shapes();
    assert_eq!(shapes.len(), 7, "hand, three fingers, three finger tips: {shapes:?}");
    let mut lowest = f64::NEG_INFINITY;
    let mut widest = 0.0_f64;
    for shape in shapes {
        let ToolShape::Capsule { a_m, b_m, radius_m } = shape else { panic!("{shape:?}") };
        for end in [a_m, b_m] {
            lowest = lowest.max(end[2] + radius_m);
            widest = widest.max(end[0].hypot(end[1]) + radius_m);
        }
    }
    // The facts: fingers open to 0.097 m, lowest mesh 0.0164 m beyond the controlled point; capsules envelop them.
    assert!((0.0164..0.03).contains(&lowest), "{lowest}");
    assert!((0.09..0.115).contains(&widest), "{widest}");
}

#[test]
fn missing_urdf_and_unknown_joint_say_where_and_what() {
    let mut config = config("sawyer");
    config.actuated_joints[3] = "right_j33".into();
    let text = Robot::load(&config, &root()).expect_err("unknown joint").to_string();
    assert!(text.contains("robot.actuated_joints has \"right_j33\"") && text.contains("sawyer.urdf"), "{text}");
    config.urdf = "assets/robots/sawyer.toml".into();
    let error = Robot::load(&config, &root()).expect_err("missing file");
    assert!(matches!(error, RobotError::Read { .. }), "{error:?}");
    assert!(error.to_string().contains("sawyer.toml"), "{error}");
    config.urdf = "Cargo.toml".into();
    assert!(matches!(Robot::load(&config, &root()), Err(RobotError::Parse { .. })));
}

#[test]
fn numbers_that_no_arm_has_are_refused() {
    let text = std::fs::read_to_string(root().join("assets/robots/sawyer.urdf")).expect("URDF");
    let folder = std::env::temp_dir().join(format!("surmise-arms-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("folder");
    let file = folder.join("arm.urdf");
    let config = RobotConfig { urdf: file.clone(), ..config("sawyer") };
    // The first value of each that belongs to a joint or link of the arm.
    for (from, to) in [
        ("<mass value=\"5.3213\"", "<mass value=\"1e308\""),
        ("ixx=\"0.053314\"", "ixx=\"1e300\""),
        ("<axis xyz=\"0 0 1.0\"", "<axis xyz=\"0 0 1e308\""),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&file, text.replace(from, to)).expect("file");
        let message = Robot::load(&config, &root()).expect_err(to).to_string();
        assert!(message.contains("arm.urdf") && message.contains("expected"), "{message}");
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}

#[test]
fn inverse_dynamics_agree_with_pinocchio() {
    // Sawyer's URDF leaves out three helper links of 1e-8 kg and Pinocchio reads it as given: nothing to tolerate but rounding.
    for name in ["sawyer", "jaco"] {
        let robot = load(name);
        let n = robot.joint_count();
        let file = format!("{}/tests/data/{name}_dynamics.csv", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(file).expect("reference vectors");
        let rows: Vec<Vec<f64>> =
            text.lines().skip(2).map(|line| line.split(',').map(|v| v.parse().expect("number")).collect()).collect();
        assert_eq!(rows.len(), 25);
        for row in rows {
            let torque = robot.inverse_dynamics(&row[..n], &row[n..2 * n], &row[2 * n..3 * n]);
            for (ours, theirs) in torque.iter().zip(&row[3 * n..]) {
                assert!((ours - theirs).abs() < 1e-9 * (1.0 + theirs.abs()), "{name}: {ours} and {theirs}");
            }
        }
    }
}

#[test]
fn inverse_dynamics_at_rest_are_gravity_and_the_mass_matrix() {
    for name in ["sawyer", "jaco"] {
        let robot = load(name);
        let n = robot.joint_count();
        for reference in references(name, n) {
            let zero = vec![0.0; n];
            let gravity = robot.inverse_dynamics(&reference.q, &zero, &zero);
            for j in 0..n {
                let mut unit = zero.clone();
                unit[j] = 1.0;
                let torque = robot.inverse_dynamics(&reference.q, &zero, &unit) - gravity;
                for i in 0..n {
                    assert!((gravity[i] - reference.gravity[i]).abs() < 1e-6);
                    assert!((torque[i] - reference.mass[(i, j)]).abs() < 1e-6, "{name}: M[{i}, {j}]");
                }
            }
        }
    }
}
