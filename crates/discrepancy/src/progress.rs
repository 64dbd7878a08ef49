//! How far a diagnosis is, for who waits for it.

use std::fmt::Debug;

/// Looks on at a diagnosis, from any thread. Nothing of it changes an answer.
pub trait Progress: Debug + Sync {
    /// A stage begins.
    fn stage(&self, stage: &'static str);

    /// So many episodes are simulated, of a budget that the search does not exceed by much. Every simulation says so: who does not want to wait any longer
    /// ends a diagnosis by unwinding from here (`std::panic::resume_unwind`).
    fn simulated(&self, episodes: usize, budget: usize);
}

/// Nobody looks on.
impl Progress for () {
    fn stage(&self, _stage: &'static str) {}

    fn simulated(&self, _episodes: usize, _budget: usize) {}
}
