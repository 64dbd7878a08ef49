//! What the network says of a start, as a teacher: draws and density belong together.

use std::path::Path;

use agent::Estimate;
use physics_model::theta::NO_OBSTACLE;
use pomdp::{Outcome, Policy as _, Purpose, Replay as _, Rng, Seed, Teacher as _};
use prior::PosteriorNetwork;
use push_task::{HeuristicPolicy, History, Particle};
use scenario::{Problem, Selection, find_root};

fn problem(domain: &str) -> Problem {
    problem_with(domain, &[])
}

fn problem_with(domain: &str, set: &[&str]) -> Problem {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let set = set.iter().map(ToString::to_string).collect();
    let selection = Selection { domain: domain.into(), preset: "surmise".into(), set, ..Selection::new(&root) };
    Problem::assemble(&selection.load().unwrap(), &root).unwrap()
}

/// The shipped network for obstacles that cannot move.
fn network(problem: &Problem) -> PosteriorNetwork {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    PosteriorNetwork::load(&root.join("assets/priors/sawyer-fixed"), "sawyer", &problem.model).unwrap()
}

/// An episode of `actions` pushes towards the object, and the network after it.
fn episode<'a>(problem: &'a Problem, actions: usize, item: u64) -> (History<'a>, PosteriorNetwork) {
    let seed = Seed(31 + item);
    let mut network = network(problem);
    let mut world = problem.sample_world(&mut seed.stream(Purpose::World, 0)).unwrap();
    let mut rng = seed.stream(Purpose::Truth, 0);
    let first = problem.truth.initial_observation(&mut world, &mut rng);
    network.reset();
    network.observe(&problem.model, None, &first, &world.state.joints_rad);
    let mut history = agent::history(problem, Some(&network), &first);
    for _ in 0..actions {
        let action = HeuristicPolicy.action(&problem.truth, &world, &mut rng);
        let (step, _) = problem.truth.act(&mut world, action, &mut rng);
        assert_eq!(step.outcome, Outcome::Continue);
        network.observe(&problem.model, Some(action), &step.observation, &world.state.joints_rad);
        history.push(action, &step.observation, &world.state.joints_rad);
    }
    (history, network)
}

#[test]
fn a_network_counts_obstacles_as_often_as_the_domain_has_them_even_where_the_first_belief_knows_of_none() {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let selection = Selection {
        domain: "obstacle".into(),
        robot: "jaco".into(),
        preset: "surmise".into(),
        ..Selection::new(&root)
    };
    let problem = Problem::assemble(&selection.load().unwrap(), &root).unwrap();
    let network = PosteriorNetwork::load(&root.join("assets/priors/jaco-fixed"), "jaco", &problem.model).unwrap();
    let mut rng = Seed(5).stream(Purpose::Test, 0);
    let mut world = problem.sample_world(&mut rng).unwrap();
    let first = problem.truth.initial_observation(&mut world, &mut rng);
    let mut share = |network: Option<&PosteriorNetwork>| {
        let history = agent::history(&problem, network, &first);
        let estimate = Estimate::prior(&history);
        let drawn: Vec<_> = (0..2000).filter_map(|_| estimate.draw(&mut rng)).collect();
        drawn.iter().filter(|(classes, _)| classes[1] != NO_OBSTACLE).count() as f64 / drawn.len() as f64
    };
    // Three worlds in four of the domain; three in five of the network's training data.
    let with = share(Some(&network));
    assert!((with - 0.75).abs() < 0.05, "{with}");
    assert_eq!(share(None), 0.0);
}

/// Mean and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// A possible start from a draw, with ln of the estimate's density over the prior's, and ln p of the first measured height.
fn start(history: &History<'_>, estimate: &Estimate<'_>, rng: &mut Rng) -> Option<(Particle, f64, f64)> {
    let (classes, z) = estimate.draw(rng)?;
    let (start, log) = history.start(&classes, &z)?;
    Some((start, estimate.log_ratio(&classes, &z), log))
}

#[test]
fn a_number_that_is_known_exactly_leaves_the_prior() {
    let zero = "{ mean = 0.0, stddev = 0.0, low = 0.0, high = 0.0 }";
    let com = format!("distribution.object.com_m=[{zero}, {zero}, {zero}]");
    for known in ["distribution.object.friction.stddev=0.0", &com] {
        let problem = problem_with("D4", &[known]);
        let (history, network) = episode(&problem, 2, 0);
        let estimate = Estimate::network(&history, &network);
        let mut rng = Seed(44).stream(Purpose::Test, 0);
        let starts: Vec<_> = (0..40).filter_map(|_| start(&history, &estimate, &mut rng)).collect();
        assert!(starts.len() > 10, "{} of 40 are possible", starts.len());
        for (start, log_ratio, _) in starts {
            let object = &start.theta.object;
            assert!(object.friction == 0.4 || object.com_m == [0.0; 3], "{object:?}");
            assert_eq!(log_ratio, 0.0);
        }
    }
}

#[test]
fn the_density_of_draws_is_normalised() {
    // E over q of p / q is the mass of p, whatever q is. p is the prior times the likelihood of the first measured height, as the network has
    // seen it: so the ratio varies little. The mass of p is found by draws of the prior. Draws that are no world count as 0 on both sides.
    let heavier = ["distribution.object.mass_kg.mean=0.6", "distribution.object.friction.mean=0.45"];
    for (domain, set) in [("D4", [].as_slice()), ("D1", &[]), ("D4", &heavier)] {
        let problem = problem_with(domain, set);
        for item in 0..2 {
            let (history, network) = episode(&problem, 0, item);
            let mut rng = Seed(41).stream(Purpose::Test, item);
            let mut mass = |estimate: &Estimate<'_>| {
                let value =
                    |_| start(&history, estimate, &mut rng).map_or(0.0, |(_, log_ratio, log)| (log - log_ratio).exp());
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
    // E over q of q(z shifted) / q(z) = 1, for every coordinate that a box and an obstacle that is a box have.
    let problem = problem("D4");
    for item in 0..2 {
        let (history, network) = episode(&problem, 4, item);
        let density = network.density().unwrap();
        let mut rng = Seed(42).stream(Purpose::Test, item);
        let log_density = |z: &[f64]| density.log_ratio(0, z) - 0.5 * z.iter().map(|z| z * z).sum::<f64>();
        for coordinate in 0..18 {
            // A twentieth of the spread of what the network says of it.
            let draws: Vec<_> = (0..3000).map(|_| density.draw(0, &mut rng)).collect();
            let mean = draws.iter().map(|z| z[coordinate]).sum::<f64>() / 3000.0;
            let stddev = (draws.iter().map(|z| (z[coordinate] - mean).powi(2)).sum::<f64>() / 3000.0).sqrt();
            let ratios = draws.iter().map(|z| {
                let mut shifted = *z;
                shifted[coordinate] += 0.05 * stddev;
                (log_density(&shifted) - log_density(z)).exp()
            });
            let (mean, error) = mean_and_error(&ratios.collect::<Vec<_>>());
            println!("{coordinate}: {mean} ± {error}, spread {stddev}");
            assert!((mean - 1.0).abs() < 4.5 * error, "{coordinate}: {mean} ± {error}");
            assert!(error < 0.02, "{coordinate}: {error}");
        }
        assert_eq!(history.coordinates(), 18);
    }
}

#[test]
fn draws_have_the_classes_of_the_domain() {
    for domain in ["D4", "D2"] {
        let problem = problem(domain);
        let (history, network) = episode(&problem, 0, 0);
        let estimate = Estimate::network(&history, &network);
        let mut rng = Seed(43).stream(Purpose::Test, 0);
        // Corrected probabilities of classes by Bayes: the network's over the training data's frequencies, times the domain's.
        let (shapes, obstacles) = history.start_coordinates().class_probabilities();
        let trained = network.distribution();
        let said = network.density().unwrap().pairs();
        let corrected: Vec<f64> = (0..12)
            .map(|pair| {
                let (shape, obstacle) = (pair / (NO_OBSTACLE + 1), pair % (NO_OBSTACLE + 1));
                let there = trained.object.shape[shape] * trained.obstacle.shape[obstacle];
                said[pair] * shapes[shape] * obstacles[obstacle] / there
            })
            .collect();
        let total: f64 = corrected.iter().sum();
        let n = 8000;
        let mut drawn = [0.0; 12];
        for _ in 0..n {
            let (classes, _) = estimate.draw(&mut rng).unwrap();
            drawn[classes[0] * (NO_OBSTACLE + 1) + classes[1]] += 1.0 / f64::from(n);
        }
        for (pair, found) in drawn.into_iter().enumerate() {
            let expected = corrected[pair] / total;
            // Null: a share of n draws. Four standard errors, and a count for what is rare.
            let tolerance = 4.0 * (expected / f64::from(n)).sqrt() + 4.0 / f64::from(n);
            assert!((found - expected).abs() < tolerance, "{domain}, {pair}: {found} {expected} ± {tolerance}");
            assert!(expected > 0.0 || found == 0.0, "{domain}: {pair} does not occur");
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
                let log_ratio = estimate.log_ratio(&classes, &z);
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
