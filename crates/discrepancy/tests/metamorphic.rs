//! What cannot change an answer: other units, frames (where friction is the same in all directions), orders and clocks of the same log.

use std::path::Path;

use discrepancy::{Nominal, Report, Settings, diagnose, rig_tool};
use measured_log::{Axis, Channel, Component, Log, Number, Readings, Shape};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

fn whole(set: &str) -> Log {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
    measured_log::read(&folder.join(set)).unwrap()
}

/// What a dozen episodes show.
fn log(set: &str) -> Log {
    let mut log = whole(set);
    log.episodes.truncate(12);
    log
}

fn report(log: &Log) -> Report {
    // What cannot change an answer cannot change that of a short search either.
    // 360 of these are left for what comes after the search.
    within(log, &Settings { rollouts: 2640, most: 2750, limit: 2970, ..Settings::default() })
}

fn within(log: &Log, budget: &Settings) -> Report {
    let nominal = Nominal::new(&log.header, rig_tool(log, None).unwrap()).unwrap();
    let settings = Settings { looks: 6, quick_fits: 3, effects: 1, ..budget.clone() };
    Report::new(&diagnose(log, "log", &nominal, &settings).unwrap(), &settings, 0.0)
}

/// Every reading of a channel, changed.
fn change(log: &mut Log, of: impl Fn(Channel) -> bool, by: impl Fn(f64) -> f64) {
    for episode in &mut log.episodes {
        for (_, readings) in episode.channels.iter_mut().filter(|(channel, _)| of(**channel)) {
            *readings = readings.iter().map(|reading| reading.map(&by)).collect();
        }
    }
}

fn times(factor: f64, number: &mut Number) {
    *number = match *number {
        Number::Fixed(value) => Number::Fixed(factor * value),
        Number::Uncertain { mean, stddev } => Number::Uncertain { mean: factor * mean, stddev: factor * stddev },
    };
}

/// Masses, inertias and forces, and what is known of their noise.
fn heavier(mut log: Log, factor: f64) -> Log {
    times(factor, &mut log.header.object.mass_kg);
    log.header.object.inertia_kgm2.iter_mut().flatten().for_each(|inertia| times(factor, inertia));
    let noise = &mut log.header.noise;
    for stddev in [&mut noise.wrist_force_n, &mut noise.wrist_torque_nm, &mut noise.joint_torque_nm] {
        *stddev = stddev.map(|stddev| factor * stddev);
    }
    let of = |channel| {
        matches!(
            channel,
            Channel::WristForce(_) | Channel::WristTorque(_) | Channel::JointTorque(_) | Channel::AddedMass
        )
    };
    change(&mut log, of, |value| factor * value);
    log
}

/// Lengths and gravity: forces with them, torques twice.
fn larger(mut log: Log, factor: f64) -> Log {
    let header = &mut log.header;
    header.gravity_mps2 *= factor;
    header.tool_radius_m = header.tool_radius_m.map(|radius| factor * radius);
    times(factor, &mut header.table.height_m);
    header.object.com_m.iter_mut().for_each(|com| times(factor, com));
    match &mut header.object.shape {
        Shape::Box { size_m } => size_m.iter_mut().for_each(|size| times(factor, size)),
        Shape::Cylinder { radius_m, height_m } => [radius_m, height_m].into_iter().for_each(|size| times(factor, size)),
        Shape::Sphere { radius_m } => times(factor, radius_m),
        Shape::Prism { .. } => panic!("no recorded log has one"),
    }
    header.object.inertia_kgm2.iter_mut().flatten().for_each(|inertia| times(factor * factor, inertia));
    let noise = &mut header.noise;
    let lengths = [&mut noise.object_position_m, &mut noise.object_velocity_mps, &mut noise.tool_position_m];
    for stddev in lengths.into_iter().chain([&mut noise.wrist_force_n]) {
        *stddev = stddev.map(|stddev| factor * stddev);
    }
    noise.wrist_torque_nm = noise.wrist_torque_nm.map(|stddev| factor * factor * stddev);
    let long = |channel| {
        matches!(
            channel,
            Channel::Command(_)
                | Channel::Tool(_)
                | Channel::ObjectPosition(_)
                | Channel::ObjectVelocity(_)
                | Channel::WristForce(_)
        )
    };
    change(&mut log, long, |value| factor * value);
    change(&mut log, |channel| matches!(channel, Channel::WristTorque(_)), |value| factor * factor * value);
    log
}

/// Seen from a frame that is turned about the vertical.
fn turned(mut log: Log, angle_rad: f64) -> Log {
    let (sin, cos) = angle_rad.sin_cos();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
    let vectors: [fn(Axis) -> Channel; 7] = [
        Channel::Command,
        Channel::Tool,
        Channel::WristForce,
        Channel::WristTorque,
        Channel::ObjectPosition,
        Channel::ObjectVelocity,
        Channel::ObjectSpin,
    ];
    for episode in &mut log.episodes {
        for make in vectors {
            let cells: Vec<_> = (0..episode.rows()).map(|row| episode.vector(make, row)).collect();
            let column = |pick: fn([f64; 3], f64, f64) -> f64| -> Readings {
                cells.iter().map(|cell| cell.map(|cell| pick(cell, sin, cos))).collect()
            };
            let turned = [column(|[x, y, _], s, c| c * x - s * y), column(|[x, y, _], s, c| s * x + c * y)];
            for (axis, readings) in [Axis::X, Axis::Y].into_iter().zip(turned) {
                episode.channels.entry(make(axis)).and_modify(|cells| *cells = readings);
            }
        }
        let poses: Vec<Option<[f64; 4]>> = (0..episode.rows())
            .map(|row| {
                let [x, y, z, w] = episode.orientation(row)?;
                let q = turn * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
                Some([q.i, q.j, q.k, q.w])
            })
            .collect();
        for (i, component) in Component::ALL.into_iter().enumerate() {
            let column: Readings = poses.iter().map(|pose| pose.map(|pose| pose[i])).collect();
            episode.channels.entry(Channel::ObjectOrientation(component)).and_modify(|cells| *cells = column);
        }
    }
    log
}

/// The same names, and values that are `factor` of their units times as large.
fn assert_same(found: &Report, plain: &Report, how: &str, factor: impl Fn(&str) -> f64) {
    let names = |report: &Report| report.effects.iter().map(|effect| effect.name).collect::<Vec<_>>();
    assert_eq!(
        (found.verdict, names(found)),
        (plain.verdict, names(plain)),
        "{how}: {} {}",
        found.summary,
        plain.summary
    );
    for (found, plain) in found.effects.iter().zip(&plain.effects) {
        for (found, plain) in found.parameters.iter().zip(&plain.parameters) {
            let factor = factor(plain.unit);
            let width = factor * (plain.interval90[1] - plain.interval90[0]);
            assert!((found.value - factor * plain.value).abs() < 0.5 * width, "{how}: {found:?}, {plain:?}");
        }
    }
}

/// What a unit is multiplied by if masses and lengths are; times stay.
fn power(unit: &str, mass: f64, length: f64) -> f64 {
    match unit {
        "N" | "N/s" => mass * length,
        "N/m" | "N·s/m" => mass,
        "N·s²/m²" => mass / length,
        "kg" => mass,
        "m" | "m/s" => length,
        _ => 1.0,
    }
}

/// A tilt, damping and a payload: without a unit, with one of forces and speeds, and of a sensor's own mass.
#[test]
fn masses_and_forces_may_be_in_any_unit() {
    let set = "set-009";
    let light = report(&heavier(log(set), 1e-3));
    assert!(!light.effects.is_empty(), "{set}: {}", light.summary);
    let heavy = report(&heavier(log(set), 1e3));
    assert_same(&heavy, &light, set, |unit| power(unit, 1e6, 1.0));
}

#[test]
fn lengths_and_gravity_may_be_in_any_unit() {
    let set = "set-003";
    let small = report(&larger(log(set), 0.1));
    assert!(!small.effects.is_empty(), "{set}: {}", small.summary);
    let large = report(&larger(log(set), 10.0));
    assert_same(&large, &small, set, |unit| power(unit, 1.0, 100.0));
}

#[test]
fn frame_order_sign_and_time_of_a_log_may_be_any() {
    // Damping has no direction. A dozen episodes or a short search do not show one this weak.
    let plain = whole("set-004");
    let report = |log: &Log| within(log, &Settings::default());
    let expected = report(&plain);
    assert!(!expected.effects.is_empty(), "{}", expected.summary);
    let mut other = turned(plain, 2.0);
    other.episodes.reverse();
    change(&mut other, |channel| matches!(channel, Channel::ObjectOrientation(_)), |value| -value);
    other.episodes.iter_mut().for_each(|episode| episode.time_secs.iter_mut().for_each(|time| *time += 1000.0));
    assert_same(&report(&other), &expected, "turned, permuted, -q, later", |_| 1.0);
}
