//! The pushing task as a generative model: conformance, rewards, sensors, determinism.

mod goal_policy;
mod unknown_effects;

use physics_model::config::ObstacleMobility;
use physics_model::world::World;
use physics_model::{BodyState, ObjectShape, ObjectTheta, ObstacleTheta, Theta};
use push_task::{Action, GoalPolicy, HeuristicPolicy, Particle, PushModel, State};

use crate::support::model;
use pomdp::conformance::{check_generative_model, check_observation_model};
use pomdp::{Outcome, Policy as _, Purpose, Seed};

/// Moves along +y and −y.
const PLUS_Y: usize = 2;
const MINUS_Y: usize = 6;

fn particle(model: &PushModel, joints: &[f64], y_m: f64) -> Particle {
    let config = model.config();
    let (x, table) = (config.task.tool_start_m[0], config.world.table_height_m);
    Particle::new(
        State { joints_rad: joints.to_vec(), object: BodyState::at_rest([x, y_m, table + 0.05], 0.0), obstacle: None },
        Theta { object: crate::support::usual_box(), obstacle: None, effects: vec![] },
    )
}

fn with_obstacle(mut particle: Particle, y_m: f64) -> Particle {
    let mut position = particle.state.object.position_m;
    position[1] = y_m;
    particle.theta.obstacle = Some(ObstacleTheta { shape: ObjectShape::Box, mass_kg: 1.0, size_m: [0.08, 0.08, 0.1] });
    particle.state.obstacle = Some(BodyState::at_rest(position, 0.0));
    particle
}

#[test]
fn both_arms_conform_to_the_generative_model() {
    for arm in ["sawyer", "jaco"] {
        let (model, joints) = model(arm, ObstacleMobility::Movable);
        let near = particle(&model, &joints, -0.1);
        let blocked = with_obstacle(near.clone(), 0.0);
        check_generative_model(&model, &[near, blocked], 12);
    }
}

#[test]
fn observations_are_likeliest_in_their_own_states() {
    for mobility in [ObstacleMobility::Fixed, ObstacleMobility::Movable] {
        let (model, joints) = model("sawyer", mobility);
        let mut states = Vec::new();
        for (shape, size_m, com_m) in [
            (ObjectShape::Box, [0.08, 0.07, 0.1], [0.01, -0.005, 0.002]),
            (ObjectShape::Cylinder, [0.04, 0.1, 0.0], [0.01, -0.005, 0.002]),
            (ObjectShape::Sphere, [0.05, 0.0, 0.0], [0.0, 0.0, -0.01]),
        ] {
            let mut particle = particle(&model, &joints, -0.1);
            particle.theta.object = ObjectTheta { shape, mass_kg: 0.5, com_m, friction: 0.4, size_m };
            particle.state.object.position_m[2] = model.config().world.table_height_m + shape.half_height_m(size_m);
            states.push(particle.clone());
            states.push(with_obstacle(particle, 0.05));
        }
        check_observation_model(&model, &states, 6);
    }
}

#[test]
fn unknown_parameters_of_effects_act_within_their_limits() {
    use physics_model::effect::{EffectKind, EffectParameter, EffectValue};
    let (plain, joints) = model("sawyer", ObstacleMobility::Fixed);
    let effects = vec![EffectKind::TableTilt.start(), EffectKind::ForceBias.start()];
    let config = push_task::PushConfig { effects, ..plain.config().clone() };
    let model = PushModel::new(config, std::sync::Arc::new(plain.robot().clone()));
    let value = |kind, name, value| EffectValue { parameter: EffectParameter::new(kind, name).unwrap(), value };
    let mut tilted = particle(&model, &joints, -0.1);
    tilted.theta.effects =
        vec![value(EffectKind::TableTilt, "slope_y_rad", 0.02), value(EffectKind::ForceBias, "bias_z_n", -1.5)];
    check_observation_model(&model, std::slice::from_ref(&tilted), 4);
    let with = |slope, bias| {
        let mut moved = tilted.clone();
        (moved.theta.effects[0].value, moved.theta.effects[1].value) = (slope, bias);
        moved
    };
    assert!(model.check(&with(0.8, 2.5)).is_err(), "steeper than the limit");
    let mut moved = with(0.6, 2.5);
    assert_eq!(model.check(&moved), Ok(()));
    // It slides by itself, and the bias is read without contact.
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let before = moved.state.object.position_m[1];
    model.act(&mut moved, Action::UP, &mut rng);
    assert!(moved.state.object.position_m[1] > before + 0.02, "{:?}", moved.state.object);
    let force = moved.force[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
    assert!((force - 2.5).abs() < 1e-9, "{force}");
    let suggested = model.memory_after_action(&moved);
    assert_eq!(suggested, None, "neither effect remembers anything");
}

#[test]
fn a_push_along_the_path_earns_the_rewards_in_turn() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let mut particle = particle(&model, &joints, -0.12);
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let mut rewards = Vec::new();
    let mut outcome = Outcome::Continue;
    while outcome == Outcome::Continue && rewards.len() < 20 {
        let step = model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng).0;
        rewards.push(step.reward);
        outcome = step.outcome;
    }
    assert_eq!(outcome, Outcome::Terminal);
    assert_eq!(rewards.iter().filter(|r| **r == 9.0).count(), 1, "moved once: {rewards:?}");
    assert_eq!(rewards.last(), Some(&99.0), "{rewards:?}");
    assert!(model.config().task.goal.contains(particle.state.object.position_m));
}

#[test]
fn an_object_that_the_tool_cannot_get_behind_is_not_expected_at_the_goal() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let task = &model.config().task;
    let value = |x_m: f64, y_m: f64| {
        let mut particle = particle(&model, &joints, y_m);
        particle.state.object.position_m[0] = x_m;
        GoalPolicy.leaf_value(&model, &particle, 20)
    };
    let steps: f64 = (0..20).map(|t| -task.discount.powi(t)).sum();
    assert!(value(0.5, -0.1) > 20.0);
    // Beyond the border the arm could only push it farther away.
    for (x_m, y_m) in [(task.reach.x_m[0] - 0.01, 0.07), (0.5, task.reach.y_m[0] - 0.01)] {
        assert!((value(x_m, y_m) - steps).abs() < 1e-9, "{x_m} {y_m}");
    }
}

#[test]
fn a_move_out_of_reach_costs_five_and_moves_nothing() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let mut particle = particle(&model, &joints, 0.25);
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    for _ in 0..4 {
        assert_eq!(model.act(&mut particle, Action::ALL[MINUS_Y], &mut rng).0.reward, -1.0);
    }
    let before = particle.clone();
    let (step, report) = model.act(&mut particle, Action::ALL[MINUS_Y], &mut rng);
    assert!(report.events.out_of_reach && step.reward == -6.0, "{step:?}");
    assert_eq!(particle.state, before.state);
}

#[test]
fn a_push_against_a_fixed_obstacle_is_a_large_force_and_stops_the_arm() {
    for arm in ["sawyer", "jaco"] {
        let (model, joints) = model(arm, ObstacleMobility::Fixed);
        let mut particle = with_obstacle(particle(&model, &joints, -0.1), -0.01);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut large = None;
        for _ in 0..9 {
            let start = model.tool_position_m(&particle.state.joints_rad)[1];
            let (step, report) = model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng);
            let advance = model.tool_position_m(&particle.state.joints_rad)[1] - start;
            if report.events.large_force {
                large = Some((step.reward, advance, report.obstacle_touched));
                break;
            }
            assert!((advance - 0.02).abs() < 1e-5, "a free move has its length: {advance}");
        }
        let (reward, advance, touched) = large.unwrap_or_else(|| panic!("{arm}: no large force"));
        assert!(touched && advance < 0.0195, "{arm}: stopped after {advance} m");
        assert!(reward == -6.0 || reward == 4.0, "{arm}: {reward}");
    }
}

#[test]
fn an_arm_stopped_by_an_obstacle_can_retreat_and_stays_out_of_it() {
    for arm in ["sawyer", "jaco"] {
        let (model, joints) = model(arm, ObstacleMobility::Fixed);
        // Nothing but the obstacle is in the way.
        let mut particle = with_obstacle(particle(&model, &joints, 0.2), -0.08);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut stopped = 0;
        for _ in 0..8 {
            let report = model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng).1;
            stopped += u32::from(report.events.large_force);
            assert_eq!(report.divergence, None, "{arm}");
            assert_eq!(model.check(&particle), Ok(()), "{arm}");
        }
        assert!(stopped >= 2, "{arm}: pushing on is stopped again: {stopped}");
        let blocked = model.tool_position_m(&particle.state.joints_rad)[1];
        let (step, report) = model.act(&mut particle, Action::ALL[MINUS_Y], &mut rng);
        let retreat = blocked - model.tool_position_m(&particle.state.joints_rad)[1];
        assert!((retreat - 0.02).abs() < 1e-5 && !report.events.large_force, "{arm}: {retreat} {step:?}");
    }
}

#[test]
fn an_arm_that_squeezes_an_object_stays_near_its_limit_and_can_leave() {
    for mass_kg in [0.2, 0.5, 2.0] {
        let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
        let mut particle = with_obstacle(particle(&model, &joints, -0.1), -0.01);
        particle.theta.object.mass_kg = mass_kg;
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut large = 0;
        for _ in 0..12 {
            let report = model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng).1;
            large += u32::from(report.events.large_force);
            assert_eq!(report.divergence, None, "{mass_kg} kg");
            // The mean of an action, whose force passes the limit for a control step or two.
            let force = particle.force[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
            assert!(force < 120.0, "{mass_kg} kg: the wrist holds {force} N");
        }
        assert!(large >= 3, "{mass_kg} kg: the push is blocked: {large}");
        // Back, back to both sides, and up. Sideways along a squeezed object the way may get narrower.
        for action in [5, 6, 7, Action::UP.index()] {
            let mut leaving = particle.clone();
            let from = model.tool_position_m(&leaving.state.joints_rad);
            model.act(&mut leaving, Action::ALL[action], &mut rng);
            let to = model.tool_position_m(&leaving.state.joints_rad);
            let way = (0..3).map(|i| (to[i] - from[i]).powi(2)).sum::<f64>().sqrt();
            assert!((way - 0.02).abs() < 1e-4, "{mass_kg} kg, action {action}: left by {way} m");
        }
    }
}

#[test]
fn a_force_above_the_limit_is_reported_whether_it_opposes_the_move_or_not() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let tool = model.tool_position_m(&joints);
    // A fixed face 5 mm inside the tool's ball: 150 N along −y.
    let mut start = with_obstacle(particle(&model, &joints, 0.2), 0.0);
    start.state.obstacle.as_mut().unwrap().position_m = [tool[0], tool[1] + 0.025 + 0.04 - 0.005, tool[2]];
    assert_eq!(model.check(&start), Ok(()));
    for (action, stays) in [(0, false), (PLUS_Y, true), (Action::UP.index(), false)] {
        let mut particle = start.clone();
        let (step, report) = model.act(&mut particle, Action::ALL[action], &mut Seed(1).stream(Purpose::Test, 0));
        assert!(report.events.large_force && step.reward == -6.0, "action {action}: {step:?}");
        let to = model.tool_position_m(&particle.state.joints_rad);
        let way = (0..3).map(|i| (to[i] - tool[i]).powi(2)).sum::<f64>().sqrt();
        assert_eq!(way < 1e-4, stays, "action {action} moved the tool by {way} m");
    }
}

#[test]
fn overlapping_bodies_are_simulated_and_impossible_ones_refused() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let overlapping = |depth_m: f64| {
        let mut particle = with_obstacle(particle(&model, &joints, 0.1), 0.18 - depth_m);
        let report = model.act(&mut particle, Action::ALL[PLUS_Y], &mut Seed(1).stream(Purpose::Test, 0)).1;
        (0.1 - particle.state.object.position_m[1], report.divergence)
    };
    assert_eq!(overlapping(0.0).0, 0.0, "bodies that only touch rest");
    let (moved, divergence) = overlapping(0.004);
    assert!(moved > 0.001 && divergence.is_none(), "pushed apart by {moved} m");
    assert_eq!(overlapping(0.02).1, Some(physics_model::world::Divergence::Overlaps));
}

#[test]
fn what_is_skipped_before_and_after_a_contact_changes_nothing() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    // The ball's surface is 6 mm from the box: the first half of the move meets nothing.
    let start = particle(&model, &joints, -0.22 + 0.04 + 0.025 + 0.006);
    for action in [Action::ALL[PLUS_Y], Action::ALL[1], Action::ALL[3]] {
        let mut skipped = start.clone();
        model.act(&mut skipped, action, &mut Seed(1).stream(Purpose::Test, 0));
        let from = model.tool_position_m(&joints);
        let pose = physics_model::world::ToolPose { position_m: from, orientation: [0.0, 0.0, 0.0, 1.0] };
        let (config, shapes) = (&model.config().world, model.robot().tool_shapes());
        let mut world = World::restore(config, &[], &start.theta, &start.state.object, None, &pose, shapes);
        for step in 1..=20 {
            let share = 0.02 * physics_model::motion::minimum_jerk(f64::from(step) / 20.0);
            world.step(std::array::from_fn(|i| from[i] + share * action.direction()[i]));
        }
        let (ours, whole) = (skipped.state.object, world.object());
        let apart = ours.position_m.iter().zip(whole.position_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 2e-4, "{action:?}: {apart} m apart");
        assert!((ours.yaw_rad() - whole.yaw_rad()).abs() < 0.01, "{action:?}");
    }
}

#[test]
fn the_wrist_feels_the_push_in_its_own_axes() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let mut particle = particle(&model, &joints, -0.155);
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng);
    let step = model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng).0;
    let v = &step.observation.0;
    let (force, torque) = (&v[7..10], &v[10..13]);
    // The hand points down with its x axis along the base's y (tool_rotation): a push along +y is felt along −x of the wrist.
    let expected = 0.4 * 0.5 * 9.81;
    assert!((-force[0] / expected - 1.0).abs() < 0.2, "{force:?}");
    assert!(force[1].abs() < 0.2 * expected && force[2].abs() < 0.2 * expected, "{force:?}");
    // The ball is 0.15 m along the wrist's z: τ_y = 0.15 f_x, up to the friction on the ball itself (0.025 m).
    assert!((torque[1] / (0.15 * force[0]) - 1.0).abs() < 0.1, "{torque:?}");
}

#[test]
fn a_free_jaco_holds_its_own_weight() {
    let (model, joints) = model("jaco", ObstacleMobility::Fixed);
    let mut particle = particle(&model, &joints, 0.1);
    let observation = model.initial_observation(&mut particle, &mut Seed(1).stream(Purpose::Test, 0));
    let gravity = model.robot().gravity_torque(&joints);
    for (j, torque) in observation.0[..6].iter().enumerate() {
        assert!((torque - gravity[j]).abs() < 1e-6, "joint {j}");
    }
    assert!(gravity.iter().any(|t| t.abs() > 1.0), "an arm has weight: {gravity:?}");
}

#[test]
fn the_joints_of_a_jaco_feel_the_push_through_the_transposed_jacobian() {
    let (model, joints) = model("jaco", ObstacleMobility::Fixed);
    // The fingers reach the object in the second action.
    let run = |y_m: f64| {
        let mut particle = particle(&model, &joints, y_m);
        particle.theta.object.com_m = [0.0, 0.0, -0.02];
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for _ in 0..5 {
            model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng);
        }
        let before = particle.state.joints_rad.clone();
        model.act(&mut particle, Action::ALL[PLUS_Y], &mut rng);
        (particle.force, before, particle.state)
    };
    let (pushing, before, state) = run(-0.1);
    let (free, _, far) = run(0.3);
    assert_eq!(far.joints_rad, state.joints_rad, "the same motion");
    assert!(state.object.position_m[1] > -0.09, "pushed: {:?}", state.object.position_m);
    let middle: Vec<f64> = before.iter().zip(&state.joints_rad).map(|(a, b)| 0.5 * (a + b)).collect();
    let jacobian = model.robot().jacobian(&middle, model.robot().tool());
    let torque = nalgebra::Vector6::from_fn(|j, _| free[j] - pushing[j]);
    let transposed = jacobian.fixed_columns::<6>(0).transpose();
    let wrench = transposed.lu().solve(&torque).expect("no singular pose");
    // Two fingers push the box along +y with μ m g.
    let expected = 0.4 * 0.5 * 9.81;
    assert!((-wrench[1] / expected - 1.0).abs() < 0.2, "{wrench}");
    assert!(wrench[0].abs() < 0.25 * expected, "{wrench}");
}

#[test]
fn the_motion_of_a_free_arm_takes_the_torques_of_its_inverse_dynamics() {
    let (model, joints) = model("jaco", ObstacleMobility::Fixed);
    let mut particle = particle(&model, &joints, 0.3);
    model.act(&mut particle, Action::ALL[PLUS_Y], &mut Seed(1).stream(Purpose::Test, 0));
    // The mean over the ends of the control steps, with joint positions solved for one by one and their derivatives by differences.
    let (n, duration) = (20, 1.0 / 3.0);
    let start = model.tool_position_m(&joints);
    let at = |time: f64| {
        let share = physics_model::motion::minimum_jerk(time);
        model.joints_for(&joints, [start[0], start[1] + 0.02 * share, start[2]]).unwrap()
    };
    let mut mean = [0.0; 6];
    for k in 0..n {
        let (time, h) = ((f64::from(k) + 1.0) / f64::from(n), 2e-3);
        let (before, now, after) = (at(time - h), at(time), at(time + h));
        let step = h * duration;
        let rate: Vec<f64> = (0..6).map(|j| (after[j] - before[j]) / (2.0 * step)).collect();
        let acceleration: Vec<f64> = (0..6).map(|j| (after[j] - 2.0 * now[j] + before[j]) / (step * step)).collect();
        let torque = model.robot().inverse_dynamics(&now, &rate, &acceleration);
        for (sum, t) in mean.iter_mut().zip(torque.iter()) {
            *sum += t / f64::from(n);
        }
    }
    let (at_start, at_end) =
        (model.robot().gravity_torque(&joints), model.robot().gravity_torque(&particle.state.joints_rad));
    let mut differs = 0.0_f64;
    for j in 0..6 {
        assert!((particle.force[j] - mean[j]).abs() < 1e-3, "joint {j}: {} and {}", particle.force[j], mean[j]);
        differs = differs.max((at_start[j] - at_end[j]).abs());
    }
    assert!(differs > 0.05, "gravity changes on the way by {differs} N·m, so that a mean is not a value at one end");
}

#[test]
fn passing_clear_of_a_resting_object_equals_its_simulation() {
    let (model, joints) = model("sawyer", ObstacleMobility::Movable);
    let start = with_obstacle(particle(&model, &joints, 0.0), 0.1);
    let mut passed = start.clone();
    model.act(&mut passed, Action::ALL[PLUS_Y], &mut Seed(1).stream(Purpose::Test, 0));
    assert_eq!(passed.state.object, start.state.object, "not simulated at all");
    let tool = model.tool_position_m(&joints);
    let pose = physics_model::world::ToolPose { position_m: tool, orientation: [0.0, 0.0, 0.0, 1.0] };
    let (object, obstacle) = (&start.state.object, start.state.obstacle.as_ref());
    let shapes = model.robot().tool_shapes();
    let mut world = World::restore(&model.config().world, &[], &start.theta, object, obstacle, &pose, shapes);
    for step in 1..=20 {
        world.step([tool[0], tool[1] + 0.001 * f64::from(step), tool[2]]);
    }
    for (a, b) in [(world.object(), *object), (world.obstacle().unwrap(), *obstacle.unwrap())] {
        let drift = a.position_m.iter().zip(b.position_m).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(drift < 2e-4, "a simulated resting body settles by {drift} m");
    }
}

#[test]
fn the_heuristic_policy_approaches_the_object() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let mut particle = particle(&model, &joints, 0.1);
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let distance = |p: &Particle| {
        let tool = model.tool_position_m(&p.state.joints_rad);
        tool.iter().zip(p.state.object.position_m).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    };
    let mut last = distance(&particle);
    for _ in 0..8 {
        let action = HeuristicPolicy.action(&model, &particle, &mut rng);
        model.act(&mut particle, action, &mut rng);
        assert!(distance(&particle) < last - 0.015);
        last = distance(&particle);
    }
}
