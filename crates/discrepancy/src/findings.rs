//! What speaks for an effect, and what is left with it: the plain numbers that a decision is made of.

use serde::{Deserialize, Serialize};

use crate::accept::Episodes;
use crate::candidate::Candidate;
use crate::fit::Fit;
use crate::likelihood::{Stack, trimmed_mean};
use crate::rival::{Rival, Round};
use crate::search::Search;
use crate::trial::Kind;

/// Of a model with an effect, beside the one without. All errors are of held-out episodes, as mean squares in units of noise; 1 is noise alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Name of the effect.
    pub effect: String,
    /// Gain in ln evidence of all fitted episodes.
    pub log_evidence: f64,
    /// By how much that is more than the gain of the best other effect.
    pub margin: f64,
    /// Whether it was fitted to all episodes, not to those of the screening alone.
    pub whole: bool,
    /// Number of its coordinates.
    pub coordinates: usize,
    /// Mean gain in ln p of the fitted episodes, in its standard errors.
    pub steadiness: f64,
    /// The same of those held out.
    pub heldout_steadiness: f64,
    /// Mean over the episodes of ln (error without / error with).
    pub drop: f64,
    /// Error without, on average over all but the worst quarter of the episodes.
    pub before: f64,
    /// Error with, the same way.
    pub after: f64,
    /// Error with of what is known of the object's motion: place, orientation, velocities.
    pub motion_after: f64,
    /// Error with of forces and torques; 1 without such sensors.
    pub force_after: f64,
    /// Error of the object's place without and with, as a share of how far it moves: root mean squares.
    pub motion_share: [f64; 2],
    /// The same of the wrist's force, as a share of its size; 0 without a sensor.
    pub force_share: [f64; 2],
    /// Largest strength, in standard deviations of its prior.
    pub size: f64,
    /// Number of fitted and of held-out episodes.
    pub episodes: [usize; 2],
}

impl Findings {
    /// Of all rivals of a round, those passed over among them, the most probable first.
    pub(crate) fn of_round(search: &Search, round: &Round, episodes: &Episodes) -> Vec<Self> {
        let raw = search.kept.raw(&round.base.model.hypothesis(&round.base.x));
        let mut rivals: Vec<&Rival> = round.passed_over_kinds().chain(&round.rivals).collect();
        rivals.retain(|rival| !rival.heldout.costs.is_empty());
        rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let gains: Vec<_> = rivals.iter().map(|rival| (rival.kind(), rival.gain)).collect();
        let margin = |rival: &Rival| {
            let others = gains.iter().filter(|(kind, _)| *kind != rival.kind()).map(|(_, gain)| *gain);
            rival.gain - others.fold(0.0, f64::max)
        };
        rivals.into_iter().map(|rival| Self::of(search, (round, &raw), (rival, margin(rival)), episodes)).collect()
    }

    fn of(
        search: &Search,
        (round, raw): (&Round, &Vec<Vec<f64>>),
        (rival, margin): (&Rival, f64),
        episodes: &Episodes,
    ) -> Self {
        let raws = [raw, &search.kept.raw(&rival.fit.model.hypothesis(&rival.fit.x))];
        let white = |fit: &Fit, raw: &Vec<Vec<f64>>| search.kept.white(raw, fit.model.engine_errors(&fit.x));
        let [without, with] = [white(&round.base, raws[0]), white(&rival.fit, raws[1])];
        let errors = |stack: &Stack, of: &dyn Fn(Kind) -> bool| search.heldout_errors(stack, episodes, of);
        let all = |_: Kind| true;
        let [before, after] = [&without, &with].map(|stack| errors(stack, &all));
        let drops: Vec<f64> = before.iter().zip(&after).map(|(before, after)| (before / after).ln()).collect();
        let trimmed = |errors: Vec<f64>| if errors.is_empty() { 1.0 } else { trimmed_mean(errors) };
        let heldout = round.before.gains(&rival.heldout);
        let by_episode = |gains: &[f64], pieces: &[std::ops::Range<usize>]| -> Vec<f64> {
            pieces.iter().map(|piece| gains[piece.clone()].iter().sum()).collect()
        };
        // Of one that was fitted to some episodes all are looked at as well.
        let costs = if rival.whole {
            rival.fit.residuals.costs()
        } else {
            let raw = search.study.raw(&rival.fit.model.hypothesis(&rival.fit.x));
            search.study.white(&raw, rival.fit.model.engine_errors(&rival.fit.x)).costs()
        };
        let gains: Vec<f64> =
            round.base.residuals.costs().iter().zip(&costs).map(|(before, after)| before - after).collect();
        let (part, own) = rival.fit.added().unzip();
        let own = own.unwrap_or_default();
        let strengths = part.into_iter().flat_map(Candidate::strengths).map(|index| own[index].abs());
        Self {
            effect: rival.kind().name().into(),
            log_evidence: rival.gain,
            margin,
            whole: rival.whole,
            coordinates: own.len(),
            steadiness: steadiness(&by_episode(&gains, &episodes.fitted)),
            heldout_steadiness: steadiness(&by_episode(&heldout, &episodes.heldout)),
            drop: drops.iter().sum::<f64>() / drops.len().max(1) as f64,
            before: trimmed(before),
            after: trimmed(after),
            motion_after: trimmed(errors(&with, &is_motion)),
            force_after: trimmed(errors(&with, &is_force)),
            motion_share: raws.map(|raw| search.heldout_share(raw, Kind::ObjectPosition)),
            force_share: raws.map(|raw| search.heldout_share(raw, Kind::WristForce)),
            size: strengths.fold(0.0, f64::max),
            episodes: [episodes.fitted.len(), episodes.heldout.len()],
        }
    }
}

impl Findings {
    /// Of a search that found nothing to try.
    pub(crate) fn of_nothing(search: &Search, null: &Fit, episodes: &Episodes) -> Self {
        let raw = search.kept.raw(&null.model.hypothesis(&null.x));
        let white = search.kept.white(&raw, null.model.engine_errors(&null.x));
        let error = |of: &dyn Fn(Kind) -> bool| {
            let errors = search.heldout_errors(&white, episodes, of);
            if errors.is_empty() { 1.0 } else { trimmed_mean(errors) }
        };
        let all = error(&|_| true);
        let [motion, force] =
            [Kind::ObjectPosition, Kind::WristForce].map(|kind| [search.heldout_share(&raw, kind); 2]);
        Self {
            effect: String::new(),
            log_evidence: 0.0,
            margin: 0.0,
            whole: true,
            coordinates: 0,
            steadiness: 0.0,
            heldout_steadiness: 0.0,
            drop: 0.0,
            before: all,
            after: all,
            motion_after: error(&is_motion),
            force_after: error(&is_force),
            motion_share: motion,
            force_share: force,
            size: 0.0,
            episodes: [episodes.fitted.len(), episodes.heldout.len()],
        }
    }
}

fn is_motion(kind: Kind) -> bool {
    matches!(kind, Kind::ObjectPosition | Kind::ObjectOrientation | Kind::ObjectVelocity | Kind::ObjectSpin)
}

fn is_force(kind: Kind) -> bool {
    matches!(kind, Kind::WristForce | Kind::WristTorque | Kind::JointTorque)
}

/// Mean over its standard error; 0 of fewer than two.
fn steadiness(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    if gains.len() < 2 {
        return 0.0;
    }
    let mean = gains.iter().sum::<f64>() / n;
    let square = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // What no episode tells from another is steady: a hundredth of a nat.
    mean / ((square / n).sqrt() + 0.01)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steadiness_is_a_mean_in_its_standard_errors() {
        // Mean 5, standard deviation √(16/3), error √(4/3).
        assert!((steadiness(&[3.0, 7.0, 3.0, 7.0]) - 5.0 / ((4.0_f64 / 3.0).sqrt() + 0.01)).abs() < 1e-12);
        assert_eq!(steadiness(&[4.0]), 0.0);
        assert!(steadiness(&[-1.0, -3.0]) < 0.0);
    }
}
