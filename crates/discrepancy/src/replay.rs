//! The episodes that a model explains worst, simulated with it once more.

use std::ops::Range;

use physics_model::rig::RigReading;

use crate::fit::Fit;
use crate::likelihood::mean_square;
use crate::simulator::{Nudge, Simulator};
use crate::trial::{Trial, groups};

/// Episodes, at most.
const EPISODES: usize = 20;

/// An episode, or a piece of one, beside its simulation.
pub(crate) struct Replay<'a> {
    pub(crate) trial: &'a Trial,
    pub(crate) start: RigReading,
    pub(crate) readings: Vec<RigReading>,
}

/// Those that a fit explains worst of the ones that it was fitted to, in their order; of each its pieces.
pub(crate) fn worst<'a>(simulator: &Simulator<'a>, chosen: &[usize], fit: &Fit) -> Vec<Vec<Replay<'a>>> {
    let (hypothesis, engine) = (fit.model.hypothesis(&fit.x), simulator.nominal.engine());
    let mut groups = groups(chosen.iter().map(|index| &simulator.trials[*index]));
    let error = |group: &Range<usize>| mean_square(&fit.residuals[group.clone()]);
    groups.sort_by(|a, b| error(b).total_cmp(&error(a)));
    groups.truncate(EPISODES);
    groups.sort_by_key(|group| group.start);
    let replay = |index: &usize| {
        let trial = &simulator.trials[*index];
        let (start, readings) = simulator.readings(&hypothesis, &engine, Nudge::default(), trial);
        Replay { trial, start, readings }
    };
    groups.into_iter().map(|group| chosen[group].iter().map(replay).collect()).collect()
}
