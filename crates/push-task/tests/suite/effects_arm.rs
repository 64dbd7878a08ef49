//! Effects on commands and sensors in the pushing task, against closed forms.

use std::sync::Arc;

use nalgebra::{Point3, Vector6};
use physics_model::config::{ArmConfig, ObstacleMobility, ServoConfig};
use physics_model::effects::*;
use physics_model::robot::ToolShape;
use physics_model::world::{ToolPose, World};
use physics_model::{BodyState, EffectConfig, ObjectShape, ObjectTheta};
use pomdp::{Purpose, Rng, Seed};
use push_task::{Action, PushConfig, PushModel};

const PLUS_Y: Action = Action::ALL[2];
const MINUS_Y: Action = Action::ALL[6];
const G: f64 = 9.81;

fn model(name: &str, effects: Vec<EffectConfig>) -> (PushModel, Vec<f64>) {
    let (plain, joints) = crate::support::model(name, ObstacleMobility::Fixed);
    let config = PushConfig { effects, ..plain.config().clone() };
    (PushModel::new(config, Arc::new(plain.robot().clone())), joints)
}

fn rng() -> Rng {
    Seed(1).stream(Purpose::Test, 0)
}

#[test]
fn a_soft_arm_lags_by_force_over_stiffness() {
    let (plain, _) = model("sawyer", vec![]);
    let config =
        physics_model::config::WorldConfig { tool_friction: 0.0, table_height_m: 0.0, ..plain.config().world.clone() };
    let theta = crate::support::particle_ahead(&plain, plain.robot().home_rad(), 0.0).theta;
    for stiffness_npm in [500.0, 5000.0] {
        let effects = vec![EffectConfig::ArmCompliance(ArmCompliance { stiffness_npm }).build()];
        let tool = ToolPose { position_m: [0.0, 0.0, 0.03], orientation: [0.0, 0.0, 0.0, 1.0] };
        let ball = [ToolShape::Ball { center_m: [0.0; 3], radius_m: 0.025 }];
        let body = BodyState::at_rest([0.0, 0.066, 0.05], 0.0);
        let mut world = World::restore(&config, &effects, &theta, &body, None, &tool, &ball);
        let (mut lag, mut force) = (0.0, 0.0);
        for step in 1..=120 {
            let command = 0.001 * f64::from(step);
            force = -world.step([0.0, command, 0.03]).force_n[1];
            lag = command - world.tool_position_m()[1];
        }
        assert!((force / (0.4 * 0.5 * G) - 1.0).abs() < 0.03, "{force} N");
        assert!((lag * stiffness_npm / force - 1.0).abs() < 0.05, "{stiffness_npm}: lags by {lag} m under {force} N");
        // Free motion follows the command.
        let far = BodyState::at_rest([1.0, 0.0, 0.05], 0.0);
        let mut world = World::restore(&config, &effects, &theta, &far, None, &tool, &ball);
        for step in 1..=20 {
            let command = 0.02 * physics_model::motion::minimum_jerk(f64::from(step) / 20.0);
            world.step([0.0, command, 0.03]);
            assert!((world.tool_position_m()[1] - command).abs() < 1e-6, "step {step}");
        }
    }
}

#[test]
fn a_soft_arm_that_is_blocked_pushes_with_its_stiffness_times_what_is_missing() {
    let wall = HiddenObstacle {
        shape: ObjectShape::Box,
        movable: false,
        x_m: 0.0,
        y_m: 0.06,
        yaw_rad: 0.0,
        size_m: [0.05, 0.05, 0.06],
        mass_kg: 1.0,
    };
    let effects = [
        EffectConfig::ArmCompliance(ArmCompliance { stiffness_npm: 2000.0 }).build(),
        EffectConfig::HiddenObstacle(wall).build(),
    ];
    let (plain, _) = model("sawyer", vec![]);
    let config = physics_model::config::WorldConfig { table_height_m: 0.0, ..plain.config().world.clone() };
    let theta = crate::support::particle_ahead(&plain, plain.robot().home_rad(), 0.0).theta;
    let tool = ToolPose { position_m: [0.0, 0.0, 0.03], orientation: [0.0, 0.0, 0.0, 1.0] };
    let ball = [ToolShape::Ball { center_m: [0.0; 3], radius_m: 0.025 }];
    let mut world =
        World::restore(&config, &effects, &theta, &BodyState::at_rest([1.0, 0.0, 0.05], 0.0), None, &tool, &ball);
    let mut force = 0.0;
    for step in 1..=60 {
        force = -world.step([0.0, 0.02 * (f64::from(step) / 20.0).min(1.0), 0.03]).force_n[1];
    }
    // The wall begins where the ball's centre is at 10 mm; the command ends at 20 mm.
    let missing_m = 0.02 - world.tool_position_m()[1];
    assert!((missing_m - 0.01).abs() < 0.002, "stops at the wall: {missing_m}");
    assert!((force / (2000.0 * missing_m) - 1.0).abs() < 0.02, "{force} N for {missing_m} m");
}

#[test]
fn a_free_move_is_its_gain_times_as_long_for_both_arms() {
    for name in ["sawyer", "jaco"] {
        let (model, joints) = model(name, vec![EffectConfig::ActuatorGain(ActuatorGain { gain: 1.15 })]);
        let mut particle = crate::support::particle_ahead(&model, &joints, 0.4);
        let start = model.tool_position_m(&joints)[1];
        model.act(&mut particle, PLUS_Y, &mut rng());
        let way = model.tool_position_m(&particle.state.joints_rad)[1] - start;
        assert!((way - 0.023).abs() < 2e-5, "{name}: {way}");
    }
}

#[test]
fn play_shortens_a_move_after_a_reversal_alone() {
    let gap_rad = 0.002;
    for name in ["sawyer", "jaco"] {
        let (loose, joints) = model(name, vec![EffectConfig::Backlash(Backlash { gap_rad })]);
        let (tight, _) = model(name, vec![]);
        let mut particle = crate::support::particle_ahead(&loose, &joints, 0.4);
        // The play is in its middle at first: half of it is lost, then nothing, then all of it.
        for (action, lost) in [(PLUS_Y, 0.5 * gap_rad), (PLUS_Y, 0.0), (MINUS_Y, gap_rad), (MINUS_Y, 0.0)] {
            let before = particle.clone();
            let mut expected = before.clone();
            expected.memory = None;
            tight.act(&mut expected, action, &mut rng());
            loose.act(&mut particle, action, &mut rng());
            for (j, from) in before.state.joints_rad.iter().enumerate() {
                let (nominal, found) = (expected.state.joints_rad[j] - from, particle.state.joints_rad[j] - from);
                if nominal.abs() > 2.0 * gap_rad {
                    let short = (nominal - found) * nominal.signum();
                    assert!((short - lost).abs() < 5e-5, "{name} {action:?} joint {j}: {short} rad short of {nominal}");
                }
            }
        }
    }
}

#[test]
fn a_delayed_command_arrives_in_the_end_and_is_felt_later() {
    for name in ["sawyer", "jaco"] {
        let delay_secs = 0.1;
        let (late, joints) = model(name, vec![EffectConfig::ActuationDelay(ActuationDelay { delay_secs })]);
        let (plain, _) = model(name, vec![]);
        // Free: the same place.
        let (mut first, mut second) =
            (crate::support::particle_ahead(&late, &joints, 0.4), crate::support::particle_ahead(&plain, &joints, 0.4));
        late.act(&mut first, PLUS_Y, &mut rng());
        plain.act(&mut second, PLUS_Y, &mut rng());
        let (a, b) = (&first.state.joints_rad, &second.state.joints_rad);
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{name}: {a:?} {b:?}");
    }
    // A touch late in the move comes after the forces have been read, and still moves the object.
    let (late, joints) = model("sawyer", vec![EffectConfig::ActuationDelay(ActuationDelay { delay_secs: 0.2 })]);
    let (plain, _) = model("sawyer", vec![]);
    let ahead_m = (0..200)
        .map(|i| 0.001 * f64::from(i))
        .find(|ahead_m| plain.check(&crate::support::particle_ahead(&plain, &joints, *ahead_m)).is_ok())
        .expect("a place ahead of the tool");
    let play = |model: &PushModel| {
        let mut particle = crate::support::particle_ahead(model, &joints, ahead_m + 0.02);
        let before = particle.state.object.position_m[1];
        model.act(&mut particle, PLUS_Y, &mut rng());
        (particle.force[..3].iter().map(|f| f.abs()).fold(0.0, f64::max), particle.state.object.position_m[1] - before)
    };
    let ((late_n, late_m), (plain_n, plain_m)) = (play(&late), play(&plain));
    assert!(plain_n > 0.1 && late_n < 1e-6, "{plain_n} N, {late_n} N");
    assert!(plain_m > 0.002 && (late_m - plain_m).abs() < 1e-3, "{plain_m} m, {late_m} m");
}

#[test]
fn joints_with_friction_lag_by_torque_over_stiffness() {
    let servo = ServoConfig { stiffness_nmprad: 2000.0, damping_ratio: 1.0 };
    let (plain, joints) = model("sawyer", vec![]);
    let friction = JointFriction { viscous_nmsprad: 1.0, coulomb_nm: 2.0 };
    let particle = crate::support::particle_ahead(&plain, &joints, 3.0);
    let at = |effects: &[Box<dyn physics_model::effect::Effect>]| {
        let base_from_tool = plain.robot().base_from_tool(&joints);
        let q = base_from_tool.rotation;
        let tool = ToolPose { position_m: base_from_tool.translation.vector.into(), orientation: [q.i, q.j, q.k, q.w] };
        let world = &plain.config().world;
        let mut world = World::restore(world, effects, &particle.theta, &particle.state.object, None, &tool, &[])
            .with_dynamic_arm(plain.robot(), &servo, &joints);
        let mut command = joints.clone();
        for _ in 0..60 {
            command[1] += 0.3 / 60.0;
            world.step_arm(&command);
        }
        world.arm_joints_rad().expect("a dynamic arm")[1]
    };
    let lag = at(&[]) - at(&[EffectConfig::JointFriction(friction).build()]);
    // (1 · 0.3 + 2) / 2000 rad.
    assert!((lag / (2.3 / 2000.0) - 1.0).abs() < 0.03, "{lag}");
}

#[test]
fn a_payload_weighs_at_the_wrist_and_on_the_joints() {
    let payload = WristPayload { mass_kg: 1.5, com_x_m: 0.03, com_y_m: -0.02, com_z_m: 0.05 };
    for name in ["sawyer", "jaco"] {
        let (loaded, joints) = model(name, vec![EffectConfig::WristPayload(payload.clone())]);
        let (plain, _) = model(name, vec![]);
        let mut with = crate::support::particle_ahead(&loaded, &joints, 0.4);
        let mut without = with.clone();
        loaded.initial_observation(&mut with, &mut rng());
        plain.initial_observation(&mut without, &mut rng());
        if name == "sawyer" {
            let force = with.force[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
            assert!((force - 1.5 * G).abs() < 1e-9, "{force}");
            continue;
        }
        let robot = loaded.robot();
        let com = robot.base_from_tool(&joints) * Point3::new(0.03, -0.02, 0.05);
        let torque = robot.contact_torque_at(&joints, &com, &Vector6::new(0.0, 0.0, -1.5 * G, 0.0, 0.0, 0.0));
        for j in 0..joints.len() {
            let expected = without.force[j] - torque[j];
            assert!((with.force[j] - expected).abs() < 1e-9, "joint {j}: {} and {expected}", with.force[j]);
        }
    }
}

#[test]
fn a_drift_goes_on_from_action_to_action() {
    let drift = ForceDrift { drift_x_nps: 0.0, drift_y_nps: 0.0, drift_z_nps: 0.02 };
    let (model, joints) = model("sawyer", vec![EffectConfig::ForceDrift(drift)]);
    let mut particle = crate::support::particle_ahead(&model, &joints, 0.4);
    model.initial_observation(&mut particle, &mut rng());
    assert_eq!(particle.force, [0.0; 6]);
    for action in 0..3 {
        model.act(&mut particle, PLUS_Y, &mut rng());
        // The mean over 20 readings at the ends of 20 steps.
        let expected = 0.02 * (f64::from(action) / 3.0 + 10.5 / 60.0);
        let force = particle.force[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
        assert!((force - expected).abs() < 1e-9, "action {action}: {force}, expected {expected}");
    }
    assert!((particle.memory.expect("time has passed").elapsed_secs - 1.0).abs() < 1e-9);
}

#[test]
fn a_rolling_sphere_is_read_where_it_was() {
    let (model, joints) = model("sawyer", vec![EffectConfig::PoseDelay(PoseDelay { delay_secs: 0.04 })]);
    let mut particle = crate::support::particle_ahead(&model, &joints, 0.0);
    particle.theta.object = ObjectTheta {
        shape: ObjectShape::Sphere,
        mass_kg: 0.5,
        com_m: [0.0; 3],
        friction: 0.4,
        size_m: [0.04, 0.0, 0.0],
    };
    let z = model.config().world.table_height_m + 0.04;
    particle.state.object = BodyState::at_rest([0.45, 0.2, z], 0.0);
    particle.state.object.linear_mps = [0.0, 0.1, 0.0];
    particle.state.object.angular_rps = [-0.1 / 0.04, 0.0, 0.0];
    model.act(&mut particle, MINUS_Y, &mut rng());
    let (state, read) = (particle.state.object, model.readings(&particle).object);
    let lag = state.position_m[1] - read.position_m[1];
    assert!((lag - 0.1 * 0.04).abs() < 1e-4, "{lag} m");
}

#[test]
fn an_arm_with_friction_is_a_dynamic_one_or_has_torque_sensors() {
    let friction = EffectConfig::JointFriction(JointFriction { viscous_nmsprad: 0.06, coulomb_nm: 0.35 });
    let (rough, joints) = model("jaco", vec![friction]);
    let (plain, _) = model("jaco", vec![]);
    assert_eq!(rough.config().arm, ArmConfig::Kinematic);
    let (mut first, mut second) =
        (crate::support::particle_ahead(&rough, &joints, 0.4), crate::support::particle_ahead(&plain, &joints, 0.4));
    rough.act(&mut first, PLUS_Y, &mut rng());
    plain.act(&mut second, PLUS_Y, &mut rng());
    for (j, start) in joints.iter().enumerate() {
        let rate = (second.state.joints_rad[j] - start) * 3.0;
        let more = first.force[j] - second.force[j];
        // The mean of F_v q̇ + F_c over a move that takes a third of a second, its slow ends aside.
        if rate.abs() > 0.1 {
            let expected = (0.06 * rate.abs() + 0.35) * rate.signum();
            assert!((more / expected - 1.0).abs() < 0.15, "joint {j}: {more}, expected {expected}");
        }
    }
}
