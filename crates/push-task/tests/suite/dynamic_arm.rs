//! The dynamic arm: free motion, compliance, pushing, blocked pushes, determinism. Its inertia is tested beside its code.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3, Vector6};
use physics_model::config::{ArmConfig, ObstacleMobility, ServoConfig};
use physics_model::motion::minimum_jerk;
use physics_model::robot::{IkOptions, Robot};
use physics_model::world::{ToolPose, World, Wrench};
use physics_model::{BodyState, ObjectShape, ObstacleTheta, Theta};
use pomdp::{Outcome, Purpose, Seed};
use proptest::prelude::*;
use push_task::{Action, Particle, PushConfig, PushModel};

const ARMS: [&str; 2] = ["sawyer", "jaco"];
/// The gains that `scenarios/base.toml` names.
const SERVO: ServoConfig = ServoConfig { stiffness_nmprad: 5000.0, damping_ratio: 1.0 };
const PLUS_Y: Action = Action::ALL[2];

fn setup(name: &str, arm: ArmConfig) -> PushModel {
    let (plain, _) = crate::support::model(name, ObstacleMobility::Fixed);
    PushModel::new(PushConfig { arm, ..plain.config().clone() }, Arc::new(plain.robot().clone()))
}

fn dynamic(name: &str) -> PushModel {
    setup(name, ArmConfig::Dynamic(SERVO))
}

fn start(model: &PushModel) -> Vec<f64> {
    model.joints_for(model.robot().home_rad(), model.config().task.tool_start_m).unwrap()
}

fn with_obstacle(mut particle: Particle, beyond_object_m: f64) -> Particle {
    let mut position = particle.state.object.position_m;
    position[1] += beyond_object_m;
    particle.theta.obstacle = Some(ObstacleTheta { shape: ObjectShape::Box, mass_kg: 1.0, size_m: [0.08, 0.08, 0.1] });
    particle.state.obstacle = Some(BodyState::at_rest(position, 0.0));
    particle
}

fn tool_rotation(robot: &Robot) -> UnitQuaternion<f64> {
    let r = robot.tool_rotation();
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| r[i][j])))
}

fn world<'a>(model: &'a PushModel, servo: &ServoConfig, particle: &Particle) -> World<'a> {
    let joints = &particle.state.joints_rad;
    let at = model.robot().base_from_tool(joints);
    let q = at.rotation;
    let tool = ToolPose { position_m: at.translation.vector.into(), orientation: [q.i, q.j, q.k, q.w] };
    let (object, obstacle) = (&particle.state.object, particle.state.obstacle.as_ref());
    World::restore(&model.config().world, &[], &particle.theta, object, obstacle, &tool, model.robot().tool_shapes())
        .with_dynamic_arm(model.robot(), servo, joints)
}

fn model_tool(model: &PushModel, particle: &Particle) -> [f64; 3] {
    model.tool_position_m(&particle.state.joints_rad)
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Joints that bring the tool to `position_m` in its usual orientation, close to `seed_rad`.
fn joints_near(robot: &Robot, seed_rad: &[f64], position_m: Vector3<f64>) -> Vec<f64> {
    let options = IkOptions { home_pull: 0.0, ..IkOptions::default() };
    let target = Isometry3::from_parts(position_m.into(), tool_rotation(robot));
    robot.solve_ik_with(seed_rad, &target, &options).unwrap()
}

#[test]
fn free_motion_follows_the_minimum_jerk_path() {
    for name in ARMS {
        let model = dynamic(name);
        let robot = model.robot();
        let reach = &model.config().task.reach;
        let (mut worst, mut worst_end, mut squares, mut count) = (0.0_f64, 0.0_f64, 0.0, 0);
        let share = |[low, high]: [f64; 2], share: f64| low + 0.02 + share * (high - low - 0.04);
        for place in 0..27 {
            let at = |digit: u32| f64::from(place / 3_u32.pow(digit) % 3) / 2.0;
            let from = [share(reach.x_m, at(0)), share(reach.y_m, at(1)), share(reach.z_m, at(2))];
            let Some(joints) = model.joints_for(&start(&model), from) else { continue };
            // Far from everything.
            let particle = crate::support::particle_ahead(&model, &joints, 3.0);
            let from = Vector3::from(model.tool_position_m(&joints));
            for action in Action::ALL {
                let mut world = world(&model, &SERVO, &particle);
                let mut commanded = joints.clone();
                for step in 1..=20 {
                    let way = 0.02 * minimum_jerk(f64::from(step) / 20.0);
                    let target = from + Vector3::from(action.direction()) * way;
                    commanded = joints_near(robot, &commanded, target);
                    assert_eq!(world.step_arm(&commanded), Wrench::default(), "{name}: touches nothing");
                    let arm = world.arm_joints_rad().unwrap();
                    let error = (Vector3::from(model.tool_position_m(&arm)) - target).norm();
                    let shown = Vector3::from(world.tool_position_m());
                    assert!((shown - Vector3::from(model.tool_position_m(&arm))).norm() < 2e-6, "one tool, one place");
                    (worst, squares, count) = (worst.max(error), squares + error * error, count + 1);
                    if step == 20 {
                        worst_end = worst_end.max(error);
                    }
                }
            }
        }
        let rms = (squares / f64::from(count)).sqrt();
        assert!(count >= 20 * 200, "{name}: {count} steps");
        assert!(worst < 4e-4 && rms < 1e-4 && worst_end < 1e-4, "{name}: {worst}, {rms} and {worst_end} m");
    }
}

/// Presses the tool `depth_m` into a fixed obstacle along +y and holds; the wrench, and how far the tool (m) stays behind its command.
fn press(model: &PushModel, servo: &ServoConfig, depth_m: f64) -> (Wrench, Vector3<f64>, Vec<f64>) {
    let robot = model.robot();
    let joints = start(model);
    // The leading point of the tool along +y touches the obstacle's face.
    let reach = if robot.name() == "sawyer" { 0.025 } else { 0.0965 };
    let mut particle = with_obstacle(crate::support::particle_ahead(model, &joints, 3.0), 0.0);
    let tool = model.tool_position_m(&joints);
    let table = model.config().world.table_height_m;
    particle.state.obstacle = Some(BodyState::at_rest([tool[0], tool[1] + reach + 0.04, table + 0.05], 0.0));
    let mut world = world(model, servo, &particle);
    let mut commanded = joints.clone();
    let mut target = Vector3::from(tool);
    let mut wrench = Wrench::default();
    for step in 1..=120 {
        target.y = tool[1] + depth_m * minimum_jerk(f64::from(step) / 60.0);
        commanded = joints_near(robot, &commanded, target);
        wrench = world.step_arm(&commanded);
    }
    let arm = world.arm_joints_rad().unwrap();
    (wrench, Vector3::from(model.tool_position_m(&arm)) - target, arm)
}

#[test]
fn a_pressed_tool_gives_way_as_the_joint_stiffness_says() {
    for name in ARMS {
        let model = dynamic(name);
        for (stiffness, depths) in [(5000.0, [0.002, 0.004]), (1000.0, [0.003, 0.006])] {
            let servo = ServoConfig { stiffness_nmprad: stiffness, ..SERVO };
            let mut forces = [0.0; 2];
            for (force, depth) in forces.iter_mut().zip(depths) {
                let (wrench, deflection, joints) = press(&model, &servo, depth);
                let jacobian = model.robot().jacobian(&joints, model.robot().tool());
                let [fx, fy, fz] = wrench.force_n;
                let [tx, ty, tz] = wrench.torque_nm;
                // K_cart⁻¹ = J K⁻¹ Jᵀ.
                let expected = jacobian * jacobian.tr_mul(&Vector6::new(fx, fy, fz, tx, ty, tz)) / stiffness;
                let expected = expected.fixed_rows::<3>(0);
                assert!(fy < -1.0, "{name}: {fy} N");
                assert!((deflection - expected).norm() < 0.01 * expected.norm(), "{name}: {deflection} and {expected}");
                *force = fy;
            }
            // The contact itself gives way a little too, the same share for both.
            let ratio = forces[1] / forces[0];
            assert!((ratio / 2.0 - 1.0).abs() < 0.1, "{name}: twice the depth, {ratio} times the force");
        }
    }
}

#[test]
fn a_push_of_two_newtons_is_that_of_the_kinematic_arm() {
    for name in ARMS {
        let (truth, plain) = (dynamic(name), setup(name, ArmConfig::Kinematic));
        let joints = start(&truth);
        let ahead = if name == "sawyer" { 0.075 } else { 0.16 };
        let (mut a, mut b) = (
            crate::support::particle_ahead(&truth, &joints, ahead),
            crate::support::particle_ahead(&plain, &joints, ahead),
        );
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for action in 1..=5 {
            truth.act(&mut a, PLUS_Y, &mut rng);
            plain.act(&mut b, PLUS_Y, &mut rng);
            let apart = distance(&a.state.object.position_m, &b.state.object.position_m);
            // An action starts where the arm has been bent to, so that its deflections add up.
            assert!(apart < 4e-4 * f64::from(action), "{name}, action {action}: objects {apart} m apart");
            let behind = model_tool(&plain, &b)[1] - model_tool(&truth, &a)[1];
            assert!(
                (0.0..3e-4 * f64::from(action)).contains(&behind),
                "{name}, action {action}: tool {behind} m behind"
            );
            let free = truth.initial_observation(&mut a.clone(), &mut rng);
            let free = truth.measured_force(&free);
            let push = |force: &[f64; 6]| distance(&[force[0], force[1], force[2]], &[free[0], free[1], free[2]]);
            let (ours, theirs) = (push(&a.force), push(&b.force));
            assert!(
                (ours - theirs).abs() < 0.1 * theirs.max(1.0),
                "{name}, action {action}: {:?} and {:?}",
                a.force,
                b.force
            );
        }
    }
}

#[test]
fn a_blocked_push_is_a_large_force_and_stops_the_arm() {
    for name in ARMS {
        let model = dynamic(name);
        let joints = start(&model);
        let ahead = if name == "sawyer" { 0.075 } else { 0.16 };
        let mut particle = with_obstacle(crate::support::particle_ahead(&model, &joints, ahead), 0.1);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let (mut large, mut advance) = (0, 0.0);
        for _ in 0..8 {
            let before = model_tool(&model, &particle);
            let (step, report) = model.act(&mut particle, PLUS_Y, &mut rng);
            assert_eq!(step.outcome, Outcome::Continue, "{name}");
            assert!(step.observation.0.iter().all(|v| v.is_finite()), "{name}: {step:?}");
            large += i32::from(report.events.large_force);
            advance = model_tool(&model, &particle)[1] - before[1];
            if report.events.large_force {
                assert!(report.obstacle_touched && advance < 0.0195, "{name}: {advance} m");
            }
        }
        // Once it stands at the obstacle it is stopped every time and goes nowhere.
        assert!(large >= 4 && advance.abs() < 2e-3, "{name}: {large} large forces, last advance {advance} m");
    }
}

#[test]
fn free_actions_end_where_they_are_commanded() {
    for name in ARMS {
        let model = dynamic(name);
        // Beyond the goal region.
        let mut particle = crate::support::particle_ahead(&model, &start(&model), 0.45);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        // A round trip: up, in a circle, down.
        for index in [8, 0, 1, 2, 3, 4, 5, 6, 7, 9] {
            let (before, action) = (model_tool(&model, &particle), Action::ALL[index]);
            let target: [f64; 3] = std::array::from_fn(|i| before[i] + 0.02 * action.direction()[i]);
            let (step, report) = model.act(&mut particle, action, &mut rng);
            assert!(!report.tool_touched && !report.events.out_of_reach && step.outcome == Outcome::Continue, "{name}");
            let error = distance(&model_tool(&model, &particle), &target);
            assert!(error < 1e-4, "{name}, action {index}: {error} m");
        }
    }
}

#[test]
fn an_arm_that_does_not_move_stays_where_it_is() {
    for name in ARMS {
        let model = dynamic(name);
        let joints = start(&model);
        let mut world = world(&model, &SERVO, &crate::support::particle_ahead(&model, &joints, 3.0));
        for _ in 0..60 {
            world.step_arm(&joints);
        }
        let arm = world.arm_joints_rad().unwrap();
        let drift = arm.iter().zip(&joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(drift < 1e-7, "{name}: gravity is compensated, {drift} rad");
    }
}

#[test]
fn an_action_depends_on_nothing_that_ran_before() {
    for name in ARMS {
        let model = dynamic(name);
        let joints = start(&model);
        let ahead = if name == "sawyer" { 0.07 } else { 0.14 };
        let run = || {
            let mut particle = crate::support::particle_ahead(&model, &joints, ahead);
            let step = model.act(&mut particle, PLUS_Y, &mut Seed(3).stream(Purpose::Test, 0)).0;
            (particle, step.observation)
        };
        let first = run();
        let mut other = with_obstacle(crate::support::particle_ahead(&model, &joints, ahead), 0.09);
        for action in Action::ALL {
            model.act(&mut other, action, &mut Seed(4).stream(Purpose::Test, 0));
        }
        assert_eq!(run(), first, "{name}");
        assert!(first.0.state.joints_rad != joints && first.0.force != [0.0; 6]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the hypothesis and the gains, a step ends: with finite values, or as diverged.
    #[test]
    fn no_hypothesis_and_no_gain_panics(
        stiffness_exponent in 0.0..6.0_f64,
        damping_ratio in 0.1..100.0_f64,
        obstacle in 0..4_usize,
        mass in 0.01..20.0_f64,
        size in prop::array::uniform3(0.01..0.2_f64),
        offset in prop::array::uniform3(-0.15..0.15_f64),
        speed in prop::array::uniform3(-2.0..2.0_f64),
        action in 0..10_usize,
        sawyer in any::<bool>(),
    ) {
        let servo = ServoConfig { stiffness_nmprad: 10_f64.powf(stiffness_exponent), damping_ratio };
        let arm = ArmConfig::Dynamic(servo);
        prop_assert_eq!(arm.problem(), None);
        let model = setup(if sawyer { "sawyer" } else { "jaco" }, arm);
        let mut p = with_obstacle(crate::support::particle_ahead(&model, &start(&model), 0.1), 0.1);
        let values = [mass, 0.0, 0.0, 0.0, 0.4, size[0], size[1], size[2], mass, size[1], size[2], size[0]];
        p.theta = Theta::from_parts(&values, [obstacle % 3, obstacle]);
        if p.theta.obstacle.is_none() {
            p.state.obstacle = None;
        }
        for (coordinate, shift) in p.state.object.position_m.iter_mut().zip(offset) {
            *coordinate += shift;
        }
        p.state.object.linear_mps = speed;
        let before = p.state.clone();
        let (step, _) = model.act(&mut p, Action::ALL[action], &mut Seed(5).stream(Purpose::Test, 0));
        prop_assert!(step.observation.0.iter().all(|v| v.is_finite()));
        prop_assert!(p.state.to_vec().iter().all(|v| v.is_finite()));
        if step.outcome == Outcome::Diverged {
            prop_assert_eq!(p.state, before);
        }
    }
}
