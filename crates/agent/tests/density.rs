//! The density of the network's suggestions in plain coordinates, against a Jacobian by finite differences and against draws.

use std::path::Path;

use nalgebra::DMatrix;
use physics_model::config::ObstacleMobility;
use physics_model::state::BODY_LEN;
use physics_model::{BodyState, ObjectShape};
use pomdp::{Purpose, Rng, Seed};
use prior::features::{self, ActionInput};
use prior::{Mixture, density};
use push_task::Particle;
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

/// Plain coordinates of the start of an episode, as far as a network knows of them.
fn plain(particle: &Particle, mobility: ObstacleMobility) -> Vec<f64> {
    let object = &particle.theta.object;
    let mut values = vec![object.mass_kg.ln(), object.friction];
    values.extend(&object.size_m[..object.shape.size_count()]);
    if let (Some(obstacle), Some(body)) = (&particle.theta.obstacle, &particle.state.obstacle) {
        values.extend(&obstacle.size_m[..obstacle.shape.size_count()]);
        match mobility {
            ObstacleMobility::Movable => values.push(obstacle.mass_kg.ln()),
            ObstacleMobility::Fixed => values.extend([body.position_m[0], body.position_m[1], body.yaw_rad()]),
        }
    }
    values
}

/// The same particle with other plain coordinates.
fn at(particle: &Particle, mobility: ObstacleMobility, values: &[f64]) -> Particle {
    let mut next = particle.clone();
    let mut values = values.iter().copied();
    let mut take = || values.next().expect("as many as there are coordinates");
    let object = &mut next.theta.object;
    (object.mass_kg, object.friction) = (take().exp(), take());
    object.size_m[..object.shape.size_count()].fill_with(&mut take);
    if let (Some(obstacle), Some(body)) = (&mut next.theta.obstacle, &mut next.state.obstacle) {
        obstacle.size_m[..obstacle.shape.size_count()].fill_with(&mut take);
        match mobility {
            ObstacleMobility::Movable => obstacle.mass_kg = take().exp(),
            ObstacleMobility::Fixed => {
                let [x_m, y_m, yaw_rad] = [take(), take(), take()];
                *body = BodyState::at_rest([x_m, y_m, body.position_m[2]], yaw_rad);
            }
        }
    }
    next
}

/// The mixture's targets that these coordinates decide: place in the layout, and what is written there.
fn written(particle: &Particle, mobility: ObstacleMobility) -> Vec<(usize, f64)> {
    let theta_at = |at: usize| JOINTS + 2 * BODY_LEN + at;
    let theta = &particle.theta;
    let mut pairs = vec![(theta_at(0), theta.object.mass_kg.ln()), (theta_at(4), theta.object.friction)];
    // Widths of boxes; twice the radius of what is round.
    let mut sizes = |first: usize, shape: ObjectShape, size: [f64; 3]| match shape.size_count() {
        3 => pairs.extend((0..3).map(|i| (theta_at(first + i), size[i]))),
        2 => pairs.extend([(theta_at(first), 2.0 * size[0]), (theta_at(first + 2), size[1])]),
        _ => pairs.push((theta_at(first), 2.0 * size[0])),
    };
    sizes(5, theta.object.shape, theta.object.size_m);
    if let (Some(obstacle), Some(body)) = (&theta.obstacle, &particle.state.obstacle) {
        sizes(9, obstacle.shape, obstacle.size_m);
        match mobility {
            ObstacleMobility::Movable => pairs.push((theta_at(8), obstacle.mass_kg.ln())),
            ObstacleMobility::Fixed => {
                let (at, sine) = (JOINTS + BODY_LEN, (0.5 * body.yaw_rad()).sin());
                pairs.extend([(at, body.position_m[0]), (at + 1, body.position_m[1]), (at + 5, sine)]);
            }
        }
    }
    pairs
}

/// ln p of the written values alone, worked out from the mixture's parts.
fn log_written(mixture: &Mixture, particle: &Particle, mobility: ObstacleMobility) -> f64 {
    let classes = particle.theta.classes();
    let pairs = written(particle, mobility);
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
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..60 {
            let particle = problem.sample_world(&mut rng).unwrap();
            let coordinates = plain(&particle, mobility);
            let n = coordinates.len();
            let step = 1e-5;
            let column = |j: usize| -> Vec<f64> {
                let at = |sign: f64| {
                    let mut moved = coordinates.clone();
                    moved[j] += sign * step;
                    written(&at(&particle, mobility, &moved), mobility)
                };
                at(1.0).iter().zip(at(-1.0)).map(|(up, down)| (up.1 - down.1) / (2.0 * step)).collect()
            };
            let columns: Vec<Vec<f64>> = (0..n).map(column).collect();
            let jacobian = DMatrix::from_fn(n, n, |i, j| columns[j][i]);
            let expected = log_written(&mixture, &particle, mobility) + jacobian.determinant().abs().ln();
            let found = density::log_density_of_start(&mixture, JOINTS, mobility, &particle);
            assert!((found - expected).abs() < 1e-5 * expected.abs().max(1.0), "{found} {expected}: {particle:?}");
            seen.insert(particle.theta.classes());
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
        let coordinates = [plain(&particle, ObstacleMobility::Fixed), particle.theta.object.com_m.to_vec()].concat();
        let valid = draw.classes[0] != 2 || draw.values[JOINTS + 2 * BODY_LEN + 3] <= 0.0;
        assert!(valid || coordinates.iter().any(|x| x.is_nan()), "{particle:?}");
        if coordinates.iter().all(|x| x.is_finite()) {
            possible += 1;
            // E over q of p/q for a density p that is q shifted a little in ln mass is the mass of p: 1 within what q covers.
            let mut shifted = particle.clone();
            shifted.theta.object.mass_kg *= 1.05;
            let log_ratio = density::log_density_of_start(&mixture, JOINTS, ObstacleMobility::Fixed, &shifted)
                - density::log_density_of_start(&mixture, JOINTS, ObstacleMobility::Fixed, &particle);
            sum += log_ratio.exp();
        }
    }
    // Null: mean of exp(−δz − δ²/2) = 1 with δ = ln 1.05 / 0.3; standard deviation 0.17, n about 3000; tolerance 4 standard errors.
    let mean = sum / f64::from(possible);
    assert!(possible > 2000 && (mean - 1.0).abs() < 0.013, "{possible} {mean}");
}
