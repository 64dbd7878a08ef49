//! LightDark: find the origin on a line of which one place is lit (after Platt, Tedrake, Kaelbling and Lozano-Pérez, "Belief space planning
//! assuming maximum likelihood observations", RSS 2010), as in the experiments of Sunberg and Kochenderfer, "Online algorithms for POMDPs
//! with continuous state, action, and observation spaces", ICAPS 2018.
//!
//! The numbers are those of the code that the published returns come from: `src/simple_lightdark.jl` of
//! zsunberg/ContinuousPOMDPTreeSearchExperiments.jl. γ = 0.95. The place is an integer from −60 to 60, and every one from −30 to 30 is as likely at the start.
//! An action adds −10, −1, 1 or 10 to it for −1, stopping at the ends, or declares that it is the origin: +100 if so, −100 if not, and the episode
//! ends. After every action the place is measured with normal noise of standard deviation |x − 10| + 10⁻⁴.
//!
//! Published returns of 1,000 episodes: POMCPOW 56.1 ± 0.6, POMCP on observations in classes of 0.05 61.1 ± 0.4. Walking to the right until one
//! place has a probability of 0.9, then [`crate::finite::FullInformation::qmdp`], returned 42.4 ± 0.4.

use std::f64::consts::TAU;

use pomdp::{Discretise, GenerativeModel, ObservationModel, Outcome, Policy, Rng, Step};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

use crate::InitialState;
use crate::finite::{self, Finite, Successor};

/// γ.
pub const DISCOUNT: f64 = 0.95;
/// Where measurements are best.
pub const LIGHT: i32 = 10;
/// Largest distance from the origin.
pub const RADIUS: i32 = 60;
/// What can be added to the place; 0 declares it the origin.
pub const ACTIONS: [i32; 5] = [-10, -1, 0, 1, 10];
/// Width of the classes of observations of the published POMCP.
pub const CLASS_WIDTH: f64 = 0.05;
/// Largest distance from the origin at the start.
const START: i32 = RADIUS / 2;

/// The problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightDark;

/// Standard deviation of a measurement at `place`.
#[must_use]
pub fn noise(place: i32) -> f64 {
    f64::from((place - LIGHT).abs()) + 1e-4
}

impl GenerativeModel for LightDark {
    type State = i32;
    type Action = i32;
    type Observation = f64;

    fn actions(&self) -> &[i32] {
        &ACTIONS
    }

    fn step(&self, place: &mut i32, action: &i32, rng: &mut Rng) -> Step<f64> {
        finite::step(self, place, action, rng, |next, rng| {
            let deviation: f64 = StandardNormal.sample(rng);
            f64::from(*next) + noise(*next) * deviation
        })
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl ObservationModel for LightDark {
    fn log_likelihood(&self, _action: &i32, next: &i32, observation: &f64) -> f64 {
        let stddev = noise(*next);
        -0.5 * ((observation - f64::from(*next)) / stddev).powi(2) - stddev.ln() - 0.5 * TAU.ln()
    }
}

impl Finite for LightDark {
    fn states(&self) -> usize {
        (2 * RADIUS + 1) as usize
    }

    fn index(&self, place: &i32) -> usize {
        (place + RADIUS) as usize
    }

    fn state(&self, index: usize) -> i32 {
        index as i32 - RADIUS
    }

    fn successors(&self, place: &i32, action: &i32, mut visit: impl FnMut(Successor<i32>)) {
        let (reward, outcome) = match (*action, *place) {
            (0, 0) => (100.0, Outcome::Terminal),
            (0, _) => (-100.0, Outcome::Terminal),
            _ => (-1.0, Outcome::Continue),
        };
        let state = (place + action).clamp(-RADIUS, RADIUS);
        visit(Successor { probability: 1.0, state, reward, outcome });
    }

    fn initial_distribution(&self) -> Vec<(i32, f64)> {
        (-START..=START).map(|place| (place, 1.0 / f64::from(2 * START + 1))).collect()
    }
}

impl Discretise for LightDark {
    type Key = i32;

    fn key(&self, observation: &f64) -> i32 {
        (observation / CLASS_WIDTH).floor() as i32
    }
}

impl InitialState for LightDark {
    fn initial(&self, rng: &mut Rng) -> i32 {
        rng.random_range(-START..=START)
    }
}

/// Walks to the origin and declares it. It looks at the place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walk;

impl Policy<LightDark> for Walk {
    fn action(&self, _model: &LightDark, place: &i32, _rng: &mut Rng) -> i32 {
        match *place {
            10.. => -10,
            1..10 => -1,
            0 => 0,
            -9..0 => 1,
            _ => 10,
        }
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed, conformance};

    use super::*;
    use crate::finite::tests::check_finite;
    use crate::finite::{ExactBelief, FullInformation};
    use crate::{Episode, episode};

    #[test]
    fn it_conforms() {
        conformance::check_generative_model(&LightDark, &[-60, -30, -1, 0, 2, 10, 17, 60], 20);
        conformance::check_observation_model(&LightDark, &[-30, 2, 17], 40);
        conformance::check_discretise(&LightDark, &[-30, 2, 17], 40);
        check_finite(&LightDark, &[-60, -30, 0, 1, 57]);
    }

    #[test]
    fn declaring_pays_at_the_origin_only_and_the_line_has_ends() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut step = |mut place: i32, action: i32| {
            let step = LightDark.step(&mut place, &action, &mut rng);
            (place, step.reward, step.outcome)
        };
        assert_eq!(step(0, 0), (0, 100.0, Outcome::Terminal));
        assert_eq!(step(1, 0), (1, -100.0, Outcome::Terminal));
        assert_eq!(step(1, -1), (0, -1.0, Outcome::Continue));
        assert_eq!(step(1, 10), (11, -1.0, Outcome::Continue));
        assert_eq!((step(55, 10).0, step(-60, -1).0), (60, -60));
    }

    #[test]
    fn measurements_have_the_stated_noise() {
        // Standard errors: σ/√n of the mean, σ/√(2n) of the standard deviation; tolerance 4 of them.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for (place, stddev) in [(1, 9.0001), (10, 1e-4), (13, 3.0001), (-29, 39.0001)] {
            let n = 4000;
            let errors: Vec<f64> = (0..n)
                .map(|_| LightDark.step(&mut { place - 1 }, &1, &mut rng).observation - f64::from(place))
                .collect();
            let (mean, variance) =
                (errors.iter().sum::<f64>() / f64::from(n), errors.iter().map(|e| e * e).sum::<f64>() / f64::from(n));
            assert!(mean.abs() < 4.0 * stddev / f64::from(n).sqrt(), "{place}: mean {mean}");
            assert!((variance.sqrt() - stddev).abs() < 4.0 * stddev / f64::from(2 * n).sqrt(), "{place}: {variance}");
        }
    }

    #[test]
    fn the_density_integrates_to_one() {
        for place in [-3, 4, 9] {
            let (step, width) = (noise(place) / 50.0, 500);
            let density =
                |i: i32| LightDark.log_likelihood(&1, &place, &(f64::from(place) + f64::from(i) * step)).exp() * step;
            let total: f64 = (-width..=width).map(density).sum();
            assert!((total - 1.0).abs() < 1e-9, "{total}");
        }
    }

    #[test]
    fn walking_ends_at_the_origin_and_knowing_the_place_is_worth_the_shortest_way() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let known = FullInformation::solve(&LightDark, 1e-9);
        for start in -25..25 {
            let mut place = start;
            let end = (0..30).find_map(|_| {
                let action = Walk.action(&LightDark, &place, &mut rng);
                let step = LightDark.step(&mut place, &action, &mut rng);
                (step.outcome == Outcome::Terminal).then_some(step.reward)
            });
            assert_eq!(end, Some(100.0), "from {start}");
            // Fewest moves of ±1 and ±10: past the origin and back where the last digit is above 5.
            let (tens, ones) = (start.abs() / 10, start.abs() % 10);
            let moves = (tens + ones).min(tens + 11 - ones);
            let worth = 100.0 * DISCOUNT.powi(moves) - (1.0 - DISCOUNT.powi(moves)) / (1.0 - DISCOUNT);
            assert!((known.value(&LightDark, &start) - worth).abs() < 1e-6, "{start}");
        }
    }

    /// Mean and standard error of a policy on exact beliefs.
    fn returns(episodes: u64, decide: impl Fn(&ExactBelief<i32>) -> i32) -> (f64, f64) {
        let play = |item| {
            let mut rng = Seed(1).stream(Purpose::Test, item);
            let (start, belief) = (LightDark.initial(&mut rng), ExactBelief::initial(&LightDark));
            let learn = |belief: ExactBelief<i32>, action: &i32, seen: &f64, _: &mut Rng| {
                belief.update(&LightDark, action, seen).expect("a normal density explains everything")
            };
            let episode: Episode =
                episode::play_with(&LightDark, start, belief, 100, &mut rng, |belief, _| decide(belief), learn);
            episode.discounted_return
        };
        episode::mean_and_error(&(0..episodes).map(play).collect::<Vec<f64>>())
    }

    #[test]
    fn simple_policies_return_what_was_published() {
        // Published: 1,000 episodes each with 10,000 particles. QMDP declares what is likeliest and loses; walking to the right until one place is
        // sure, then QMDP, wins. Null: equal means; tolerance 4 standard errors of the difference. Noise of |x − 10| / √2 would fail.
        let known = FullInformation::solve(&LightDark, 1e-9);
        let qmdp = returns(1000, |belief| known.qmdp(&LightDark, belief));
        let right = returns(1000, |belief| {
            let most = belief.probabilities().map(|(_, p)| p).fold(0.0, f64::max);
            if most > 0.9 { known.qmdp(&LightDark, belief) } else { 10 }
        });
        for (name, (mean, error), (published, published_error)) in
            [("QMDP", qmdp, (-6.37, 1.03)), ("to the right", right, (42.42, 0.43))]
        {
            let off = (mean - published) / error.hypot(published_error);
            assert!(off.abs() < 4.0, "{name}: {mean} ± {error}, published {published} ± {published_error}");
        }
    }
}
