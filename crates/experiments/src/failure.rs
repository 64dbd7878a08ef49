//! Why trials failed, finer than [`Reason`].

use agent::Reason;
use serde::{Deserialize, Serialize};

use crate::TrialRecord;

/// Why a trial did not reach the goal. Every failed trial has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Failure {
    /// No actions left, by none of the two below.
    Horizon,
    /// No actions left, and at least a third of them met a force above the limit.
    ExcessiveForce,
    /// No actions left, and at least a third of them would have left the reachable region.
    OutOfReach,
    /// Out of particles.
    Depleted,
    /// The true world became impossible.
    Diverged,
    /// The world did not answer, or not properly.
    WorldFailed,
}

impl Failure {
    /// Why `trial` failed; `None` where it did not.
    ///
    /// At the horizon a third of the actions decides: a direct push takes a little more than a third of them, so that a trial which lost as
    /// many to collisions or to the edge was held up by these. Where both are that frequent, the more frequent one names it, force where
    /// they are even.
    #[must_use]
    pub fn of(trial: &TrialRecord) -> Option<Self> {
        let frequent = |count: usize| count > 0 && 3 * count >= trial.steps;
        match trial.reason {
            Reason::Goal => None,
            Reason::Depleted => Some(Self::Depleted),
            Reason::Diverged => Some(Self::Diverged),
            Reason::WorldFailed => Some(Self::WorldFailed),
            Reason::Horizon if trial.out_of_reach > trial.large_forces && frequent(trial.out_of_reach) => {
                Some(Self::OutOfReach)
            }
            Reason::Horizon if frequent(trial.large_forces) => Some(Self::ExcessiveForce),
            Reason::Horizon => Some(Self::Horizon),
        }
    }

    /// Name in tables and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Horizon => "horizon",
            Self::ExcessiveForce => "excessive-force",
            Self::OutOfReach => "out-of-reach",
            Self::Depleted => "depleted",
            Self::Diverged => "diverged",
            Self::WorldFailed => "world-failed",
        }
    }
}

/// What worlds did wrong in these trials, in a sentence: the first of it, and how often anything was. `None` where nothing was.
#[must_use]
pub fn world_failures<'a>(trials: impl Iterator<Item = &'a TrialRecord>) -> Option<String> {
    let (mut all, mut first, mut failed) = (0, None, 0);
    for trial in trials {
        all += 1;
        if let Some(failure) = &trial.failure {
            failed += 1;
            first.get_or_insert((trial, failure));
        }
    }
    let (trial, failure) = first?;
    let (method, number) = (trial.method.name(), trial.trial);
    Some(format!("the world failed in {failed} of {all} trials, first in trial {number} of {method}: {failure}"))
}

#[cfg(test)]
mod tests {
    use agent::Method;

    use super::*;

    #[test]
    fn a_third_of_the_actions_names_a_failure_at_the_horizon() {
        let at_horizon = |large_forces, out_of_reach| {
            let trial = TrialRecord { steps: 30, large_forces, out_of_reach, ..crate::trial::tests::record() };
            Failure::of(&TrialRecord { reason: Reason::Horizon, success: false, method: Method::NoRnn, ..trial })
        };
        assert_eq!(at_horizon(9, 9), Some(Failure::Horizon));
        assert_eq!(at_horizon(10, 0), Some(Failure::ExcessiveForce));
        assert_eq!(at_horizon(0, 10), Some(Failure::OutOfReach));
        assert_eq!(at_horizon(10, 11), Some(Failure::OutOfReach));
        assert_eq!(at_horizon(11, 11), Some(Failure::ExcessiveForce));
        assert_eq!(at_horizon(12, 11), Some(Failure::ExcessiveForce));
    }

    #[test]
    fn what_worlds_did_wrong_is_told_once_with_its_number() {
        let good = crate::trial::tests::record();
        let bad = |trial, failure: &str| TrialRecord { trial, failure: Some(failure.into()), ..good.clone() };
        assert_eq!(world_failures([&good, &good].into_iter()), None);
        let sentence = world_failures([&good, &bad(1, "it died"), &bad(2, "it lied")].into_iter()).unwrap();
        assert_eq!(sentence, "the world failed in 2 of 3 trials, first in trial 1 of no-rnn: it died");
    }

    #[test]
    fn other_ends_name_themselves_and_a_success_is_none() {
        let ended = |reason| {
            let success = reason == Reason::Goal;
            Failure::of(&TrialRecord { reason, success, large_forces: 9, steps: 9, ..crate::trial::tests::record() })
        };
        assert_eq!(ended(Reason::Goal), None);
        assert_eq!(ended(Reason::Depleted), Some(Failure::Depleted));
        assert_eq!(ended(Reason::Diverged), Some(Failure::Diverged));
        assert_eq!(ended(Reason::WorldFailed), Some(Failure::WorldFailed));
    }

    #[test]
    fn names_in_tables_and_files_agree() {
        use Failure::{Depleted, Diverged, ExcessiveForce, Horizon, OutOfReach, WorldFailed};
        for failure in [Horizon, ExcessiveForce, OutOfReach, Depleted, Diverged, WorldFailed] {
            assert_eq!(serde_json::to_string(&failure).unwrap(), format!("\"{}\"", failure.name()));
        }
    }
}
