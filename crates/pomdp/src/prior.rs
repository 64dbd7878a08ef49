//! Learned suggestions of states and parameters.

use crate::Rng;

/// A probability density that can be sampled and evaluated.
pub trait Density {
    /// What is drawn.
    type Value;

    /// One draw.
    fn sample(&self, rng: &mut Rng) -> Self::Value;

    /// ln p(value).
    fn log_density(&self, value: &Self::Value) -> f64;
}

/// A source of densities over (s, Θ) from the history of actions and observations.
pub trait Prior<A, O> {
    /// What it suggests.
    type Suggestion: Density;

    /// Forgets the history: a new episode begins.
    fn reset(&mut self);

    /// Takes in the next observation and the action before it (`None` for the first observation of an episode).
    fn suggest(&mut self, action: Option<&A>, observation: &O) -> Self::Suggestion;
}
