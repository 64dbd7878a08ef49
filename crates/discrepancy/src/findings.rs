//! What speaks for an effect, and what is left with it: the plain numbers that a decision is made of.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::accept::Episodes;
use crate::fit::Fit;
use crate::gains::Gains;
use crate::likelihood::{Stack, trimmed_mean};
use crate::replay::{Replay, replays, worst};
use crate::rival::{Rival, Round};
use crate::search::Search;
use crate::study::Study;
use crate::terms::lacking_force;
use crate::touch::contact_gap;
use crate::trial::Kind;
use crate::units::Units;

/// Of a model with an effect, beside the one without. Errors are mean squares of held-out episodes in units of noise; 1 is noise alone. What is gained is
/// counted over fitted and held-out episodes: few are held out, and an effect has few coordinates to fit them with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Name of the effect.
    pub effect: String,
    /// Gain in ln evidence of all fitted episodes.
    pub log_evidence: f64,
    /// Whether it was fitted to all episodes, not to those of the screening alone.
    pub whole: bool,
    /// Number of its coordinates.
    pub coordinates: usize,
    /// Mean over the episodes of ln(error without / error with), in its standard errors.
    pub drop_steadiness: f64,
    /// ln(error without / error with) of what is wrong for long.
    pub slow_drop: f64,
    /// Mean gain of a residual in ln p.
    pub gain: f64,
    /// The median episode's gain in ln p.
    pub median_gain: f64,
    /// Gain in ln p by forces and torques.
    pub force_gain: f64,
    /// Error without, on average over all but the worst quarter of the episodes.
    pub before: f64,
    /// Error with of what is known of the object's motion, the same way: place, orientation, velocities.
    pub motion_after: f64,
    /// Error of the object's place without and with, as a share of how far it moves: root mean squares.
    pub motion_share: [f64; 2],
    /// The same of the wrist's force, as a share of its size; 0 without a sensor.
    pub force_share: [f64; 2],
    /// Without and with: the share of the square of the lacking force on the object that follows a law in its motion, its place and the time, in fitted episodes
    /// that coefficients of the law were not fitted to (see [`crate::terms`]). Of the episodes that are worst without; 0 where too little moves to say.
    pub lawful_share: [f64; 2],
    /// Readings by which measured contacts begin before or after simulated ones without and with, in the median of these episodes; 0 where that is not known.
    pub apart_readings: [f64; 2],
    /// Number of fitted and of held-out episodes.
    pub episodes: [usize; 2],
}

impl Findings {
    /// Of all rivals of a round, those passed over among them, the most probable first.
    pub(crate) fn of_round(search: &Search, round: &Round, episodes: &Episodes) -> Vec<Self> {
        let mut rivals: Vec<&Rival> = round.passed_over_kinds().chain(&round.rivals).collect();
        rivals.retain(|rival| !rival.heldout.costs.is_empty());
        if rivals.is_empty() {
            return Vec::new();
        }
        rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let groups = worst(&search.study, &round.base);
        let without = Leftover::new(&search.study, &round.base, &replays(&search.study, &groups, &round.base));
        rivals.into_iter().map(|rival| Self::of(search, round, (&groups, &without), rival, episodes)).collect()
    }

    fn of(
        search: &Search,
        round: &Round,
        (groups, left): (&[Range<usize>], &Leftover),
        rival: &Rival,
        episodes: &Episodes,
    ) -> Self {
        let raws = [&round.before.raw, &rival.heldout.raw];
        let white = |fit: &Fit, raw: &Vec<Vec<f64>>| search.kept.white(raw, fit.model.engine_errors(&fit.x));
        let [without, with] = [white(&round.base, raws[0]), white(&rival.fit, raws[1])];
        let trimmed = |stack: &Stack, of: &dyn Fn(Kind) -> bool| trimmed_errors(search, stack, episodes, of);
        let mut gains = Gains::default();
        gains.add(&without, &with, &episodes.heldout);
        // Of one that was fitted to some episodes all are looked at as well.
        let base = &round.base.residuals;
        let replayed = if rival.whole {
            gains.add(base, &rival.fit.residuals, &episodes.fitted);
            replays(&search.study, groups, &rival.fit)
        } else {
            let mut all = replays(&search.study, &episodes.fitted, &rival.fit);
            let raw: Vec<Vec<f64>> = all.iter().flatten().map(Replay::residuals).collect();
            gains.add(base, &search.study.white(&raw, rival.fit.model.engine_errors(&rival.fit.x)), &episodes.fitted);
            let mut fitted = episodes.fitted.iter();
            all.retain(|_| fitted.next().is_some_and(|episode| groups.contains(episode)));
            all
        };
        let left_with = Leftover::new(&search.study, &rival.fit, &replayed);
        Self {
            effect: rival.kind().name().into(),
            log_evidence: rival.gain,
            whole: rival.whole,
            coordinates: rival.fit.added().map_or(0, |(_, own)| own.len()),
            drop_steadiness: gains.drop_steadiness(),
            slow_drop: gains.slow_drop(),
            gain: gains.of_residual(),
            median_gain: gains.median(),
            force_gain: gains.force,
            before: trimmed(&without, &|_| true),
            motion_after: trimmed(&with, &is_motion),
            motion_share: raws.map(|raw| search.heldout_share(raw, Kind::ObjectPosition)),
            force_share: raws.map(|raw| search.heldout_share(raw, Kind::WristForce)),
            lawful_share: [left.lawful, left_with.lawful],
            apart_readings: [left.apart, left_with.apart],
            episodes: [episodes.fitted.len(), episodes.heldout.len()],
        }
    }
}

/// What a model leaves of the episodes that are worst without an effect.
struct Leftover {
    /// Share of the lacking force that follows a law.
    lawful: f64,
    /// Readings by which contacts begin apart.
    apart: f64,
}

impl Leftover {
    fn new(study: &Study, fit: &Fit, replays: &[Vec<Replay>]) -> Self {
        let lacking = lacking_force(study.simulator, fit, replays, &Units::default());
        Self {
            // What is no number follows none.
            lawful: lacking
                .map(|lacking| lacking.explained_share)
                .filter(|share| *share > 0.0)
                .map_or(0.0, |share| share.min(1.0)),
            apart: contact_gap(replays).map_or(0.0, |gap| gap.apart()),
        }
    }
}

impl Findings {
    /// Of a search that found nothing to try.
    pub(crate) fn of_nothing(search: &Search, null: &Fit, episodes: &Episodes) -> Self {
        let raw = search.kept.raw(&null.model.hypothesis(&null.x));
        let white = search.kept.white(&raw, null.model.engine_errors(&null.x));
        let [motion, force] =
            [Kind::ObjectPosition, Kind::WristForce].map(|kind| [search.heldout_share(&raw, kind); 2]);
        let left = Leftover::new(&search.study, null, &replays(&search.study, &worst(&search.study, null), null));
        Self {
            effect: String::new(),
            log_evidence: 0.0,
            whole: true,
            coordinates: 0,
            drop_steadiness: 0.0,
            slow_drop: 0.0,
            gain: 0.0,
            median_gain: 0.0,
            force_gain: 0.0,
            before: trimmed_errors(search, &white, episodes, &|_| true),
            motion_after: trimmed_errors(search, &white, episodes, &is_motion),
            motion_share: motion,
            force_share: force,
            lawful_share: [left.lawful; 2],
            apart_readings: [left.apart; 2],
            episodes: [episodes.fitted.len(), episodes.heldout.len()],
        }
    }
}

/// Mean error of all but the worst quarter of the held-out episodes, in channels of some kinds; 1 where none is measured.
fn trimmed_errors(search: &Search, stack: &Stack, episodes: &Episodes, of: &dyn Fn(Kind) -> bool) -> f64 {
    let errors = search.heldout_errors(stack, episodes, of);
    if errors.is_empty() { 1.0 } else { trimmed_mean(errors) }
}

fn is_motion(kind: Kind) -> bool {
    matches!(kind, Kind::ObjectPosition | Kind::ObjectOrientation | Kind::ObjectVelocity | Kind::ObjectSpin)
}
