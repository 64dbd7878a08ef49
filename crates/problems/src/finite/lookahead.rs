//! One exact step before the value of a belief.

use pomdp::{Belief as _, Outcome, Policy as _, Rng};

use super::value::best;
use super::{ExactBelief, Finite, PricedUncertainty, given};

/// States below this share of a belief do not change what it is worth.
const LEAST: f64 = 1e-3;

/// The best action by its expected reward and the mean value of the exact beliefs after drawn observations. What a search with few states in its branches
/// approaches: between the two lies what these states cost.
#[derive(Clone, Copy, Debug)]
pub struct Lookahead<'a> {
    value: PricedUncertainty<'a>,
    observations: usize,
}

impl<'a> Lookahead<'a> {
    /// With so many draws of an observation for each action.
    ///
    /// # Panics
    ///
    /// Without a draw.
    #[must_use]
    pub fn new(value: PricedUncertainty<'a>, observations: usize) -> Self {
        assert!(observations > 0, "a step needs an observation");
        Self { value, observations }
    }

    /// The best action, the first of several.
    ///
    /// # Panics
    ///
    /// Where the model has no actions.
    #[must_use]
    pub fn action<M: Finite>(&self, model: &M, belief: &ExactBelief<M::State>, rng: &mut Rng) -> M::Action
    where
        M::State: Clone,
    {
        let values = model.actions().iter().map(|action| self.action_value(model, belief, action, rng));
        best(model, &values.collect::<Vec<f64>>())
    }

    fn action_value<M: Finite>(
        &self,
        model: &M,
        belief: &ExactBelief<M::State>,
        action: &M::Action,
        rng: &mut Rng,
    ) -> f64
    where
        M::State: Clone,
    {
        let (reward, predicted) = belief.predicted(model, action);
        let mut later = 0.0;
        for _ in 0..self.observations {
            let mut state = belief.sample(rng).clone();
            let step = model.step(&mut state, action, rng);
            // An episode that has ended brings nothing more.
            if step.outcome == Outcome::Continue
                && let Some(mut next) = given(model, predicted.clone(), action, &step.observation)
            {
                next.retain(|(_, probability)| *probability > LEAST);
                later += self.value.belief_value(model, &next, 0);
            }
        }
        reward + model.discount() * later / self.observations as f64
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::super::tests::Rooms;
    use super::super::{FullInformation, PricedUncertainty};
    use super::*;

    #[test]
    fn a_step_is_worth_its_reward_and_what_follows() {
        // By hand: staying pays 0.4 and what is heard moves the belief (¾, ¼) as Bayes' rule says; the mean of the values of two such beliefs, by the
        // probabilities of hearing either. n = 20,000 draws; tolerance 4 standard deviations of a mean of two values.
        let known = FullInformation::solve(&Rooms, 1e-12);
        let value = PricedUncertainty::new(&known, 0.5);
        let belief = ExactBelief::initial(&Rooms);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let found = Lookahead::new(value, 20_000).action_value(&Rooms, &belief, &false, &mut rng);
        let after = |heard: bool| {
            let next = given(&Rooms, vec![(false, 0.75), (true, 0.25)], &false, &heard).unwrap();
            value.belief_value(&Rooms, &next, 0)
        };
        let heard_true = 0.25 * 0.8 + 0.75 * 0.2;
        let mean = heard_true * after(true) + (1.0 - heard_true) * after(false);
        let spread = (after(true) - after(false)).abs() * (heard_true * (1.0 - heard_true) / 20_000.0).sqrt();
        assert!((found - (0.4 + 0.5 * mean)).abs() < 4.0 * 0.5 * spread + 1e-12, "{found}");
    }

    #[test]
    fn the_best_action_is_taken_the_first_of_equals() {
        let known = FullInformation::solve(&Rooms, 1e-12);
        let belief = ExactBelief::initial(&Rooms);
        let value = PricedUncertainty::new(&known, 0.0);
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let step = Lookahead::new(value, 2000);
        let [stay, go] = [false, true].map(|action| step.action_value(&Rooms, &belief, &action, &mut rng));
        assert!((stay - go).abs() > 0.01, "{stay} {go}");
        assert_eq!(step.action(&Rooms, &belief, &mut rng), go > stay);
    }
}
