//! Standard normal coordinates of starts, against the distribution of worlds that they stand for.

use crate::worlds::{Worlds, normals};
use physics_model::config::ObstacleMobility;
use physics_model::effect::EffectKind;
use physics_model::theta::obstacle_class;
use physics_model::{BodyState, ObjectShape};
use pomdp::{Purpose, Rng, Seed};
use push_task::coordinates::{START, sleeps};
use push_task::sampling::{TruncatedNormal, WorldDistribution, effects};
use push_task::{Coordinates, Observation, Particle};
use rand::RngExt as _;

const MOBILITIES: [ObstacleMobility; 2] = [ObstacleMobility::Fixed, ObstacleMobility::Movable];
/// First coordinate of the obstacle.
const OBSTACLE: usize = 11;

type Shapes = (ObjectShape, Option<ObjectShape>);

/// Something done to a start.
type Change = fn(&mut Particle);

fn shapes(item: usize) -> Shapes {
    (ObjectShape::ALL[item % 3], ObjectShape::ALL.get(item / 3 % 4).copied())
}

/// Whether a coordinate of a start is lost: of a centre of mass at its limit, and of a mass at its own.
fn lost(start: &Particle, index: usize) -> bool {
    let object = &start.theta.object;
    match index {
        2..5 => object.com_m[index - 2].abs() >= 0.5 * object.shape.half_extents_m(object.size_m)[index - 2],
        OBSTACLE => start.theta.obstacle.as_ref().is_some_and(|obstacle| obstacle.mass_kg <= 0.02),
        _ => false,
    }
}

/// Possible starts of all shapes with their coordinates, each in a world of its own.
fn starts(worlds: &Worlds, count: usize) -> Vec<(Shapes, Observation, Vec<f64>, Particle)> {
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let one = |item: usize| {
        let (_, first) = worlds.draw(&mut rng);
        let coordinates = worlds.coordinates(&first);
        let z = normals(coordinates.count(), &mut rng);
        let (start, _) = coordinates.start(shapes(item), &z)?;
        Some((shapes(item), first, z, start))
    };
    let starts: Vec<_> = (0..count).filter_map(one).collect();
    assert!(starts.len() > count / 4, "{} of {count} starts are possible", starts.len());
    starts
}

#[test]
fn the_coordinates_of_a_start_are_those_that_it_was_made_of() {
    let mut rng = Seed(6).stream(Purpose::Test, 0);
    for mobility in MOBILITIES {
        let worlds = Worlds::new("sawyer", mobility, |_| {});
        for (shapes, first, z, start) in starts(&worlds, 600) {
            let coordinates = worlds.coordinates(&first);
            let found = coordinates.of(&start, &mut rng).unwrap();
            for index in (0..START).filter(|index| !sleeps(shapes, *index) && !lost(&start, *index)) {
                // Which side of its centre a sphere's centre of mass was on is not known: it is turned below.
                let turned = shapes.0 == ObjectShape::Sphere && index == 4;
                let (found, z) = if turned { (found[4].abs(), z[4].abs()) } else { (found[index], z[index]) };
                // Of a coordinate 5 standard deviations out, the distribution function has 10 digits left.
                assert!((found - z).abs() < 1e-5, "coordinate {index} of {shapes:?}: {found} {z}");
            }
            let (again, _) = coordinates.start(shapes, &found).unwrap();
            let numbers = |p: &Particle| [p.state.to_vec(), p.theta.continuous().to_vec()].concat();
            for (a, b) in numbers(&again).iter().zip(numbers(&start)) {
                assert!((a - b).abs() < 1e-7, "{shapes:?}: {a} {b}");
            }
        }
    }
}

#[test]
fn the_coordinates_of_worlds_are_standard_normal() {
    let mut worlds = Worlds::new("sawyer", ObstacleMobility::Movable, |_| {});
    // A third of the centres of mass lie at their limits.
    worlds.distribution.object.com_m =
        std::array::from_fn(|_| TruncatedNormal { mean: 0.0, stddev: 0.02, low: -0.05, high: 0.05 });
    let mut rng = Seed(7).stream(Purpose::Test, 0);
    let mut columns = vec![Vec::new(); START];
    for _ in 0..4000 {
        let (world, first) = worlds.draw(&mut rng);
        // The object's place is measured within 6 standard deviations.
        let z = worlds.coordinates(&first).of(&world, &mut rng).unwrap();
        columns.iter_mut().zip(z).for_each(|(column, z)| column.push(z));
    }
    for (index, column) in columns.into_iter().enumerate() {
        // Worlds whose bodies overlap are drawn again: that bends the obstacle's place by less than the test sees in 4000.
        let normal = normals(200_000, &mut rng);
        let (distance, most) = kolmogorov_smirnov(column, normal, START);
        println!("coordinate {index}: {distance:.3} of {most:.3}");
        assert!(distance < most, "coordinate {index}: {distance} {most}");
    }
}

/// Another distribution of the same worlds: heavier, rougher and larger objects, and obstacles elsewhere.
fn another(worlds: &Worlds) -> WorldDistribution {
    let mut other = worlds.distribution.clone();
    other.object.mass_kg.mean *= 1.5;
    other.object.friction.mean += 0.1;
    other.object.size_m.r#box[1].stddev *= 0.7;
    other.object.com_m[0].stddev *= 0.5;
    other.obstacle.x_m.mean += 0.02;
    other
}

#[test]
fn coordinates_of_another_distribution_stand_for_the_same_start() {
    let worlds = Worlds::new("sawyer", ObstacleMobility::Movable, |_| {});
    let mut compared = 0;
    for (shapes, first, z, start) in starts(&worlds, 400) {
        let here = worlds.coordinates(&first);
        assert_eq!(here.translated(&here.clone(), shapes, &z), Some((z.clone(), 0.0)));
        let there = here.with_distribution(&another(&worlds));
        let Some((other, log_ratio)) = there.translated(&here, shapes, &z) else { continue };
        let (moved, _) = there.start(shapes, &other).unwrap();
        for (a, b) in moved.theta.continuous().iter().zip(start.theta.continuous()) {
            assert!((a - b).abs() < 1e-7, "{shapes:?}: {a} {b}");
        }
        // p(x) dx = φ(z) dz on both sides, one coordinate a value.
        let log_normal = |z: &[f64]| -0.5 * z[..START].iter().map(|z| z * z).sum::<f64>();
        let step = 1e-4;
        let slopes: Option<f64> = (0..START)
            .map(|index| {
                let near = |step: f64| {
                    let mut z = z.clone();
                    z[index] += step;
                    there.translated(&here, shapes, &z).map(|(z, _)| z[index])
                };
                Some(((near(step)? - near(-step)?) / (2.0 * step)).ln())
            })
            .sum();
        let Some(slopes) = slopes else { continue };
        let expected = log_normal(&z) - log_normal(&other) - slopes;
        // Errors of the derivative are of the order of step², and of rounding over it.
        assert!((log_ratio - expected).abs() < 1e-4, "{shapes:?}: {log_ratio} {expected}");
        compared += 1;
    }
    assert!(compared > 60, "{compared}");
}

#[test]
fn what_lies_outside_the_distribution_has_no_coordinates() {
    let changes: [Change; 9] = [
        |p| p.theta.object.mass_kg = f64::NAN,
        |p| p.theta.object.mass_kg = -1.0,
        |p| p.theta.object.friction = 0.05,
        |p| p.theta.object.friction = f64::NAN,
        |p| p.theta.object.size_m[0] = 0.2,
        |p| p.theta.obstacle.as_mut().unwrap().mass_kg = 0.0,
        |p| p.theta.obstacle.as_mut().unwrap().size_m[0] = 0.2,
        |p| p.state.obstacle.as_mut().unwrap().position_m[0] = 0.7,
        |p| p.state.obstacle.as_mut().unwrap().orientation = BodyState::at_rest([0.0; 3], 2.0).orientation,
    ];
    let mut rng = Seed(8).stream(Purpose::Test, 0);
    let worlds = Worlds::new("sawyer", ObstacleMobility::Fixed, |_| {});
    let starts = starts(&worlds, 60);
    let (shapes, first, z, start) = starts.iter().find(|(shapes, ..)| shapes.1.is_some()).unwrap();
    let coordinates = worlds.coordinates(first);
    assert!(coordinates.of(start, &mut rng).is_some());
    for (number, change) in changes.iter().enumerate() {
        let mut moved = start.clone();
        change(&mut moved);
        assert!(coordinates.of(&moved, &mut rng).is_none(), "change {number}");
    }
    let mut narrow = worlds.distribution.clone();
    let friction = start.theta.object.friction;
    (narrow.object.friction.low, narrow.object.friction.high) = (friction + 0.01, 1.0);
    assert!(coordinates.with_distribution(&narrow).translated(&coordinates, *shapes, z).is_none());
}

/// Numbers of a start whose distributions are compared; those of an obstacle only where there is one.
fn compared(start: &Particle, first: &Observation) -> Vec<Option<f64>> {
    let (object, body) = (&start.theta.object, &start.state.object);
    let (measured_m, measured) = first.object_pose();
    let measured = BodyState { orientation: measured, ..BodyState::at_rest(measured_m, 0.0) };
    let obstacle = start.theta.obstacle.as_ref().zip(start.state.obstacle.as_ref());
    vec![
        Some(object.mass_kg),
        Some(object.friction),
        Some(object.com_m[2]),
        Some(object.size_m[0]),
        Some(object.shape.half_height_m(object.size_m)),
        Some(body.position_m[0]),
        Some(body.position_m[1]),
        Some(body.yaw_rad()),
        Some(body.position_m[0] - measured_m[0]),
        Some(body.position_m[2] - measured_m[2]),
        Some(body.yaw_rad() - measured.yaw_rad()),
        obstacle.map(|(theta, _)| theta.mass_kg),
        obstacle.map(|(theta, _)| theta.size_m[0]),
        obstacle.map(|(_, body)| body.position_m[0]),
        obstacle.map(|(_, body)| body.position_m[1]),
        obstacle.map(|(_, body)| body.yaw_rad()),
    ]
}

/// Largest distance between two empirical distribution functions, and what it exceeds with probability 0.001 / `tests`.
fn kolmogorov_smirnov(mut a: Vec<f64>, mut b: Vec<f64>, tests: usize) -> (f64, f64) {
    a.sort_by(f64::total_cmp);
    b.sort_by(f64::total_cmp);
    let (n, m) = (a.len() as f64, b.len() as f64);
    let share = |sorted: &[f64], value: f64| sorted.partition_point(|v| *v <= value) as f64;
    let distance = |value: &f64| (share(&a, *value) / n - share(&b, *value) / m).abs();
    let largest = a.iter().chain(&b).map(distance).fold(0.0, f64::max);
    (largest, (0.5 * (2.0 * tests as f64 / 0.001).ln() * (n + m) / (n * m)).sqrt())
}

/// A start given a first observation: of the prior's draws, in proportion to the likelihood of the measured height.
fn given(coordinates: &Coordinates<'_>, position_m: f64, rng: &mut Rng) -> Particle {
    let most = -position_m.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln();
    loop {
        let shapes =
            (ObjectShape::ALL[rng.random_range(0..3)], ObjectShape::ALL.get(rng.random_range(0..4_usize)).copied());
        let z = normals(coordinates.count(), rng);
        if let Some((start, log)) = coordinates.start(shapes, &z) {
            assert!(log <= most + 1e-9, "{log} {most}");
            if rng.random::<f64>() < (log - most).exp() {
                return start;
            }
        }
    }
}

#[test]
fn starts_given_observations_are_distributed_like_worlds() {
    // If a start is drawn given the observation of a world, start and observation together are distributed like world and observation.
    for mobility in MOBILITIES {
        let worlds = Worlds::new("sawyer", mobility, |_| {});
        let noise_m = worlds.model.config().sensor.noise.position_m;
        let (mut rng, count) = (Seed(2).stream(Purpose::Test, 0), 3000);
        let mut samples = [Vec::new(), Vec::new()];
        let mut classes = [[0.0; 12]; 2];
        for item in 0..2 * count {
            let (world, first) = worlds.draw(&mut rng);
            // Independent samples: a world serves one of them.
            let side = item % 2;
            let start = if side == 0 { world } else { given(&worlds.coordinates(&first), noise_m, &mut rng) };
            let obstacle = obstacle_class(start.theta.obstacle.as_ref().map(|o| o.shape));
            classes[side][4 * start.theta.object.shape.index() + obstacle] += 1.0;
            samples[side].push(compared(&start, &first));
        }
        // Null: both rows are draws of one multinomial. χ² with 11 degrees of freedom exceeds 31.3 with probability 0.001.
        let chi_squared: f64 =
            classes[0].iter().zip(classes[1]).map(|(a, b): (&f64, f64)| (a - b).powi(2) / (a + b)).sum();
        assert!(chi_squared < 31.3, "{chi_squared}: {classes:?}");
        let numbers = samples[0][0].len();
        for number in 0..numbers {
            let column = |side: usize| samples[side].iter().filter_map(|row: &Vec<Option<f64>>| row[number]).collect();
            // Null: one distribution. Level 0.001 over all numbers; atoms make the test conservative.
            let (distance, most) = kolmogorov_smirnov(column(0), column(1), numbers);
            println!("number {number}: {distance:.3} of {most:.3}");
            assert!(distance < most, "number {number}: {distance} {most}");
        }
    }
}

#[test]
fn the_centre_of_mass_has_its_atoms() {
    let mut worlds = Worlds::new("sawyer", ObstacleMobility::Fixed, |_| {});
    // A third of the draws lie beyond a quarter of the size.
    worlds.distribution.object.com_m =
        std::array::from_fn(|_| TruncatedNormal { mean: 0.0, stddev: 0.02, low: -0.05, high: 0.05 });
    let mut rng = Seed(3).stream(Purpose::Test, 0);
    let on_limit = |particle: &Particle, axis: usize| {
        let object = &particle.theta.object;
        let limit = 0.5 * object.shape.half_extents_m(object.size_m)[axis];
        assert!(object.com_m[axis].abs() <= limit, "{object:?}");
        object.com_m[axis].abs() == limit
    };
    let (_, first) = worlds.draw(&mut rng);
    let coordinates = worlds.coordinates(&first);
    for shape in ObjectShape::ALL {
        let mut distribution = worlds.distribution.clone();
        distribution.object.shape = std::array::from_fn(|i| f64::from(u8::from(i == shape.index())));
        let (mut counts, mut total) = ([[0.0; 2]; 3], 0);
        while total < 1500 {
            let z = normals(coordinates.count(), &mut rng);
            let Some((start, _)) = coordinates.start((shape, None), &z) else { continue };
            let world = distribution.sample(&worlds.joints_rad, 0.0, &mut rng);
            for (axis, [of_worlds, of_starts]) in counts.iter_mut().enumerate() {
                *of_worlds += f64::from(u8::from(on_limit(&world, axis)));
                *of_starts += f64::from(u8::from(on_limit(&start, axis)));
            }
            total += 1;
        }
        for (axis, [a, b]) in counts.into_iter().enumerate() {
            let (a, b): (f64, f64) = (a, b);
            // Null: two binomials of one probability. Four standard deviations of their difference are at most 4 √(a + b).
            assert!((a - b).abs() <= 4.0 * (a + b).sqrt(), "{shape:?}, axis {axis}: {a} {b}");
            // In the frame of a sphere the centre of mass lies below the centre.
            let atoms = shape != ObjectShape::Sphere || axis == 2;
            assert_eq!(atoms, a > 100.0 && b > 100.0, "{shape:?}, axis {axis}: {a} {b}");
        }
    }
}

#[test]
fn unknown_parameters_of_effects_have_coordinates_of_their_own() {
    let mut worlds = Worlds::new("sawyer", ObstacleMobility::Fixed, |config| {
        config.effects.extend([EffectKind::TableTilt.start(), EffectKind::PoseOffset.start()]);
    });
    let plain = {
        let (_, first) = worlds.draw(&mut Seed(4).stream(Purpose::Test, 1));
        worlds.coordinates(&first).count()
    };
    let distribution = |stddev: f64, low: f64, high: f64| TruncatedNormal { mean: 0.0, stddev, low, high };
    worlds.distribution.effects = [
        (EffectKind::PoseOffset, [("offset_x_m".into(), distribution(0.01, -0.02, 0.02))].into()),
        (EffectKind::TableTilt, [("slope_y_rad".into(), distribution(0.02, -0.03, 0.05))].into()),
    ]
    .into();
    let mut rng = Seed(4).stream(Purpose::Test, 0);
    let (_, first) = worlds.draw(&mut rng);
    let coordinates = worlds.coordinates(&first);
    assert_eq!(coordinates.count(), plain + 2);
    let noise_m = worlds.model.config().sensor.noise.position_m;
    let mut columns = vec![(Vec::new(), Vec::new()); 2];
    for item in 0..1500 {
        let z = normals(coordinates.count(), &mut rng);
        let Some((start, _)) = coordinates.start(shapes(item), &z) else { continue };
        let drawn = effects::sample(&worlds.distribution.effects, &mut rng);
        assert_eq!(start.theta.effects.len(), drawn.len());
        for ((column, found), drawn) in columns.iter_mut().zip(&start.theta.effects).zip(&drawn) {
            assert_eq!(found.parameter, drawn.parameter);
            column.0.push(found.value);
            column.1.push(drawn.value);
        }
        // Whatever its own offset is, a hypothesis would be seen where the object was seen, within 6 standard deviations.
        let seen = worlds.model.readings(&start).object.position_m[0] - first.object_pose().0[0];
        assert!(seen.abs() < 6.0 * noise_m, "{seen}");
    }
    for (a, b) in columns {
        // Null: one distribution; level 0.001. A start whose own offset puts it into the tool is none, but the object is 6 cm away from it.
        let (distance, most) = kolmogorov_smirnov(a, b, 2);
        assert!(distance < most, "{distance} {most}");
    }
}

#[test]
fn an_observation_outside_the_distribution_is_taken_for_itself() {
    let worlds = Worlds::new("sawyer", ObstacleMobility::Fixed, |_| {});
    let mut rng = Seed(5).stream(Purpose::Test, 0);
    let (_, first) = worlds.draw(&mut rng);
    let turned = |roll: f64, yaw: f64| {
        let q = nalgebra::UnitQuaternion::from_euler_angles(roll, 0.0, yaw);
        [q.i, q.j, q.k, q.w]
    };
    let pi = std::f64::consts::PI;
    let poses = [
        ([0.53, 0.3, -0.05], turned(0.0, 0.0)),
        ([-3.0, 20.0, 5.0], turned(0.0, pi)),
        ([1e300, -1e300, -1e300], turned(pi, 0.0)),
        ([0.53, -0.15, -0.05], turned(0.5 * pi, -2.0)),
        // Just outside the limits of the distribution.
        ([0.4999, -0.1501, -0.05], turned(0.0, 0.8)),
    ];
    let noise_m = worlds.model.config().sensor.noise.position_m;
    for (number, (position_m, orientation)) in poses.into_iter().enumerate() {
        let mut observation = first.clone();
        let at = observation.0.len() - 7;
        observation.0[at..at + 3].copy_from_slice(&position_m);
        observation.0[at + 3..].copy_from_slice(&orientation);
        let coordinates = worlds.coordinates(&observation);
        let mut possible = 0;
        for item in 0..200 {
            let z = normals(coordinates.count(), &mut rng);
            let Some((start, log)) = coordinates.start(shapes(item), &z) else { continue };
            possible += 1;
            assert!(!log.is_nan() && log < f64::INFINITY, "{log}");
            assert!(coordinates.of(&start, &mut rng).is_none_or(|z| z.iter().all(|z| z.is_finite())));
            let off_m = start.state.object.position_m[1] - position_m[1];
            assert!(off_m.abs() <= 4.0 * noise_m + 1e-12, "pose {number}: {off_m}");
        }
        // The first and the last can be worlds.
        assert!(possible > 20 || ![0, 4].contains(&number), "pose {number}: {possible}");
    }
}
