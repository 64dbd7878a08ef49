//! The reference sampler against exact posteriors: a line, with or without a walk on top, and whether there is a second body.

mod line;

use belief::{Particles, Reference, ReferenceConfig, reference};
use line::guess::Guess;
use line::{Exact, Line, NOW, SLOPE, State};
use pomdp::{Purpose, Seed};

/// The prior, moved by `shift` standard deviations and `width` times as wide, with another probability of a second body: a teacher that is badly wrong.
fn wrong(line: &Line, shift: f64, width: f64) -> Guess {
    let before = Line::new(line.q, line.r, line.second());
    Guess { second: (0.1, line.second()), ..Guess::wrong(&before, shift, width, 0.0) }
}

fn line(q: f64, steps: usize, item: u64) -> Line {
    let mut rng = Seed(31).stream(Purpose::Test, item);
    let mut line = Line::new(q, 0.3, 0.5);
    let mut truth = line.draw(&mut rng);
    (0..steps).for_each(|_| line.act(&mut truth, &mut rng));
    line
}

fn sample(line: &Line, teacher: &Guess, item: u64) -> Reference<State> {
    let config = ReferenceConfig { particles: 1000, ..ReferenceConfig::default() };
    reference(&config, line, teacher, &mut Seed(32).stream(Purpose::Test, item)).unwrap()
}

fn moments(belief: &Particles<State>, value: impl Fn(&State) -> f64) -> (f64, f64) {
    let mean: f64 = belief.iter().map(|(state, w)| w * value(state)).sum();
    (mean, belief.iter().map(|(state, w)| w * (value(state) - mean).powi(2)).sum())
}

fn second(belief: &Particles<State>) -> f64 {
    belief.iter().filter(|(state, _)| state.height != 0.0).map(|(_, w)| w).sum()
}

/// Means, variances, the probability of a second body and the evidence of six lines, from a teacher that is two standard deviations off and too narrow.
#[test]
fn a_wrong_teacher_leads_to_the_exact_posterior() {
    for (q, item) in [(0.0, 0), (0.0, 1), (0.0, 2), (0.1, 3), (0.1, 4), (0.1, 5)] {
        let line = line(q, 8, item);
        let exact = Exact::new(&line);
        let found = sample(&line, &wrong(&line, 2.0, 0.5), item);
        for (place, value) in [(NOW, (|s: &State| s.x) as fn(&State) -> f64), (SLOPE, |s: &State| s.slope)] {
            let (mean, variance) = exact.moments(place);
            let (m, v) = moments(&found.belief, value);
            assert!((m - mean).abs() < 0.25 * variance.sqrt(), "line {item}, {place}: mean {m} for {mean}");
            assert!((v / variance).ln().abs() < 0.3, "line {item}, {place}: variance {v} for {variance}");
        }
        let share = second(&found.belief);
        assert!((share - exact.second).abs() < 0.1, "line {item}: {share} for {}", exact.second);
        let evidence = exact.log_evidence(&line);
        assert!((found.log_evidence - evidence).abs() < 0.3, "line {item}: {} for {evidence}", found.log_evidence);
        assert!(found.bridges > 1 && found.acceptance > 0.02, "line {item}: {found:?}");
    }
}

#[test]
fn settings_outside_their_limits_are_refused() {
    let line = line(0.0, 2, 0);
    let teacher = wrong(&line, 0.0, 1.0);
    for config in [
        ReferenceConfig { particles: 1, ..ReferenceConfig::default() },
        ReferenceConfig { sweeps: 0, ..ReferenceConfig::default() },
        ReferenceConfig { effective_share: 1.0, ..ReferenceConfig::default() },
        ReferenceConfig { prior_share: 0.0, ..ReferenceConfig::default() },
        ReferenceConfig { prior_share: f64::NAN, ..ReferenceConfig::default() },
    ] {
        let refused = reference(&config, &line, &teacher, &mut Seed(1).stream(Purpose::Test, 0));
        assert!(matches!(refused, Err(belief::Error::Config { .. })), "{config:?}");
    }
}
