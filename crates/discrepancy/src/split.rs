//! Which episodes models are fitted to, which choose between models, and which the figures of a report are of.
//!
//! An error on episodes that helped to choose a model is too small. So the held-out ones are halved, in turn along the log: by one half
//! effects are accepted, ordered and refused, and nothing but the report looks at the other.

use std::ops::Range;

use measured_log::Log;
use nalgebra::DVector;
use physics_model::EffectKind;
use serde::Serialize;

use crate::diagnosis::Settings;
use crate::error::Error;
use crate::fit::Fit;
use crate::noise::NoiseLevels;
use crate::nominal::Nominal;
use crate::rival::{Rival, Round};
use crate::search::Search;
use crate::study::Study;
use crate::trial::{Kind, Trial, groups};

/// Episodes that a fit needs: a bootstrap of fewer says nothing.
pub(crate) const LEAST_FITTED: usize = 4;
/// A log of fewer episodes has too few to hold out twice.
const FEW: usize = 9;

/// How many episodes do what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Split {
    /// Models are fitted to these.
    pub fitted: usize,
    /// Effects are accepted and refused by these.
    pub choosing: usize,
    /// The figures of the report are of these.
    pub reported: usize,
    /// Whether the last two are the same: the log is too short for both.
    pub shared: bool,
}

impl Split {
    pub(crate) fn new(search: &Search) -> Self {
        let [fitted, choosing, reported] =
            [&search.study, &search.kept, search.reported()].map(|study| study.groups().len());
        Self { fitted, choosing, reported, shared: search.reported.is_none() }
    }

    /// In words.
    #[must_use]
    pub fn sentence(&self) -> String {
        let Self { fitted, choosing, reported, shared } = self;
        if *shared {
            return format!(
                "{fitted} episodes were fitted. The log is short: the {reported} held out choose between models, too, so that their error is rather too small."
            );
        }
        format!(
            "{fitted} episodes were fitted, {choosing} held out to choose between models, {reported} to report the error."
        )
    }
}

/// What a log is compared by.
pub(crate) struct Compared {
    pub(crate) trials: Vec<Trial>,
    /// Places of what is fitted.
    pub(crate) fitted: Vec<usize>,
    /// Of what chooses.
    pub(crate) choosing: Vec<usize>,
    /// Of what is reported; `None`: the same.
    pub(crate) reported: Option<Vec<usize>>,
    /// Numbers of episodes that cannot be simulated.
    pub(crate) left_out: Vec<u64>,
}

impl Compared {
    /// Of a log.
    pub(crate) fn new(
        log: &Log,
        name: &str,
        nominal: &Nominal,
        noise: &NoiseLevels,
        settings: &Settings,
    ) -> Result<Self, Error> {
        let split = match settings.fold {
            Some([part, parts]) => log.fold(settings.seed, part, parts),
            None => log.split(settings.seed),
        };
        let report = reported(log, &split.holdout);
        let (mut trials, mut left_out) = (Vec::new(), Vec::new());
        // Places of what is fitted, chooses and is reported, and how many episodes those are.
        let mut roles: [(Vec<usize>, usize); 3] = Default::default();
        for (index, episode) in log.episodes.iter().enumerate() {
            let pieces = Trial::of_episode(log, episode, noise, nominal.has_tool());
            if pieces.is_empty() {
                left_out.push(episode.id);
                continue;
            }
            let role = if report.contains(&index) { 2 } else { usize::from(split.holdout.contains(&index)) };
            roles[role].0.extend(trials.len()..trials.len() + pieces.len());
            roles[role].1 += 1;
            trials.extend(pieces);
        }
        let [(fitted, fits), (choosing, chooses), (reported, reports)] = roles;
        if fits < LEAST_FITTED || chooses + reports == 0 {
            let reason = format!(
                "expected at least {LEAST_FITTED} episodes to fit and one held out, each with a pose of the object and a row after it, \
                 found {fits} and {}",
                chooses + reports
            );
            return Err(Error::Unfit { log: name.into(), reason });
        }
        let (choosing, reported) = match (chooses, reports) {
            (0, _) => (reported, None),
            (_, 0) => (choosing, None),
            _ => (choosing, Some(reported)),
        };
        Ok(Self { fitted, trials, choosing, reported, left_out })
    }
}

/// Of the episodes that are held out those whose error is reported: every other one. Of few episodes all, which choose as well.
pub(crate) fn reported(log: &Log, holdout: &[usize]) -> Vec<usize> {
    let few = log.episodes.len() < FEW || holdout.len() < 2;
    holdout.iter().copied().step_by(if few { 1 } else { 2 }).collect()
}

/// Held-out episodes under the nominal and the accepted model, with the errors of the latter.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Sums of squares of each piece.
    pub sums: [Vec<f64>; 2],
    /// Number of residuals of each piece.
    pub counts: Vec<usize>,
    /// Of each episode: number in the log, mean squares.
    pub episodes: Vec<(u64, f64, f64)>,
    /// Each channel in units of its sensor's noise alone.
    pub plain: Vec<Plain>,
}

/// Mean squares of a channel in units of its sensor's noise, whatever engines differ by: what another simulator's replay can be compared with.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Plain {
    /// What is measured.
    pub channel: Kind,
    /// Number of residuals.
    pub residuals: usize,
    /// Of the re-tuned nominal model.
    pub before: f64,
    /// With the named effects.
    pub after: f64,
}

/// Of the raw residuals of a study before and after.
fn plain(study: &Study, raw: &[Vec<Vec<f64>>; 2]) -> Vec<Plain> {
    let of = |kind: Kind| {
        let squares = |raw: &[Vec<f64>]| -> Vec<f64> {
            let one = |(index, raw): (&usize, &Vec<f64>)| -> Vec<f64> {
                let blocks = study.simulator.trials[*index].blocks.iter().zip(raw);
                blocks.filter(|(block, _)| block.kind == kind).map(|(_, residual)| residual * residual).collect()
            };
            study.chosen.iter().zip(raw).flat_map(one).collect()
        };
        let [before, after] = raw.each_ref().map(|raw| squares(raw));
        let mean = |squares: &[f64]| squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        Plain { channel: kind, residuals: before.len(), before: mean(&before), after: mean(&after) }
    };
    Kind::ALL.into_iter().map(of).filter(|plain| plain.residuals > 0).collect()
}

impl HeldOut {
    pub(crate) fn new(study: &Study, models: [&Fit; 2]) -> Self {
        let raw = models.map(|fit| study.raw(&fit.model.hypothesis(&fit.x)));
        let sums = [0, 1].map(|i| whitened(study, models[i], &raw[i]));
        let trial = |place: usize| &study.simulator.trials[study.chosen[place]];
        let counts: Vec<usize> = (0..study.chosen.len()).map(|place| trial(place).blocks.len()).collect();
        let one = |group: Range<usize>| {
            let count = counts[group.clone()].iter().sum::<usize>().max(1) as f64;
            let [before, after] = [0, 1].map(|i| sums[i][group.clone()].iter().sum::<f64>() / count);
            (trial(group.start).id, before, after)
        };
        let episodes = groups(study.chosen.iter().map(|index| &study.simulator.trials[*index]));
        Self { episodes: episodes.into_iter().map(one).collect(), plain: plain(study, &raw), sums, counts }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.sums.iter().flatten().all(|sum| sum.is_finite())
    }

    /// Mean squares of all.
    #[must_use]
    pub fn errors(&self) -> [f64; 2] {
        let count = self.counts.iter().sum::<usize>().max(1) as f64;
        self.sums.each_ref().map(|sums| sums.iter().sum::<f64>() / count)
    }
}

/// Sums of squares of the episodes of a study under a model.
pub(crate) fn squares(study: &Study, fit: &Fit) -> Vec<f64> {
    whitened(study, fit, &study.raw(&fit.model.hypothesis(&fit.x)))
}

fn whitened(study: &Study, fit: &Fit, raw: &[Vec<f64>]) -> Vec<f64> {
    study.white(raw, fit.model.engine_errors(&fit.x)).iter().map(DVector::norm_squared).collect()
}

/// Mean squares of the episodes of a study under each rival of the first round.
pub(crate) fn ranking(rounds: &[Round], study: &Study) -> Vec<(EffectKind, f64)> {
    let Some(round) = rounds.first() else { return Vec::new() };
    let count = study.count().max(1) as f64;
    let one = |rival: &Rival| (rival.kind(), squares(study, &rival.fit).iter().sum::<f64>() / count);
    round.rivals.iter().chain(round.passed_over_kinds()).map(one).collect()
}
