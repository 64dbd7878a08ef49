//! VDP Tag against its definition and published returns.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use pomdp::{Belief as _, Purpose, Seed, conformance};

use super::*;
use crate::{Particles, episode};

fn rng() -> Rng {
    Seed(1).stream(Purpose::Test, 0)
}

fn model() -> VdpTag {
    VdpTag::with_actions((0..16).map(|i| Action { look: i % 2 == 0, angle: TAU * f64::from(i) / 16.0 }).collect())
}

fn at(agent: [f64; 2], target: [f64; 2]) -> State {
    State { agent, target }
}

#[test]
fn it_conforms() {
    let states = [at([0.0; 2], [3.0, -2.0]), at([1.0, 1.0], [-1.0, 0.5]), at([-2.0, 0.5], [2.0, 2.0])];
    conformance::check_generative_model(&model(), &states, 60);
    conformance::check_observation_model(&model(), &states, 60);
}

#[test]
fn the_target_follows_the_oscillator() {
    // At rest in the origin. Elsewhere: the same equations with steps of 10⁻⁵ s by Euler's method, whose error is about as large.
    assert_eq!(carried([0.0, 0.0]), [0.0, 0.0]);
    for start in [[1.0, 0.0], [-2.0, 1.5], [0.5, -3.0]] {
        let mut fine: [f64; 2] = start;
        for _ in 0..50_000 {
            let slope = [2.0 * (fine[0] - fine[0].powi(3) / 3.0 - fine[1]), fine[0] / 2.0];
            fine = [fine[0] + 1e-5 * slope[0], fine[1] + 1e-5 * slope[1]];
        }
        let found = carried(start);
        assert!(
            (found[0] - fine[0]).abs() < 2e-3 && (found[1] - fine[1]).abs() < 2e-3,
            "{start:?}: {found:?} {fine:?}"
        );
    }
}

#[test]
fn walls_stop_the_agent_and_gaps_let_it_through() {
    let close = |found: [f64; 2], expected: [f64; 2]| {
        assert!((found[0] - expected[0]).abs() < 1e-9 && (found[1] - expected[1]).abs() < 1e-9, "{found:?}");
    };
    close(walked([1.0, 1.0], 0.0), [1.5, 1.0]);
    // Down onto the wall along the x axis, through the gap at the origin, and past its end.
    close(walked([1.0, 0.2], -FRAC_PI_2), [1.0, 0.0]);
    close(walked([0.1, 0.2], -FRAC_PI_2), [0.1, -0.3]);
    close(walked([3.1, 0.2], -FRAC_PI_2), [3.1, -0.3]);
    close(walked([-0.2, -2.0], 0.0), [0.0, -2.0]);
    // From the wall back, but not through it, from either side.
    for (from, away) in [([1.0, 0.2], FRAC_PI_2), ([1.0, -0.2], -FRAC_PI_2)] {
        let stopped = walked(from, -away);
        assert!(stopped[1] * from[1] > 0.0, "{stopped:?}");
        close(walked(stopped, -away), [1.0, 0.0]);
        close(walked(stopped, away), [1.0, 0.5 * away.signum()]);
    }
    // Both axes are crossed; the wall along the x axis, 0.3 m off the origin, comes first.
    close(walked([0.4, 0.1], PI + FRAC_PI_4), [0.3, 0.0]);
}

#[test]
fn a_caught_target_pays_and_looking_costs() {
    let model = model();
    // Straight at a target that will be 0.5 m to the east of the origin: within 0.1 m with probability 1 − exp(−0.1² / (2 · 0.05²)) = 0.8647.
    // n = 4000; tolerance 4 standard deviations.
    let target = {
        // Where it has to be before: by fixed-point steps against the flow.
        let mut before = [0.5_f64, 0.0];
        for _ in 0..200 {
            let after = carried(before);
            before = [before[0] + 0.2 * (0.5 - after[0]), before[1] - 0.2 * after[1]];
        }
        before
    };
    let action = towards([0.0; 2], target);
    assert!(action.angle.abs() < 1e-6, "{action:?}");
    let mut rng = rng();
    let (mut caught, n) = (0.0, 4000);
    for item in 0..n {
        let look = item % 2 == 0;
        let step = model.step(&mut at([0.0; 2], target), &Action { look, ..action }, &mut rng);
        let cost = if look { 5.0 } else { 0.0 };
        match step.outcome {
            Outcome::Terminal => {
                caught += 1.0;
                assert_eq!(step.reward, 100.0 - cost);
            }
            _ => assert_eq!(step.reward, -1.0 - cost),
        }
    }
    let p = 1.0 - (-2.0_f64).exp();
    assert!((caught / f64::from(n) - p).abs() < 4.0 * (p * (1.0 - p) / f64::from(n)).sqrt(), "{caught}");
}

#[test]
fn beams_are_sharp_where_the_agent_looks() {
    let state = at([1.0, 1.0], [-2.0, 5.0]);
    let of = |look| beams(&Action { look, angle: 0.0 }, &state);
    assert_eq!(of(true), Beams { active: Some(2), seen: (5.0, 0.1), others: (1.0, 5.0) });
    assert_eq!(of(false), Beams { active: Some(2), seen: (5.0, 5.0), others: (1.0, 5.0) });
}

/// Mean and standard error of a policy with as many particles.
fn returns(episodes: u64, count: usize, decide: impl Fn(&Particles<State>, &mut Rng) -> Action) -> (f64, f64) {
    let model = model();
    let play = |item| {
        let mut rng = Seed(2).stream(Purpose::Test, item);
        let mut chooses = Seed(3).stream(Purpose::Test, item);
        let (start, belief) = (model.initial(&mut rng), Particles::initial(&model, count, &mut rng));
        let learn = |belief: Particles<State>, action: &Action, seen: &Reading, rng: &mut Rng| {
            belief.resample(&model, action, seen, rng).expect("normal densities explain everything")
        };
        let decide = |belief: &Particles<State>, _| decide(belief, &mut chooses);
        episode::play_with(&model, start, belief, 100, &mut rng, decide, learn).discounted_return
    };
    episode::mean_and_error(&(0..episodes).map(play).collect::<Vec<f64>>())
}

/// √det of the covariance of the targets, m², and their mean, m.
fn spread(belief: &Particles<State>) -> (f64, [f64; 2]) {
    let n = belief.states().len() as f64;
    let mean = [0, 1].map(|axis| belief.states().iter().map(|s| s.target[axis]).sum::<f64>() / n);
    let covariance = |a: usize, b: usize| {
        belief.states().iter().map(|s| (s.target[a] - mean[a]) * (s.target[b] - mean[b])).sum::<f64>() / n
    };
    ((covariance(0, 0) * covariance(1, 1) - covariance(0, 1).powi(2)).max(0.0).sqrt(), mean)
}

#[test]
fn simple_policies_return_what_was_published() {
    // Published: 1,000 episodes each with 10,000 particles. Null: equal means; tolerance 4 standard errors of the difference.
    let random = returns(100, 500, |belief, rng| {
        let State { agent, target } = *belief.sample(rng);
        towards(agent, target)
    });
    let mean = returns(200, 1000, |belief, _| {
        let (spread, mean) = spread(belief);
        Action { look: spread > 0.01, ..towards(belief.states()[0].agent, mean) }
    });
    for (name, (mean, error), (published, published_error)) in
        [("a random particle", random, (-17.05, 0.38)), ("the mean", mean, (-2.73, 1.23))]
    {
        let off = (mean - published) / error.hypot(published_error);
        assert!(off.abs() < 4.0, "{name}: {mean} ± {error}, published {published} ± {published_error}");
    }
}

#[test]
fn who_chases_a_belief_makes_for_its_mean_and_looks_while_it_is_wide() {
    // √det of the covariance: 0.25 m² for the corners of a square with sides of 1 m, 0.0025 m² for sides of 0.1 m.
    let corners = |side: f64, heavy: f64| {
        [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
            .map(|[x, y]| (at([0.0; 2], [2.0 + 0.5 * side * x, 1.0 + 0.5 * side * y]), heavy))
    };
    let chase = |belief: &[(State, f64)]| Chase.belief_action(&model(), belief, &mut rng());
    let (wide, narrow) = (chase(&corners(1.0, 1.0)), chase(&corners(0.1, 7.0)));
    assert!(wide.look && !narrow.look);
    let expected = towards([0.0; 2], [2.0, 1.0]).angle;
    assert!((wide.angle - expected).abs() < 1e-9 && (narrow.angle - expected).abs() < 1e-9);
    // A state alone is known.
    let alone = at([0.5, 0.0], [-1.0, 1.0]);
    assert_eq!(chase(&[(alone, 0.1)]), Chase.action(&model(), &alone, &mut rng()));
}
