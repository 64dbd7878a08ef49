//! What the network says of a start, as a teacher: draws and density belong together.

use std::path::Path;

use agent::Estimate;
use physics_model::theta::NO_OBSTACLE;
use pomdp::{Outcome, Policy as _, Prior as _, Purpose, Replay as _, Rng, Seed, Teacher as _};
use prior::Suggester;
use push_task::{HeuristicPolicy, History, Particle};
use scenario::{Problem, Selection, find_root};

fn problem(domain: &str) -> Problem {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let selection = Selection { domain: domain.into(), ..Selection::new(&root) };
    Problem::assemble(&selection.load().unwrap(), &root).unwrap()
}

/// The shipped network for obstacles that cannot move.
fn network(problem: &Problem) -> Suggester {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    Suggester::load(&root.join("assets/priors/sawyer-fixed"), "sawyer", &problem.model).unwrap()
}

/// An episode of `actions` pushes towards the object, and the network after it.
fn episode<'a>(problem: &'a Problem, actions: usize, item: u64) -> (History<'a>, Suggester) {
    let seed = Seed(31 + item);
    let mut network = network(problem);
    let mut world = problem.sample_world(&mut seed.stream(Purpose::World, 0)).unwrap();
    let mut rng = seed.stream(Purpose::Truth, 0);
    let first = problem.truth.initial_observation(&mut world, &mut rng);
    network.reset();
    network.suggest(None, &first);
    let mut history = agent::history(problem, Some(&network), &first);
    for _ in 0..actions {
        let action = HeuristicPolicy.action(&problem.truth, &world, &mut rng);
        let (step, _) = problem.truth.act(&mut world, action, &mut rng);
        assert_eq!(step.outcome, Outcome::Continue);
        network.suggest(Some(&action), &step.observation);
        history.push(action, &step.observation, &world.state.joints_rad);
    }
    (history, network)
}

/// Mean and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// A possible start from a draw, with ln p of the first measured height.
fn start(history: &History<'_>, estimate: &Estimate<'_>, rng: &mut Rng) -> Option<(Particle, f64)> {
    let (classes, z) = estimate.draw(rng)?;
    history.start(&classes, &z)
}

#[test]
fn a_number_that_is_known_exactly_leaves_the_prior() {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let set = vec!["distribution.object.friction.stddev=0.0".into()];
    let selection = Selection { domain: "D4".into(), set, ..Selection::new(&root) };
    let problem = Problem::assemble(&selection.load().unwrap(), &root).unwrap();
    let (history, network) = episode(&problem, 2, 0);
    let estimate = Estimate::network(&history, &network);
    let mut rng = Seed(44).stream(Purpose::Test, 0);
    let starts: Vec<_> = (0..40).filter_map(|_| start(&history, &estimate, &mut rng)).collect();
    assert!(starts.len() > 10, "{} of 40 are possible", starts.len());
    for (start, _) in starts {
        assert_eq!((start.theta.object.friction, estimate.log_ratio(&start)), (0.4, 0.0));
    }
}

#[test]
fn the_density_of_draws_is_normalised() {
    // E over q of p / q is the mass of p, whatever q is. p is the prior times the likelihood of the first measured height, as the network has
    // seen it: so the ratio varies little. The mass of p is found by draws of the prior. Draws that are no world count as 0 on both sides.
    for domain in ["D4", "D1"] {
        let problem = problem(domain);
        for item in 0..2 {
            let (history, network) = episode(&problem, 0, item);
            let mut rng = Seed(41).stream(Purpose::Test, item);
            let mut mass = |estimate: &Estimate<'_>| {
                let value = |_| {
                    start(&history, estimate, &mut rng)
                        .map_or(0.0, |(start, log)| (log - estimate.log_ratio(&start)).exp())
                };
                mean_and_error(&(0..6000).map(value).collect::<Vec<_>>())
            };
            let (expected, expected_error) = mass(&Estimate::prior(&history));
            let (found, error) = mass(&Estimate::network(&history, &network));
            println!("{domain}: {found} ± {error} for {expected} ± {expected_error}");
            // Tolerance: four standard errors of the difference.
            assert!(
                (found - expected).abs() < 4.0 * error.hypot(expected_error),
                "{domain}: {found} ± {error}, {expected} ± {expected_error}"
            );
            assert!(error < 0.05 * found, "the test sees 20 %: {error} of {found}");
        }
    }
}

#[test]
fn draws_follow_the_density() {
    // E over q of p / q = 1 for a density p that is q shifted a little: in mass, which has no limits.
    let problem = problem("D4");
    for item in 0..2 {
        let (history, network) = episode(&problem, 4, item);
        let estimate = Estimate::network(&history, &network);
        let coordinates = history.start_coordinates();
        let log_density = |start: &Particle| estimate.log_ratio(start) + coordinates.log_density(start);
        let mut rng = Seed(42).stream(Purpose::Test, item);
        for shift in [0.95, 1.05] {
            let mut ratios = Vec::new();
            while ratios.len() < 3000 {
                let Some((start, _)) = start(&history, &estimate, &mut rng) else { continue };
                let mut shifted = start.clone();
                shifted.theta.object.mass_kg *= shift;
                ratios.push((log_density(&shifted) - log_density(&start)).exp());
            }
            let (mean, error) = mean_and_error(&ratios);
            println!("{mean} ± {error}");
            assert!((mean - 1.0).abs() < 4.0 * error, "{mean} ± {error}");
            assert!(error < 0.02, "{error}");
        }
    }
}

#[test]
fn draws_have_the_classes_of_the_domain() {
    for domain in ["D4", "D2"] {
        let problem = problem(domain);
        let (history, network) = episode(&problem, 0, 0);
        let estimate = Estimate::network(&history, &network);
        let mut rng = Seed(43).stream(Purpose::Test, 0);
        let classes = || (0..3).flat_map(|shape| (0..=NO_OBSTACLE).map(move |obstacle| [shape, obstacle]));
        // Corrected probabilities of classes by Bayes: the network's over the training data's frequencies, times the domain's.
        let (shapes, obstacles) = history.start_coordinates().class_probabilities();
        let ratio = |[shape, obstacle]: [usize; 2]| {
            shapes[shape] * obstacles[obstacle] / network.class_frequency([shape, obstacle])
        };
        let total: f64 = classes().map(|c| network.class_probability(c) * ratio(c)).sum();
        // Of the network's draws of a class a share lies within the limits of the domain: that share is met by the teacher.
        let n = 8000;
        let table_m = problem.model.config().world.table_height_m;
        let mut raw = [[0.0_f64; NO_OBSTACLE + 1]; 3];
        let mut drawn = raw;
        let mut z = vec![0.0; history.coordinates()];
        for _ in 0..n {
            let particle = network.sample_raw(table_m, &mut rng).unwrap();
            if history.start_coordinates().invert(&particle, &mut z).is_some() {
                let [shape, obstacle] = particle.theta.classes();
                raw[shape][obstacle] += 1.0 / f64::from(n);
            }
            if let Some((classes, _)) = estimate.draw(&mut rng) {
                drawn[classes[0]][classes[1]] += 1.0 / f64::from(n);
            }
        }
        println!("{domain}: {} of the network's draws are possible", raw.iter().flatten().sum::<f64>());
        for class in classes() {
            let [shape, obstacle] = class;
            let factor = ratio(class) / total;
            let (found, expected) = (drawn[shape][obstacle], raw[shape][obstacle] * factor);
            // Null: both are shares of n draws. Four standard errors, and a count for what is rare.
            let variance = (found + factor * expected) / f64::from(n);
            let tolerance = 4.0 * variance.sqrt() + 4.0 * factor.max(1.0) / f64::from(n);
            println!("{class:?}: {found:.4} for {expected:.4} ± {tolerance:.4}");
            assert!((found - expected).abs() < tolerance, "{domain} {class:?}: {found} {expected} ± {tolerance}");
            assert!(factor > 0.0 || found == 0.0, "{domain} {class:?} does not occur");
        }
    }
}

#[test]
fn the_ratio_of_every_draw_is_finite_and_no_draw_has_an_obstacle_where_there_is_none() {
    for (domain, actions) in [("D1", 0), ("D1", 5), ("D4", 0), ("D4", 5)] {
        let problem = problem(domain);
        let (history, network) = episode(&problem, actions, 1);
        let mut rng = Seed(44).stream(Purpose::Test, actions as u64);
        for estimate in [Estimate::network(&history, &network), Estimate::prior(&history)] {
            let mut possible = 0;
            for _ in 0..1000 {
                let Some((classes, z)) = estimate.draw(&mut rng) else { continue };
                assert!(domain != "D1" || classes == [0, NO_OBSTACLE], "{classes:?}");
                assert!(z.len() == history.coordinates() && z.iter().all(|z| z.is_finite()));
                let Some((start, _)) = history.start(&classes, &z) else { continue };
                assert_eq!(start.theta.classes().to_vec(), classes);
                let log_ratio = estimate.log_ratio(&start);
                assert!(log_ratio.is_finite(), "{log_ratio}: {start:?}");
                possible += 1;
            }
            println!("{domain}, {actions} actions: {possible} of 1000");
            assert!(possible > 300, "{domain}, {actions} actions: {possible} of 1000");
        }
    }
}

#[test]
fn the_prior_teaches_nothing() {
    let problem = problem("D4");
    let (history, _) = episode(&problem, 0, 2);
    let estimate = Estimate::prior(&history);
    let mut rng = Seed(45).stream(Purpose::Test, 0);
    let mut counts = [[0.0_f64; NO_OBSTACLE + 1]; 3];
    let (n, mut squares) = (6000, vec![0.0; history.coordinates()]);
    for _ in 0..n {
        let (classes, z) = estimate.draw(&mut rng).unwrap();
        counts[classes[0]][classes[1]] += 1.0;
        squares.iter_mut().zip(&z).for_each(|(sum, z)| *sum += z * z / f64::from(n));
    }
    // Null: 12 classes of equal probability; χ² with 11 degrees of freedom exceeds 31.3 with probability 0.001. Mean squares of normal numbers are 1,
    // with a standard error of √(2 / n) = 0.018; tolerance 4.5 of them, for 18.
    let expected = f64::from(n) / 12.0;
    let chi_squared: f64 = counts.iter().flatten().map(|count| (count - expected).powi(2) / expected).sum();
    assert!(chi_squared < 31.3, "{chi_squared}: {counts:?}");
    assert!(squares.iter().all(|square| (square - 1.0).abs() < 0.082), "{squares:?}");
}
