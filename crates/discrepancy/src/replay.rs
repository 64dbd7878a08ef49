//! The episodes that a model explains worst, simulated with it once more.

use std::ops::Range;

use physics_model::rig::RigReading;
use rayon::prelude::*;

use crate::fit::Fit;
use crate::likelihood::mean_square;
use crate::simulator::Nudge;
use crate::study::Study;
use crate::trial::Trial;

/// Episodes, at most.
const EPISODES: usize = 20;

/// An episode, or a piece of one, beside its simulation.
pub(crate) struct Replay<'a> {
    pub(crate) trial: &'a Trial,
    pub(crate) start: RigReading,
    pub(crate) readings: Vec<RigReading>,
}

impl Replay<'_> {
    /// Standardised residuals.
    pub(crate) fn residuals(&self) -> Vec<f64> {
        self.trial.residuals(&self.start, &self.readings)
    }
}

/// Places of the pieces of the episodes of a study that a fit to all of them explains worst, in their order.
pub(crate) fn worst(study: &Study, fit: &Fit) -> Vec<Range<usize>> {
    let mut groups = study.groups();
    let error = |group: &Range<usize>| mean_square(&fit.residuals[group.clone()]);
    groups.sort_by(|a, b| error(b).total_cmp(&error(a)));
    groups.truncate(EPISODES);
    groups.sort_by_key(|group| group.start);
    groups
}

/// Such episodes as a model has them; of each its pieces.
pub(crate) fn replays<'a>(study: &Study<'a>, groups: &[Range<usize>], fit: &Fit) -> Vec<Vec<Replay<'a>>> {
    let simulator = study.simulator;
    let (hypothesis, engine) = (fit.model.hypothesis(&fit.x), simulator.nominal.engine());
    let replay = |index: &usize| {
        let trial = &simulator.trials[*index];
        let (start, readings) = simulator.readings(&hypothesis, &engine, Nudge::default(), trial);
        Replay { trial, start, readings }
    };
    groups.par_iter().map(|group| study.chosen[group.clone()].iter().map(replay).collect()).collect()
}
