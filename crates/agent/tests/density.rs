//! The density of the network's suggestions in the filter's coordinates, against a Jacobian by finite differences and against draws.

use std::path::Path;

use nalgebra::DMatrix;
use physics_model::config::ObstacleMobility;
use physics_model::state::BODY_LEN;
use pomdp::{Purpose, Rng, Seed, StaticParameters as _};
use prior::features::{self, ActionInput};
use prior::{Mixture, density};
use push_task::{Particle, PushModel};
use rand::RngExt as _;
use scenario::{Problem, Selection, find_root};

const JOINTS: usize = 7;
const WIDTH: usize = JOINTS + 2 * BODY_LEN + 12;

fn problem(mobility: ObstacleMobility) -> Problem {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let selection = Selection { domain: "D4".into(), ..Selection::new(&root) };
    Problem::assemble(&selection.load().unwrap().with_mobility(mobility), &root).unwrap()
}

/// Two components around plausible values.
fn mixture(rng: &mut Rng) -> Mixture {
    let theta = [-0.7, 0.0, 0.0, -0.004, 0.4, 0.08, 0.08, 0.09, 0.0, 0.05, 0.05, 0.09];
    let spread = [0.3, 0.006, 0.006, 0.003, 0.1, 0.01, 0.01, 0.01, 0.8, 0.01, 0.01, 0.01];
    let (mut means, mut stddevs) = (Vec::new(), Vec::new());
    for _ in 0..2 {
        let mut mean = vec![0.0; WIDTH - 12];
        let mut stddev = vec![0.1; WIDTH - 12];
        let obstacle = JOINTS + BODY_LEN;
        for (place, (value, width)) in [(0, (0.58, 0.02)), (1, (0.02, 0.02)), (5, (0.1, 0.2))] {
            (mean[obstacle + place], stddev[obstacle + place]) = (value, width);
        }
        mean.extend(theta.iter().zip(spread).map(|(m, s)| m + 0.5 * s * (rng.random::<f64>() - 0.5)));
        stddev.extend(spread);
        means.extend(mean);
        stddevs.extend(stddev);
    }
    let classes = [0.4, 0.3, 0.3, 0.1, 0.2, 0.3, 0.4, 0.2, 0.5, 0.3, 0.4, 0.3, 0.1, 0.2];
    Mixture::new(&[0.3, 0.7], means, stddevs, vec![3, 4], &classes)
}

/// Written targets that a filter's coordinates decide, in the order of the layout.
fn written(model: &PushModel, particle: &Particle) -> Vec<f64> {
    let (theta, shapes) = (&particle.theta, particle.theta.object.shape.size_count());
    let mut values = vec![theta.object.mass_kg.ln(), theta.object.friction];
    let widths = |shape: physics_model::ObjectShape, size: [f64; 3]| match shape.size_count() {
        3 => size.to_vec(),
        2 => vec![2.0 * size[0], size[1]],
        _ => vec![2.0 * size[0]],
    };
    values.extend(widths(theta.object.shape, theta.object.size_m));
    values.extend(if shapes == 1 { theta.object.com_m[2..].to_vec() } else { theta.object.com_m.to_vec() });
    if let (Some(obstacle), Some(body)) = (&theta.obstacle, &particle.state.obstacle) {
        values.extend(widths(obstacle.shape, obstacle.size_m));
        match model.config().world.obstacle_mobility {
            ObstacleMobility::Movable => values.push(obstacle.mass_kg.ln()),
            ObstacleMobility::Fixed => {
                values.extend([body.position_m[0], body.position_m[1], (0.5 * body.yaw_rad()).sin()]);
            }
        }
    }
    values
}

/// ln p of the written values alone, worked out from the mixture's parts.
fn log_written(mixture: &Mixture, particle: &Particle, mobility: ObstacleMobility) -> f64 {
    let layout_of = |at: usize| JOINTS + 2 * BODY_LEN + at;
    let theta = &particle.theta;
    let classes = theta.classes();
    let mut pairs = vec![(layout_of(0), theta.object.mass_kg.ln()), (layout_of(4), theta.object.friction)];
    let mut sizes = |first: usize, shape: physics_model::ObjectShape, size: [f64; 3]| match shape.size_count() {
        3 => pairs.extend((0..3).map(|i| (layout_of(first + i), size[i]))),
        2 => pairs.extend([(layout_of(first), 2.0 * size[0]), (layout_of(first + 2), size[1])]),
        _ => pairs.push((layout_of(first), 2.0 * size[0])),
    };
    sizes(5, theta.object.shape, theta.object.size_m);
    if let Some(obstacle) = &theta.obstacle {
        sizes(9, obstacle.shape, obstacle.size_m);
    }
    let axes = if theta.object.shape.size_count() == 1 { 2..3 } else { 0..3 };
    pairs.extend(axes.map(|i| (layout_of(1 + i), theta.object.com_m[i])));
    if let (Some(obstacle), Some(body)) = (&theta.obstacle, &particle.state.obstacle) {
        let at = JOINTS + BODY_LEN;
        match mobility {
            ObstacleMobility::Movable => pairs.push((layout_of(8), obstacle.mass_kg.ln())),
            ObstacleMobility::Fixed => {
                let sine = (0.5 * body.yaw_rad()).sin();
                pairs.extend([(at, body.position_m[0]), (at + 1, body.position_m[1]), (at + 5, sine)]);
            }
        }
    }
    let component = |k: usize| {
        let normal = |&(at, value): &(usize, f64)| {
            let (mean, stddev) = (mixture.means(k)[at], mixture.stddevs(k)[at]);
            let z = (value - mean) / stddev;
            (-0.5 * z * z).exp() / (stddev * (2.0 * std::f64::consts::PI).sqrt())
        };
        let labels = (0..2).map(|target| mixture.log_classes(k, target)[classes[target]].exp()).product::<f64>();
        mixture.weights()[k] * labels * pairs.iter().map(normal).product::<f64>()
    };
    (component(0) + component(1)).ln()
}

#[test]
fn the_density_has_the_jacobian_of_finite_differences() {
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let mixture = mixture(&mut rng);
    for mobility in [ObstacleMobility::Fixed, ObstacleMobility::Movable] {
        let problem = problem(mobility);
        let model = &problem.model;
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..60 {
            let particle = problem.sample_world(&mut rng).unwrap();
            let coordinates = model.parameters(&particle);
            let n = coordinates.len();
            let step = 1e-5;
            let column = |j: usize| -> Option<Vec<f64>> {
                let at = |sign: f64| {
                    let mut moved = coordinates.clone();
                    moved[j] += sign * step;
                    model.with_parameters(&particle, &moved).map(|particle| written(model, &particle))
                };
                Some(at(1.0)?.iter().zip(at(-1.0)?).map(|(up, down)| (up - down) / (2.0 * step)).collect())
            };
            // A world on the edge of the possible cannot be moved.
            let Some(columns) = (0..n).map(column).collect::<Option<Vec<_>>>() else { continue };
            let jacobian = DMatrix::from_fn(n, n, |i, j| columns[j][i]);
            let expected = log_written(&mixture, &particle, mobility) + jacobian.determinant().abs().ln();
            let found = density::log_density(&mixture, JOINTS, mobility, &particle);
            assert!((found - expected).abs() < 1e-5 * expected.abs().max(1.0), "{found} {expected}: {particle:?}");
            seen.insert(model.structure(&particle));
        }
        assert_eq!(seen.len(), 12, "every pair of shapes: {seen:?}");
    }
}

#[test]
fn raw_draws_are_those_of_the_density_and_impossible_ones_are_marked() {
    let mut rng = Seed(2).stream(Purpose::Test, 0);
    let mixture = mixture(&mut rng);
    let problem = problem(ObstacleMobility::Fixed);
    let layout = features::layout("sawyer", &problem.model, ActionInput::Off);
    let observation = vec![0.0; layout.observation.len()];
    let table_m = problem.model.config().world.table_height_m;
    let (mut possible, mut sum, count) = (0, 0.0, 4000);
    for _ in 0..count {
        let draw = mixture.sample(&mut rng);
        let particle = density::raw_particle(&layout, &draw, &observation, JOINTS, table_m);
        let coordinates = problem.model.parameters(&particle);
        let valid = draw.classes[0] != 2 || draw.values[JOINTS + 2 * BODY_LEN + 3] <= 0.0;
        assert!(valid || coordinates.iter().any(|x| x.is_nan()), "{particle:?}");
        if coordinates.iter().all(|x| x.is_finite()) {
            possible += 1;
            // E over q of p/q for a density p that is q shifted a little in ln mass is the mass of p: 1 within what q covers.
            let mut shifted = particle.clone();
            shifted.theta.object.mass_kg *= 1.05;
            let log_ratio = density::log_density(&mixture, JOINTS, ObstacleMobility::Fixed, &shifted)
                - density::log_density(&mixture, JOINTS, ObstacleMobility::Fixed, &particle);
            sum += log_ratio.exp();
        }
    }
    // Null: mean of exp(−δz − δ²/2) = 1 with δ = ln 1.05 / 0.3; standard deviation 0.17, n about 3000; tolerance 4 standard errors.
    let mean = sum / f64::from(possible);
    assert!(possible > 2000 && (mean - 1.0).abs() < 0.013, "{possible} {mean}");
}
