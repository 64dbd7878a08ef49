//! The tail of a simulation below the tree: the default policy to the horizon.

use pomdp::{GenerativeModel, Outcome, Policy, Rng};

use crate::RolloutDepth;

/// What a rollout brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rollout {
    /// Σ γ^t r_t from the first action of the rollout on, what the policy expects beyond its cut included.
    pub(crate) discounted_return: f64,
    pub(crate) transitions: usize,
    /// How the last step ended; `Continue` where the rollout was cut by its length.
    pub(crate) outcome: Outcome,
}

/// How far a rollout goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Actions until it is cut.
    pub(crate) actions: usize,
    /// Actions until the horizon.
    pub(crate) left: usize,
}

/// Follows `policy` in place from `state`.
pub(crate) fn rollout<M, P>(model: &M, policy: &P, state: &mut M::State, span: Span, rng: &mut Rng) -> Rollout
where
    M: GenerativeModel,
    P: Policy<M> + ?Sized,
{
    let Span { actions, left } = span;
    let mut result = Rollout { discounted_return: 0.0, transitions: 0, outcome: Outcome::Continue };
    let (mut weight, discount) = (1.0, model.discount());
    while result.transitions < actions && result.outcome == Outcome::Continue {
        let action = policy.action(model, state, rng);
        let step = model.step(state, &action, rng);
        result.discounted_return += weight * step.reward;
        result.transitions += 1;
        result.outcome = step.outcome;
        weight *= discount;
    }
    if result.outcome == Outcome::Continue && result.transitions < left {
        result.discounted_return += weight * policy.leaf_value(model, state, left - result.transitions);
    }
    result
}

impl RolloutDepth {
    /// Actions of a rollout that has `left` actions until the horizon of its simulation.
    pub(crate) fn actions(self, left: usize) -> usize {
        match self {
            Self::Full => left,
            Self::Actions(n) => n.min(left),
        }
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed, Step, UniformPolicy};

    use super::*;

    /// Pays 1 an action and ends at the given count, in the given way.
    struct Countdown(Outcome);

    impl GenerativeModel for Countdown {
        type State = usize;
        type Action = ();
        type Observation = ();

        fn actions(&self) -> &[()] {
            &[()]
        }

        fn step(&self, left: &mut usize, (): &(), _rng: &mut Rng) -> Step<()> {
            *left -= 1;
            let outcome = if *left == 0 { self.0 } else { Outcome::Continue };
            Step { observation: (), reward: 1.0, outcome }
        }

        fn discount(&self) -> f64 {
            0.5
        }
    }

    /// Uniform, and expects half the actions left.
    struct Expects;

    impl Policy<Countdown> for Expects {
        fn action(&self, model: &Countdown, state: &usize, rng: &mut Rng) {
            UniformPolicy.action(model, state, rng);
        }

        fn leaf_value(&self, _model: &Countdown, _state: &usize, actions_left: usize) -> f64 {
            actions_left as f64 / 2.0
        }
    }

    fn run(ending: Outcome, mut count: usize, actions: usize, left: usize) -> Rollout {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        rollout(&Countdown(ending), &UniformPolicy, &mut count, Span { actions, left }, &mut rng)
    }

    #[test]
    fn the_return_is_the_geometric_sum_to_the_cut() {
        // 1 + 1/2 + 1/4 + 1/8
        let expected = Rollout { discounted_return: 1.875, transitions: 4, outcome: Outcome::Continue };
        assert_eq!(run(Outcome::Terminal, 100, 4, 9), expected);
        assert_eq!(run(Outcome::Terminal, 100, 0, 9).discounted_return, 0.0);
    }

    #[test]
    fn terminal_and_diverged_worlds_end_a_rollout_with_their_last_reward() {
        for ending in [Outcome::Terminal, Outcome::Diverged] {
            assert_eq!(run(ending, 2, 10, 10), Rollout { discounted_return: 1.5, transitions: 2, outcome: ending });
        }
    }

    #[test]
    fn a_cut_rollout_adds_the_discounted_leaf_value_and_an_ended_or_full_one_does_not() {
        let run = |mut count, actions, left| {
            let mut rng = Seed(1).stream(Purpose::Test, 0);
            let model = Countdown(Outcome::Terminal);
            rollout(&model, &Expects, &mut count, Span { actions, left }, &mut rng).discounted_return
        };
        // 1 + 1/2, then (9 − 2) / 2 discounted twice.
        assert_eq!(run(100, 2, 9), 1.5 + 0.25 * 3.5);
        assert_eq!(run(100, 0, 9), 4.5);
        assert_eq!(run(100, 2, 2), 1.5);
        assert_eq!(run(2, 2, 9), 1.5);
    }

    #[test]
    fn a_rollout_never_passes_the_horizon() {
        assert_eq!(RolloutDepth::Full.actions(7), 7);
        assert_eq!(RolloutDepth::Actions(3).actions(7), 3);
        assert_eq!(RolloutDepth::Actions(9).actions(7), 7);
    }
}
