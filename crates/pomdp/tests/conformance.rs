//! The conformance checks on a model that keeps every promise, and on one that breaks each.

use std::cell::Cell;

use pomdp::conformance as check;
use pomdp::{Density, Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Prior, Rng, Step};
use rand::RngExt as _;

/// What is wrong with the model.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    Nothing,
    NoActions,
    Discount,
    SharedState,
    InfiniteReward,
    ImpossibleOwnObservation,
    LikelihoodUpsideDown,
    LikelihoodIgnoresObservation,
    LikelihoodsSumToLess,
    KeyChanges,
    NoiseImpossible,
    NoiseDoesNothing,
    NoiseOffCentre,
}
use Fault::*;

/// A lamp: on with an unknown probability.
struct Lamp(Fault, Cell<u32>);

#[derive(Clone, Debug, PartialEq)]
struct State {
    share: f64,
}

fn lamp(fault: Fault) -> Lamp {
    Lamp(fault, Cell::new(0))
}

fn states() -> Vec<State> {
    (0..10).map(|i| State { share: 0.05 + 0.1 * f64::from(i) }).collect()
}

impl GenerativeModel for Lamp {
    type State = State;
    type Action = ();
    type Observation = bool;

    fn actions(&self) -> &[()] {
        if self.0 == NoActions { &[] } else { &[()] }
    }

    fn step(&self, state: &mut State, _action: &(), rng: &mut Rng) -> Step<bool> {
        self.1.set(self.1.get() + 1);
        let on = rng.random_bool(state.share) ^ (self.0 == SharedState && self.1.get().is_multiple_of(2));
        let reward = if self.0 == InfiniteReward { f64::INFINITY } else { 0.0 };
        Step { observation: on, reward, outcome: Outcome::Continue }
    }

    fn discount(&self) -> f64 {
        if self.0 == Discount { 1.5 } else { 0.9 }
    }
}

impl ObservationModel for Lamp {
    fn log_likelihood(&self, _action: &(), next: &State, observation: &bool) -> f64 {
        let log = if *observation { next.share } else { 1.0 - next.share }.ln();
        match self.0 {
            ImpossibleOwnObservation if *observation => f64::NEG_INFINITY,
            LikelihoodUpsideDown => -log,
            LikelihoodIgnoresObservation => -1.0,
            LikelihoodsSumToLess => log - 0.1,
            _ => log,
        }
    }
}

impl Discretise for Lamp {
    type Key = u32;

    fn key(&self, observation: &bool) -> u32 {
        self.1.set(self.1.get() + 1);
        u32::from(*observation) + if self.0 == KeyChanges { self.1.get() } else { 0 }
    }
}

impl Perturb for Lamp {
    fn perturb(&self, state: &mut State, rng: &mut Rng) {
        let noise = rng.random_range(-0.04..0.04);
        state.share += match self.0 {
            NoiseDoesNothing => 0.0,
            NoiseImpossible => 10.0 * noise,
            NoiseOffCentre => noise + 0.004,
            _ => noise,
        };
    }
}

fn possible(state: &State) -> bool {
    (0.0..=1.0).contains(&state.share)
}

fn check_model(fault: Fault) {
    let model = lamp(fault);
    check::check_generative_model(&model, &states(), 20);
    check::check_observation_model(&model, &states(), 200);
    check::check_discrete_likelihoods(&model, &states(), 5, &[true, false]);
    check::check_discretise(&model, &states(), 20);
    check::check_perturb(&model, &states(), 50, possible);
    check::check_perturb_is_centred(&model, &states()[5], 4000, |s| vec![s.share]);
}

fn message(run: impl FnOnce() + std::panic::UnwindSafe) -> String {
    let panic = std::panic::catch_unwind(run).expect_err("the check passed");
    panic.downcast_ref::<String>().cloned().unwrap_or_else(|| panic.downcast_ref::<&str>().unwrap().to_string())
}

#[test]
fn a_model_that_keeps_its_promises_passes() {
    check_model(Nothing);
}

#[test]
fn every_broken_promise_is_found_and_named() {
    for (fault, expected) in [
        (NoActions, "at least one action"),
        (Discount, "discount 1.5"),
        (SharedState, "gave different steps"),
        (InfiniteReward, "reward inf is not finite"),
        (ImpossibleOwnObservation, "ln likelihood of a simulated observation is -inf"),
        (LikelihoodUpsideDown, "in their own states, but"),
        (LikelihoodIgnoresObservation, "in their own states, but"),
        (LikelihoodsSumToLess, "sum to 0.904"),
        (KeyChanges, "changed its class"),
        (NoiseImpossible, "impossible"),
        (NoiseDoesNothing, "changed nothing"),
        (NoiseOffCentre, "on average"),
    ] {
        let message = message(move || check_model(fault));
        assert!(message.contains(expected), "{message} does not say {expected}");
    }
    let nothing = message(|| check::check_observation_model(&lamp(Nothing), &[], 10));
    assert!(nothing.contains("nothing would be checked"), "{nothing}");
}

/// A line with a density that falls from 2 to 0 on [0, 1].
struct Ramp {
    factor: f64,
    beyond: bool,
    drawn: Cell<u32>,
}

impl Density for Ramp {
    type Value = f64;

    fn sample(&self, rng: &mut Rng) -> f64 {
        self.drawn.set(self.drawn.get() + 1);
        let value = 1.0 - rng.random::<f64>().sqrt();
        if self.beyond { value + 0.5 } else { value }
    }

    fn log_density(&self, value: &f64) -> f64 {
        if (0.0..1.0).contains(value) { (2.0 * self.factor * (1.0 - value)).ln() } else { f64::NEG_INFINITY }
    }
}

fn ramp(factor: f64, beyond: bool) -> Ramp {
    Ramp { factor, beyond, drawn: Cell::new(0) }
}

#[test]
fn densities_are_checked() {
    check::check_density(&ramp(1.0, false), 100);
    check::check_density_integrates_to_one(&ramp(1.0, false), 2.0, 20_000, |rng| 2.0 * rng.random::<f64>());
    let beyond = message(|| check::check_density(&ramp(1.0, true), 100));
    assert!(beyond.contains("ln density of a draw is -inf"), "{beyond}");
    let unnormalised = message(|| {
        check::check_density_integrates_to_one(&ramp(1.1, false), 2.0, 20_000, |rng| 2.0 * rng.random::<f64>());
    });
    assert!(unnormalised.contains("not to 1"), "{unnormalised}");
    let few =
        message(|| check::check_density_integrates_to_one(&ramp(1.0, false), 2.0, 20, |rng| 2.0 * rng.random::<f64>()));
    assert!(few.contains("give more"), "{few}");

    /// Draws that depend on how many there were.
    struct Counter(Cell<u32>);
    impl Density for Counter {
        type Value = u32;
        fn sample(&self, _rng: &mut Rng) -> u32 {
            self.0.set(self.0.get() + 1);
            self.0.get()
        }
        fn log_density(&self, _value: &u32) -> f64 {
            0.0
        }
    }
    let counted = message(|| check::check_density(&Counter(Cell::new(0)), 5));
    assert!(counted.contains("equal streams gave different draws"), "{counted}");
}

/// Suggests a ramp as high as the number of observations so far.
struct Memory {
    observed: f64,
    forgets: bool,
}

struct Shifted(f64);

impl Density for Shifted {
    type Value = f64;
    fn sample(&self, rng: &mut Rng) -> f64 {
        self.0 + rng.random::<f64>()
    }
    fn log_density(&self, value: &f64) -> f64 {
        if (self.0..self.0 + 1.0).contains(value) { 0.0 } else { f64::NEG_INFINITY }
    }
}

impl Prior<(), bool> for Memory {
    type Suggestion = Shifted;
    fn reset(&mut self) {
        if self.forgets {
            self.observed = 0.0;
        }
    }
    fn suggest(&mut self, _action: Option<&()>, _observation: &bool) -> Shifted {
        self.observed += 1.0;
        Shifted(self.observed)
    }
}

#[test]
fn priors_are_checked() {
    let history = [((), true), ((), false)];
    check::check_prior(&mut Memory { observed: 0.0, forgets: true }, &true, &history);
    let remembers = message(move || check::check_prior(&mut Memory { observed: 0.0, forgets: false }, &true, &history));
    assert!(remembers.contains("after a reset"), "{remembers}");
}
