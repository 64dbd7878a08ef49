//! Looking on at an episode.

use belief::Particles;
use planner::SearchReport;
use push_task::{Action, Particle};

use crate::StepRecord;

/// What there is to see before the first action and after each one.
#[derive(Clone, Copy, Debug)]
pub struct StepView<'a> {
    /// Joint positions, rad.
    pub joints_rad: &'a [f64],
    /// True state and parameters, where the world knows them.
    pub truth: Option<&'a Particle>,
    /// The belief with what was learnt from the action; `None` where the method has none, where it is out of particles, and at the end, from
    /// which nothing is learnt.
    pub belief: Option<&'a Particles<Particle>>,
    /// The search that chose the action; `None` without search and before the first action.
    pub search: Option<&'a SearchReport<Action>>,
    /// The action and what came of it; `None` before the first action.
    pub step: Option<&'a StepRecord>,
}

/// Someone who looks on at an episode, and changes nothing of it.
pub trait Watcher {
    /// Called before the first action and after each one that the world answered.
    fn see(&mut self, view: &StepView<'_>);
}

/// Nobody.
impl Watcher for () {
    fn see(&mut self, _view: &StepView<'_>) {}
}
