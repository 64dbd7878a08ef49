//! Simulating many states at once, each with a random stream of its own.

use pomdp::{ObservationModel, Outcome, Purpose, Rng, Seed};
use rayon::prelude::*;

/// Fewest states per task of the thread pool. A step may take a few nanoseconds, too little for a task of its own.
const STATES_PER_TASK: usize = 16;

/// What became of one simulated state.
pub(crate) struct Simulated<S> {
    pub(crate) next: S,
    /// ln p(o | a, s'); −∞ where the world diverged or the episode ended.
    pub(crate) log_likelihood: f64,
    /// ln p(o' | a, s') of the observation o' that was simulated.
    pub(crate) own: f64,
    pub(crate) outcome: Outcome,
}

/// Runs `work` for every index on the threads of the current pool. Each index has its own stream and results come in
/// order, so they do not depend on the number of threads.
pub(crate) fn each<T: Send>(count: usize, rng: &mut Rng, work: impl Fn(usize, &mut Rng) -> T + Sync) -> Vec<T> {
    use rand::Rng as _;
    let base = Seed(rng.next_u64());
    let item = |index: usize| work(index, &mut base.stream(Purpose::Filter, index as u64));
    (0..count).into_par_iter().with_min_len(STATES_PER_TASK).map(item).collect()
}

/// Steps one state and weighs it. A terminal state explains nothing: a filter is only called while the real episode goes on.
pub(crate) fn step<M: ObservationModel>(
    model: &M,
    action: &M::Action,
    observation: &M::Observation,
    mut state: M::State,
    rng: &mut Rng,
) -> Simulated<M::State> {
    let step = model.step(&mut state, action, rng);
    let (mut log_likelihood, mut own) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    if step.outcome == Outcome::Continue {
        // NaN and +∞ are broken likelihoods: such a particle must not win.
        let value = model.log_likelihood(action, &state, observation);
        log_likelihood = if value < f64::INFINITY { value } else { f64::NEG_INFINITY };
        own = model.log_likelihood(action, &state, &step.observation);
    }
    Simulated { next: state, log_likelihood, own, outcome: step.outcome }
}
