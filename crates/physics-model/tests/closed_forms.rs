//! Rapier worlds against closed forms of rigid-body mechanics with Coulomb friction.
//!
//! Settings are those of `scenarios/base.toml`. With friction opposite to the slip (see `friction.rs`) what is left is the time step h: a body
//! that friction stops from speed v comes v h / 2 short of v² / (2 μ g), because its position follows the speed at the end of each
//! substep. Expectations below contain that term.

use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::Effect;
use physics_model::effects::{RollingResistance, TableTilt};
use physics_model::motion::minimum_jerk;
use physics_model::robot::ToolShape;
use physics_model::world::{ToolPose, World, Wrench};
use physics_model::{BodyState, ObjectShape, ObjectTheta, ObstacleTheta, Theta};

const G: f64 = 9.81;
const BALL: [ToolShape; 1] = [ToolShape::Ball { center_m: [0.0; 3], radius_m: 0.025 }];
const FAR: [f64; 3] = [5.0, 5.0, 1.0];

fn config() -> WorldConfig {
    WorldConfig {
        control_period_secs: 1.0 / 60.0,
        control_steps: 20,
        solver_iterations: 2,
        contact_frequency_hz: 60.0,
        contact_damping_ratio: 5.0,
        table_height_m: 0.0,
        gravity_mps2: G,
        tool_friction: 0.2,
        obstacle_friction: 0.5,
        arm_stiffness_npm: 50_000.0,
        restitution: 0.0,
        obstacle_mobility: ObstacleMobility::Fixed,
    }
}

fn object(shape: ObjectShape, size_m: [f64; 3]) -> Theta {
    Theta {
        object: ObjectTheta { shape, mass_kg: 0.5, com_m: [0.0; 3], friction: 0.4, size_m },
        obstacle: None,
        effects: vec![],
    }
}

fn tool(position_m: [f64; 3]) -> ToolPose {
    ToolPose { position_m, orientation: [0.0, 0.0, 0.0, 1.0] }
}

fn restore<'a>(
    config: &'a WorldConfig,
    effects: &'a [Box<dyn Effect>],
    theta: &Theta,
    body: &BodyState,
    at: [f64; 3],
) -> World<'a> {
    World::restore(config, effects, theta, body, None, &tool(at), &BALL)
}

/// Pushes along `direction` for `actions` moves of 2 cm in one world; returns the world and the mean wrench of the last move.
fn push<'a>(world: &mut World<'a>, mut at: [f64; 3], direction: [f64; 3], actions: usize) -> ([f64; 3], Wrench) {
    let mut mean = Wrench::default();
    for _ in 0..actions {
        mean = Wrench::default();
        let start = at;
        for step in 1..=20 {
            let share = minimum_jerk(f64::from(step) / 20.0);
            at = std::array::from_fn(|i| start[i] + 0.02 * share * direction[i]);
            mean.add_scaled(&world.step(at), 0.05);
        }
    }
    (at, mean)
}

/// Half a substep, s.
const HALF_SUBSTEP: f64 = 0.5 / 120.0;

/// A box, a flat box, a long box and a cylinder, and how they are turned: friction must not depend on it.
const SLIDERS: [(ObjectShape, [f64; 3]); 4] = [
    (ObjectShape::Box, [0.08, 0.08, 0.08]),
    (ObjectShape::Box, [0.08, 0.08, 0.02]),
    (ObjectShape::Box, [0.05, 0.11, 0.03]),
    (ObjectShape::Cylinder, [0.04, 0.05, 0.0]),
];
const YAWS: [f64; 3] = [0.0, 0.3, std::f64::consts::FRAC_PI_4];

#[test]
fn a_push_at_constant_speed_takes_friction_times_weight() {
    // A tool without friction: with it the ball carries or adds a part of the weight, up to 0.2 of the push.
    let config = WorldConfig { tool_friction: 0.0, ..config() };
    for (shape, size_m) in SLIDERS {
        for friction in [0.2, 0.4, 0.8] {
            let mut theta = object(shape, size_m);
            theta.object.friction = friction;
            let half = shape.half_height_m(size_m);
            let reach = if shape == ObjectShape::Box { size_m[1] / 2.0 } else { size_m[0] };
            // Low on the object, so that it slides and does not tip.
            let start = [0.0, 0.0, half.min(0.026)];
            let mut world = restore(&config, &[], &theta, &BodyState::at_rest([0.0, reach + 0.025, half], 0.0), start);
            let mut mean = Wrench::default();
            for step in 1..=60 {
                let wrench = world.step([0.0, 0.001 * f64::from(step), start[2]]);
                if step > 30 {
                    mean.add_scaled(&wrench, 1.0 / 30.0);
                }
            }
            let expected = friction * 0.5 * G;
            let ratio = -mean.force_n[1] / expected;
            assert!((ratio - 1.0).abs() < 0.02, "{shape:?} {size_m:?} μ {friction}: push force is {ratio} of μ m g");
            assert!(mean.force_n[0].abs() < 0.03 * expected, "a central push has no side force: {:?}", mean.force_n);
        }
    }
}

#[test]
fn a_slide_stops_where_friction_has_eaten_its_energy_and_goes_straight() {
    let config = config();
    for (shape, size_m) in SLIDERS {
        for yaw in YAWS {
            let mut body = BodyState::at_rest([0.0, 0.0, shape.half_height_m(size_m)], yaw);
            body.linear_mps = [0.0, 1.0, 0.0];
            let mut world = restore(&config, &[], &object(shape, size_m), &body, FAR);
            for _ in 0..60 {
                world.step(FAR);
            }
            let end = world.object();
            let expected = 1.0 / (2.0 * 0.4 * G) - HALF_SUBSTEP;
            let ratio = end.position_m[1] / expected;
            assert!((ratio - 1.0).abs() < 0.02, "{shape:?} {size_m:?} turned {yaw}: slide is {ratio} of v²/(2 μ g)");
            assert!(end.position_m[0].abs() < 0.006 && (end.yaw_rad() - yaw).abs() < 0.03, "{size_m:?} {end:?}");
        }
    }
}

#[test]
fn a_spin_stops_where_friction_at_the_corners_has_eaten_its_energy() {
    let config = config();
    let size_m: [f64; 3] = [0.08, 0.08, 0.03];
    let mut body = BodyState::at_rest([0.0, 0.0, 0.015], 0.0);
    body.angular_rps = [0.0, 0.0, 15.0];
    let mut world = restore(&config, &[], &object(ObjectShape::Box, size_m), &body, FAR);
    for _ in 0..60 {
        world.step(FAR);
    }
    // The engine carries a box on its four corners: torque μ m g r, inertia m (a² + b²) / 12.
    let corner = size_m[0].hypot(size_m[1]) / 2.0;
    let deceleration = 0.4 * G * corner / ((size_m[0].powi(2) + size_m[1].powi(2)) / 12.0);
    let expected = 225.0 / (2.0 * deceleration) - 15.0 * HALF_SUBSTEP;
    let ratio = world.object().yaw_rad() / expected;
    assert!((ratio - 1.0).abs() < 0.02, "turn is {ratio} of ω²/(2 α)");
}

#[test]
fn a_sliding_sphere_ends_rolling_at_five_sevenths_of_its_speed() {
    let config = config();
    let mut body = BodyState::at_rest([0.0, 0.0, 0.04], 0.0);
    body.linear_mps = [0.3, 0.0, 0.0];
    let mut world = restore(&config, &[], &object(ObjectShape::Sphere, [0.04, 0.0, 0.0]), &body, FAR);
    for _ in 0..30 {
        world.step(FAR);
    }
    let end = world.object();
    assert!((end.linear_mps[0] / 0.3 - 5.0 / 7.0).abs() < 0.03, "{:?}", end.linear_mps);
    assert!(
        (end.angular_rps[1] * 0.04 / end.linear_mps[0] - 1.0).abs() < 0.03,
        "rolls without slip: {:?}",
        end.angular_rps
    );
}

#[test]
fn rolling_resistance_stops_a_sphere_after_the_closed_form_distance() {
    let config = config();
    let effects: Vec<Box<dyn Effect>> = vec![Box::new(RollingResistance { lever_m: 0.002 })];
    let mut body = BodyState::at_rest([0.0, 0.0, 0.04], 0.0);
    body.linear_mps = [0.2, 0.0, 0.0];
    body.angular_rps = [0.0, 0.2 / 0.04, 0.0];
    let mut world = restore(&config, &effects, &object(ObjectShape::Sphere, [0.04, 0.0, 0.0]), &body, FAR);
    for _ in 0..90 {
        world.step(FAR);
    }
    // a = 5/7 c_rr g / r.
    let expected = 0.2 * 0.2 / (2.0 * 5.0 / 7.0 * 0.002 * G / 0.04);
    let ratio = world.object().position_m[0] / expected;
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
}

#[test]
fn the_centre_of_mass_shows_in_the_turn_of_a_pushed_box() {
    let (config, start) = (config(), [0.0, 0.0, 0.04]);
    let yaw = |com_x: f64| {
        let mut theta = object(ObjectShape::Box, [0.08; 3]);
        theta.object.com_m = [com_x, 0.0, 0.0];
        let mut world = restore(&config, &[], &theta, &BodyState::at_rest([0.0, 0.065, 0.04], 0.0), start);
        push(&mut world, start, [0.0, 1.0, 0.0], 3);
        world.object().yaw_rad().to_degrees()
    };
    // The side without the mass runs ahead: a mass on the right (+x), pushed along +y, turns the box clockwise.
    let (right, middle, left) = (yaw(0.02), yaw(0.0), yaw(-0.02));
    assert!(right < -5.0 && left > 5.0, "{right} {left}");
    assert!(middle.abs() < 2.0, "{middle}");
    assert!((right + left).abs() < 0.15 * (right - left).abs(), "mirrored pushes turn alike: {right} {left}");
}

#[test]
fn a_resting_scene_stays_at_rest() {
    let config = config();
    for (shape, size_m) in [
        (ObjectShape::Box, [0.08, 0.06, 0.1]),
        (ObjectShape::Cylinder, [0.04, 0.1, 0.0]),
        (ObjectShape::Sphere, [0.04, 0.0, 0.0]),
    ] {
        let start = BodyState::at_rest([0.0, 0.0, shape.half_height_m(size_m)], 0.3);
        let mut world = restore(&config, &[], &object(shape, size_m), &start, FAR);
        for _ in 0..300 {
            let wrench = world.step(FAR);
            assert_eq!(wrench, Wrench::default());
            // v²/2 + g h: no more than the drop to the contact's resting depth gives.
            let speed = world.object().linear_mps.iter().map(|v| v * v).sum::<f64>();
            assert!(speed / 2.0 < G * 0.001, "{shape:?} moves at {}", speed.sqrt());
        }
        let drift =
            world.object().position_m.iter().zip(start.position_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(drift < 0.0015, "{shape:?} drifts by {drift} m in 5 s");
        assert_eq!(world.divergence(), None);
    }
}

#[test]
fn a_tilt_beyond_the_friction_angle_makes_the_object_slide() {
    let config = config();
    let slide = |slope: f64| {
        let effects: Vec<Box<dyn Effect>> = vec![Box::new(TableTilt { slope_x_rad: slope, slope_y_rad: 0.0 })];
        let theta = object(ObjectShape::Box, [0.08, 0.08, 0.02]);
        let mut world = restore(&config, &effects, &theta, &BodyState::at_rest([0.0, 0.0, 0.01], 0.0), FAR);
        for _ in 0..60 {
            world.step(FAR);
        }
        world.object().position_m[0]
    };
    // atan(0.4) = 0.38 rad.
    assert!(slide(0.3).abs() < 0.002, "{}", slide(0.3));
    // s = g (sin − μ cos) t² / 2 with t = 1 s, solved for μ.
    let friction = (0.5_f64.sin() - 2.0 * slide(0.5) / G) / 0.5_f64.cos();
    assert!((friction / 0.4 - 1.0).abs() < 0.02, "slides as with friction {friction}");
}

#[test]
fn a_fixed_obstacle_blocks_the_push_and_a_movable_one_gives_way() {
    let start = [0.0, 0.0, 0.04];
    let mut theta = object(ObjectShape::Box, [0.08; 3]);
    theta.obstacle = Some(ObstacleTheta { shape: ObjectShape::Box, mass_kg: 0.3, size_m: [0.08; 3] });
    let run = |mobility| {
        let config = WorldConfig { obstacle_mobility: mobility, ..config() };
        let body = BodyState::at_rest([0.0, 0.065, 0.04], 0.0);
        let obstacle = BodyState::at_rest([0.0, 0.15, 0.04], 0.0);
        let mut world = World::restore(&config, &[], &theta, &body, Some(&obstacle), &tool(start), &BALL);
        let mut mean = Wrench::default();
        // Two moves, or as far as 100 N let the arm go.
        for step in 1..=40 {
            let wrench = world.step([0.0, 0.001 * f64::from(step), 0.04]);
            mean = if step > 25 { wrench } else { mean };
            if wrench.force_magnitude_n() > 100.0 {
                mean = wrench;
                break;
            }
        }
        (
            world.object().position_m[1],
            world.obstacle().unwrap().position_m[1],
            mean.force_magnitude_n(),
            world.obstacle_touched(),
        )
    };
    let (object_y, obstacle_y, force, touched) = run(ObstacleMobility::Fixed);
    assert!(touched && obstacle_y == f64::from(0.15_f32) && (object_y - 0.07).abs() < 0.006, "{object_y} {obstacle_y}");
    assert!(force > 100.0, "the blocked tool feels {force} N");
    let (object_y, obstacle_y, force, touched) = run(ObstacleMobility::Movable);
    assert!(
        touched && (obstacle_y - 0.185).abs() < 0.004 && (object_y - 0.105).abs() < 0.004,
        "{object_y} {obstacle_y}"
    );
    let expected = 0.4 * 0.5 * G + 0.5 * 0.3 * G;
    assert!((force / expected - 1.0).abs() < 0.2, "pushes both: {force} N, expected {expected} N");
}

#[test]
fn a_tool_lifted_over_the_object_leaves_it_where_it_is() {
    let (config, start) = (config(), [0.0, 0.0, 0.11]);
    let body = BodyState::at_rest([0.0, 0.065, 0.04], 0.2);
    let mut world = restore(&config, &[], &object(ObjectShape::Box, [0.08; 3]), &body, start);
    let (at, wrench) = push(&mut world, start, [0.0, 1.0, 0.0], 6);
    assert!(at[1] > 0.11 && wrench == Wrench::default());
    let moved = world.object().position_m.iter().zip(body.position_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 2e-4, "{moved}");
}

#[test]
fn a_tool_pressed_down_feels_the_object_carry_it_and_does_not_move_it() {
    // The tool's ball is 1 mm over the top of a standing cylinder and 5 mm off its axis.
    let (config, start) = (config(), [0.005, 0.0, 0.126]);
    let body = BodyState::at_rest([0.0, 0.0, 0.05], 0.0);
    let mut world = restore(&config, &[], &object(ObjectShape::Cylinder, [0.04, 0.1, 0.0]), &body, start);
    let mut last = Wrench::default();
    for step in 1..=10 {
        last = world.step([start[0], 0.0, start[2] - 0.00015 * f64::from(step)]);
    }
    assert!(last.force_n[2] > 5.0, "pressed with {:?}", last.force_n);
    assert!(last.force_n[0].hypot(last.force_n[1]) < 0.2 * last.force_n[2], "straight down: {:?}", last.force_n);
    assert!(world.object().position_m[0].abs() < 1e-3 && world.object().yaw_rad().abs() < 0.02);
}

#[test]
fn a_cylinder_stands_upright_and_rolls_on_its_side() {
    let config = config();
    let theta = object(ObjectShape::Cylinder, [0.04, 0.1, 0.0]);
    // On its side: axis along x.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut lying = BodyState::at_rest([0.0, 0.0, 0.04], 0.0);
    lying.orientation = [0.0, half, 0.0, half];
    lying.linear_mps = [0.0, 0.2, 0.0];
    lying.angular_rps = [-0.2 / 0.04, 0.0, 0.0];
    let mut world = restore(&config, &[], &theta, &lying, FAR);
    for _ in 0..60 {
        world.step(FAR);
    }
    let end = world.object();
    assert!((end.position_m[1] - 0.2).abs() < 0.004 && (end.position_m[2] - 0.04).abs() < 1e-3, "rolls on: {end:?}");
    // A solid cylinder that slides without turning ends rolling at two thirds of its speed.
    let sliding = BodyState { angular_rps: [0.0; 3], ..lying };
    let mut world = restore(&config, &[], &theta, &sliding, FAR);
    for _ in 0..30 {
        world.step(FAR);
    }
    let speed = world.object().linear_mps[1];
    assert!((speed / 0.2 - 2.0 / 3.0).abs() < 0.03, "{speed}");
    // Upright and pushed low it slides and stays upright.
    let start = [0.0, 0.0, 0.03];
    let mut world = restore(&config, &[], &theta, &BodyState::at_rest([0.0, 0.065, 0.05], 0.0), start);
    push(&mut world, start, [0.0, 1.0, 0.0], 2);
    let [x, y, _, _] = world.object().orientation;
    assert!(x * x + y * y < 1e-4, "upright: {:?}", world.object());
}

#[test]
fn a_tool_that_meets_something_fixed_feels_the_stiffness_of_the_arm() {
    let config = config();
    let mut theta = object(ObjectShape::Box, [0.08; 3]);
    theta.obstacle = Some(ObstacleTheta { shape: ObjectShape::Box, mass_kg: 1.0, size_m: [0.08; 3] });
    let (body, obstacle) = (BodyState::at_rest([0.5, 0.0, 0.04], 0.0), BodyState::at_rest([0.0, 0.07, 0.04], 0.0));
    let start = [0.0, 0.0, 0.04];
    let mut world = World::restore(&config, &[], &theta, &body, Some(&obstacle), &tool(start), &BALL);
    let mut force = Wrench::default();
    for step in 1..=10 {
        force = world.step([0.0, 0.001 * f64::from(step), 0.04]);
    }
    // The faces meet after 5 mm; contacts are found at the beginning of a step, 2 mm are allowed for: 9 − 5 − 2 = 2 mm of 50 N/mm.
    assert!((force.force_n[1] + 100.0).abs() < 2.0 && force.force_n[0].abs() < 1.0, "{:?}", force.force_n);
    assert!(world.obstacle_touched());
    // However many contact points and parts share it: a capsule flat on the face, two balls side by side.
    let capsule = ToolShape::Capsule { a_m: [-0.03, 0.0, 0.0], b_m: [0.03, 0.0, 0.0], radius_m: 0.025 };
    let ball = |x: f64| ToolShape::Ball { center_m: [x, 0.0, 0.0], radius_m: 0.025 };
    for shapes in [vec![capsule], vec![ball(-0.02), ball(0.02)]] {
        let mut world = World::restore(&config, &[], &theta, &body, Some(&obstacle), &tool(start), &shapes);
        world.step([0.0, 0.008, 0.04]);
        let force = world.step([0.0, 0.008, 0.04]);
        assert!((force.force_n[1] + 50.0).abs() < 2.0, "{shapes:?}: {:?}", force.force_n);
    }
    // The table likewise, 3 mm deep.
    let mut world = restore(&config, &[], &theta, &body, [0.0, 0.0, 0.03]);
    let force = world.step([0.0, 0.0, 0.022]);
    assert!((force.force_n[2] - 50.0).abs() < 1.0, "{:?}", force.force_n);
}

#[test]
fn a_world_is_a_function_of_its_state_whatever_ran_before() {
    let (config, start) = (config(), [0.0, 0.0, 0.04]);
    let theta = object(ObjectShape::Cylinder, [0.04, 0.08, 0.0]);
    let run = || {
        let mut world = restore(&config, &[], &theta, &BodyState::at_rest([0.004, 0.067, 0.04], 0.2), start);
        let (_, wrench) = push(&mut world, start, [0.0, 1.0, 0.0], 3);
        (world.object(), wrench)
    };
    let first = run();
    let mut other =
        restore(&config, &[], &object(ObjectShape::Box, [0.1; 3]), &BodyState::at_rest([0.0, 0.08, 0.05], 1.0), start);
    push(&mut other, start, [0.0, 1.0, 0.0], 5);
    assert_eq!(run(), first);
}

#[test]
fn the_torque_about_the_tool_follows_from_force_and_contact_point() {
    // A box whose face is met 1 cm above the ball's centre height would be met at the ball's equator: the contact lies at the radius along +y,
    // so a pure normal force along −y has no torque, and friction on it has torque r × f.
    let (config, start) = (config(), [0.02, 0.0, 0.04]);
    let theta = object(ObjectShape::Box, [0.08; 3]);
    let mut world = restore(&config, &[], &theta, &BodyState::at_rest([0.0, 0.0655, 0.04], 0.0), start);
    let (_, wrench) = push(&mut world, start, [0.0, 1.0, 0.0], 1);
    let [fx, _, fz] = wrench.force_n;
    let [tx, _, tz] = wrench.torque_nm;
    // r = (0, 0.025, 0): τ = (r_y f_z, 0, −r_y f_x), up to the box's turn of a few degrees.
    assert!((tz + 0.025 * fx).abs() < 0.15 * (0.025 * fx).abs() + 1e-3, "{tz} {fx}");
    assert!((tx - 0.025 * fz).abs() < 0.15 * (0.025 * fz).abs() + 1e-3, "{tx} {fz}");
}
