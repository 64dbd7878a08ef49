//! Which effects could explain what the re-tuned nominal model leaves.
//!
//! For each candidate a linear step, measured near the nominal model, and a scan of its strengths over what is plausible: what rolls, slides off or meets
//! a tool elsewhere is no multiple of what a slight effect does. Clocks are set anew at each point of a scan, which costs no simulation: without the effect they
//! may have been re-tuned to stand for it.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use physics_model::EffectKind;

use crate::candidate::Candidate;
use crate::fit::{Fit, cost};
use crate::likelihood::{self, Stack, dot, pick, weights};
use crate::study::{Study, difference};

/// Episodes that the screening looks at, at most.
const EPISODES: usize = 10;
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
/// ... and, from the best of those, weaker or stronger ones.
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
    /// By how much the coordinates of the model without it would move then.
    pub beside: Vec<f64>,
    /// The best point of the scan, if it gains anything.
    pub(crate) start: Option<Start>,
}

/// Where a fit may begin.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Start {
    /// Coordinates of the clocks.
    pub(crate) clocks: Vec<f64>,
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
    start: Start,
    change: Vec<Vec<f64>>,
}

impl Screening {
    /// Simulates every candidate near the re-tuned nominal model in the episodes of `part`, which are those at `places` of all.
    #[must_use]
    pub fn new(part: &Study, places: Vec<usize>, nominal: &Fit, candidates: &[Candidate]) -> Self {
        let hypothesis = nominal.model.hypothesis(&nominal.x);
        let base = part.raw(&hypothesis);
        let scanned = spread(nominal, &part.groups(), SCANNED);
        let few = part.part(&scanned);
        let columns = |candidate: &Candidate| {
            let change = |a: &[f64]| -> Vec<Vec<f64>> {
                let mut hypothesis = hypothesis.clone();
                hypothesis.effects.push(candidate.effect(a));
                changes(&part.raw(&hypothesis), &base)
            };
            match &candidate.begin {
                Some(begin) => Columns::Whole(change(begin)),
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
        let points =
            |candidate: &Candidate| if has_tool { scan(&few, &before, nominal, candidate) } else { Vec::new() };
        let one = |candidate: &Candidate| Screened {
            columns: columns(candidate),
            points: points(candidate),
            candidate: candidate.clone(),
        };
        let screened = candidates.iter().map(one).collect();
        Self { places, scanned, screened }
    }

    /// What each candidate would bring in so many episodes beside what `fit` has; the most promising first. `part` and `fit` know the episodes of the
    /// screening alone.
    #[must_use]
    pub fn promises(&self, part: &Study, fit: &Fit, episodes: usize) -> Vec<Promise> {
        let Fit { model, x, raw, residuals, jacobian: tuning, .. } = fit;
        let moved = |change: &Vec<Vec<f64>>| -> Stack { part.white(&plus(raw.iter(), change), model.engine_errors(x)) };
        let few = part.part(&self.scanned);
        let before = cost(x, &pick(residuals, &self.scanned));
        // Beside another effect changes are taken to add up.
        let best = |points: &[Point]| -> Option<(f64, Start)> {
            let gain = |point: &Point| {
                let raw = plus(self.scanned.iter().map(|place| &raw[*place]), &point.change);
                let mut x = x.clone();
                x[..point.start.clocks.len()].copy_from_slice(&point.start.clocks);
                let white = few.white(&raw, model.engine_errors(&x));
                x.extend(&point.start.own);
                before - cost(&x, &white)
            };
            let gains = points.iter().map(|point| (gain(point), point.start.clone()));
            gains.filter(|(gain, _)| *gain > 0.0).max_by(|a, b| a.0.total_cmp(&b.0))
        };
        // What was left out says as much again.
        let share = episodes as f64 / self.places.len() as f64;
        let share_of_few = episodes as f64 / self.scanned.len() as f64;
        let mut promises: Vec<Promise> = (self.screened.iter())
            .map(|Screened { candidate, columns, points }| {
                let (gain, begin, beside) = match columns {
                    Columns::Whole(change) => {
                        let begin = candidate.begin.clone().unwrap_or_default();
                        (met(residuals, &moved(change)) - begin.len() as f64, begin, vec![0.0; x.len()])
                    }
                    Columns::Linear(columns) => {
                        let strengths: Vec<usize> = candidate.strengths().collect();
                        let reach = |index: &usize| reach(candidate, *index);
                        let white: Vec<Stack> = (columns.iter().zip(&strengths))
                            .map(|(change, index)| difference(&moved(change), residuals, reach(index)))
                            .collect();
                        let (gain, mut beside) = linear(candidate, &strengths, x, residuals, tuning, &white);
                        let mut begin = vec![0.0; candidate.coordinates.len()];
                        for (index, a) in strengths.iter().zip(beside.split_off(x.len())) {
                            begin[*index] = a;
                        }
                        (gain, begin, beside)
                    }
                };
                let (scanned, start) = best(points).map_or((0.0, None), |(gain, start)| (gain, Some(start)));
                let gain = (gain * share).max(scanned * share_of_few);
                Promise { candidate: candidate.clone(), gain, episodes, begin, beside, start }
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

/// Simulates strengths of a candidate, one coordinate after another: some either way, then a weaker or a stronger one than the best, and in the end the
/// best of all coordinates together. `before`: residuals of the nominal model.
fn scan(few: &Study, before: &[Vec<f64>], nominal: &Fit, candidate: &Candidate) -> Vec<Point> {
    if candidate.begin.is_some() {
        return Vec::new();
    }
    let model = nominal.model.with(candidate);
    let mut points: Vec<(f64, Point)> = Vec::new();
    let look = |own: Vec<f64>| -> (f64, Point) {
        let mut x = [nominal.x.as_slice(), &own].concat();
        let (clocks, raw) = few.with_best_clocks(&model.hypothesis(&x));
        x[..clocks.len()].copy_from_slice(&clocks);
        let cost = cost(&x, &few.white(&raw, model.engine_errors(&x)));
        (cost, Point { start: Start { clocks, own }, change: changes(&raw, before) })
    };
    let without = cost(&nominal.x, &few.white(before, nominal.model.engine_errors(&nominal.x)));
    let mut together = vec![0.0; candidate.coordinates.len()];
    for index in candidate.strengths() {
        let at = |a: f64| {
            let [low, high] = candidate.coordinates[index].range;
            let mut own = vec![0.0; candidate.coordinates.len()];
            own[index] = a;
            (low..=high).contains(&a).then(|| look(own))
        };
        let mut own: Vec<(f64, Point)> = STRENGTHS.iter().flat_map(|a| [*a, -a]).filter_map(at).collect();
        let best = |own: &[(f64, Point)]| -> Option<f64> {
            let best = own.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
            (best.0 < without).then(|| best.1.start.own[index])
        };
        let next = match best(&own) {
            Some(a) if a.abs() == STRENGTHS[1] => BEYOND[1].copysign(a),
            Some(a) => BEYOND[0].copysign(a),
            None => BEYOND[0],
        };
        own.extend(at(next));
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

/// What ln evidence gains by the strengths' columns beside re-tuning; by how much what is re-tuned moves then, followed by the best values of the
/// strengths, held to their ranges.
fn linear(
    candidate: &Candidate,
    strengths: &[usize],
    z: &[f64],
    residuals: &Stack,
    tuning: &[Stack],
    columns: &[Stack],
) -> (f64, Vec<f64>) {
    let all: Vec<&Stack> = tuning.iter().chain(columns).collect();
    let (k, n) = (tuning.len(), all.len());
    let weights = weights(residuals);
    let gram = DMatrix::from_fn(n, n, |i, j| dot(all[i], all[j], &weights) + f64::from(u8::from(i == j)));
    let x: Vec<f64> = (0..n).map(|i| z.get(i).copied().unwrap_or(0.0)).collect();
    let slope = DVector::from_fn(n, |i, _| dot(all[i], residuals, &weights) + x[i]);
    // What it would cost if residuals were linear: their squares do not tell how much an odd episode may say.
    let cost_at = |delta: &DVector<f64>| {
        let mut moved = residuals.clone();
        for (column, d) in all.iter().zip(delta.iter()) {
            moved.iter_mut().zip(column.iter()).for_each(|(r, c)| r.axpy(*d, c, 1.0));
        }
        let prior: f64 = x.iter().zip(delta.iter()).map(|(x, d)| (x + d) * (x + d)).sum();
        likelihood::cost(&moved) + 0.5 * prior
    };
    let gain = |kept: &[usize], held: &DVector<f64>| -> Option<(f64, DVector<f64>)> {
        let m = kept.len();
        let a = DMatrix::from_fn(m, m, |i, j| gram[(kept[i], kept[j])]);
        let b = DVector::from_fn(m, |i, _| {
            -(slope[kept[i]] + (0..n).filter(|j| !kept.contains(j)).map(|j| gram[(kept[i], j)] * held[j]).sum::<f64>())
        });
        let cholesky = a.cholesky()?;
        let mut delta = held.clone();
        for (i, value) in kept.iter().zip(cholesky.solve(&b).iter()) {
            delta[*i] = *value;
        }
        Some((-cost_at(&delta) - cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>(), delta))
    };
    let nothing = DVector::zeros(n);
    let without = if k == 0 {
        -cost_at(&nothing)
    } else {
        gain(&(0..k).collect::<Vec<_>>(), &nothing).map_or(-cost_at(&nothing), |(gain, _)| gain)
    };
    let mut held = nothing.clone();
    let mut kept: Vec<usize> = (0..n).collect();
    let mut best = gain(&kept, &held);
    // What leaves its range is held at the border.
    if let Some((_, delta)) = &best {
        let mut changed = false;
        for (j, index) in strengths.iter().enumerate() {
            let [low, high] = candidate.coordinates[*index].range;
            let value = delta[k + j];
            if value < low || value > high {
                held[k + j] = value.clamp(low, high);
                kept.retain(|i| *i != k + j);
                changed = true;
            }
        }
        if changed {
            best = gain(&kept, &held);
        }
    }
    match best {
        Some((gain, delta)) => (gain - without, delta.iter().copied().collect()),
        None => (0.0, vec![0.0; n]),
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
        let (gain, step) = linear(&damping, &strengths, &[2.0], &residuals.into(), &[tuning], &[strength]);
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
