//! From a log to a verdict.

use measured_log::Log;
use nalgebra::DVector;
use physics_model::EffectKind;

use crate::candidate::{Context, candidates};
use crate::error::Error;
use crate::fit::{Begin, Effort, Fit, fit};
use crate::locate::{Cell, locate};
use crate::model::Model;
use crate::noise::NoiseLevels;
use crate::nominal::{Engine, Nominal, Tunable};
use crate::screen::{Promise, Screening, shortlist};
use crate::simulator::{Nudge, Simulator};
use crate::study::{Study, chi2};
use crate::trial::{Kind, Trial};

/// What the search may do.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Seed of the hold-out split and of the bootstrap.
    pub seed: u64,
    /// Kinds that are fitted to the episodes of the screening.
    pub quick_fits: usize,
    /// The best of those, that are fitted to all.
    pub fits: usize,
    /// Rivals nearer than this in ln evidence are in the confusion set.
    pub confusion: f64,
    /// What an effect has to gain in ln evidence to be named.
    pub threshold: f64,
    /// Effects at most.
    pub effects: usize,
    /// No further effect is looked for after this many simulated episodes.
    pub rollouts: usize,
    /// Held-out sum of squares a residual above which the best model is not the whole story.
    pub unexplained: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            quick_fits: 6,
            fits: 3,
            confusion: 20.0_f64.ln(),
            threshold: 6.0,
            effects: 2,
            rollouts: 4000,
            unexplained: 1.15,
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
    /// Sums of squares of the held-out episodes under the model that they were added to, with the same errors.
    pub before: Vec<f64>,
    /// Variance of the residuals of the best.
    pub dispersion: f64,
}

/// What a diagnosis is made of.
#[derive(Debug)]
pub struct Diagnosis {
    /// The re-tuned nominal model.
    pub nominal: Fit,
    /// The accepted model; the nominal one where nothing was.
    pub model: Fit,
    /// Rounds of the search, the last of which accepted nothing.
    pub rounds: Vec<Round>,
    /// Sums of squares of the held-out episodes: nominal and accepted model, with the errors of the accepted one.
    pub heldout: [Vec<f64>; 2],
    /// Number of held-out residuals.
    pub heldout_count: usize,
    /// Of each held-out episode: number in the log, mean squares of nominal and accepted model.
    pub heldout_episodes: Vec<(u64, f64, f64)>,
    /// What re-tuning may change.
    pub tunables: Vec<Tunable>,
    /// Where the re-tuned nominal model disagrees.
    pub located: Vec<Cell>,
    /// Where the accepted model still does.
    pub remaining: Vec<Cell>,
    /// Simulated episodes.
    pub rollouts: usize,
}

/// Diagnoses a log that was read from the folder `name`.
///
/// # Errors
///
/// [`Error::Unfit`] for a log without poses of the object, or with too few episodes that can be simulated.
pub fn diagnose(log: &Log, name: &str, nominal: &Nominal, settings: &Settings) -> Result<Diagnosis, Error> {
    let noise = NoiseLevels::of_log(log);
    let all: Vec<Option<Trial>> =
        log.episodes.iter().map(|episode| Trial::new(log, episode, &noise, nominal.has_tool())).collect();
    let split = log.split(settings.seed);
    let mut trials = Vec::new();
    let mut sides = [Vec::new(), Vec::new()];
    for (index, trial) in all.into_iter().enumerate() {
        if let Some(trial) = trial {
            sides[usize::from(split.holdout.contains(&index))].push(trials.len());
            trials.push(trial);
        }
    }
    let [fitted, heldout] = sides;
    if fitted.len() < LEAST_FITTED || heldout.is_empty() {
        let reason = format!(
            "expected at least {LEAST_FITTED} episodes to fit and one held out, each with two rows and a pose of the object in the first, \
             found {} and {}",
            fitted.len(),
            heldout.len()
        );
        return Err(Error::Unfit { log: name.into(), reason });
    }
    let simulator = Simulator::new(nominal, &trials);
    let engine = Engine::default();
    let mut search = Search {
        study: Study::new(&simulator, engine, fitted),
        kept: Study::new(&simulator, engine, heldout),
        settings,
    };

    // The null hypothesis: re-tuning alone. Its errors are learnt near where it fits, then it is fitted again.
    let tunables = nominal.tunables.len();
    let model = Model::nominal(tunables);
    let first = fit(&search.study, model.clone(), Begin::at(&vec![0.0; tunables]), Effort::Quick);
    search.learn_errors(&first);
    let null = fit(&search.study, model, Begin::at(&first.x), Effort::Full);
    let context = context(&simulator, &null, log, nominal);
    let screening = Screening::new(&search.study, &null, &candidates(&context));

    let mut accepted = null.clone();
    let (mut rounds, mut explained) = (Vec::new(), 0.0);
    while accepted.model.parts.len() < settings.effects {
        if simulator.rollouts() > settings.rollouts {
            break;
        }
        let round = search.round(&screening, &accepted);
        // The errors of a solver grow with what it is asked to explain.
        let least = settings.threshold.max(SECOND_SHARE * explained);
        let best = round.rivals.first().filter(|best| best.gain > least && agrees(best, &round));
        let best = best.map(|best| (best.gain, best.fit.clone()));
        rounds.push(round);
        match best {
            Some((gain, fit)) => (explained, accepted) = (explained + gain, fit),
            None => break,
        }
    }
    let heldout = [search.heldout(&null), search.heldout(&accepted)];
    let heldout_episodes = (search.kept.chosen.iter().zip(heldout[0].iter().zip(&heldout[1])))
        .map(|(index, (before, after))| {
            let trial = &trials[*index];
            let count = trial.blocks.len().max(1) as f64;
            (trial.id, before / count, after / count)
        })
        .collect();
    let chosen = &search.study.chosen;
    let located = locate(&simulator, chosen, &null, settings.seed);
    let remaining = if accepted.model.parts.is_empty() {
        located.clone()
    } else {
        locate(&simulator, chosen, &accepted, settings.seed)
    };
    Ok(Diagnosis {
        located,
        remaining,
        nominal: null,
        model: accepted,
        rounds,
        heldout,
        heldout_count: search.kept.len(),
        heldout_episodes,
        tunables: nominal.tunables.clone(),
        rollouts: simulator.rollouts(),
    })
}

/// Episodes that a fit needs: a bootstrap of fewer says nothing.
const LEAST_FITTED: usize = 4;
/// What a further effect has to gain, as a share of what those before it did.
const SECOND_SHARE: f64 = 0.003;
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
    fn learn_errors(&mut self, fit: &Fit) {
        let hypothesis = fit.model.hypothesis(&fit.x);
        self.study.learn_errors(&hypothesis);
        self.kept.learn_errors(&hypothesis);
    }

    /// Sums of squares of the held-out episodes.
    fn heldout(&self, fit: &Fit) -> Vec<f64> {
        self.kept.white(&self.kept.raw(&fit.model.hypothesis(&fit.x))).iter().map(DVector::norm_squared).collect()
    }

    /// Compares what could be added to `base`.
    fn round(&mut self, screening: &Screening, base: &Fit) -> Round {
        let promises = screening.promises(&self.study, base);
        let mut quick = self.quick(screening, base, &promises);
        // How large errors are is learnt where the model is nearly right.
        let mut base = base.clone();
        if let Some(best) = quick.first()
            && best.log_evidence(1.0) - base.part(&screening.places).log_evidence(1.0) > FAR
        {
            let best = best.clone();
            self.learn_errors(&best);
            base = fit(&self.study, base.model, Begin::at(&base.x), Effort::Quick);
        }
        let fits = if base.model.parts.is_empty() { self.settings.fits } else { 1 };
        quick.truncate(fits);
        let lead = quick.first().map_or(0.0, |best| best.log_evidence(1.0));
        let mut rivals: Vec<Rival> = quick
            .into_iter()
            .enumerate()
            .map(|(rank, quick)| {
                // The ranking of those far behind needs no exact optimum.
                let near = lead - quick.log_evidence(1.0) < NEAR;
                let effort = if rank == 0 || near { Effort::Full } else { Effort::Quick };
                let fit = fit(&self.study, quick.model, Begin::at(&quick.x), effort);
                Rival { heldout: self.heldout(&fit), fit, gain: 0.0 }
            })
            .collect();
        let best = rivals.iter().map(|rival| rival.fit.chi2()).fold(base.chi2(), f64::min);
        let dispersion = (best / self.study.len() as f64).max(1.0);
        let without = base.log_evidence(dispersion);
        for rival in &mut rivals {
            rival.gain = rival.fit.log_evidence(dispersion) - without;
        }
        rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Round { promises, rivals, before: self.heldout(&base), dispersion }
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
        quick.sort_by(|a, b| b.log_evidence(1.0).total_cmp(&a.log_evidence(1.0)));
        quick
    }
}

/// Whether what was held out is explained better too. Small gains may hide in its scatter, but not large ones.
fn agrees(rival: &Rival, round: &Round) -> bool {
    let gains: Vec<f64> = round.before.iter().zip(&rival.heldout).map(|(before, after)| before - after).collect();
    gains.iter().sum::<f64>() > 0.0
}

/// The linear step of the screening as far as it helps: large effects are not linear.
fn begin(part: &Study, base: &Fit, model: &Model, promise: &Promise) -> Begin {
    let at = |share: f64| -> Vec<f64> {
        let own = promise.begin.iter().map(|a| if promise.candidate.begin.is_some() { *a } else { share * a });
        base.x.iter().copied().chain(own).collect()
    };
    let mut best: Option<(f64, Vec<f64>, Vec<Vec<f64>>)> = None;
    for share in [1.0, 0.4, 0.1] {
        let x = at(share);
        let raw = part.raw(&model.hypothesis(&x));
        let cost = 0.5 * chi2(&part.white(&raw)) + 0.5 * x.iter().map(|x| x * x).sum::<f64>();
        let good = cost < 0.5 * base.chi2();
        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            best = Some((cost, x, raw));
        }
        if good || promise.candidate.begin.is_some() {
            break;
        }
    }
    let (_, x, raw) = best.unwrap_or_else(|| (0.0, at(0.0), base.raw.clone()));
    Begin { x, raw: Some(raw), jacobian: base.jacobian.clone() }
}

/// Where the object went and what the log has.
fn context(simulator: &Simulator, null: &Fit, log: &Log, nominal: &Nominal) -> Context {
    let engine = Engine::default();
    let (world, theta) = nominal.rig(&null.x, &engine).nominal(&nominal.object(&null.x, 0.0, &engine));
    let noise = NoiseLevels::of_log(log);
    let has = |kind: Kind| noise.of(kind).is_some();
    let mut path: Vec<[f64; 2]> = Vec::new();
    let mut largest_force_n = 0.0_f64;
    for episode in &log.episodes {
        for row in 0..episode.rows() {
            if let Some([x, y, _]) = episode.vector(measured_log::Channel::ObjectPosition, row)
                && path.last().is_none_or(|[a, b]| (x - a).hypot(y - b) > 0.01)
            {
                path.push([x, y]);
            }
            if let Some(f) = episode.vector(measured_log::Channel::WristForce, row) {
                largest_force_n = largest_force_n.max(f.iter().map(|v| v * v).sum::<f64>().sqrt());
            }
        }
    }
    let obstacles_m = stops(simulator, null);
    Context {
        world,
        theta,
        places_m: centres(&path, 6),
        obstacles_m,
        largest_force_n,
        tool: nominal.has_tool(),
        forces: has(Kind::WristForce) || has(Kind::JointTorque),
        joints: has(Kind::JointPosition) || (nominal.joints() > 0 && has(Kind::ToolPosition)),
        joint_torques: has(Kind::JointTorque),
    }
}

/// Farthest-point centres of a cloud of points.
fn centres(points: &[[f64; 2]], count: usize) -> Vec<[f64; 2]> {
    let Some(first) = points.first() else { return Vec::new() };
    let distance = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut centres = vec![*first];
    while centres.len() < count {
        let nearest = |p: &[f64; 2]| centres.iter().map(|c| distance(p, c)).fold(f64::INFINITY, f64::min);
        let farthest = points.iter().max_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        match farthest {
            Some(point) if nearest(point) > 0.03 => centres.push(*point),
            _ => break,
        }
    }
    centres
}

/// Places where something may stand in the way: ahead of where the tool meets a force that the model does not know of, and ahead of where
/// objects end that should have gone farther.
fn stops(simulator: &Simulator, null: &Fit) -> Vec<[f64; 2]> {
    let hypothesis = null.model.hypothesis(&null.x);
    let mut found: Vec<(f64, [f64; 2])> = Vec::new();
    for trial in simulator.trials {
        let (_, readings) = simulator.readings(&hypothesis, &Engine::default(), Nudge::default(), trial);
        found.extend(trial.blocked(&readings, AHEAD_M).filter(|(surprise_n, _)| *surprise_n > UNEXPECTED_N));
        let (Some(last), Some(measured)) = (readings.last(), trial.last_position()) else { continue };
        let simulated = last.object.position_m;
        let miss = [simulated[0] - measured[0], simulated[1] - measured[1]];
        let length = miss[0].hypot(miss[1]);
        if length > 0.005 {
            let ahead = |axis: usize| measured[axis] + AHEAD_M * miss[axis] / length;
            // A newton a millimetre, so that both kinds of surprise can be compared.
            found.push((1e3 * length, [ahead(0), ahead(1)]));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let points: Vec<[f64; 2]> = found.iter().take(12).map(|(_, point)| *point).collect();
    centres(&points, 4)
}

/// A force, N, that no friction explains, and how far ahead, m, of tool or object the centre of an obstacle is looked for.
const UNEXPECTED_N: f64 = 3.0;
const AHEAD_M: f64 = 0.05;
