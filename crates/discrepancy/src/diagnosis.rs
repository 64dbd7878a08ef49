//! From a log to a verdict.

use std::ops::Range;

use measured_log::Log;
use nalgebra::DVector;
use physics_model::{EffectConfig, EffectKind};

use crate::accept::{Asked, Episodes, convinces};
use crate::begin::{begin, follow, shake};
use crate::candidate::{Candidate, candidates};
use crate::context::context;
use crate::error::Error;
use crate::evidence::Evidence;
use crate::fit::{Begin, Effort, Fit, cost, fit};
use crate::locate::{Cell, locate};
use crate::model::Model;
use crate::noise::NoiseLevels;
use crate::nominal::{Nominal, Tunable};
use crate::screen::{Promise, Screening, shortlist};
use crate::simulator::Simulator;
use crate::study::Study;
use crate::trial::{Trial, groups};

/// What the search may do.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Seed of the hold-out split, of the bootstrap and of the test of what is left.
    pub seed: u64,
    /// Kinds that are fitted to the episodes of the screening.
    pub quick_fits: usize,
    /// The best of those, that are fitted to all.
    pub fits: usize,
    /// Rivals nearer than this in ln evidence are in the confusion set.
    pub confusion: f64,
    /// What an effect has to gain in ln evidence to be named.
    pub threshold: f64,
    /// The same for what rolls: a ball goes another way at the least provocation.
    pub threshold_rolling: f64,
    /// Effects at most.
    pub effects: usize,
    /// After this many simulated episodes no further effect is looked for, and of rivals the first alone is fitted to all.
    pub rollouts: usize,
    /// After this many fits end where they are.
    pub most: usize,
    /// Above this many a fit makes no last Jacobian. With what is drawn and told of them logs of 40 episodes took up to 5006 when it was 4800.
    pub limit: usize,
    /// Mean square of the residuals of an episode, on average over all but the worst, above which the model is not the whole story.
    pub unexplained: f64,
    /// The same of the held-out ones before anything is named, from which on what is named has to close half of the gap of a typical one;
    /// a body in the way, which shows where it is met, has not.
    pub gap: f64,
    /// The same of a single held-out one above which nothing is not the whole story either.
    pub odd: f64,
    /// Chance that some channel in some phase would stand out as much under a right model, below which another effect is looked for.
    pub another: f64,
    /// Chance that some channel in some phase would stand out as much under a right model, below which what is left is no chance.
    pub left_by_chance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            quick_fits: 6,
            fits: 3,
            confusion: 20.0_f64.ln(),
            // Of 28 simulated logs without an effect, 20 of boxes and cylinders gained up to 5, 8 of balls up to 17 by what else convinced.
            threshold: 10.0,
            threshold_rolling: 20.0,
            effects: 2,
            rollouts: 3900,
            most: 4300,
            limit: 4700,
            unexplained: 1.4,
            gap: 1.1,
            // At most 1.6 in the 38 logs without an effect of seeds 101, 103 and 106.
            odd: 10.0,
            // Of 11 pairs of seed 7 with both named 10 had at most 0.002 after the first, one 0.26; two second effects that were not there had 0.14 and 0.87.
            another: 0.05,
            // Of 87 logs of seed 7, 59 with an effect that was rightly named and 28 without any, the least is 0.008, of the 12
            // logs of MuJoCo 0.005; of 15 with an effect outside the catalogue the largest is 0.004.
            left_by_chance: 0.005,
        }
    }
}

/// A fitted model with a further effect.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Its fit; the further effect is the last of the model's parts.
    pub fit: Fit,
    /// ln evidence over that of the model without.
    pub gain: f64,
    /// Sums of squares of the held-out episodes.
    pub heldout: Vec<f64>,
}

impl Rival {
    /// The further effect.
    ///
    /// # Panics
    ///
    /// Never: a rival has one.
    #[must_use]
    pub fn kind(&self) -> EffectKind {
        self.fit.model.parts.last().expect("a rival has an effect").kind()
    }
}

/// What a round of the search compared.
#[derive(Debug)]
pub struct Round {
    /// What each candidate promised by a linear step.
    pub promises: Vec<Promise>,
    /// The fitted ones, the most probable first.
    pub rivals: Vec<Rival>,
    /// The model that they were added to, with the same errors.
    pub base: Fit,
    /// Sums of squares of the held-out episodes under that model.
    pub before: Vec<f64>,
}

/// What a diagnosis is made of.
#[derive(Debug)]
pub struct Diagnosis {
    /// The re-tuned nominal model.
    pub nominal: Fit,
    /// The accepted model; the nominal one where nothing was.
    pub model: Fit,
    /// Rounds of the search. The last accepted nothing, unless what its effect leaves does not stand out or no more effects are allowed.
    pub rounds: Vec<Round>,
    /// Sums of squares of the held-out episodes: nominal and accepted model, with the errors of the accepted one.
    pub heldout: [Vec<f64>; 2],
    /// Number of held-out residuals.
    pub heldout_count: usize,
    /// Of each held-out episode: number in the log, mean squares of nominal and accepted model.
    pub heldout_episodes: Vec<(u64, f64, f64)>,
    /// Mean squares of all episodes under the accepted model.
    pub mean_squares: Vec<f64>,
    /// What re-tuning may change.
    pub tunables: Vec<Tunable>,
    /// Where the re-tuned nominal model disagrees.
    pub located: Vec<Cell>,
    /// Where the accepted model still does.
    pub remaining: Vec<Cell>,
    /// Held-out episodes before and after, for plots.
    pub evidence: Evidence,
    /// Simulated episodes.
    pub rollouts: usize,
    /// Places of the pieces of each fitted episode.
    pub pieces: Vec<Range<usize>>,
}

/// Diagnoses a log that was read from the folder `name`.
///
/// # Errors
///
/// [`Error::Unfit`] for a log without poses of the object, or with too few episodes that can be simulated.
pub fn diagnose(log: &Log, name: &str, nominal: &Nominal, settings: &Settings) -> Result<Diagnosis, Error> {
    let noise = NoiseLevels::of_log(log);
    let (trials, [fitted, heldout]) = trials(log, name, nominal, &noise, settings.seed)?;
    let simulator = Simulator::new(nominal, &trials).with_budget([settings.most, settings.limit]);
    let engine = nominal.engine();
    let mut search = Search {
        study: Study::new(&simulator, engine, fitted),
        kept: Study::new(&simulator, engine, heldout),
        settings,
    };

    // The null hypothesis: re-tuning alone. Its errors are learnt near where it fits, then it is fitted again: in the search, with care where
    // nothing explains much more.
    let tunables = nominal.tunables.len();
    let first = fit(&search.study, Model::nominal(tunables, 0), Begin::at(&vec![0.0; tunables]), Effort::Quick);
    search.study.learn_errors(&first.model.hypothesis(&first.x));
    let model = Model::nominal(tunables, search.study.engine_errors());
    let mut x = first.x;
    x.resize(model.count(), 0.0);
    let null = fit(&search.study, model, Begin::at(&x), Effort::Quick);
    let context = context(&simulator, &null, log, &noise);
    let screening = Screening::new(&search.study, &null, &candidates(&context));

    let episodes = Episodes {
        fitted: search.study.groups(),
        heldout: search.kept.groups(),
        counts: search.kept.chosen.iter().map(|index| trials[*index].blocks.len()).collect(),
    };
    let (accepted, rounds, remaining) = search.effects(&screening, &null, &episodes);
    let null = rounds.first().map_or(null, |round| round.base.clone());
    let heldout = [search.heldout(&null), search.heldout(&accepted)];
    // Of each episode, whose pieces come one after another.
    let heldout_episodes = (episodes.heldout.iter())
        .map(|group| {
            let count = episodes.counts[group.clone()].iter().sum::<usize>().max(1) as f64;
            let [before, after] = [0, 1].map(|i| heldout[i][group.clone()].iter().sum::<f64>() / count);
            (trials[search.kept.chosen[group.start]].id, before, after)
        })
        .collect::<Vec<_>>();
    let fitted_mean = |group: &Range<usize>| {
        let residuals = &accepted.residuals[group.clone()];
        let count: usize = residuals.iter().map(DVector::len).sum();
        residuals.iter().map(DVector::norm_squared).sum::<f64>() / count.max(1) as f64
    };
    let mean_squares =
        episodes.fitted.iter().map(fitted_mean).chain(heldout_episodes.iter().map(|(_, _, after)| *after)).collect();
    let chosen = &search.study.chosen;
    let located = locate(&simulator, chosen, &null, settings.seed);
    let remaining = match remaining {
        Some(cells) => cells,
        None if accepted.model.parts.is_empty() => located.clone(),
        None => locate(&simulator, chosen, &accepted, settings.seed),
    };
    Ok(Diagnosis {
        located,
        remaining,
        evidence: Evidence::new(&search.kept, &null, &accepted),
        nominal: null,
        model: accepted,
        rounds,
        heldout,
        heldout_count: search.kept.count(),
        heldout_episodes,
        mean_squares,
        tunables: nominal.tunables.clone(),
        rollouts: simulator.rollouts(),
        pieces: episodes.fitted,
    })
}

/// What the log is compared by, and which of it is fitted and held out.
fn trials(
    log: &Log,
    name: &str,
    nominal: &Nominal,
    noise: &NoiseLevels,
    seed: u64,
) -> Result<(Vec<Trial>, [Vec<usize>; 2]), Error> {
    let split = log.split(seed);
    let mut trials = Vec::new();
    let mut sides = [Vec::new(), Vec::new()];
    for (index, episode) in log.episodes.iter().enumerate() {
        let side = &mut sides[usize::from(split.holdout.contains(&index))];
        for trial in Trial::of_episode(log, episode, noise, nominal.has_tool()) {
            side.push(trials.len());
            trials.push(trial);
        }
    }
    let episodes = |side: &[usize]| groups(side.iter().map(|index| &trials[*index])).len();
    let [fitted, heldout] = [episodes(&sides[0]), episodes(&sides[1])];
    if fitted < LEAST_FITTED || heldout == 0 {
        let reason = format!(
            "expected at least {LEAST_FITTED} episodes to fit and one held out, each with two rows and a pose of the object in the first, \
             found {fitted} and {heldout}"
        );
        return Err(Error::Unfit { log: name.into(), reason });
    }
    Ok((trials, sides))
}

/// Episodes that a fit needs: a bootstrap of fewer says nothing.
const LEAST_FITTED: usize = 4;
/// What a further effect has to gain, as a share of what those before it did.
const SECOND_SHARE: f64 = 0.01;
/// Rivals nearer than this in ln evidence on the episodes of the screening are fitted with care.
const NEAR: f64 = 60.0;
/// A null that leaves more than this share of the best effect's gain unexplained was no place to learn errors at.
const FAR: f64 = 100.0;

struct Search<'a> {
    study: Study<'a>,
    kept: Study<'a>,
    settings: &'a Settings,
}

impl Search<'_> {
    /// Sums of squares of the held-out episodes.
    fn heldout(&self, fit: &Fit) -> Vec<f64> {
        let raw = self.kept.raw(&fit.model.hypothesis(&fit.x));
        self.kept.white(&raw, fit.model.engine_errors(&fit.x)).iter().map(DVector::norm_squared).collect()
    }

    /// Adds effects to the re-tuned nominal model, as long as one convinces and what it leaves stands out; the model with them, what was compared, and
    /// what the model leaves where that is known.
    fn effects(
        &mut self,
        screening: &Screening,
        null: &Fit,
        episodes: &Episodes,
    ) -> (Fit, Vec<Round>, Option<Vec<Cell>>) {
        let settings = self.settings;
        let (mut accepted, mut rounds, mut explained, mut remaining) = (null.clone(), Vec::new(), 0.0, None);
        while accepted.model.parts.len() < settings.effects && self.study.simulator.rollouts() <= settings.rollouts {
            let mut round = self.round(screening, &accepted);
            // The errors of a solver grow with what it is asked to explain.
            let rolls = self.study.simulator.nominal.rolls();
            let threshold = if rolls { settings.threshold_rolling } else { settings.threshold };
            let asked = Asked { least: threshold.max(SECOND_SHARE * explained), steady: rolls };
            let best = round.rivals.iter().position(|rival| convinces(rival, &round, episodes, asked, settings.seed));
            // Those before it do not convince: they are no rivals.
            round.rivals.drain(..best.unwrap_or(0));
            if best.is_none() {
                // The same model, fitted with more care on the way.
                accepted = round.base.clone();
                rounds.push(round);
                return (accepted, rounds, None);
            }
            explained += round.rivals[0].gain;
            accepted = round.rivals[0].fit.clone();
            rounds.push(round);
            let cells = locate(self.study.simulator, &self.study.chosen, &accepted, settings.seed);
            let another = cells.iter().any(|cell| cell.p_value < settings.another);
            remaining = Some(cells);
            if !another {
                break;
            }
        }
        (accepted, rounds, remaining)
    }

    /// Compares what could be added to `base`.
    fn round(&mut self, screening: &Screening, base: &Fit) -> Round {
        let promises = screening.promises(&self.study, base);
        let mut quick = self.quick(screening, base, &promises);
        let before = base.part(&screening.places).log_evidence();
        let mut base = base.clone();
        if base.model.parts.is_empty() {
            let best = quick.first().filter(|best| best.log_evidence() - before > FAR);
            // How large errors are is learnt where the model is nearly right: with what explains most.
            let right = best.unwrap_or(&base);
            let hypothesis = right.model.hypothesis(&right.x);
            if best.is_some() {
                self.study.learn_errors(&hypothesis);
            }
            self.kept.learn_errors(&hypothesis);
            let effort = if best.is_some() { Effort::Quick } else { Effort::Full };
            base = fit(&self.study, base.model, Begin::at(&base.x), effort);
        }
        let fits = if base.model.parts.is_empty() { self.settings.fits } else { 1 };
        quick.truncate(fits);
        let lead = quick.first().map_or(0.0, Fit::log_evidence);
        let without = base.log_evidence();
        let share = base.residuals.len() as f64 / screening.places.len() as f64;
        let fully = |quick: Fit| {
            let fit = fit(&self.study, quick.model, Begin::at(&quick.x), Effort::Full);
            Rival {
                heldout: self.heldout(&fit),
                gain: fit.log_evidence() - without - self.finer_steps(&base, &fit),
                fit,
            }
        };
        let mut rivals: Vec<Rival> = (quick.into_iter().enumerate())
            .map(|(rank, quick)| {
                // Those far behind need no exact optimum: what they gain in the episodes of the screening they gain in all.
                let gain = quick.log_evidence();
                let affordable = self.study.simulator.rollouts() < self.settings.rollouts;
                if rank == 0 || (lead - gain < NEAR && affordable) {
                    fully(quick)
                } else {
                    Rival { heldout: self.heldout(&quick), fit: quick, gain: share * (gain - before) }
                }
            })
            .collect();
        loop {
            rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            // Unless those before do not keep what they promise.
            match rivals.first() {
                Some(first)
                    if first.fit.residuals.len() < self.study.chosen.len() && !self.study.simulator.exhausted() =>
                {
                    let first = rivals.swap_remove(0);
                    rivals.push(fully(first.fit));
                }
                _ => break,
            }
        }
        if let Some(again) = rivals.first().and_then(|first| self.retuned(&base, &first.fit)) {
            let gained = again.log_evidence() - base.log_evidence();
            rivals.iter_mut().for_each(|rival| rival.gain -= gained);
            base = again;
        }
        Round { promises, rivals, before: self.heldout(&base), base }
    }

    /// What a bounce gains by its finer steps alone, which are no bounce: they suit balls.
    fn finer_steps(&self, base: &Fit, rival: &Fit) -> f64 {
        let Some(bounce) = rival.model.parts.last().filter(|part| part.kind() == EffectKind::Restitution) else {
            return 0.0;
        };
        let mut hypothesis = base.model.hypothesis(&base.x);
        hypothesis.effects.push(bounce.effect(&vec![0.0; bounce.coordinates.len()]));
        let white = self.study.white(&self.study.raw(&hypothesis), base.model.engine_errors(&base.x));
        (base.cost() - cost(&base.x, &white)).max(0.0)
    }

    /// The model without the last effect of `rival` where re-tuning can do the same, fitted from there, if that is better than `base`: no effect may be
    /// named because re-tuning had not gone far enough.
    fn retuned(&self, base: &Fit, rival: &Fit) -> Option<Fit> {
        let part = rival.model.parts.last()?;
        let coordinates = &rival.x[rival.x.len() - part.coordinates.len()..];
        let tunables = &self.study.simulator.nominal.tunables;
        let place = |key: &str| tunables.iter().position(|tunable| tunable.key == key);
        let value = |place: usize| tunables[place].value(rival.x[place]);
        let (place, value) = match part.effect(coordinates) {
            EffectConfig::FrictionLevel(level) => (place("table.friction")?, level.coefficient),
            // Forces at all speeds and weights are in proportion to the mass.
            EffectConfig::ForceGain(gain) => place("object.mass_kg").map(|place| (place, value(place) * gain.gain))?,
            _ => return None,
        };
        let mut x = rival.x[..base.x.len()].to_vec();
        let [low, high] = base.model.range(place);
        x[place] = tunables[place].coordinate(value).clamp(low, high);
        let raw = self.study.raw(&base.model.hypothesis(&x));
        if cost(&x, &self.study.white(&raw, base.model.engine_errors(&x))) > base.cost() {
            return None;
        }
        let begin = Begin { x, raw: Some(raw), jacobian: Vec::new() };
        let again = fit(&self.study, base.model.clone(), begin, Effort::Quick);
        (again.log_evidence() > base.log_evidence()).then_some(again)
    }

    /// Fits what promises most to the episodes of the screening; the best first.
    fn quick(&self, screening: &Screening, base: &Fit, promises: &[Promise]) -> Vec<Fit> {
        let places = &screening.places;
        let part = self.study.part(places);
        let base = base.part(places);
        let count = if base.model.parts.is_empty() { self.settings.quick_fits } else { self.settings.fits };
        let mut quick: Vec<Fit> = shortlist(promises, count)
            .iter()
            .map(|promise| {
                let model = base.model.with(&promise.candidate);
                let begin = begin(&part, &base, &model, promise);
                fit(&part, model, begin, Effort::Quick)
            })
            .collect();
        let sort = |fits: &mut Vec<Fit>| fits.sort_by(|a, b| b.log_evidence().total_cmp(&a.log_evidence()));
        sort(&mut quick);
        // Half or one and a half times as strong an effect may lie beyond a ridge that no descent crosses.
        if let Some(best) = quick.first_mut() {
            shake(&part, best);
        }
        // Twins (a tilt and a force) reach the same optimum or neither: one that was found is where the other begins.
        if let Some(best) = quick.first().cloned() {
            quick.iter_mut().skip(1).for_each(|other| follow(&part, &best, other));
            sort(&mut quick);
        }
        // Of one kind's several places the best.
        let mut kinds = Vec::new();
        quick.retain(|fit| {
            let kind = fit.model.parts.last().map(Candidate::kind);
            let first = !kinds.contains(&kind);
            kinds.push(kind);
            first
        });
        quick
    }
}
