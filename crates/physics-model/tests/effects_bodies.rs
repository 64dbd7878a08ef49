//! Effects on bodies and contacts in rapier worlds, against closed forms. Settings are those of `scenarios/base.toml` unless a test says so.

use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::Effect;
use physics_model::effects::*;
use physics_model::motion::minimum_jerk;
use physics_model::robot::ToolShape;
use physics_model::world::{ToolPose, World, Wrench};
use physics_model::{BodyState, ObjectShape, ObjectTheta, Theta};

const G: f64 = 9.81;
const BALL: [ToolShape; 1] = [ToolShape::Ball { center_m: [0.0; 3], radius_m: 0.025 }];
const FAR: [f64; 3] = [5.0, 5.0, 1.0];
/// Half a substep, s: how much shorter than its closed form a slide is (see `closed_forms.rs`).
const HALF_SUBSTEP: f64 = 0.5 / 120.0;
const FLAT: [f64; 3] = [0.08, 0.08, 0.02];

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

/// Short steps, for forces that act between them.
fn fine() -> WorldConfig {
    WorldConfig { control_period_secs: 1.0 / 600.0, ..config() }
}

fn object(shape: ObjectShape, size_m: [f64; 3]) -> Theta {
    Theta {
        object: ObjectTheta { shape, mass_kg: 0.5, com_m: [0.0; 3], friction: 0.4, size_m },
        obstacle: None,
        effects: vec![],
    }
}

fn list(effect: impl Effect + 'static) -> Vec<Box<dyn Effect>> {
    vec![Box::new(effect)]
}

fn restore<'a>(
    config: &'a WorldConfig,
    effects: &'a [Box<dyn Effect>],
    theta: &Theta,
    body: &BodyState,
    at: [f64; 3],
) -> World<'a> {
    let tool = ToolPose { position_m: at, orientation: [0.0, 0.0, 0.0, 1.0] };
    World::restore(config, effects, theta, body, None, &tool, &BALL)
}

fn flying(velocity_mps: [f64; 3]) -> BodyState {
    let mut body = BodyState::at_rest([0.0, 0.0, 2.0], 0.0);
    body.linear_mps = velocity_mps;
    body
}

/// A flat box that slides along `angle_rad`; how far it gets.
fn slide_m(effects: &[Box<dyn Effect>], speed_mps: f64, angle_rad: f64) -> f64 {
    slide_in_m(&config(), effects, speed_mps, angle_rad)
}

fn slide_in_m(config: &WorldConfig, effects: &[Box<dyn Effect>], speed_mps: f64, angle_rad: f64) -> f64 {
    let mut body = BodyState::at_rest([0.0, 0.0, 0.01], 0.0);
    body.linear_mps = [speed_mps * angle_rad.cos(), speed_mps * angle_rad.sin(), 0.0];
    let mut world = restore(config, effects, &object(ObjectShape::Box, FLAT), &body, FAR);
    for _ in 0..(1.5 / config.control_period_secs) as u32 {
        world.step(FAR);
    }
    let [x, y, _] = world.object().position_m;
    x.hypot(y)
}

fn assert_near(found: f64, expected: f64, share: f64, what: &str) {
    assert!((found / expected - 1.0).abs() < share, "{what}: {found}, expected {expected}");
}

#[test]
fn a_flying_body_is_slowed_by_drag_and_damping_as_closed_forms_say() {
    // Gravity off the axis of motion does not change the horizontal part of linear damping; drag is tested without it.
    let config = WorldConfig { gravity_mps2: 1e-9, ..config() };
    let theta = object(ObjectShape::Box, [0.08; 3]);
    let speed = |effects: &[Box<dyn Effect>]| {
        let mut world = restore(&config, effects, &theta, &flying([0.0, 2.0, 0.0]), FAR);
        for _ in 0..60 {
            world.step(FAR);
        }
        world.object().linear_mps[1]
    };
    // 2 exp(−c t / m) and 2 / (1 + k 2 t / m) after 1 s.
    assert_near(speed(&list(ViscousDamping { coefficient_nspm: 0.5 })), 2.0 * (-1.0_f64).exp(), 0.02, "viscous");
    assert_near(speed(&list(QuadraticDrag { coefficient_ns2pm2: 0.75 })), 2.0 / 4.0, 0.002, "quadratic");
}

#[test]
fn a_slide_has_the_length_of_its_friction_level() {
    for coefficient in [0.15, 0.7] {
        let length = slide_m(&list(FrictionLevel { coefficient }), 1.0, 0.3);
        // It takes a part of the first step until the contacts carry the weight.
        assert_near(length, 1.0 / (2.0 * coefficient * G) - HALF_SUBSTEP, 0.05, "v² / (2 μ g)");
    }
}

#[test]
fn a_slide_under_stribeck_friction_has_the_length_of_the_integral() {
    let (excess, velocity_mps) = (1.0, 0.3);
    // In short steps: the curve is read at the beginning of each.
    let length = slide_in_m(&fine(), &list(StribeckFriction { excess, velocity_mps }), 0.5, 0.3);
    // ∫ v dv / (μ g (1 + Δ exp(−(v / v_s)²))) from 0 to 0.5 m/s.
    let n = 100_000;
    let expected: f64 = (0..n)
        .map(|i| {
            let v = 0.5 * (f64::from(i) + 0.5) / f64::from(n);
            v / (0.4 * G * (1.0 + excess * (-(v / velocity_mps).powi(2)).exp())) * 0.5 / f64::from(n)
        })
        .sum();
    assert_near(length, expected, 0.03, "stopping distance");
    // Without it 0.25 / (2 · 0.4 g) = 32 mm.
    assert!(expected < 0.026, "{expected}");
}

#[test]
fn a_slide_over_a_grained_table_depends_on_its_direction() {
    let effects = list(AnisotropicFriction { amplitude: 0.3, axis_rad: 0.2 });
    for (angle, factor) in [(0.2, 1.3), (0.2 + std::f64::consts::FRAC_PI_2, 0.7), (0.2 - std::f64::consts::PI, 1.3)] {
        let expected = 1.0 / (2.0 * 0.4 * factor * G) - HALF_SUBSTEP;
        assert_near(slide_m(&effects, 1.0, angle), expected, 0.03, "v² / (2 μ(φ) g)");
    }
}

#[test]
fn what_sticks_takes_more_force_to_start_than_to_go_on() {
    // A soft arm pulls slowly: its force rises to μ_s m g, then the box slips.
    let config = WorldConfig { tool_friction: 0.0, ..fine() };
    let theta = object(ObjectShape::Box, [0.08; 3]);
    let start = [0.0, 0.0, 0.026];
    for ratio in [1.0, 1.5] {
        let effects: Vec<Box<dyn Effect>> =
            vec![Box::new(StaticFriction { ratio }), Box::new(ArmCompliance { stiffness_npm: 500.0 })];
        let mut world = restore(&config, &effects, &theta, &BodyState::at_rest([0.0, 0.065, 0.04], 0.0), start);
        let (mut highest, mut lowest) = (0.0_f64, f64::INFINITY);
        for step in 1..=1200 {
            let force = -world.step([0.0, 0.01 * f64::from(step) / 600.0, start[2]]).force_n[1];
            if step > 60 {
                highest = highest.max(force);
            }
            if highest > 1.9 {
                lowest = lowest.min(force);
            }
        }
        assert_near(highest, ratio * 0.4 * 0.5 * G, 0.05, "breakaway");
        assert!(lowest < 0.42 * 0.5 * G && lowest > 0.1, "the force falls once it slips: {lowest}");
    }
    // A slide that does not stop on the way is held back by μ alone.
    let (sticking_m, plain_m) = (slide_m(&list(StaticFriction { ratio: 1.5 }), 1.0, 0.0), slide_m(&[], 1.0, 0.0));
    assert_near(sticking_m, plain_m, 1e-3, "a slide");
}

#[test]
fn a_slide_into_a_patch_loses_its_energy_where_the_patch_is() {
    let patch = |x_m: f64| list(FrictionPatch { excess: 1.0, x_m, y_m: 0.0, radius_m: 1.0 });
    let plain = slide_m(&[], 1.0, 0.0);
    assert_near(slide_m(&patch(-3.0), 1.0, 0.0), plain, 0.01, "a patch elsewhere");
    assert_near(slide_m(&patch(0.0), 1.0, 0.0), 1.0 / (2.0 * 0.8 * G) - HALF_SUBSTEP, 0.05, "all of it on the patch");
    // Under the left half alone: it turns to the left.
    let config = config();
    let effects = list(FrictionPatch { excess: 1.0, x_m: 0.0, y_m: 5.0, radius_m: 5.0 });
    let mut body = BodyState::at_rest([0.0, 0.0, 0.01], 0.0);
    body.linear_mps = [0.5, 0.0, 0.0];
    let mut world = restore(&config, &effects, &object(ObjectShape::Box, FLAT), &body, FAR);
    for _ in 0..60 {
        world.step(FAR);
    }
    assert!(world.object().yaw_rad() > 0.05, "{}", world.object().yaw_rad());
}

#[test]
fn a_spin_on_support_points_stops_as_their_torsional_moment_says() {
    let config = config();
    for (shape, size_m) in [(ObjectShape::Box, [0.08, 0.08, 0.03]), (ObjectShape::Cylinder, [0.04, 0.03, 0.0])] {
        for radius_share in [0.4, 0.7] {
            let mut body = BodyState::at_rest([0.0, 0.0, 0.015], 0.0);
            body.angular_rps = [0.0, 0.0, 10.0];
            let effects = list(PressureDistribution { radius_share });
            let mut world = restore(&config, &effects, &object(shape, size_m), &body, FAR);
            for _ in 0..90 {
                world.step(FAR);
            }
            // α = μ m g r_eff / I.
            let (radius, inertia) = match shape {
                ObjectShape::Box => (0.08_f64.hypot(0.08) / 2.0, (2.0 * 0.08 * 0.08) / 12.0),
                _ => (0.04, 0.04 * 0.04 / 2.0),
            };
            let deceleration = 0.4 * G * radius_share * radius / inertia;
            let expected = 100.0 / (2.0 * deceleration) - 10.0 * HALF_SUBSTEP;
            assert_near(world.object().yaw_rad(), expected, 0.04, "turn");
            // A slide does not depend on where the box bears.
            let length = slide_m(&effects, 1.0, 0.3);
            assert_near(length, 1.0 / (2.0 * 0.4 * G) - HALF_SUBSTEP, 0.03, "slide");
        }
    }
}

#[test]
fn a_tilted_table_accelerates_a_frictionless_box_by_g_sin() {
    let config = config();
    let mut theta = object(ObjectShape::Box, FLAT);
    theta.object.friction = 0.0;
    let body = BodyState::at_rest([0.0, 0.0, 0.01], 0.0);
    for (effects, expected) in [
        (list(TableTilt { slope_x_rad: 0.03, slope_y_rad: -0.02 }), [G * 0.03_f64.sin(), -G * 0.02_f64.sin()]),
        // 0.3 N on 0.5 kg.
        (list(ConstantForce { force_x_n: 0.3, force_y_n: -0.1 }), [0.6, -0.2]),
    ] {
        let mut world = restore(&config, &effects, &theta, &body, FAR);
        for _ in 0..60 {
            world.step(FAR);
        }
        let [vx, vy, _] = world.object().linear_mps;
        assert_near(vx, expected[0], 0.01, "v_x after 1 s");
        assert_near(vy, expected[1], 0.01, "v_y after 1 s");
    }
}

#[test]
fn a_tethered_box_swings_with_the_closed_forms_period_and_rests_where_friction_holds_it() {
    let config = config();
    let mut theta = object(ObjectShape::Box, FLAT);
    theta.object.friction = 0.0;
    let effects = list(Tether { stiffness_npm: 20.0, anchor_x_m: 0.1, anchor_y_m: 0.0 });
    let body = BodyState::at_rest([0.2, 0.0, 0.01], 0.0);
    let mut world = restore(&config, &effects, &theta, &body, FAR);
    // Half a period, π √(m / k) = 0.4967 s, takes it to the other side.
    let mut lowest = (0.0, f64::INFINITY);
    for step in 1..=45 {
        world.step(FAR);
        let x = world.object().position_m[0];
        if x < lowest.1 {
            lowest = (f64::from(step) / 60.0, x);
        }
    }
    assert!((lowest.0 - 0.4967).abs() < 0.02 && lowest.1.abs() < 0.005, "{lowest:?}");
    // k d = 1 N against μ m g = 1.96 N: it stays.
    theta.object.friction = 0.4;
    let held = BodyState::at_rest([0.15, 0.0, 0.01], 0.0);
    let mut world = restore(&config, &effects, &theta, &held, FAR);
    for _ in 0..60 {
        world.step(FAR);
    }
    assert!((world.object().position_m[0] - 0.15).abs() < 1e-3, "{:?}", world.object().position_m);
}

#[test]
fn a_leaking_object_is_pushed_with_less_and_less_force() {
    let config = WorldConfig { tool_friction: 0.0, ..config() };
    let effects = list(MassLeak { rate_ps: 0.1 });
    let theta = object(ObjectShape::Box, [0.08; 3]);
    let start = [0.0, 0.0, 0.026];
    let mut world = restore(&config, &effects, &theta, &BodyState::at_rest([0.0, 0.065, 0.04], 0.0), start);
    let mut forces = Vec::new();
    for step in 1..=300 {
        let wrench = world.step([0.0, 0.0005 * f64::from(step), start[2]]);
        forces.push(-wrench.force_n[1]);
    }
    let mean = |from: usize| forces[from..from + 30].iter().sum::<f64>() / 30.0;
    // μ m (1 − λ t) g at 1.25 s and 4.25 s.
    assert_near(mean(60), 0.4 * 0.5 * G * (1.0 - 0.125), 0.03, "after 1.25 s");
    assert_near(mean(240), 0.4 * 0.5 * G * (1.0 - 0.425), 0.03, "after 4.25 s");
}

#[test]
fn a_dropped_ball_comes_up_to_the_square_of_the_restitution() {
    let config = fine();
    let theta = object(ObjectShape::Sphere, [0.04, 0.0, 0.0]);
    for coefficient in [0.0, 0.4, 0.8] {
        let effects = list(Restitution { coefficient });
        let mut world = restore(&config, &effects, &theta, &BodyState::at_rest([0.0, 0.0, 0.24], 0.0), FAR);
        let (mut met, mut highest) = (false, 0.0_f64);
        for _ in 0..420 {
            world.step(FAR);
            let height = world.object().position_m[2] - 0.04;
            met |= height < 0.002;
            if met {
                highest = highest.max(height);
            }
        }
        // A drop of 0.2 m.
        assert!((highest - 0.2 * coefficient * coefficient).abs() < 0.006, "{coefficient}: {highest}");
    }
}

#[test]
fn a_body_sinks_into_soft_contacts_by_its_weight_over_their_stiffness() {
    let config = config();
    let theta = object(ObjectShape::Sphere, [0.04, 0.0, 0.0]);
    for frequency_hz in [10.0, 20.0] {
        let effects = list(ContactCompliance { frequency_hz, damping_ratio: 1.0 });
        let mut world = restore(&config, &effects, &theta, &BodyState::at_rest([0.0, 0.0, 0.04], 0.0), FAR);
        for _ in 0..120 {
            world.step(FAR);
        }
        let sunk = 0.04 - world.object().position_m[2];
        let expected = G / (2.0 * std::f64::consts::PI * frequency_hz).powi(2);
        // The engine allows 0.5 mm before the spring acts.
        assert!((sunk - expected).abs() < 0.0006 + 0.1 * expected, "{frequency_hz} Hz: {sunk}, expected {expected}");
    }
}

#[test]
fn a_retreating_tool_takes_a_light_object_along_and_feels_the_pull_of_a_heavy_one() {
    let config = config();
    let pull = |mass_kg: f64, pull_off_n: f64| {
        let effects = list(Adhesion { pull_off_n });
        let mut theta = object(ObjectShape::Box, [0.08; 3]);
        theta.object.mass_kg = mass_kg;
        let start = [0.0, 0.0, 0.03];
        let mut world = restore(&config, &effects, &theta, &BodyState::at_rest([0.0, 0.065, 0.04], 0.0), start);
        let mut most = 0.0_f64;
        for step in 1..=20 {
            let share = minimum_jerk(f64::from(step) / 20.0);
            let wrench = world.step([0.0, -0.02 * share, start[2]]);
            most = most.max(wrench.force_n[1]);
        }
        (most, world.object().position_m[1] - 0.065)
    };
    let (force, moved) = pull(2.0, 1.0);
    assert!(force > 0.8 && force < 1.05 && moved.abs() < 0.001, "held by μ m g = 7.8 N: {force} N, {moved} m");
    let (force, moved) = pull(0.05, 2.0);
    assert!(moved < -0.01 && force > 0.1 && force < 2.05, "dragged along: {force} N, {moved} m");
    let (force, moved) = pull(0.05, 0.0);
    assert!(force < 0.02 && moved > -0.001, "left behind: {force} N, {moved} m");
}

#[test]
fn a_hidden_obstacle_stops_the_tool_where_it_stands_and_a_movable_one_is_pushed() {
    let config = config();
    let theta = object(ObjectShape::Box, [0.08; 3]);
    let start = [0.0, 0.0, 0.03];
    let body = BodyState::at_rest([1.0, 0.0, 0.04], 0.0);
    let hidden = |movable: bool| {
        list(HiddenObstacle {
            shape: ObjectShape::Box,
            movable,
            x_m: 0.0,
            y_m: 0.06,
            yaw_rad: 0.0,
            size_m: [0.05, 0.05, 0.06],
            mass_kg: 0.4,
        })
    };
    let push = |effects: &[Box<dyn Effect>]| {
        let mut world = restore(&config, effects, &theta, &body, start);
        let mut wrench = Wrench::default();
        for step in 1..=20 {
            wrench = world.step([0.0, 0.02 * minimum_jerk(f64::from(step) / 20.0), start[2]]);
        }
        (wrench, world.hidden())
    };
    // Its face is at 35 mm, the ball's at 45 mm: 10 mm of overlap, 2 of them free, at 50 N/mm.
    let (wrench, bodies) = push(&hidden(false));
    assert_near(-wrench.force_n[1], 400.0, 0.02, "resistance");
    assert_eq!(bodies[0].position_m[1], f64::from(0.06_f32));
    let (_, bodies) = push(&hidden(true));
    assert!((bodies[0].position_m[1] - 0.07).abs() < 0.002, "{:?}", bodies[0].position_m);
    assert_eq!(push(&[]).0, Wrench::default());
}
