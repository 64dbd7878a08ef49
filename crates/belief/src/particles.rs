//! The belief: weighted states, never empty.

use pomdp::{Belief, Rng};
use rand::RngExt as _;

use crate::{Error, effective_sample_size};

/// A distribution over finitely many states. Immutable: an update makes a new one.
///
/// # Example
///
/// ```
/// use belief::Particles;
/// let belief = Particles::weighted(vec!["box", "sphere"], vec![3.0, 1.0])?;
/// assert_eq!(belief.iter().collect::<Vec<_>>(), [(&"box", 0.75), (&"sphere", 0.25)]);
/// # Ok::<(), belief::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Particles<S> {
    states: Vec<S>,
    weights: Weights,
}

#[derive(Clone, Debug, PartialEq)]
enum Weights {
    Uniform,
    /// Partial sums of the normalised weights beside them: a draw is a binary search.
    Each {
        normalised: Vec<f64>,
        cumulative: Vec<f64>,
    },
}

impl<S> Particles<S> {
    /// Equally weighted states.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] where there are none.
    pub fn uniform(states: Vec<S>) -> Result<Self, Error> {
        if states.is_empty() { Err(Error::Empty) } else { Ok(Self { states, weights: Weights::Uniform }) }
    }

    /// States with weights of any positive sum; they are normalised.
    ///
    /// # Errors
    ///
    /// Where there are no states, the counts differ, a weight is negative or not finite, or their sum is zero or overflows.
    pub fn weighted(states: Vec<S>, weights: Vec<f64>) -> Result<Self, Error> {
        if states.is_empty() {
            return Err(Error::Empty);
        }
        if states.len() != weights.len() {
            return Err(Error::WeightCount { states: states.len(), weights: weights.len() });
        }
        if let Some((index, &value)) = weights.iter().enumerate().find(|(_, w)| !(w.is_finite() && **w >= 0.0)) {
            return Err(Error::Weight { index, value });
        }
        let sum: f64 = weights.iter().sum();
        if !(sum.is_finite() && sum > 0.0) {
            return Err(Error::WeightSum { sum });
        }
        let mut normalised = weights;
        normalised.iter_mut().for_each(|w| *w /= sum);
        let partial_sum = |total: &mut f64, w: &f64| {
            *total += w;
            Some(*total)
        };
        let cumulative = normalised.iter().scan(0.0, partial_sum).collect();
        Ok(Self { states, weights: Weights::Each { normalised, cumulative } })
    }

    /// The states, in order.
    #[must_use]
    pub fn states(&self) -> &[S] {
        &self.states
    }

    /// Takes the states out, in order.
    #[must_use]
    pub fn into_states(self) -> Vec<S> {
        self.states
    }

    /// Number of particles. At least one.
    #[must_use]
    pub fn count(&self) -> usize {
        self.states.len()
    }

    /// States with their normalised weights.
    pub fn iter(&self) -> impl Iterator<Item = (&S, f64)> {
        self.states.iter().enumerate().map(|(index, state)| (state, self.weight(index)))
    }

    /// (Σw)² / Σw².
    #[must_use]
    pub fn effective_sample_size(&self) -> f64 {
        match &self.weights {
            Weights::Uniform => self.states.len() as f64,
            Weights::Each { normalised, .. } => effective_sample_size(normalised),
        }
    }

    fn weight(&self, index: usize) -> f64 {
        match &self.weights {
            Weights::Uniform => 1.0 / self.states.len() as f64,
            Weights::Each { normalised, .. } => normalised[index],
        }
    }
}

impl<S> Belief for Particles<S> {
    type State = S;

    fn sample(&self, rng: &mut Rng) -> &S {
        let index = match &self.weights {
            Weights::Uniform => rng.random_range(0..self.states.len()),
            Weights::Each { cumulative, .. } => {
                let total = cumulative[cumulative.len() - 1];
                let draw = rng.random::<f64>() * total;
                // Rounding may lift the draw to the total, which no partial sum exceeds: the last particle with a weight is meant.
                let last = cumulative.partition_point(|&sum| sum < total);
                cumulative.partition_point(|&sum| sum <= draw).min(last)
            }
        };
        &self.states[index]
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_is_no_distribution_is_refused() {
        let states = || vec!['a', 'b'];
        assert_eq!(Particles::<char>::uniform(vec![]), Err(Error::Empty));
        assert_eq!(Particles::<char>::weighted(vec![], vec![]), Err(Error::Empty));
        assert_eq!(Particles::weighted(states(), vec![1.0]), Err(Error::WeightCount { states: 2, weights: 1 }));
        assert_eq!(Particles::weighted(states(), vec![1.0, -1.0]), Err(Error::Weight { index: 1, value: -1.0 }));
        assert!(matches!(Particles::weighted(states(), vec![f64::NAN, 1.0]), Err(Error::Weight { index: 0, .. })));
        assert_eq!(Particles::weighted(states(), vec![0.0, 0.0]), Err(Error::WeightSum { sum: 0.0 }));
        let overflow = Particles::weighted(states(), vec![f64::MAX, f64::MAX]);
        assert_eq!(overflow, Err(Error::WeightSum { sum: f64::INFINITY }));
    }

    #[test]
    fn draws_follow_the_weights() {
        // Null: counts are multinomial with the given weights. n = 60,000; χ² with 3 degrees of freedom exceeds 16.27 with
        // probability 0.001. The uniform belief is the same check with equal weights.
        let weights = [0.1, 0.2, 0.3, 0.4];
        let weighted = Particles::weighted(vec![0, 1, 2, 3], weights.to_vec()).unwrap();
        let uniform = Particles::uniform(vec![0, 1, 2, 3]).unwrap();
        for (belief, weights) in [(weighted, weights), (uniform, [0.25; 4])] {
            let mut rng = Seed(1).stream(Purpose::Test, 0);
            let mut counts = [0.0; 4];
            for _ in 0..60_000 {
                counts[*belief.sample(&mut rng)] += 1.0;
            }
            let chi_squared: f64 =
                counts.iter().zip(weights).map(|(c, w)| (c - 6e4 * w) * (c - 6e4 * w) / (6e4 * w)).sum();
            assert!(chi_squared < 16.27, "{chi_squared}: {counts:?}");
        }
    }

    proptest! {
        #[test]
        fn weights_normalise_and_weightless_particles_are_never_drawn(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 1e-12..1e12_f64], 1..20),
            item in 0_u64..1000,
        ) {
            prop_assume!(weights.iter().any(|&w| w > 0.0));
            let belief = Particles::weighted((0..weights.len()).collect(), weights.clone()).unwrap();
            let sum: f64 = belief.iter().map(|(_, w)| w).sum();
            prop_assert!((sum - 1.0).abs() < 1e-12);
            let mut rng = Seed(1).stream(Purpose::Test, item);
            for _ in 0..100 {
                prop_assert!(weights[*belief.sample(&mut rng)] > 0.0);
            }
        }
    }
}
