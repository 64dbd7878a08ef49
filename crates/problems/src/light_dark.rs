//! LightDark: find the origin on a line that is lit far from it (Platt, Tedrake, Kaelbling and Lozano-Pérez, "Belief space planning
//! assuming maximum likelihood observations", RSS 2010), in the one-dimensional form with continuous observations of Sunberg and
//! Kochenderfer, "Online algorithms for POMDPs with continuous state, action, and observation spaces", ICAPS 2018 (γ = 0.9).
//!
//! The place is an integer. An action adds −10, −1, 1 or 10 to it for −1, or declares that it is the origin: +100 if so, −100 if not, and the
//! episode ends. After every action the place is measured with normal noise of standard deviation |x − 10| / √2 + 0.01.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use pomdp::{Discretise, GenerativeModel, ObservationModel, Outcome, Policy, Rng, Step};
use rand_distr::{Distribution as _, Normal, StandardNormal};

use crate::InitialState;

/// γ.
pub const DISCOUNT: f64 = 0.9;
/// Where measurements are best.
pub const LIGHT: i32 = 10;
/// What can be added to the place; 0 declares it the origin.
pub const ACTIONS: [i32; 5] = [-10, -1, 0, 1, 10];
/// Width of the classes of observations for planners that need some.
pub const CLASS_WIDTH: f64 = 1.0;

/// The problem. The place at the start is normal around 2 with standard deviation 3, rounded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightDark;

/// Standard deviation of a measurement at `place`.
#[must_use]
pub fn noise(place: i32) -> f64 {
    f64::from((place - LIGHT).abs()) * FRAC_1_SQRT_2 + 0.01
}

impl GenerativeModel for LightDark {
    type State = i32;
    type Action = i32;
    type Observation = f64;

    fn actions(&self) -> &[i32] {
        &ACTIONS
    }

    fn step(&self, place: &mut i32, action: &i32, rng: &mut Rng) -> Step<f64> {
        *place += action;
        let deviation: f64 = StandardNormal.sample(rng);
        let observation = f64::from(*place) + noise(*place) * deviation;
        let (reward, outcome) = match (*action, *place) {
            (0, 0) => (100.0, Outcome::Terminal),
            (0, _) => (-100.0, Outcome::Terminal),
            _ => (-1.0, Outcome::Continue),
        };
        Step { observation, reward, outcome }
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

impl Discretise for LightDark {
    type Key = i32;

    fn key(&self, observation: &f64) -> i32 {
        (observation / CLASS_WIDTH).round() as i32
    }
}

impl InitialState for LightDark {
    fn initial(&self, rng: &mut Rng) -> i32 {
        let start: f64 = Normal::new(2.0, 3.0).expect("a positive standard deviation").sample(rng);
        start.round() as i32
    }
}

/// Walks to the origin and declares it: the rollout policy of the published experiments, which looks at the place.
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

    #[test]
    fn it_conforms() {
        conformance::check_generative_model(&LightDark, &[-30, -1, 0, 2, 10, 17], 20);
    }

    #[test]
    fn declaring_pays_at_the_origin_only() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut step = |mut place: i32, action: i32| {
            let step = LightDark.step(&mut place, &action, &mut rng);
            (place, step.reward, step.outcome)
        };
        assert_eq!(step(0, 0), (0, 100.0, Outcome::Terminal));
        assert_eq!(step(1, 0), (1, -100.0, Outcome::Terminal));
        assert_eq!(step(1, -1), (0, -1.0, Outcome::Continue));
        assert_eq!(step(1, 10), (11, -1.0, Outcome::Continue));
    }

    #[test]
    fn measurements_have_the_stated_noise() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for (place, stddev) in [(1, 9.0 / 2_f64.sqrt() + 0.01), (9, 1.0 / 2_f64.sqrt() + 0.01), (11, 0.01)] {
            let n = 4000;
            let errors: Vec<f64> = (0..n)
                .map(|_| LightDark.step(&mut { place - 1 }, &1, &mut rng).observation - f64::from(place))
                .collect();
            let (mean, variance) =
                (errors.iter().sum::<f64>() / f64::from(n), errors.iter().map(|e| e * e).sum::<f64>() / f64::from(n));
            // Standard errors: σ/√n of the mean, σ/√(2n) of the standard deviation; tolerance 4 of them.
            if place != 11 {
                assert!(mean.abs() < 4.0 * stddev / f64::from(n).sqrt(), "{place}: mean {mean}");
                assert!(
                    (variance.sqrt() - stddev).abs() < 4.0 * stddev / f64::from(2 * n).sqrt(),
                    "{place}: {variance}"
                );
            }
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
    fn walking_ends_at_the_origin() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for start in -25..25 {
            let mut place = start;
            let end = (0..30).find_map(|_| {
                let action = Walk.action(&LightDark, &place, &mut rng);
                let step = LightDark.step(&mut place, &action, &mut rng);
                (step.outcome == Outcome::Terminal).then_some(step.reward)
            });
            assert_eq!(end, Some(100.0), "from {start}");
        }
    }
}
