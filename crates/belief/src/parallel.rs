//! Work on many particles at once, each with a random stream of its own.

use pomdp::{Purpose, Rng, Seed};
use rayon::prelude::*;

/// Fewest particles per task of the thread pool. A step may take a few nanoseconds, too little for a task of its own.
const PARTICLES_PER_TASK: usize = 16;

/// Runs `work` for every index on the threads of the current pool. Each index has its own stream and results come in
/// order, so they do not depend on the number of threads.
pub(crate) fn each<T: Send>(count: usize, rng: &mut Rng, work: impl Fn(usize, &mut Rng) -> T + Sync) -> Vec<T> {
    use rand::Rng as _;
    let base = Seed(rng.next_u64());
    let item = |index: usize| work(index, &mut base.stream(Purpose::Filter, index as u64));
    (0..count).into_par_iter().with_min_len(PARTICLES_PER_TASK).map(item).collect()
}
