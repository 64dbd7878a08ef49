//! Checks that every implementor of [`GenerativeModel`] calls from its tests.

use crate::{GenerativeModel, Outcome, Purpose, Seed};

/// Runs every check on `model` from the given initial states.
///
/// Copies are independent, equal streams give equal steps, rewards are finite, the discount lies in [0, 1], actions exist.
///
/// # Panics
///
/// When a check fails, with the values that broke it.
pub fn check_generative_model<M>(model: &M, initial: &[M::State], steps: usize)
where
    M: GenerativeModel,
    M::State: PartialEq + std::fmt::Debug,
    M::Observation: PartialEq + std::fmt::Debug,
{
    assert!(!model.actions().is_empty(), "a model needs at least one action");
    assert!((0.0..=1.0).contains(&model.discount()), "discount {} is outside [0, 1]", model.discount());
    assert!(!initial.is_empty(), "no initial state was given: nothing would be checked");
    for (item, start) in initial.iter().enumerate() {
        check_one(model, start, steps, item as u64);
    }
}

fn check_one<M>(model: &M, start: &M::State, steps: usize, item: u64)
where
    M: GenerativeModel,
    M::State: PartialEq + std::fmt::Debug,
    M::Observation: PartialEq + std::fmt::Debug,
{
    let untouched = start.clone();
    let mut first = start.clone();
    let mut second = start.clone();
    let mut first_rng = Seed(1).stream(Purpose::Test, item);
    let mut second_rng = Seed(1).stream(Purpose::Test, item);
    for index in 0..steps {
        let action = model.actions()[index % model.actions().len()].clone();
        let a = model.step(&mut first, &action, &mut first_rng);
        assert_eq!(&untouched, start, "stepping a copy changed the original state");
        let b = model.step(&mut second, &action, &mut second_rng);
        assert_eq!(a, b, "step {index}: equal states and equal streams gave different steps");
        assert_eq!(first, second, "step {index}: equal states and equal streams gave different next states");
        assert!(a.reward.is_finite(), "step {index}: reward {} is not finite", a.reward);
        // A copy made on the way must behave as the state it was copied from.
        let copy = first.clone();
        assert_eq!(copy, first, "step {index}: a copy differs from its original");
        second = copy;
        if a.outcome != Outcome::Continue {
            break;
        }
    }
}
