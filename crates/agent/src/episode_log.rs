//! What is kept of an episode while it is played: records, statistics, and what the watcher sees.

use belief::Particles;
use pomdp::discounted_return;
use push_task::Particle;

use crate::controller::{Decision, Update};
use crate::record::End;
use crate::{BeliefErrors, Episode, StepRecord, StepView, Watcher, WorldStep};

/// Keeps the books of one episode. Nothing of it goes back into the loop.
pub(crate) struct EpisodeLog<'a> {
    watcher: &'a mut dyn Watcher,
    steps: Vec<StepRecord>,
    belief_errors: BeliefErrors,
    depletions: usize,
}

impl<'a> EpisodeLog<'a> {
    /// An empty one.
    pub(crate) fn new(watcher: &'a mut dyn Watcher) -> Self {
        Self { watcher, steps: Vec::new(), belief_errors: BeliefErrors::default(), depletions: 0 }
    }

    /// Before the first action.
    pub(crate) fn begin(&mut self, joints_rad: &[f64], truth: Option<&Particle>, belief: Option<&Particles<Particle>>) {
        self.watcher.see(&StepView { joints_rad, truth, belief, search: None, step: None });
        self.compare(truth, belief);
    }

    /// After each action that the world answered.
    pub(crate) fn step(
        &mut self,
        decision: &Decision,
        answer: &WorldStep,
        update: &Update,
        truth: Option<&Particle>,
        belief: Option<&Particles<Particle>>,
    ) {
        let record = StepRecord::new(decision, answer, update);
        // From the end nothing is learnt: the belief is that before the action.
        let belief = belief.filter(|_| !update.ends());
        let (joints_rad, search) = (&answer.joints_rad, decision.search.as_ref());
        self.watcher.see(&StepView { joints_rad, truth, belief, search, step: Some(&record) });
        self.compare(truth, belief);
        self.depletions += usize::from(match update {
            Update::Belief { report, .. } => report.acceptance == 0.0,
            Update::End(end) => matches!(end, End::OutOfParticles { .. }),
            Update::NoBelief => false,
        });
        tracing::debug!(
            time = self.steps.len(),
            action = record.action.index(),
            value = record.value,
            reward = record.reward,
            acceptance = record.update.as_ref().map(|u| u.acceptance),
            obstacle_share = record.obstacle_share,
            "step"
        );
        self.steps.push(record);
    }

    /// Keeps how far the belief is from the world's truth, where there are both.
    fn compare(&mut self, truth: Option<&Particle>, belief: Option<&Particles<Particle>>) {
        if let (Some(belief), Some(truth)) = (belief, truth) {
            self.belief_errors.push(belief, truth);
        }
    }

    /// The episode, which ended so.
    pub(crate) fn finish(self, end: &End, discount: f64) -> Episode {
        let Self { steps, belief_errors, depletions, .. } = self;
        Episode {
            reason: end.reason(),
            discounted_return: discounted_return(steps.iter().map(|step| step.reward), discount),
            depletions,
            steps,
            belief_errors: (!belief_errors.is_empty()).then_some(belief_errors),
            failure: end.failure(),
        }
    }
}
