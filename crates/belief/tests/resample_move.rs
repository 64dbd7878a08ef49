//! The resample–move filter against exact posteriors: a line with a walk on top, and whether there is a second body.

mod line;

use belief::{ResampleMoveConfig, ResampleMoveFilter};
use line::{Exact, Line, SLOPE};
use pomdp::{Purpose, Seed};

/// What a filter found of the slope (mean, variance) and of the second body (probability), and what is exact.
struct Found {
    slope: (f64, f64),
    exact_slope: (f64, f64),
    second: f64,
    exact_second: f64,
}

/// One episode of a world drawn from the prior.
fn episode(config: &ResampleMoveConfig, steps: usize, item: u64) -> Found {
    let mut rng = Seed(11).stream(Purpose::Test, item);
    let mut line = Line::new(0.2, 0.3, 0.5);
    let mut truth = line.draw(&mut rng);
    let mut filter = ResampleMoveFilter::new(config.clone(), &line, &mut rng).unwrap();
    for _ in 0..steps {
        line.act(&mut truth, &mut rng);
        filter.update(&line, &mut rng).unwrap();
    }
    let belief = filter.belief().unwrap();
    let mean: f64 = belief.iter().map(|(s, w)| w * s.slope).sum();
    let variance = belief.iter().map(|(s, w)| w * (s.slope - mean).powi(2)).sum();
    let second = belief.iter().filter(|(s, _)| s.height != 0.0).map(|(_, w)| w).sum();
    let exact = Exact::new(&line);
    Found { slope: (mean, variance), exact_slope: exact.moments(SLOPE), second, exact_second: exact.second }
}

#[test]
fn slope_and_second_body_have_their_exact_posterior() {
    let config =
        ResampleMoveConfig { particles: 400, move_transitions: 200_000, sweeps: 15, ..ResampleMoveConfig::default() };
    let found: Vec<Found> = (0..60).map(|item| episode(&config, 8, item)).collect();
    let mean = |value: &dyn Fn(&Found) -> f64| found.iter().map(value).sum::<f64>() / found.len() as f64;
    // Means in units of the exact spread: error of 400 draws is 0.05; variance: 0.07 of itself.
    let off = |f: &Found| (f.slope.0 - f.exact_slope.0) / f.exact_slope.1.sqrt();
    let bias = mean(&off);
    let error = mean(&|f| off(f).powi(2)).sqrt();
    let ratio = mean(&|f| f.slope.1 / f.exact_slope.1);
    let second = mean(&|f| (f.second - f.exact_second).abs());
    let second_bias = mean(&|f| f.second - f.exact_second);
    println!("bias {bias:.3} error {error:.3} variance {ratio:.3} second {second:.3} bias {second_bias:.3}");
    assert!(bias.abs() < 0.05 && error < 0.15, "{bias} {error}");
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    // A probability from 400 draws has a standard error of at most √(1/4 / 400) = 0.025. Eight updates resample at most eight times, and few
    // moves change a class. If none did, the errors would add up to 0.025 √8 = 0.071, of which the mean magnitude is 0.071 √(2/π) = 0.056. Their
    // mean over 60 worlds would have a standard error of 0.071 / √60 = 0.009; tolerance 4 of them. (Measured: magnitude 0.038 for 400 particles,
    // 0.019 for 1600.)
    assert!(second < 0.056, "{second}");
    assert!(second_bias.abs() < 0.036, "{second_bias}");
}
