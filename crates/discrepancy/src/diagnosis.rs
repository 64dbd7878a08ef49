//! From a log to a verdict.

use measured_log::Log;
use nalgebra::DVector;
use physics_model::EffectKind;

use crate::candidate::{Context, candidates};
use crate::error::Error;
use crate::evidence::Evidence;
use crate::fit::{Begin, Effort, Fit, dispersion, fit};
use crate::interval::bootstrap;
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
    /// Mean square of an episode's residuals above which the model does not explain it, and share of such episodes among all above which the model
    /// is not the whole story.
    pub unexplained: [f64; 2],
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
            unexplained: [1.3, 0.3],
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
    /// Variance of the residuals of each fitted episode under the model that explains it best.
    pub dispersion: Vec<f64>,
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
    let context = context(&simulator, &null, log, &noise);
    let screening = Screening::new(&search.study, &null, &candidates(&context));

    let mut accepted = null.clone();
    let counts: Vec<usize> = search.kept.chosen.iter().map(|index| trials[*index].blocks.len()).collect();
    let (mut rounds, mut explained) = (Vec::new(), 0.0);
    while accepted.model.parts.len() < settings.effects {
        if simulator.rollouts() > settings.rollouts {
            break;
        }
        let round = search.round(&screening, &accepted);
        // The errors of a solver grow with what it is asked to explain.
        let least = settings.threshold.max(SECOND_SHARE * explained);
        let convinces =
            |best: &&Rival| best.gain > least && agrees(best, &round, &counts) && lasts(&best.fit, settings.seed);
        let best = round.rivals.first().filter(convinces);
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
    let mean_squares = accepted.residuals.iter().map(|r| r.norm_squared() / r.len().max(1) as f64);
    let mean_squares =
        mean_squares.chain(heldout[1].iter().zip(&counts).map(|(sum, n)| sum / (*n).max(1) as f64)).collect();
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
    })
}

/// Share of resamples in which a strength has to have the same sign.
const SAME_SIGN: f64 = 0.95;
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
        let part = base.part(&screening.places);
        let spread = dispersion(quick.iter().chain([&part]));
        if let Some(best) = quick.first()
            && best.log_evidence(&spread) - part.log_evidence(&spread) > FAR
        {
            let best = best.clone();
            self.learn_errors(&best);
            base = fit(&self.study, base.model, Begin::at(&base.x), Effort::Quick);
        }
        let fits = if base.model.parts.is_empty() { self.settings.fits } else { 1 };
        quick.truncate(fits);
        let lead = quick.first().map_or(0.0, |best| best.log_evidence(&spread));
        let mut rivals: Vec<Rival> = quick
            .into_iter()
            .enumerate()
            .map(|(rank, quick)| {
                // The ranking of those far behind needs no exact optimum.
                let near = lead - quick.log_evidence(&spread) < NEAR;
                let effort = if rank == 0 || near { Effort::Full } else { Effort::Quick };
                let fit = fit(&self.study, quick.model, Begin::at(&quick.x), effort);
                Rival { heldout: self.heldout(&fit), fit, gain: 0.0 }
            })
            .collect();
        let dispersion = dispersion(rivals.iter().map(|rival| &rival.fit).chain([&base]));
        let without = base.log_evidence(&dispersion);
        for rival in &mut rivals {
            rival.gain = rival.fit.log_evidence(&dispersion) - without;
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
        let spread = dispersion(quick.iter().chain([&base]));
        quick.sort_by(|a, b| b.log_evidence(&spread).total_cmp(&a.log_evidence(&spread)));
        quick
    }
}

/// Whether the last effect is there whichever episodes are left out: some strength of it has the same sign in nearly all resamples.
fn lasts(fit: &Fit, seed: u64) -> bool {
    let Some(part) = fit.model.parts.last() else { return false };
    let first = fit.x.len() - part.coordinates.len();
    let samples = bootstrap(fit, seed);
    part.strengths().any(|index| {
        // A body in the way begins with a size: its absence is not at 0.
        let absent = if part.begin.is_some() { part.coordinates[index].range[0] } else { 0.0 };
        let above = samples.iter().filter(|x| x[first + index] > absent).count();
        above.max(samples.len() - above) as f64 >= SAME_SIGN * samples.len() as f64
    })
}

/// Whether what was held out is explained better too. As above, what neither explains has no say.
fn agrees(rival: &Rival, round: &Round, counts: &[usize]) -> bool {
    let gains = round.before.iter().zip(&rival.heldout).zip(counts).map(|((before, after), count)| {
        let dispersion = (before.min(*after) / (*count).max(1) as f64).max(1.0);
        (before - after) / dispersion
    });
    gains.sum::<f64>() > 0.0
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
fn context(simulator: &Simulator, null: &Fit, log: &Log, noise: &NoiseLevels) -> Context {
    let nominal = simulator.nominal;
    let engine = Engine::default();
    let (world, theta) = nominal.rig(&null.x, &engine).nominal(&nominal.object(&null.x, 0.0, &engine));
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
    let obstacles_m = stops(simulator, null, theta.object.shape.footprint_radius_m(theta.object.size_m));
    Context {
        world,
        theta,
        places_m: centres(&path, 6),
        obstacles_m,
        largest_force_n,
        tool: nominal.has_tool(),
        forces: has(Kind::WristForce) || has(Kind::JointTorque),
        joints: has(Kind::JointPosition) || (nominal.joints() > 0 && has(Kind::ToolPosition)),
        wrist_torques: has(Kind::WristTorque),
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

/// Places where something may stand in the way: ahead of where the tool meets a force that the model does not know of, and beside where objects
/// of `radius_m` leave the simulated path.
fn stops(simulator: &Simulator, null: &Fit, radius_m: f64) -> Vec<[f64; 2]> {
    let hypothesis = null.model.hypothesis(&null.x);
    let mut found: Vec<(f64, [f64; 2])> = Vec::new();
    for trial in simulator.trials {
        let (_, readings) = simulator.readings(&hypothesis, &Engine::default(), Nudge::default(), trial);
        found.extend(trial.blocked(&readings, AHEAD_M).filter(|(surprise_n, _)| *surprise_n > UNEXPECTED_N));
        // A newton a millimetre, so that both kinds of surprise can be compared.
        let deflected = trial.deflected(&readings, radius_m + OBSTACLE_M);
        found.extend(deflected.filter(|(off_m, _)| *off_m > OFF_M).map(|(off_m, place)| (1e3 * off_m, place)));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let points: Vec<[f64; 2]> = found.iter().take(12).map(|(_, point)| *point).collect();
    centres(&points, 4)
}

/// A force, N, that no friction explains, and how far ahead, m, of tool or object the centre of an obstacle is looked for.
const UNEXPECTED_N: f64 = 3.0;
const AHEAD_M: f64 = 0.05;
/// How far off, m, an object has to end, and the radius, m, of the obstacles that a fit begins with.
const OFF_M: f64 = 0.005;
const OBSTACLE_M: f64 = 0.03;
