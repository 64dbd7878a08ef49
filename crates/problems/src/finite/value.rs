//! What states and beliefs of a finite problem are worth to somebody who knows the state, or will know it after one more step.

use std::collections::BTreeMap;

use pomdp::{GenerativeModel, Outcome, Policy, Rng};

use super::{ExactBelief, Finite};

/// Expected discounted return of the best policy that sees the state: a bound from above on what an agent can reach.
#[derive(Clone, Debug)]
pub struct FullInformation {
    values: Vec<f64>,
    /// Of each state those of all actions, in the order of the model: a belief asks for thousands.
    of_actions: Vec<f64>,
}

impl FullInformation {
    /// Value iteration in place, in turn upwards and downwards through the states, until no value changes by more than `tolerance`.
    #[must_use]
    pub fn solve<M: Finite>(model: &M, tolerance: f64) -> Self {
        let mut values = vec![0.0; model.states()];
        loop {
            let mut change = 0.0_f64;
            for upwards in [true, false] {
                for count in 0..values.len() {
                    let index = if upwards { count } else { values.len() - 1 - count };
                    let state = model.state(index);
                    let of_actions = model.actions().iter().map(|action| backup(model, &values, &state, action));
                    let best = of_actions.fold(f64::NEG_INFINITY, f64::max);
                    change = change.max((best - values[index]).abs());
                    values[index] = best;
                }
            }
            if change <= tolerance {
                break;
            }
        }
        let of_actions = (0..values.len()).flat_map(|index| {
            let (state, values) = (model.state(index), &values);
            model.actions().iter().map(move |action| backup(model, values, &state, action))
        });
        let of_actions = of_actions.collect();
        Self { values, of_actions }
    }

    /// Value of a state in which the episode goes on.
    #[must_use]
    pub fn value<M: Finite>(&self, model: &M, state: &M::State) -> f64 {
        self.values[model.index(state)]
    }

    /// Values of all actions in a state, in the order of the model.
    #[must_use]
    pub fn action_values<M: Finite>(&self, model: &M, state: &M::State) -> &[f64] {
        let count = model.actions().len();
        &self.of_actions[count * model.index(state)..][..count]
    }

    /// QMDP: the action with the highest mean value, the first of several.
    #[must_use]
    pub fn qmdp<M: Finite>(&self, model: &M, belief: &ExactBelief<M::State>) -> M::Action
    where
        M::State: Clone,
    {
        best(model, &self.mean_action_values(model, belief.probabilities()))
    }

    /// Means of [`Self::action_values`] over weighted states, times the sum of the weights.
    pub(crate) fn mean_action_values<'a, M: Finite>(
        &self,
        model: &M,
        belief: impl Iterator<Item = (&'a M::State, f64)>,
    ) -> Vec<f64>
    where
        M::State: 'a,
    {
        let mut means = vec![0.0; model.actions().len()];
        for (state, weight) in belief {
            let values = self.action_values(model, state);
            means.iter_mut().zip(values).for_each(|(mean, value)| *mean += weight * value);
        }
        means
    }
}

/// Value of an action in a state, from those of the states after it.
fn backup<M: Finite>(model: &M, values: &[f64], state: &M::State, action: &M::Action) -> f64 {
    let mut value = 0.0;
    model.successors(state, action, |next| {
        let later = if next.outcome == Outcome::Continue { values[model.index(&next.state)] } else { 0.0 };
        value += next.probability * (next.reward + model.discount() * later);
    });
    value
}

/// The states of a belief with their weights.
fn weighted<S>(belief: &[(S, f64)]) -> impl Iterator<Item = (&S, f64)> {
    belief.iter().map(|(state, weight)| (state, *weight))
}

/// The action with the highest of `values`, which are in the order of the model; the first of several.
pub(super) fn best<M: GenerativeModel>(model: &M, values: &[f64]) -> M::Action {
    let valued = model.actions().iter().zip(values);
    let best = valued.reduce(|best, next| if next.1.total_cmp(best.1).is_gt() { next } else { best });
    best.expect("a model has actions").0.clone()
}

impl<M: Finite> Policy<M> for FullInformation {
    fn action(&self, model: &M, state: &M::State, _rng: &mut Rng) -> M::Action {
        best(model, self.action_values(model, state))
    }

    fn leaf_value(&self, model: &M, state: &M::State, _actions_left: usize) -> f64 {
        self.value(model, state)
    }

    /// QMDP.
    fn belief_action(&self, model: &M, belief: &[(M::State, f64)], _rng: &mut Rng) -> M::Action {
        best(model, &self.mean_action_values(model, weighted(belief)))
    }

    /// The value of QMDP: that of one more action for a belief, after which the state is known.
    fn belief_value(&self, model: &M, belief: &[(M::State, f64)], _actions_left: usize) -> f64 {
        let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
        self.mean_action_values(model, weighted(belief)).into_iter().fold(f64::NEG_INFINITY, f64::max) / total
    }
}

/// Full information, less a price for what a belief leaves open: `price` (in units of reward) times its entropy in nats.
///
/// The value of full information expects that everything is known after one more step, so a search with it at its leaves gains nothing by learning
/// sooner. The bounds of DESPOT make up for that in LaserTag: a leaf whose scenarios are told apart has the value of full information, any other one
/// only what an agent earns that never finds out (zsunberg/ContinuousPOMDPTreeSearchExperiments.jl, `LaserBounds`). The entropy says the
/// same without scenarios. The price is a choice, no bound.
#[derive(Clone, Copy, Debug)]
pub struct PricedUncertainty<'a> {
    known: &'a FullInformation,
    price: f64,
}

impl<'a> PricedUncertainty<'a> {
    /// With this price of a nat.
    #[must_use]
    pub fn new(known: &'a FullInformation, price: f64) -> Self {
        Self { known, price }
    }
}

/// Entropy of weighted states, in nats; equal states count as one.
fn entropy<M: Finite>(model: &M, belief: &[(M::State, f64)]) -> f64 {
    let mut weights: BTreeMap<usize, f64> = BTreeMap::new();
    for (state, weight) in belief {
        *weights.entry(model.index(state)).or_default() += weight;
    }
    let total: f64 = weights.values().sum();
    weights.values().map(|weight| weight / total).filter(|p| *p > 0.0).map(|p| -p * p.ln()).sum()
}

impl<M: Finite> Policy<M> for PricedUncertainty<'_> {
    fn action(&self, model: &M, state: &M::State, rng: &mut Rng) -> M::Action {
        self.known.action(model, state, rng)
    }

    fn leaf_value(&self, model: &M, state: &M::State, _actions_left: usize) -> f64 {
        self.known.value(model, state)
    }

    fn belief_action(&self, model: &M, belief: &[(M::State, f64)], rng: &mut Rng) -> M::Action {
        self.known.belief_action(model, belief, rng)
    }

    fn belief_value(&self, model: &M, belief: &[(M::State, f64)], actions_left: usize) -> f64 {
        let value = self.known.belief_value(model, belief, actions_left);
        if self.price == 0.0 { value } else { value - self.price * entropy(model, belief) }
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::super::tests::Rooms;
    use super::*;

    #[test]
    fn what_a_belief_leaves_open_has_its_price() {
        // Weights 1 and 3: entropy ln 4 − ¾ ln 3. A state that stands twice is one state.
        let known = FullInformation::solve(&Rooms, 1e-12);
        let priced = PricedUncertainty::new(&known, 2.0);
        let less = |belief: &[(bool, f64)]| {
            let value = |policy: &dyn Policy<Rooms>| policy.belief_value(&Rooms, belief, 9);
            value(&known) - value(&priced)
        };
        let open = 4_f64.ln() - 0.75 * 3_f64.ln();
        assert!((less(&[(true, 1.0), (false, 3.0)]) - 2.0 * open).abs() < 1e-12);
        assert!((less(&[(false, 2.0), (true, 2.0), (false, 4.0)]) - 2.0 * open).abs() < 1e-12);
        assert_eq!(less(&[(true, 1.0), (true, 3.0)]), 0.0);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let even = [(true, 1.0), (false, 1.0)];
        assert_eq!(priced.belief_action(&Rooms, &even, &mut rng), known.belief_action(&Rooms, &even, &mut rng));
        assert_eq!(priced.leaf_value(&Rooms, &true, 9), known.value(&Rooms, &true));
    }
}
