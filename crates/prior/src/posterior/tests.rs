use std::path::PathBuf;

use pomdp::{Purpose, Seed};
use push_task::coordinates::START;
use serde::Deserialize;

use super::*;

/// What `tests/peers/pytorch_posterior.py` recorded.
#[derive(Deserialize)]
struct Expected {
    steps: Vec<Vec<f64>>,
    log_pairs: Vec<Vec<f64>>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    pair: usize,
    z: Vec<f64>,
    log_ratios: Vec<f64>,
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/posterior")
}

/// A small network with what it says after each step.
fn densities() -> (Expected, Vec<StartDensity>) {
    let expected: Expected =
        serde_json::from_str(&std::fs::read_to_string(folder().join("expected.json")).unwrap()).unwrap();
    let weights = Arc::new(file::load(&folder()).unwrap());
    let mut state = weights.lstm.start();
    let seen: Vec<(Option<Action>, Seen)> = expected.steps.iter().map(|values| Seen::of_values(values)).collect();
    let densities = (0..seen.len()).map(|step| {
        let before = &seen[step.saturating_sub(1)].1;
        let row = weights.features.row(seen[step].0, &seen[step].1, before, &seen[0].1);
        StartDensity::new(&weights, weights.lstm.step(&mut state, &row))
    });
    let densities = densities.collect();
    (expected, densities)
}

#[test]
fn the_density_is_that_of_pytorch() {
    let (expected, densities) = densities();
    for (step, density) in densities.iter().enumerate() {
        for (pair, log) in expected.log_pairs[step].iter().enumerate() {
            // Both compute with 24 bits.
            assert!((density.log_pair(pair) - log).abs() < 1e-5, "step {step}, pair {pair}");
        }
        for case in &expected.cases {
            let (found, expected) = (density.log_ratio(case.pair, &case.z), case.log_ratios[step]);
            assert!((found - expected).abs() < 1e-4 * (1.0 + expected.abs()), "step {step}: {found} {expected}");
        }
    }
}

#[test]
fn draws_follow_the_density() {
    let (_, densities) = densities();
    let density = densities.last().unwrap();
    let mut rng = Seed(3).stream(Purpose::Test, 0);
    for pair in [0, 3, 7, 11] {
        // E over q of φ / q is 1: a network of random weights is broad enough for that.
        let ratios: Vec<f64> =
            (0..40_000).map(|_| (-density.log_ratio(pair, &density.draw(pair, &mut rng))).exp()).collect();
        let n = ratios.len() as f64;
        let mean = ratios.iter().sum::<f64>() / n;
        let error = (ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n * n)).sqrt();
        assert!((mean - 1.0).abs() < 4.5 * error, "pair {pair}: {mean} ± {error}");
        assert!(error < 0.2, "{error}");
    }
}

#[test]
fn what_the_classes_do_not_use_stays_standard_normal_and_counts_nothing() {
    let (_, densities) = densities();
    let density = densities.last().unwrap();
    let mut rng = Seed(4).stream(Purpose::Test, 0);
    // A sphere, and no obstacle.
    let pair = 11;
    let mut squares = [0.0; START];
    for _ in 0..4000 {
        let mut z = density.draw(pair, &mut rng);
        squares.iter_mut().zip(&z).for_each(|(sum, z)| *sum += z * z / 4000.0);
        let log_ratio = density.log_ratio(pair, &z);
        z[2] += 1.0;
        z[11..].iter_mut().for_each(|z| *z -= 3.0);
        assert_eq!(density.log_ratio(pair, &z), log_ratio);
    }
    // Mean squares of normal numbers are 1, with a standard error of √(2 / 4000) = 0.022.
    assert!(squares[11..].iter().all(|square| (square - 1.0).abs() < 0.1), "{squares:?}");
}

#[test]
fn damage_is_refused_with_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, dir.path().join(path.file_name().unwrap())).unwrap();
    }
    let json = dir.path().join(FILE);
    let manifest: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    type Change = (&'static str, serde_json::Value, &'static str);
    let changes: [Change; 8] = [
        ("/version", 2.into(), "format version 2, but this program reads version 1"),
        ("/hidden", serde_json::json!([]), "hidden, units and components: expected 1 to 4096 each"),
        ("/units", 1_000_000.into(), "hidden, units and components"),
        ("/order/0", 3.into(), "order: expected each of 0 to 17 once"),
        ("/force_scale/2", 0.0.into(), "force_scale: expected values above 0"),
        ("/distribution/object/shape/0", 0.9.into(), "distribution.object.shape: expected probabilities"),
        ("/components", 3.into(), "tensor `out.weights` is F32"),
        ("/weights/bytes", 3.into(), "bytes, but 3 were written"),
    ];
    for (pointer, value, expected) in changes {
        let mut edited = manifest.clone();
        *edited.pointer_mut(pointer).unwrap() = value;
        std::fs::write(&json, edited.to_string()).unwrap();
        let message = file::load(dir.path()).unwrap_err().to_string();
        assert!(message.contains(expected), "{pointer}: {message}");
    }
}
