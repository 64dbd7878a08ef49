//! Checks that implementors of the traits call from their tests. Each panics with the values that broke it.
//!
//! | trait | check |
//! |---|---|
//! | [`GenerativeModel`] | [`check_generative_model`] |
//! | [`ObservationModel`] | [`check_observation_model`]; [`check_discrete_likelihoods`] where observations can be listed |
//! | [`Discretise`] | [`check_discretise`] |
//! | [`Perturb`] | [`check_perturb`], [`check_perturb_is_centred`] |
//! | [`Density`] | [`check_density`], [`check_density_integrates_to_one`] |
//! | [`Prior`] | [`check_prior`] |
//!
//! Random checks use fixed streams: they fail always or never.

use std::fmt::Debug;

use crate::{Density, Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Prior, Purpose, Rng, Seed};

/// How many standard errors a mean may be off.
const STANDARD_ERRORS: f64 = 4.0;

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
    M::State: PartialEq + Debug,
    M::Observation: PartialEq + Debug,
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
    M::State: PartialEq + Debug,
    M::Observation: PartialEq + Debug,
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

/// One simulated step: action, next state, observation.
type Seen<M> = (<M as GenerativeModel>::Action, <M as GenerativeModel>::State, <M as GenerativeModel>::Observation);

/// Steps that the episode survived, `steps` from each initial state.
fn walk<M: GenerativeModel>(model: &M, initial: &[M::State], steps: usize) -> Vec<Seen<M>> {
    assert!(!initial.is_empty(), "no initial state was given: nothing would be checked");
    let mut seen = Vec::new();
    for (item, start) in initial.iter().enumerate() {
        let mut state = start.clone();
        let mut rng = Seed(2).stream(Purpose::Test, item as u64);
        for index in 0..steps {
            let action = model.actions()[(index + item) % model.actions().len()].clone();
            let step = model.step(&mut state, &action, &mut rng);
            if step.outcome != Outcome::Continue {
                break;
            }
            seen.push((action, state.clone(), step.observation));
        }
    }
    assert!(!seen.is_empty(), "every step ended an episode: nothing would be checked");
    seen
}

/// Simulated observations have a finite likelihood. On average it is larger in their own state than in another (Gibbs'
/// inequality).
///
/// The initial states must differ in what they show; the more steps, the surer the second check.
///
/// # Panics
///
/// When a check fails.
pub fn check_observation_model<M>(model: &M, initial: &[M::State], steps: usize)
where
    M: ObservationModel<State: Debug, Observation: Debug>,
{
    let seen = walk(model, initial, steps);
    let (mut own, mut other) = (0.0, 0.0);
    for (index, (action, state, observation)) in seen.iter().enumerate() {
        let log = model.log_likelihood(action, state, observation);
        assert!(
            log.is_finite(),
            "step {index}: ln likelihood of a simulated observation is {log}: {observation:?} in {state:?}"
        );
        // Far enough along to be another episode where there is one.
        let (_, _, strange) = &seen[(index + seen.len() / 2 + 1) % seen.len()];
        let log_strange = model.log_likelihood(action, state, strange);
        assert!(
            log_strange < f64::INFINITY,
            "step {index}: ln likelihood of another observation is {log_strange}: {strange:?} in {state:?}"
        );
        own += log / seen.len() as f64;
        other += log_strange / seen.len() as f64;
    }
    assert!(
        own > other,
        "mean ln likelihood of {} observations is {own} in their own states, but {other} in other ones",
        seen.len()
    );
}

/// Likelihoods of `observations`, which are all there are, sum to one in every state that is reached.
///
/// # Panics
///
/// When a sum is off by more than 1e-9.
pub fn check_discrete_likelihoods<M>(model: &M, initial: &[M::State], steps: usize, observations: &[M::Observation])
where
    M: ObservationModel<State: Debug>,
{
    for (index, (action, state, _)) in walk(model, initial, steps).iter().enumerate() {
        let sum: f64 = observations.iter().map(|o| model.log_likelihood(action, state, o).exp()).sum();
        assert!((sum - 1.0).abs() < 1e-9, "step {index}: the likelihoods in {state:?} sum to {sum}");
    }
}

/// Equal observations have equal classes, whenever they are asked for.
///
/// # Panics
///
/// When they have not.
pub fn check_discretise<M>(model: &M, initial: &[M::State], steps: usize)
where
    M: Discretise<Observation: Debug + PartialEq>,
{
    let seen = walk(model, initial, steps);
    let keys: Vec<M::Key> = seen.iter().map(|(_, _, observation)| model.key(observation)).collect();
    for (index, (_, _, observation)) in seen.iter().enumerate() {
        let again = model.key(&observation.clone());
        assert_eq!(keys[index], again, "observation {index} changed its class: {observation:?}");
        let same = seen.iter().position(|(_, _, other)| other == observation).unwrap_or(index);
        assert_eq!(keys[index], keys[same], "equal observations have different classes: {observation:?}");
    }
}

/// Noise moves a state, and leaves it `possible`.
///
/// # Panics
///
/// When a noisy state is not possible, or no draw changed anything.
pub fn check_perturb<M>(model: &M, initial: &[M::State], draws: usize, possible: impl Fn(&M::State) -> bool)
where
    M: Perturb<State: Debug + PartialEq>,
{
    assert!(!initial.is_empty(), "no initial state was given: nothing would be checked");
    for (item, start) in initial.iter().enumerate() {
        assert!(possible(start), "initial state {item} is not possible itself: {start:?}");
        let mut rng = Seed(3).stream(Purpose::Test, item as u64);
        let mut changed = false;
        for _ in 0..draws {
            let mut state = start.clone();
            model.perturb(&mut state, &mut rng);
            assert!(possible(&state), "noise made {start:?} impossible: {state:?}");
            changed |= state != *start;
        }
        assert!(changed, "{draws} draws of noise changed nothing in {start:?}");
    }
}

/// Noise has mean zero in each of `values`, within 4 standard errors of `draws` draws. Only for states away from the ends of their ranges,
/// where clamping moves the mean.
///
/// # Panics
///
/// When a mean is off.
pub fn check_perturb_is_centred<M>(model: &M, start: &M::State, draws: usize, values: impl Fn(&M::State) -> Vec<f64>)
where
    M: Perturb<State: Debug>,
{
    let before = values(start);
    let mut sums = vec![(0.0, 0.0); before.len()];
    let mut rng = Seed(4).stream(Purpose::Test, 0);
    for _ in 0..draws {
        let mut state = start.clone();
        model.perturb(&mut state, &mut rng);
        for ((sum, squares), (after, before)) in sums.iter_mut().zip(values(&state).iter().zip(&before)) {
            *sum += after - before;
            *squares += (after - before).powi(2);
        }
    }
    for (index, (sum, squares)) in sums.into_iter().enumerate() {
        let mean = sum / draws as f64;
        let error = ((squares / draws as f64 - mean * mean).max(0.0) / draws as f64).sqrt();
        assert!(
            mean.abs() <= STANDARD_ERRORS * error,
            "noise moves value {index} of {start:?} by {mean} on average, {:.1} standard errors from 0",
            mean / error
        );
    }
}

/// Draws have a finite density, and equal streams give equal draws.
///
/// # Panics
///
/// When they do not.
pub fn check_density<D: Density>(density: &D, draws: usize)
where
    D::Value: Debug + PartialEq,
{
    let (mut first, mut second) = (Seed(5).stream(Purpose::Test, 0), Seed(5).stream(Purpose::Test, 0));
    for index in 0..draws {
        let value = density.sample(&mut first);
        assert_eq!(value, density.sample(&mut second), "draw {index}: equal streams gave different draws");
        let log = density.log_density(&value);
        assert!(log.is_finite(), "draw {index}: ln density of a draw is {log}: {value:?}");
    }
}

/// The density integrates to one over a region that holds nearly all of it. `volume` is the volume of the region and
/// `uniform` draws from it. The integral may be off by 4 standard errors of `draws` draws, which must be below 10 %.
///
/// # Panics
///
/// When it does not, or the draws are too few.
pub fn check_density_integrates_to_one<D: Density>(
    density: &D,
    volume: f64,
    draws: usize,
    uniform: impl Fn(&mut Rng) -> D::Value,
) {
    let mut rng = Seed(6).stream(Purpose::Test, 0);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..draws {
        let value = volume * density.log_density(&uniform(&mut rng)).exp();
        sum += value;
        squares += value * value;
    }
    let mean = sum / draws as f64;
    let error = ((squares / draws as f64 - mean * mean).max(0.0) / draws as f64).sqrt();
    assert!(
        error < 0.1,
        "{draws} draws leave an error of {error} on an integral of {mean}: give more, or a tighter region"
    );
    assert!(
        (mean - 1.0).abs() <= STANDARD_ERRORS * error + 1e-9,
        "the density integrates to {mean} ± {error}, not to 1"
    );
}

/// A prior suggests what can be drawn and has a finite density, and forgets an episode on reset.
///
/// # Panics
///
/// When it does not.
pub fn check_prior<A, O, P: Prior<A, O>>(prior: &mut P, first: &O, history: &[(A, O)])
where
    <P::Suggestion as Density>::Value: Debug + PartialEq,
{
    let mut play = || {
        prior.reset();
        let mut draws = Vec::new();
        for (index, (action, observation)) in
            std::iter::once((None, first)).chain(history.iter().map(|(a, o)| (Some(a), o))).enumerate()
        {
            let suggestion = prior.suggest(action, observation);
            check_density(&suggestion, 10);
            draws.push(suggestion.sample(&mut Seed(7).stream(Purpose::Test, index as u64)));
        }
        draws
    };
    let (before, after) = (play(), play());
    assert_eq!(before, after, "after a reset the same history gave other suggestions");
}
