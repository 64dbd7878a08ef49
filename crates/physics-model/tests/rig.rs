//! Rigs of measured logs against closed forms, and what a program that fits them counts on.

#[path = "support/rigs.rs"]
mod rigs;
#[path = "support/robots.rs"]
mod robots;

use std::sync::Arc;

use physics_model::effect::{Effect, EffectKind};
use physics_model::rig::{Prism, Rig, RigError, RigObject, RigReading, RigShape, RigStart, RigTool};
use physics_model::world::Divergence;
use physics_model::{BodyState, ObjectShape};
use rigs::{G, rig};

const MU: f64 = 0.3;
const MASS_KG: f64 = 0.5;
const SIZE_M: [f64; 3] = [0.08, 0.06, 0.05];
const BALL_M: f64 = 0.02;

fn ball() -> Rig {
    rig(RigTool::Ball { radius_m: BALL_M })
}

fn cuboid() -> RigObject {
    RigObject::new(RigShape::Solid { shape: ObjectShape::Box, size_m: SIZE_M }, MASS_KG, MU)
}

fn rectangle(feet_m: Vec<[f64; 2]>) -> RigShape {
    let [a, b, c] = SIZE_M;
    let outline = [[a, b], [-a, b], [-a, -b], [a, -b]].map(|p| p.map(|v| v / 2.0));
    RigShape::Prism(Arc::new(Prism::new(outline.to_vec(), c, feet_m).unwrap()))
}

fn effect(kind: EffectKind, values: &[f64]) -> Vec<Box<dyn Effect>> {
    vec![kind.from_parameters(values).unwrap().build()]
}

fn standing() -> BodyState {
    BodyState::at_rest([0.0, 0.0, SIZE_M[2] / 2.0], 0.0)
}

fn moving(linear_mps: [f64; 3], angular_rps: [f64; 3]) -> BodyState {
    BodyState { linear_mps, angular_rps, ..standing() }
}

/// A ball 5 mm before the box that speeds up to 0.1 m/s and pushes it along x, a little off its middle.
fn push(ticks: usize) -> ([f64; 3], Vec<[f64; 3]>) {
    let place = |tick: usize| {
        let time = 0.01 * tick as f64;
        let way = if time < 0.2 { 0.25 * time * time } else { 0.01 + 0.1 * (time - 0.2) };
        [-SIZE_M[0] / 2.0 - BALL_M - 0.005 + way, 0.006, 0.02]
    };
    (place(0), (1..=ticks).map(place).collect())
}

fn play(rig: &Rig, object: &RigObject, effects: &[Box<dyn Effect>], ticks: usize) -> Vec<RigReading> {
    let (tool_m, commands) = push(ticks);
    rig.run(object, effects, &RigStart::of_episode(standing(), Some(tool_m)), &commands).unwrap()
}

fn free(object: &RigObject, effects: &[Box<dyn Effect>], from: BodyState, ticks: usize) -> Vec<RigReading> {
    let start = RigStart::of_episode(from, None);
    rig(RigTool::None).run(object, effects, &start, &vec![[0.0; 3]; ticks]).unwrap()
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} and {expected}");
}

#[test]
fn a_scale_shows_in_the_apparent_gravity_of_a_fall() {
    let mut from = moving([0.3, 0.0, 1.0], [5.0, 3.0, 1.0]);
    from.position_m[2] = 1.0;
    let time = 0.3;
    for scale in [1.0, 1.05] {
        let last = free(&cuboid(), &effect(EffectKind::PoseScale, &[scale]), from, 30).pop().unwrap().object;
        close(last.position_m[0], 0.3 * time, 1e-5);
        // Euler steps of 2.5 ms.
        close(last.position_m[2], 1.0 + time - scale * G * time * time / 2.0, 0.5 * G * time * 0.003);
        close(last.linear_mps[2], 1.0 - scale * G * time, 1e-4);
    }
}

#[test]
fn a_slide_ends_after_v_squared_over_two_mu_g() {
    let last = free(&cuboid(), &[], moving([0.5, 0.0, 0.0], [0.0; 3]), 60).pop().unwrap().object;
    close(last.position_m[0], 0.25 / (2.0 * MU * G), 0.002);
    close(last.linear_mps[0], 0.0, 1e-3);
}

#[test]
fn a_steady_push_takes_mu_m_g_with_what_is_added() {
    for added_mass_kg in [0.0, 0.3] {
        let object = RigObject { added_mass_kg, ..cuboid() };
        let mut rig = ball();
        rig.world.tool_friction = 0.0;
        let (tool_m, mut commands) = push(120);
        let straight = |p: &mut [f64; 3]| p[1] = 0.0;
        commands.iter_mut().for_each(straight);
        let start = RigStart::of_episode(standing(), Some([tool_m[0], 0.0, tool_m[2]]));
        let readings = rig.run(&object, &[], &start, &commands).unwrap();
        let mean = readings[60..].iter().map(|r| -r.wrench.force_n[0]).sum::<f64>() / 60.0;
        close(mean, MU * (MASS_KG + added_mass_kg) * G, 0.02 * MU * MASS_KG * G);
    }
}

#[test]
fn a_cylinder_on_its_side_slides_until_it_rolls_whatever_its_sole_bears_on() {
    let (radius_m, height_m, speed_mps) = (0.03, 0.08, 0.3);
    let shape = RigShape::Solid { shape: ObjectShape::Cylinder, size_m: [radius_m, height_m, 0.0] };
    let plain = RigObject::new(shape, MASS_KG, MU);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Its axis along y.
    let mut from = moving([speed_mps, 0.0, 0.0], [0.0; 3]);
    (from.position_m[2], from.orientation) = (radius_m, [half, 0.0, 0.0, half]);
    let patch = effect(EffectKind::FrictionPatch, &[1e-6, 0.0, 0.0, 0.05]);
    for (object, effects) in [(RigObject { on_points: true, ..plain.clone() }, &[][..]), (plain, &patch)] {
        let last = free(&object, effects, from, 60).pop().unwrap().object;
        // Friction takes a third of the speed of a solid cylinder: v = v₀ / (1 + I / (m r²)), I = m r² / 2.
        close(last.linear_mps[0], speed_mps / 1.5, 0.01 * speed_mps);
        close(last.angular_rps[1], last.linear_mps[0] / radius_m, 0.2);
        close(last.position_m[2], radius_m, 1e-3);
    }
}

#[test]
fn the_pair_of_tool_and_object_has_its_own_friction() {
    // The ball rises along the face that it pushes, at 3 cm/s.
    let vertical = |friction, tool_slip_mps| {
        let mut rig = Rig { tool_slip_mps, ..ball() };
        rig.world.tool_friction = friction;
        let object = RigObject { friction: 0.1, ..cuboid() };
        let commands: Vec<[f64; 3]> =
            (1..=60).map(|i| [-0.062 + 0.001 * f64::from(i), 0.0, 0.01 + 0.0003 * f64::from(i)]).collect();
        let start = RigStart::of_episode(standing(), Some([-0.062, 0.0, 0.01]));
        let readings = rig.run(&object, &[], &start, &commands).unwrap();
        let sums = readings[30..].iter().fold([0.0; 2], |[x, z], r| [x + r.wrench.force_n[0], z + r.wrench.force_n[2]]);
        sums[1] / sums[0]
    };
    close(vertical(0.3, 0.0), 0.3, 0.02);
    close(vertical(0.05, 0.0), 0.05, 0.01);
    // One that lets go has all of it from a slip on, and half of it at half of that.
    close(vertical(0.3, 0.01), 0.3, 0.02);
    close(vertical(0.3, 0.06), 0.15, 0.02);
}

#[test]
fn a_slip_that_is_none_is_refused() {
    for tool_slip_mps in [-0.001, 2.0, f64::NAN] {
        let rig = Rig { tool_slip_mps, ..ball() };
        let (tool_m, commands) = push(3);
        let result = rig.run(&cuboid(), &[], &RigStart::of_episode(standing(), Some(tool_m)), &commands);
        assert!(result.unwrap_err().to_string().contains("tool_slip_mps"));
    }
}

#[test]
fn an_added_mass_separates_a_tilt_from_a_constant_force() {
    let speed = |effects: &[Box<dyn Effect>], added_mass_kg| {
        let object = RigObject { friction: 0.0, added_mass_kg, ..cuboid() };
        free(&object, effects, standing(), 50).pop().unwrap().object.linear_mps[0]
    };
    let tilt = effect(EffectKind::TableTilt, &[0.02, 0.0]);
    let force = effect(EffectKind::ConstantForce, &[0.1, 0.0]);
    for added in [0.0, 0.5] {
        close(speed(&tilt, added), 0.5 * G * 0.02f64.sin(), 2e-3);
        close(speed(&force, added), 0.5 * 0.1 / (MASS_KG + added), 2e-3);
    }
}

#[test]
fn inertia_decides_how_long_a_spin_lasts_and_feet_how_strongly_it_is_held() {
    let spin = |shape: RigShape, inertia_kgm2: Option<[f64; 3]>, added_mass_kg| {
        let object = RigObject { shape, inertia_kgm2, added_mass_kg, ..cuboid() };
        let readings = free(&object, &[], moving([0.0; 3], [0.0, 0.0, 12.0]), 4);
        (readings[0].object.angular_rps[2] - readings[3].object.angular_rps[2]) / 0.03
    };
    let uniform = MASS_KG * (SIZE_M[0].powi(2) + SIZE_M[1].powi(2)) / 12.0;
    let corners = SIZE_M[0].hypot(SIZE_M[1]) / 2.0;
    let slowing = |lever_m: f64, moment: f64, mass_kg: f64| MU * mass_kg * G * lever_m / moment;
    let solid = RigShape::Solid { shape: ObjectShape::Box, size_m: SIZE_M };
    let three = uniform * 3.0;
    let feet = |r: f64| vec![[r, 0.0], [-0.5 * r, 0.866 * r], [-0.5 * r, -0.866 * r]];
    let mut found = Vec::new();
    for (shape, inertia, added, expected) in [
        (solid.clone(), None, 0.0, slowing(corners, uniform, MASS_KG)),
        (solid.clone(), Some([three; 3]), 0.0, slowing(corners, three, MASS_KG)),
        // In the axis: more weight, the same inertia.
        (solid, Some([three; 3]), 0.5, slowing(corners, three, MASS_KG + 0.5)),
        (rectangle(vec![]), None, 0.0, slowing(corners, uniform, MASS_KG)),
        (rectangle(feet(0.02)), None, 0.0, slowing(0.02, uniform, MASS_KG)),
        (rectangle(feet(0.03)), None, 0.0, slowing(0.03, uniform, MASS_KG)),
    ] {
        found.push((spin(shape, inertia, added), expected));
    }
    assert!(found.iter().all(|(found, expected)| (found / expected - 1.0).abs() < 0.05), "{found:?}");
}

#[test]
fn an_added_mass_draws_the_centre_of_mass_to_the_middle() {
    // Spinning freely, the centre of mass goes straight and the centre of the shape round it at the distance of the two.
    let object = RigObject { com_m: [0.02, 0.0, 0.0], added_mass_kg: MASS_KG, ..cuboid() };
    let mut from = moving([0.0, 0.0, 0.0], [0.0, 0.0, 10.0]);
    from.position_m[2] = 1.0;
    let last = free(&object, &[], from, 20).pop().unwrap().object;
    // After 2 rad about the centre of mass at 0.01 m, which moves along y at 0.1 m/s.
    close(last.position_m[0], 0.01 - 0.01 * 2f64.cos(), 3e-4);
    close(last.position_m[1], 0.2 * 0.1 - 0.01 * 2f64.sin(), 3e-4);
}

#[test]
fn a_toss_bounces_by_its_restitution() {
    let mut from = standing();
    from.position_m[2] += 0.3;
    // Short steps: a contact is seen when it overlaps, up to a step's way late.
    let mut rig = rig(RigTool::None);
    (rig.tick_steps, rig.world.control_period_secs) = (8, 0.01 / 8.0);
    let ball = RigShape::Solid { shape: ObjectShape::Sphere, size_m: [SIZE_M[2] / 2.0, 0.0, 0.0] };
    // A box that lands flat does so on four points, between which the engine does not iterate: it bounces a little less.
    for (shape, e, tolerance) in
        [(&ball, 0.2, 0.02), (&ball, 0.6, 0.02), (&cuboid().shape, 0.2, 0.03), (&cuboid().shape, 0.6, 0.1)]
    {
        let object = RigObject { shape: shape.clone(), restitution: Some(e), ..cuboid() };
        let readings = rig.run(&object, &[], &RigStart::of_episode(from, None), &[[0.0; 3]; 60]).unwrap();
        let top = readings[30..].iter().map(|r| r.object.position_m[2]).fold(0.0, f64::max) - SIZE_M[2] / 2.0;
        close((top / 0.3).sqrt(), e, tolerance);
    }
    // One that slides through its bounce loses mu times all of the normal impulse; how much of it the engine has at hand when it solves friction
    // depends on where in a step the contact begins.
    let object = RigObject { shape: ball, restitution: Some(0.6), ..cuboid() };
    from.linear_mps[0] = 6.0;
    let shares: Vec<f64> = (0..10)
        .map(|i| {
            let height = 0.3 + 0.0005 * f64::from(i);
            from.position_m[2] = height + SIZE_M[2] / 2.0;
            let readings = rig.run(&object, &[], &RigStart::of_episode(from, None), &[[0.0; 3]; 40]).unwrap();
            (6.0 - readings[39].object.linear_mps[0]) / (MU * 1.6 * (2.0 * G * height).sqrt())
        })
        .collect();
    assert!((shares.iter().sum::<f64>() / 10.0 - 1.0).abs() < 0.1, "{shares:?}");
    assert!(shares.iter().all(|share| (share - 1.0).abs() < 0.25), "{shares:?}");
    // A tumbling one comes to rest on the table.
    let mut from = moving([1.0, -0.5, -1.0], [15.0, -10.0, 8.0]);
    from.position_m[2] = 0.3;
    for shape in [cuboid().shape, rectangle(vec![]), rectangle(vec![[0.02, 0.0], [-0.02, 0.02], [-0.02, -0.02]])] {
        let object = RigObject { shape, restitution: Some(0.1), ..cuboid() };
        let last = free(&object, &[], from, 300).pop().unwrap().object;
        assert!(last.position_m[2] > 0.02 && last.position_m[2] < 0.045, "{last:?}");
        assert!(last.linear_mps.iter().all(|v| v.abs() < 0.01), "{last:?}");
    }
}

#[test]
fn a_delay_shifts_the_tool_path_and_a_start_in_the_middle_goes_on() {
    let (tool_m, commands) = push(100);
    let delay = effect(EffectKind::ActuationDelay, &[0.053]);
    let readings = play(&ball(), &cuboid(), &delay, 100);
    for tick in 10..100 {
        // Between the commands 6 and 5 ticks before.
        let expected = 0.3 * commands[tick - 6][0] + 0.7 * commands[tick - 5][0];
        close(readings[tick].tool_m.unwrap()[0], expected, 1e-12);
    }
    for cut in [3, 60] {
        let read = &readings[cut - 1];
        let start = RigStart {
            object: read.object,
            tool_m: read.tool_m,
            joints_rad: None,
            time_secs: 0.01 * cut as f64,
            // The command before the first was the place itself.
            earlier_commands: &[&[tool_m], &commands[..cut]].concat(),
            hidden: &[],
        };
        let again = ball().run(&cuboid(), &delay, &start, &commands[cut..]).unwrap();
        for (a, b) in again.iter().zip(&readings[cut..]) {
            assert_eq!(a.tool_m, b.tool_m);
        }
    }
}

#[test]
fn a_run_that_begins_in_the_middle_of_a_push_goes_on_alike() {
    let (tool_m, commands) = push(150);
    let late = effect(EffectKind::PoseDelay, &[0.034]);
    let mut both = effect(EffectKind::PoseScale, &[1.02]);
    both.extend(effect(EffectKind::TimeBase, &[0.97]));
    let soft = effect(EffectKind::ArmCompliance, &[3000.0]);
    for (effects, tolerance_m) in [(vec![], 1e-4), (late, 2e-4), (both, 1e-4), (soft, 2e-4)] {
        let whole = play(&ball(), &cuboid(), &effects, 150);
        for cut in [20, 50, 100] {
            let read = &whole[cut - 1];
            let start = RigStart {
                object: read.object,
                tool_m: read.tool_m,
                joints_rad: None,
                time_secs: 0.01 * cut as f64,
                earlier_commands: &[&[tool_m], &commands[..cut]].concat(),
                hidden: &[],
            };
            let again = ball().run(&cuboid(), &effects, &start, &commands[cut..]).unwrap();
            for (i, (a, b)) in again.iter().zip(&whole[cut..]).enumerate().take(30) {
                for axis in 0..3 {
                    let off = (a.object.position_m[axis] - b.object.position_m[axis]).abs();
                    assert!(off < tolerance_m, "{effects:?} {cut}+{i}: {off} on axis {axis}");
                }
                close(a.object.yaw_rad(), b.object.yaw_rad(), 2e-3);
            }
        }
    }
}

#[test]
fn a_slow_sensor_shows_every_force_filtered() {
    let plain = play(&ball(), &cuboid(), &[], 80);
    let slow = play(&ball(), &cuboid(), &effect(EffectKind::ForceLowPass, &[0.03]), 80);
    let kept = (-0.01f64 / 0.03).exp();
    let mut expected = plain[0].wrench.force_n[0];
    for (plain, slow) in plain.iter().zip(&slow) {
        expected = kept * expected + (1.0 - kept) * plain.wrench.force_n[0];
        close(slow.wrench.force_n[0], expected, 1e-12);
        assert_eq!(plain.object, slow.object);
    }
}

fn arm(name: &str) -> (Rig, BodyState, [f64; 3]) {
    let (tool_m, table_height_m) = match name {
        "sawyer" => ([0.53, -0.22, -0.05], -0.1),
        _ => ([0.46, -0.26, 0.05], 0.0),
    };
    let mut rig = rig(RigTool::Arm(Arc::new(robots::robot(name))));
    rig.world.table_height_m = table_height_m;
    let at = [tool_m[0], tool_m[1] + 0.1, rig.world.table_height_m + SIZE_M[2] / 2.0];
    (rig, BodyState::at_rest(at, 0.0), tool_m)
}

/// Forth along y by `reach_m` and back.
fn forth_and_back(from_m: [f64; 3], reach_m: f64) -> Vec<[f64; 3]> {
    let share = |tick: i32| f64::from(100 - (tick - 100).abs()) / 100.0;
    (1..=200).map(|tick| [from_m[0], from_m[1] + reach_m * share(tick), from_m[2]]).collect()
}

#[test]
fn play_shows_only_after_a_reversal() {
    let (rig, object, tool_m) = arm("sawyer");
    let commands = forth_and_back(tool_m, 0.02);
    let start = RigStart::of_episode(object, Some(tool_m));
    let play = effect(EffectKind::Backlash, &[0.002]);
    let lag = |effects: &[Box<dyn Effect>]| -> Vec<f64> {
        let readings = rig.run(&cuboid(), effects, &start, &commands).unwrap();
        readings.iter().zip(&commands).map(|(r, c)| r.tool_m.unwrap()[1] - c[1]).collect()
    };
    assert!(lag(&[]).iter().all(|v| v.abs() < 1e-12));
    let lag = lag(&play);
    // A joint that has taken up its play stays behind its drive by half the gap, and after the reversal by as much ahead: 1 mrad at up to 1 m.
    let [forth, back] = [lag[98], lag[198]];
    assert!(forth < -1e-4 && forth > -3e-3 && back > 1e-4 && back < 3e-3, "{forth} {back}");
    close(lag[98], lag[90], 1e-4);
    close(lag[198], lag[190], 1e-4);
    let mut ball = ball();
    ball.world.table_height_m = rig.world.table_height_m;
    let none = ball.run(&cuboid(), &play, &start, &commands).unwrap();
    assert!(none.iter().zip(&commands).all(|(r, c)| r.tool_m == Some(*c)), "a tool without joints");
}

#[test]
fn an_arm_reads_joints_and_torques_and_its_sensors_see_a_payload() {
    let (rig, mut object, tool_m) = arm("jaco");
    object.position_m[1] += 0.3;
    let RigTool::Arm(robot) = &rig.tool else { panic!("an arm") };
    let commands = forth_and_back(tool_m, 0.02);
    let start = RigStart::of_episode(object, Some(tool_m));
    let plain = rig.run(&cuboid(), &[], &start, &commands).unwrap();
    let loaded =
        rig.run(&cuboid(), &effect(EffectKind::WristPayload, &[0.5, 0.0, 0.0, 0.0]), &start, &commands).unwrap();
    for (reading, command) in plain.iter().zip(&commands) {
        let at = robot.base_from_tool(&reading.joints_rad.as_slice()[..robot.joint_count()]).translation;
        assert!((0..3).all(|i| (at.vector[i] - command[i]).abs() < 2e-7));
    }
    // In steady motion away from the ends: gravity, and little else.
    let (a, b) = (&plain[50], &loaded[50]);
    let joints = &a.joints_rad.as_slice()[..robot.joint_count()];
    assert!((a.joint_torque_nm - robot.gravity_torque(joints)).amax() < 0.05, "{}", a.joint_torque_nm);
    close(b.wrench.force_n[2] - a.wrench.force_n[2], -0.5 * G, 0.01);
    let weight = robot.contact_torque(joints, &nalgebra::Vector6::new(0.0, 0.0, -0.5 * G, 0.0, 0.0, 0.0));
    assert!((b.joint_torque_nm - a.joint_torque_nm + weight).amax() < 0.02);
}

#[test]
fn a_prism_of_four_corners_is_a_box() {
    let prism = RigObject { shape: rectangle(vec![]), ..cuboid() };
    let (a, b) = (play(&ball(), &cuboid(), &[], 150), play(&ball(), &prism, &[], 150));
    for (a, b) in a.iter().zip(&b) {
        for axis in 0..3 {
            close(a.object.position_m[axis], b.object.position_m[axis], 2e-4);
        }
        close(a.object.yaw_rad(), b.object.yaw_rad(), 5e-3);
    }
}

#[test]
fn outlines_of_many_corners_and_hollow_ones_stand_and_slide() {
    let octagon: Vec<[f64; 2]> =
        (0..8).map(|i| f64::from(i) * std::f64::consts::FRAC_PI_4).map(|a| [0.04 * a.cos(), 0.04 * a.sin()]).collect();
    let ell = vec![[-0.03, -0.03], [0.05, -0.03], [0.05, 0.0], [0.0, 0.0], [0.0, 0.05], [-0.03, 0.05]];
    for outline in [octagon, ell] {
        let shape = RigShape::Prism(Arc::new(Prism::new(outline, SIZE_M[2], vec![]).unwrap()));
        let object = RigObject { shape, ..cuboid() };
        let last = free(&object, &[], moving([0.4, 0.0, 0.0], [0.0; 3]), 60).pop().unwrap().object;
        close(last.position_m[0], 0.16 / (2.0 * MU * G), 0.002);
        close(last.position_m[2], SIZE_M[2] / 2.0, 5e-4);
        play(&ball(), &object, &[], 100);
    }
}

#[test]
fn neutral_effects_change_nothing_bit_for_bit() {
    let (arm, at, tool_m) = arm("jaco");
    let commands = forth_and_back(tool_m, 0.06);
    let prism = RigObject { shape: rectangle(vec![[0.02, 0.0], [-0.02, 0.02], [-0.02, -0.02]]), ..cuboid() };
    let prism = RigObject { restitution: Some(0.2), added_mass_kg: 0.1, com_m: [0.004, 0.002, 0.0], ..prism };
    for (rig, object, from, tool_m, commands) in [
        (ball(), cuboid(), standing(), Some(push(0).0), push(100).1),
        (arm, prism.clone(), at, Some(tool_m), commands),
        (rig(RigTool::None), prism, moving([0.3, 0.1, 0.0], [0.0, 0.0, 5.0]), None, push(100).1),
    ] {
        let start = RigStart::of_episode(from, tool_m);
        let plain = rig.run(&object, &[], &start, &commands).unwrap();
        let (world, theta) = rig.nominal(&object);
        for kind in EffectKind::ALL {
            let neutral = rig.run(&object, &[kind.neutral(&world, &theta).build()], &start, &commands).unwrap();
            let off = plain.iter().zip(&neutral).position(|(a, b)| a != b);
            assert_eq!(off, None, "{}: {:?}", kind.name(), off.map(|i| (&plain[i], &neutral[i])));
        }
    }
}

#[test]
fn every_effect_acts() {
    let (rig, mut at, tool_m) = arm("jaco");
    at.position_m[1] = tool_m[1] + 0.06;
    let commands = forth_and_back(tool_m, 0.1);
    let start = RigStart::of_episode(at, Some(tool_m));
    let sphere = RigObject::new(RigShape::Solid { shape: ObjectShape::Sphere, size_m: [0.04, 0.0, 0.0] }, MASS_KG, MU);
    for kind in EffectKind::ALL {
        let object = if kind.name() == "rolling_resistance" { &sphere } else { &cuboid() };
        let mut start = start.clone();
        if kind.name() == "rolling_resistance" {
            start.object.position_m[2] = rig.world.table_height_m + 0.04;
        }
        let values: Vec<f64> = kind
            .parameters()
            .iter()
            .map(|parameter| match (kind.name(), parameter.name) {
                ("friction_level", _) => 0.5,
                ("force_saturation", _) => 0.5,
                ("hidden_obstacle", "y_m") => tool_m[1] + 0.16,
                ("friction_patch" | "tether", "y_m" | "anchor_y_m") => tool_m[1] + 0.1,
                ("hidden_obstacle" | "friction_patch" | "tether", "x_m" | "anchor_x_m") => tool_m[0],
                ("hidden_obstacle", "size_0_m" | "size_1_m") => 0.06,
                _ => parameter.typical(),
            })
            .collect();
        let plain = rig.run(object, &[], &start, &commands).unwrap();
        let changed = rig.run(object, &effect(*kind, &values), &start, &commands).unwrap();
        assert!(plain.iter().zip(&changed).any(|(a, b)| a != b), "{}", kind.name());
        assert_eq!(changed, rig.run(object, &effect(*kind, &values), &start, &commands).unwrap(), "{}", kind.name());
    }
}

#[test]
fn absurd_starts_are_reported() {
    let diverged = |object: BodyState, tool_m| {
        let start = RigStart::of_episode(object, Some(tool_m));
        match ball().run(&cuboid(), &[], &start, &push(20).1) {
            Err(RigError::Diverged { tick, divergence, readings }) => (tick, divergence, readings.len()),
            other => panic!("{other:?}"),
        }
    };
    let tool_m = push(0).0;
    let at = |position_m: [f64; 3]| BodyState { position_m, ..standing() };
    assert_eq!(diverged(at([0.0, 0.0, -3.0]), tool_m), (0, Divergence::Sank, 0));
    assert_eq!(diverged(at([1e30, 0.0, 0.1]), tool_m), (0, Divergence::Flies, 0));
    assert_eq!(diverged(moving([1e5, 0.0, 0.0], [0.0; 3]), tool_m), (0, Divergence::Flies, 0));
    assert_eq!(diverged(moving([0.0; 3], [0.0, 1e9, 0.0]), tool_m), (0, Divergence::Flies, 0));
    assert_eq!(diverged(standing(), [f64::NAN; 3]), (0, Divergence::NotFinite, 0));
    assert_eq!(diverged(BodyState { orientation: [0.0; 4], ..standing() }, tool_m), (0, Divergence::NotFinite, 0));
    // Falls off the end of what is looked at, after some ticks.
    let start = RigStart::of_episode(moving([0.0, 0.0, 25.0], [0.0; 3]), None);
    let force = effect(EffectKind::ConstantForce, &[100.0, 0.0]);
    let error = rig(RigTool::None).run(&cuboid(), &force, &start, &[[0.0; 3]; 100]).unwrap_err();
    let RigError::Diverged { tick, divergence: Divergence::Flies, readings } = error else { panic!("{error}") };
    assert!(tick > 3 && readings.len() == tick);
    assert!(ball().run(&cuboid(), &[], &RigStart::of_episode(standing(), None), &push(5).1).is_err());
    let massless = RigObject { mass_kg: 0.0, ..cuboid() };
    assert!(matches!(
        ball().run(&massless, &[], &RigStart::of_episode(standing(), Some(tool_m)), &[]),
        Err(RigError::Object { what: "mass", .. })
    ));
}
