//! Action choice without search, and advice for a search.

use crate::{GenerativeModel, Rng};

/// Advice on one action at a new node of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActionPrior {
    /// Whether the action may be taken at all. At least one action of a state is legal.
    pub legal: bool,
    /// Simulations that the prior value stands for: N_init.
    pub visits: u32,
    /// Prior of the discounted return: V_init. Without effect where `visits` is zero.
    pub value: f64,
}

impl Default for ActionPrior {
    fn default() -> Self {
        Self { legal: true, visits: 0, value: 0.0 }
    }
}

/// A policy on the full state, for rollouts, baselines and data collection. It may also advise a search.
///
/// A search asks in a state that was sampled from a belief. Advice that uses what the agent cannot see makes the search
/// optimistic. States may carry what the agent knows of its history, such as counts of measurements or its last action.
/// Advice can then depend on the history.
pub trait Policy<M: GenerativeModel> {
    /// Action to take in `state`.
    fn action(&self, model: &M, state: &M::State, rng: &mut Rng) -> M::Action;

    /// Advice on the actions at a new node: which are illegal and which are preferred (Silver and Veness 2010, section
    /// 5). There is one entry per action, in the model's order. Each arrives as [`ActionPrior::default`], which says
    /// nothing. `state` is the state of the simulation that adds the node.
    fn priors(&self, _model: &M, _state: &M::State, _priors: &mut [ActionPrior]) {}

    /// Discounted return expected from `state` on, where a rollout is cut `actions_left` actions before the horizon of
    /// its simulation. Zero by default. Not called in a terminal state or at the horizon.
    fn leaf_value(&self, _model: &M, _state: &M::State, _actions_left: usize) -> f64 {
        0.0
    }

    /// Action of an agent that does not see the state. `belief` holds at least one state, each with a positive weight.
    /// By default [`Self::action`] in a state drawn by weight.
    fn belief_action(&self, model: &M, belief: &[(M::State, f64)], rng: &mut Rng) -> M::Action {
        use rand::RngExt as _;
        let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
        let mut mark = rng.random::<f64>() * total;
        let drawn = belief.iter().find(|(_, weight)| {
            mark -= weight;
            mark < 0.0
        });
        // Rounding may leave the mark on the total: then it is the last state.
        let (state, _) = drawn.or(belief.last()).expect("a belief holds at least one state");
        self.action(model, state, rng)
    }

    /// As [`Self::leaf_value`], for an agent that does not see the state. By default the mean of that value.
    fn belief_value(&self, model: &M, belief: &[(M::State, f64)], actions_left: usize) -> f64 {
        let total: f64 = belief.iter().map(|(_, weight)| weight).sum();
        belief.iter().map(|(state, weight)| weight / total * self.leaf_value(model, state, actions_left)).sum()
    }
}

/// Uniform choice over all actions.
#[derive(Clone, Copy, Debug, Default)]
pub struct UniformPolicy;

impl<M: GenerativeModel> Policy<M> for UniformPolicy {
    fn action(&self, model: &M, _state: &M::State, rng: &mut Rng) -> M::Action {
        use rand::RngExt as _;
        let actions = model.actions();
        actions[rng.random_range(0..actions.len())].clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Outcome, Purpose, Seed, Step};

    /// Does what its state says.
    struct Named;

    impl GenerativeModel for Named {
        type State = u8;
        type Action = u8;
        type Observation = ();

        fn actions(&self) -> &[u8] {
            &[0, 1, 2]
        }

        fn step(&self, _state: &mut u8, _action: &u8, _rng: &mut Rng) -> Step<()> {
            Step { observation: (), reward: 0.0, outcome: Outcome::Terminal }
        }

        fn discount(&self) -> f64 {
            1.0
        }
    }

    struct Obeys;

    impl Policy<Named> for Obeys {
        fn action(&self, _model: &Named, state: &u8, _rng: &mut Rng) -> u8 {
            *state
        }

        fn leaf_value(&self, _model: &Named, state: &u8, actions_left: usize) -> f64 {
            f64::from(*state) * actions_left as f64
        }
    }

    #[test]
    fn without_knowledge_of_beliefs_a_policy_acts_in_a_state_drawn_by_weight() {
        let belief = [(0, 1.0), (1, 2.0), (2, 5.0)];
        assert!((Obeys.belief_value(&Named, &belief, 4) - 4.0 * (2.0 + 10.0) / 8.0).abs() < 1e-12);
        // Null: shares 1/8, 2/8 and 5/8. n = 8000; tolerance 4 binomial standard deviations.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut counts = [0.0; 3];
        for _ in 0..8000 {
            counts[usize::from(Obeys.belief_action(&Named, &belief, &mut rng))] += 1.0;
        }
        for (count, share) in counts.into_iter().zip([0.125, 0.25, 0.625]) {
            let deviation: f64 = count - 8000.0 * share;
            assert!(deviation.abs() < 4.0 * (8000.0 * share * (1.0_f64 - share)).sqrt(), "{counts:?}");
        }
    }
}
