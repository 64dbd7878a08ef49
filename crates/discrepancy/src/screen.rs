//! Which effects could explain what the nominal model leaves.
//!
//! For each candidate a linear step, and a scan of its strengths over what is plausible: what rolls, slides off or meets a tool elsewhere is no multiple
//! of what a slight effect does. At each point of a scan clocks are set anew, and everything else is re-tuned as if residuals were linear, which costs no
//! simulation.
//!
//! Both begin where the log says, not where re-tuning has led: that may have made up for what is missing, and then nothing like it shows. A body in the way
//! is tried beside the re-tuned model, because what meets it has to come there in time.

use std::ops::Range;

use nalgebra::DVector;
use physics_model::EffectKind;

use crate::candidate::Candidate;
use crate::fit::Fit;
use crate::likelihood::{self, Stack, pick};
use crate::linear::{Linear, Minimum};
use crate::model::Model;
use crate::simulator::Hypothesis;
use crate::study::{Study, difference};

/// Episodes that the screening looks at, at most. With more of them a search ends before it has compared its best models in all episodes.
const EPISODES: usize = 8;
/// The same of what is thrown, which lacks several effects: each toss meets the table more than once.
const EPISODES_THROWN: usize = 8;
/// An episode lasts long if it does so many times as long as the mean.
const LONG: f64 = 3.0;

/// How far from neutral, in units, a linear step is measured: far enough to stand out of the solver's grain.
const REACH: f64 = 0.35;
/// Episodes of the screening in which strengths are scanned, at most; none of what is thrown, whose budget several effects share.
const SCANNED: usize = 4;
/// Strengths that are looked at, in units, either way as far as they are within the range...
const STRENGTHS: [f64; 2] = [0.5, 2.0];
/// ... and, from the best of those, a weaker or a stronger one; both of what has one side.
const BEYOND: [f64; 2] = [0.125, 8.0];

/// What the screening says of a candidate.
#[derive(Clone, Debug)]
pub struct Promise {
    /// The candidate.
    pub candidate: Candidate,
    /// What ln evidence would gain, of all episodes.
    pub gain: f64,
    /// Number of these.
    pub episodes: usize,
    /// Coordinates to begin a fit from.
    pub begin: Vec<f64>,
    /// By how much the coordinates of the model without it would move then; 0 where the screening began somewhere else.
    pub beside: Vec<f64>,
    /// The best point of the scan, if it gains anything, and where the linear step leads from where the screening began, if that promises more.
    pub(crate) starts: Vec<Start>,
}

/// Where a fit may begin.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Start {
    /// The first coordinates of the model without the candidate, as many as differ from where that is.
    pub(crate) shared: Vec<f64>,
    /// Those of the candidate.
    pub(crate) own: Vec<f64>,
}

/// What was simulated for the screening: it serves again when an effect has been accepted.
#[derive(Debug)]
pub struct Screening {
    /// Places in the study of the episodes that it looks at.
    pub places: Vec<usize>,
    /// Which of those are scanned.
    scanned: Vec<usize>,
    screened: Vec<Screened>,
    /// Where the first effect is looked for, if not where re-tuning has led.
    pub(crate) stated: Option<Fit>,
    /// Clocks where the scans began.
    clocks: Vec<f64>,
}

#[derive(Debug)]
struct Screened {
    candidate: Candidate,
    columns: Columns,
    points: Vec<Point>,
}

/// Changes of residuals that are not white: what is white changes when errors are learnt anew.
#[derive(Debug)]
enum Columns {
    /// Within reach of each strength.
    Linear(Vec<Vec<Vec<f64>>>),
    /// At the place to begin from: no small version exists.
    Whole(Vec<Vec<f64>>),
}

/// A point of a scan, with the changes of residuals there.
#[derive(Debug)]
struct Point {
    clocks: Vec<f64>,
    own: Vec<f64>,
    change: Vec<Vec<f64>>,
}

/// What a screening of the whole catalogue takes in the episodes of `part`: one simulation of each for each strength and place, and scans of some. Of what is thrown
/// fewer effects show.
pub(crate) fn cost(part: &Study) -> usize {
    if !part.simulator.nominal.has_tool() {
        return 40 * part.rollouts();
    }
    let (episodes, scanned) = (part.groups().len(), part.groups().len().min(SCANNED));
    87 * part.rollouts() + 145 * part.rollouts() * scanned / episodes.max(1)
}

impl Screening {
    /// Simulates every candidate beside the nominal model in the episodes of `part`, which are those at `places` of all: as the log states it, or else as
    /// re-tuned, `null`; bodies beside the latter.
    #[must_use]
    pub fn new(part: &Study, places: Vec<usize>, null: &Fit, stated: Option<Fit>, candidates: &[Candidate]) -> Self {
        let nominal = stated.as_ref().unwrap_or(null);
        let hypothesis = nominal.model.hypothesis(&nominal.x);
        let base = &nominal.raw;
        let scanned = spread(nominal, &part.groups(), SCANNED);
        let few = part.part(&scanned);
        let columns = |candidate: &Candidate| {
            let changed = |mut hypothesis: Hypothesis, a: &[f64], base: &[Vec<f64>]| -> Vec<Vec<f64>> {
                hypothesis.effects.push(candidate.effect(a));
                changes(&part.raw(&hypothesis), base)
            };
            let change = |a: &[f64]| changed(hypothesis.clone(), a, base);
            match &candidate.begin {
                Some(begin) => Columns::Whole(changed(null.model.hypothesis(&null.x), begin, &null.raw)),
                None => Columns::Linear(
                    candidate
                        .strengths()
                        .map(|index| {
                            let mut a = vec![0.0; candidate.coordinates.len()];
                            a[index] = reach(candidate, index);
                            change(&a)
                        })
                        .collect(),
                ),
            }
        };
        let before: Vec<Vec<f64>> = scanned.iter().map(|place| base[*place].clone()).collect();
        let has_tool = part.simulator.nominal.has_tool();
        let tuning: Vec<Stack> = nominal.jacobian.iter().map(|column| pick(column, &scanned)).collect();
        let points = |candidate: &Candidate| {
            if has_tool { scan(&few, &before, nominal, &tuning, candidate) } else { Vec::new() }
        };
        let one = |candidate: &Candidate| Screened {
            columns: columns(candidate),
            points: points(candidate),
            candidate: candidate.clone(),
        };
        let screened = candidates.iter().map(one).collect();
        let clocks = nominal.x[..nominal.model.clocks].to_vec();
        Self { places, scanned, screened, clocks, stated }
    }

    /// What each candidate would bring in so many episodes beside what `fit` has; the most promising first. `part` and `fit` know the episodes of the
    /// screening alone.
    #[must_use]
    pub fn promises(&self, part: &Study, fit: &Fit, episodes: usize) -> Vec<Promise> {
        let stated = self.stated.as_ref().filter(|_| fit.model.parts.is_empty());
        let at = stated.unwrap_or(fit);
        let Fit { model, x, raw, residuals, jacobian: tuning, .. } = at;
        let moved = |Fit { model, x, raw, .. }: &Fit, change: &Vec<Vec<f64>>| -> Stack {
            part.white(&plus(raw.iter(), change), model.engine_errors(x))
        };
        let few = part.part(&self.scanned);
        let mut tuning_of_few: Vec<Stack> = tuning.iter().map(|column| pick(column, &self.scanned)).collect();
        let before = retuned(model, x, &pick(residuals, &self.scanned), &tuning_of_few);
        // Beside another effect changes are taken to add up.
        let mut best = |candidate: &Candidate, points: &[Point]| -> Option<(f64, Start)> {
            let before = before.as_ref()?.cost;
            let kept = without_clocks(part, candidate, &mut tuning_of_few);
            let gain = |point: &Point| -> Option<(f64, Start)> {
                let raw = plus(self.scanned.iter().map(|place| &raw[*place]), &point.change);
                // Clocks moved by as much as from where the scan began.
                let mut shared = x.clone();
                for (clock, to) in point.clocks.iter().enumerate() {
                    let [low, high] = model.range(clock);
                    shared[clock] = (x[clock] + to - self.clocks[clock]).clamp(low, high);
                }
                let white = few.white(&raw, model.engine_errors(&shared));
                let again = retuned(model, &shared, &white, &tuning_of_few)?;
                shared.iter_mut().zip(again.delta.iter()).for_each(|(x, d)| *x += d);
                Some((before - again.cost - prior(&point.own), Start { shared, own: point.own.clone() }))
            };
            let best =
                points.iter().filter_map(gain).filter(|(gain, _)| *gain > 0.0).max_by(|a, b| a.0.total_cmp(&b.0));
            kept.into_iter().for_each(|(clock, column)| tuning_of_few[clock] = column);
            best
        };
        // What was left out says as much again.
        let share = episodes as f64 / self.places.len() as f64;
        let share_of_few = episodes as f64 / self.scanned.len() as f64;
        let mut promises: Vec<Promise> = (self.screened.iter())
            .map(|Screened { candidate, columns, points }| {
                let (scanned, mut starts) =
                    best(candidate, points).map_or((0.0, Vec::new()), |(gain, start)| (gain, vec![start]));
                let scanned = scanned * share_of_few;
                let (columns, strengths) = match columns {
                    Columns::Whole(change) => {
                        let begin = candidate.begin.clone().unwrap_or_default();
                        let gain = share * (met(&fit.residuals, &moved(fit, change)) - begin.len() as f64);
                        let (candidate, beside) = (candidate.clone(), vec![0.0; x.len()]);
                        return Promise { candidate, gain, episodes, begin, beside, starts: Vec::new() };
                    }
                    Columns::Linear(columns) => (columns, candidate.strengths().collect::<Vec<usize>>()),
                };
                let column = |(change, index): (&Vec<Vec<f64>>, &usize)| -> Stack {
                    difference(&moved(at, change), residuals, reach(candidate, *index))
                };
                let white: Vec<Stack> = columns.iter().zip(&strengths).map(column).collect();
                // A clock that gives way jumps, whatever the strength: no step is linear then.
                let jumps = part.simulator.nominal.replaced_by(candidate.kind()).next().is_some();
                let (gain, mut beside) = if jumps {
                    (0.0, vec![0.0; x.len() + strengths.len()])
                } else {
                    let range = |index: usize| model.range(index);
                    linear(candidate, &strengths, x, residuals, (tuning, &range), &white)
                };
                let gain = share * gain;
                let mut begin = vec![0.0; candidate.coordinates.len()];
                for (index, a) in strengths.iter().zip(beside.split_off(x.len())) {
                    begin[*index] = a;
                }
                if stated.is_some() && gain > scanned {
                    let shared = x.iter().zip(&beside).map(|(x, d)| x + d).collect();
                    starts.push(Start { shared, own: begin.clone() });
                }
                // No step from where re-tuning has led.
                let beside = if stated.is_some() { vec![0.0; x.len()] } else { beside };
                Promise { candidate: candidate.clone(), gain: gain.max(scanned), episodes, begin, beside, starts }
            })
            .collect();
        promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        promises
    }
}

fn changes(after: &[Vec<f64>], before: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let less = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    after.iter().zip(before).map(less).collect()
}

fn plus<'a>(before: impl Iterator<Item = &'a Vec<f64>>, change: &[Vec<f64>]) -> Vec<Vec<f64>> {
    before.zip(change).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a + b).collect()).collect()
}

/// −ln prior of coordinates, but for a constant.
fn prior(x: &[f64]) -> f64 {
    0.5 * x.iter().map(|x| x * x).sum::<f64>()
}

/// The step from `x` by which re-tuning explains residuals best, as if they were linear: what another strength does re-tuning may have to make up for.
fn retuned(model: &Model, x: &[f64], residuals: &Stack, tuning: &[Stack]) -> Option<Minimum> {
    let columns: Vec<&Stack> = tuning.iter().collect();
    Linear::new(residuals, &columns).minimum(x, |index| model.range(index), 0.0)
}

/// Sets the derivatives by clocks that give way to a candidate to 0, and says what they were.
fn without_clocks(part: &Study, candidate: &Candidate, tuning: &mut [Stack]) -> Vec<(usize, Stack)> {
    let clocks = part.simulator.nominal.replaced_by(candidate.kind());
    let none = |clock: usize| {
        let kept = tuning[clock].clone();
        tuning[clock].iter_mut().for_each(|episode| episode.fill(0.0));
        (clock, kept)
    };
    clocks.map(none).collect()
}

/// Simulates strengths of a candidate, one coordinate after another: some either way, then a weaker or a stronger one than the best, and in the end the
/// best of all coordinates together. `before`: residuals of the nominal model; `tuning`: their derivatives by its coordinates.
fn scan(few: &Study, before: &[Vec<f64>], nominal: &Fit, tuning: &[Stack], candidate: &Candidate) -> Vec<Point> {
    if candidate.begin.is_some() {
        return Vec::new();
    }
    let mut beside = tuning.to_vec();
    without_clocks(few, candidate, &mut beside);
    let model = nominal.model.with(candidate);
    let cost = |x: &[f64], raw: &[Vec<f64>], tuning: &[Stack]| -> f64 {
        let white = few.white(raw, nominal.model.engine_errors(x));
        retuned(&nominal.model, x, &white, tuning).map_or(f64::INFINITY, |minimum| minimum.cost)
    };
    let mut points: Vec<(f64, Point)> = Vec::new();
    let look = |own: Vec<f64>| -> (f64, Point) {
        let mut x = [nominal.x.as_slice(), &own].concat();
        let (clocks, raw) = few.with_best_clocks(&model.hypothesis(&x));
        x.truncate(nominal.x.len());
        x[..clocks.len()].copy_from_slice(&clocks);
        (cost(&x, &raw, &beside) + prior(&own), Point { clocks, own, change: changes(&raw, before) })
    };
    let without = cost(&nominal.x, before, tuning);
    let mut together = vec![0.0; candidate.coordinates.len()];
    for index in candidate.strengths() {
        let at = |a: f64| {
            let [low, high] = candidate.coordinates[index].range;
            let mut own = vec![0.0; candidate.coordinates.len()];
            own[index] = a;
            (low..=high).contains(&a).then(|| look(own))
        };
        let mut own: Vec<(f64, Point)> = STRENGTHS.iter().flat_map(|a| [*a, -a]).filter_map(at).collect();
        let one_sided = candidate.coordinates[index].range.contains(&0.0);
        let best = |own: &[(f64, Point)]| -> Option<f64> {
            let best = own.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
            (best.0 < without).then(|| best.1.own[index])
        };
        // What has one side is looked at there at all of them: a strong effect need not show in a weaker one.
        let next = match best(&own) {
            _ if one_sided => BEYOND.to_vec(),
            Some(a) if a.abs() == STRENGTHS[1] => vec![BEYOND[1].copysign(a)],
            Some(a) => vec![BEYOND[0].copysign(a)],
            None => vec![BEYOND[0]],
        };
        let sides = |a: f64| if one_sided { vec![a, -a] } else { vec![a] };
        own.extend(next.into_iter().flat_map(sides).filter_map(at));
        together[index] = best(&own).unwrap_or(0.0);
        points.extend(own);
    }
    if together.iter().filter(|a| **a != 0.0).count() > 1 {
        points.push(look(together));
    }
    points.into_iter().map(|(_, point)| point).collect()
}

/// By how much a body in the way explains episodes better. One that neither explains says nothing: a millimetre beside its place an object that meets it
/// may go another way, but what went by freely still has to.
pub(crate) fn met(before: &Stack, after: &Stack) -> f64 {
    let gain = |(episode, (a, b)): (&DVector<f64>, (f64, f64))| {
        if likelihood::explained(episode) { a - b } else { (a - b).max(0.0) }
    };
    before.iter().zip(before.costs().into_iter().zip(after.costs())).map(gain).sum()
}

/// The change of a strength by which a linear step is measured; the other way where this is beyond the range.
fn reach(candidate: &Candidate, index: usize) -> f64 {
    let [low, high] = candidate.coordinates[index].range;
    if (low..=high).contains(&REACH) { REACH } else { -REACH }
}

/// The best of each kind, as many kinds as asked for; of what is tied to a place, or far from linear, two: a fit does not find the way from afar. Of a
/// body in the way two that move and two that do not: what either would do after a fit its promise does not say.
#[must_use]
pub fn shortlist(promises: &[Promise], count: usize) -> Vec<Promise> {
    use EffectKind as K;
    let mut variants: Vec<(EffectKind, bool)> = Vec::new();
    let mut list = Vec::new();
    for promise in promises.iter().filter(|promise| promise.gain > 0.0) {
        let variant = promise.candidate.variant();
        let kind = variant.0;
        let before = variants.iter().filter(|other| **other == variant).count();
        let several = matches!(kind, K::FrictionPatch | K::Restitution | K::Adhesion);
        let most = if several || promise.candidate.begin.is_some() { 2 } else { 1 };
        if before < most && (before > 0 || list.len() < count) {
            variants.push(variant);
            list.push(promise.clone());
        }
    }
    list
}

/// Pieces of the episodes to look at, which are evenly spread over those sorted by how badly the nominal model fails them. Of those that last much longer
/// than most only the worst may be among them: each costs as much as several others.
pub(crate) fn places(study: &Study, nominal: &Fit) -> Vec<usize> {
    let mut groups = study.groups();
    let ticks = |group: &Range<usize>| -> usize {
        group.clone().map(|place| study.simulator.trials[study.chosen[place]].ticks).sum()
    };
    let mean = groups.iter().map(ticks).sum::<usize>() as f64 / groups.len().max(1) as f64;
    let long = |group: &Range<usize>| ticks(group) as f64 > LONG * mean;
    let worst = by_failure(nominal, &groups).into_iter().find(|group| long(group));
    groups.retain(|group| !long(group) || Some(group) == worst.as_ref());
    let most = if study.simulator.nominal.has_tool() { EPISODES } else { EPISODES_THROWN };
    spread(nominal, &groups, most)
}

/// Episodes sorted by how badly a model fails them, the worst first.
fn by_failure(fit: &Fit, groups: &[Range<usize>]) -> Vec<Range<usize>> {
    let failure = |group: &Range<usize>| fit.residuals[group.clone()].iter().map(DVector::norm_squared).sum::<f64>();
    let mut order = groups.to_vec();
    order.sort_by(|a, b| failure(b).total_cmp(&failure(a)));
    order
}

/// Pieces of so many episodes, evenly spread over those sorted by how badly a model fails them.
fn spread(fit: &Fit, groups: &[Range<usize>], count: usize) -> Vec<usize> {
    let order = by_failure(fit, groups);
    let count = order.len().min(count);
    let mut places: Vec<usize> = (0..count).flat_map(|i| order[i * order.len() / count].clone()).collect();
    places.sort_unstable();
    places
}

/// What ln evidence gains by the strengths' columns beside re-tuning, of which `tuned` says the ranges; by how much what is re-tuned moves then, followed by the best values of the
/// strengths, held to their ranges.
fn linear(
    candidate: &Candidate,
    strengths: &[usize],
    z: &[f64],
    residuals: &Stack,
    (tuning, tuned): (&[Stack], &dyn Fn(usize) -> [f64; 2]),
    columns: &[Stack],
) -> (f64, Vec<f64>) {
    let all: Vec<&Stack> = tuning.iter().chain(columns).collect();
    let x: Vec<f64> = (0..all.len()).map(|i| z.get(i).copied().unwrap_or(0.0)).collect();
    let range = |index: usize| match index.checked_sub(tuning.len()) {
        Some(strength) => candidate.coordinates[strengths[strength]].range,
        None => tuned(index),
    };
    let linear = Linear::new(residuals, &all);
    let with = linear.minimum(&x, range, 0.0);
    let without = linear.minimum(&x, |index| if index < tuning.len() { range(index) } else { [0.0; 2] }, 0.0);
    match (with, without) {
        (Some(with), Some(without)) => {
            let evidence = |minimum: &Minimum| -minimum.cost - minimum.half_determinant;
            (evidence(&with) - evidence(&without), with.delta.iter().copied().collect())
        }
        _ => (0.0, vec![0.0; all.len()]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_step_moves_what_is_re_tuned_with_the_effect() {
        // Residuals that are linear in one tunable and one strength, at no noise and with columns far above the prior: the step is exact.
        let column = |f: fn(f64) -> f64| Stack::from(vec![DVector::from_fn(200, |row, _| 100.0 * f(row as f64))]);
        let (tuning, strength) = (column(|t| (0.1 * t).sin()), column(|t| (0.1 * t).sin() + (0.3 * t).cos()));
        // Re-tuning alone has gone to 2, where 0.5 less and an effect of 0.7 are right.
        let residuals = vec![&tuning[0] * 0.5 - &strength[0] * 0.7];
        let damping = candidate(EffectKind::ViscousDamping);
        let strengths: Vec<usize> = damping.strengths().collect();
        let (gain, step) =
            linear(&damping, &strengths, &[2.0], &residuals.into(), (&[tuning], &|_| [-8.0, 8.0]), &[strength]);
        assert!((step[0] + 0.5).abs() < 1e-2 && (step[1] - 0.7).abs() < 1e-2, "{step:?}");
        assert!(gain > 100.0, "{gain}");
    }

    fn candidate(kind: EffectKind) -> Candidate {
        let all = crate::candidate::candidates(&crate::candidate::tests::context());
        all.into_iter().find(|candidate| candidate.kind() == kind).unwrap()
    }

    #[test]
    fn what_met_a_body_may_go_another_way_and_what_went_by_may_not() {
        let episode = |size: f64| DVector::from_element(50, size);
        let gain = |before: f64, after: f64| met(&vec![episode(before)].into(), &vec![episode(after)].into());
        // A hit that is explained, one that neither explains, and a body that stands where something went by.
        assert!(gain(5.0, 1.0) > 50.0);
        assert_eq!(gain(3.0, 5.0), 0.0);
        assert!(gain(1.0, 5.0) < -50.0);
    }
}
