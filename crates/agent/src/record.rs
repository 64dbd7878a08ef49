//! What is kept of an episode.

use pomdp::UpdateReport;
use push_task::{Action, Observation};
use serde::{Deserialize, Serialize};

use crate::controller::{Decision, Update};
use crate::{BeliefErrors, WorldError, WorldStep};

/// Why an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The object reached the goal region.
    Goal,
    /// No actions left.
    Horizon,
    /// Out of particles.
    Depleted,
    /// The true world became impossible.
    Diverged,
    /// The world did not answer, or not properly.
    WorldFailed,
}

impl Reason {
    /// Name in tables and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Goal => "goal",
            Self::Horizon => "horizon",
            Self::Depleted => "depleted",
            Self::Diverged => "diverged",
            Self::WorldFailed => "world-failed",
        }
    }
}

/// How an episode ended, with what its [`Reason`] leaves out.
#[derive(Debug)]
pub(crate) enum End {
    /// The object reached the goal region.
    Goal,
    /// No actions left.
    Horizon,
    /// No particle explains the latest observation.
    OutOfParticles {
        /// Transitions that the filter simulated before it gave up.
        transitions: usize,
    },
    /// The true world became impossible.
    Diverged,
    /// The world did not answer, or not properly.
    WorldFailed(WorldError),
}

impl End {
    /// The reason.
    pub(crate) const fn reason(&self) -> Reason {
        match self {
            Self::Goal => Reason::Goal,
            Self::Horizon => Reason::Horizon,
            Self::OutOfParticles { .. } => Reason::Depleted,
            Self::Diverged => Reason::Diverged,
            Self::WorldFailed(_) => Reason::WorldFailed,
        }
    }

    /// What the world did wrong, with its causes.
    pub(crate) fn failure(&self) -> Option<String> {
        let Self::WorldFailed(error) = self else { return None };
        let error: &dyn std::error::Error = error;
        let causes = std::iter::successors(error.source(), |cause| cause.source());
        Some(causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}")))
    }
}

/// One step of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Executed action.
    pub action: Action,
    /// Observation after it.
    pub observation: Observation,
    /// Reward.
    pub reward: f64,
    /// Value of the action in the search; `None` without search.
    pub value: Option<f64>,
    /// Simulations of the search.
    pub simulations: usize,
    /// Simulations of earlier searches that the pruned tree brought along.
    pub reused: u64,
    /// Transitions simulated for the decision and the belief update.
    pub transitions: usize,
    /// Belief update; `None` where there was none (last step, no belief).
    pub update: Option<UpdateReport>,
    /// Share of the particles with an obstacle after the update; `None` without belief.
    pub obstacle_share: Option<f64>,
    /// A force above the limit.
    pub large_force: bool,
    /// The move would have left the reachable region, and was not made.
    pub out_of_reach: bool,
    /// The object or the tool pushed against the obstacle.
    pub obstacle_touched: bool,
}

impl StepRecord {
    /// Of a decision, the world's answer to it, and what that changed.
    pub(crate) fn new(decision: &Decision, answer: &WorldStep, update: &Update) -> Self {
        let search = decision.search.as_ref();
        let events = answer.report.events;
        let (update_transitions, report, obstacle_share) = match update {
            Update::Belief { report, obstacle_share } => {
                (report.transitions, Some(report.clone()), Some(*obstacle_share))
            }
            Update::End(End::OutOfParticles { transitions }) => (*transitions, None, None),
            Update::End(_) | Update::NoBelief => (0, None, None),
        };
        Self {
            action: decision.action,
            observation: answer.observation.clone(),
            reward: answer.reward,
            value: search.map(|search| search.actions[search.action.index()].value),
            simulations: search.map_or(0, |search| search.simulations),
            reused: search.map_or(0, |search| search.reused),
            transitions: search.map_or(0, |search| search.transitions) + update_transitions,
            update: report,
            obstacle_share,
            large_force: events.large_force,
            out_of_reach: events.out_of_reach,
            obstacle_touched: answer.report.obstacle_touched,
        }
    }
}

/// An episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Why it ended.
    pub reason: Reason,
    /// Σ γ^t r_t.
    pub discounted_return: f64,
    /// Updates in which no simulated particle agreed with the observation.
    pub depletions: usize,
    /// Steps.
    pub steps: Vec<StepRecord>,
    /// Errors of the beliefs; `None` without a belief, or in a world that does not know its truth.
    pub belief_errors: Option<BeliefErrors>,
    /// What the world did wrong, where that ended the episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

impl Episode {
    /// An episode that ended before it began.
    #[must_use]
    pub fn failed(failure: String) -> Self {
        let (reason, failure) = (Reason::WorldFailed, Some(failure));
        Self { reason, discounted_return: 0.0, depletions: 0, steps: Vec::new(), belief_errors: None, failure }
    }

    /// Whether the object reached the goal region.
    #[must_use]
    pub fn success(&self) -> bool {
        self.reason == Reason::Goal
    }

    /// Transitions simulated in the whole episode.
    #[must_use]
    pub fn transitions(&self) -> usize {
        self.steps.iter().map(|s| s.transitions).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_tables_and_files_agree() {
        for reason in [Reason::Goal, Reason::Horizon, Reason::Depleted, Reason::Diverged, Reason::WorldFailed] {
            assert_eq!(serde_json::to_string(&reason).unwrap(), format!("\"{}\"", reason.name()));
        }
    }
}
