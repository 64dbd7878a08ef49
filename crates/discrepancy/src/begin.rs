//! Where fits begin: a descent finds the nearest optimum, not the best one.

use nalgebra::{DMatrix, DVector};
use physics_model::{EffectConfig, EffectKind};

use crate::candidate::Candidate;
use crate::fit::{Begin, Effort, Fit, cost, fit};
use crate::likelihood::Stack;
use crate::model::Model;
use crate::screen::{Promise, Start};
use crate::simulator::Hypothesis;
use crate::study::Study;

/// An effect can do what another does if it leaves less than this of the change's squares.
const MOST: f64 = 0.5;

/// A linear step that moves a tunable by more than this, in standard deviations of its prior, is tried with what it moves.
const FAR: f64 = 1.0;

/// A mass this many standard deviations from its prior's mean may stand for something else.
const FAR_TUNED: f64 = 2.0;

/// Fits anew from other strengths of the last effect, if one of them is better than where the fit is.
pub(crate) fn shake(part: &Study, best: &mut Fit) {
    let Some(candidate) = best.model.parts.last().filter(|part| part.begin.is_none()) else { return };
    let first = best.x.len() - candidate.coordinates.len();
    for share in [0.5, 1.5] {
        let mut x = best.x.clone();
        for index in candidate.strengths() {
            let [low, high] = candidate.coordinates[index].range;
            x[first + index] = (share * x[first + index]).clamp(low, high);
        }
        let raw = part.raw(&best.model.hypothesis(&x));
        if cost(&x, &part.white(&raw, best.model.engine_errors(&x))) < best.cost() {
            let begin = Begin { x, raw: Some(raw), jacobian: Vec::new() };
            let again = fit(part, best.model.clone(), begin, Effort::Quick);
            if again.log_evidence() > best.log_evidence() {
                *best = again;
            }
            return;
        }
    }
}

/// Pairs of effects that do nearly the same: what one does at some strength, the other does at another.
const TWINS: [[EffectKind; 2]; 11] = [
    [EffectKind::TableTilt, EffectKind::ConstantForce],
    [EffectKind::Tether, EffectKind::TableTilt],
    [EffectKind::Tether, EffectKind::ConstantForce],
    [EffectKind::ViscousDamping, EffectKind::QuadraticDrag],
    [EffectKind::ForceBias, EffectKind::WristPayload],
    [EffectKind::PoseScale, EffectKind::TimeBase],
    [EffectKind::PoseDelay, EffectKind::ActuationDelay],
    [EffectKind::ForceDelay, EffectKind::ForceLowPass],
    [EffectKind::FrictionLevel, EffectKind::ForceGain],
    // Of a workspace that lies to one side of the origin.
    [EffectKind::PoseOffset, EffectKind::PoseScale],
    [EffectKind::PoseOffset, EffectKind::PoseRotation],
];

/// Whether two kinds of effects do nearly the same.
pub(crate) fn are_twins(kinds: [EffectKind; 2]) -> bool {
    TWINS.iter().any(|twins| *twins == kinds || *twins == [kinds[1], kinds[0]])
}

/// The same of their names.
#[must_use]
pub fn are_twins_by_name(names: [&str; 2]) -> bool {
    let [a, b] = names.map(str::parse::<EffectKind>);
    a.is_ok_and(|a| b.is_ok_and(|b| are_twins([a, b])))
}

/// −ln posterior where the last effect of `model` does what that of `best` does, its twin, and a fit can begin.
pub(crate) fn follow(part: &Study, best: &Fit, model: &Model) -> Option<(f64, Begin)> {
    let (found, candidate) = (best.model.parts.last()?, model.parts.last()?);
    let (shared, own) = best.x.split_at(best.x.len() - found.coordinates.len());
    let z = &shared[..best.model.tunables];
    let has_tool = part.simulator.nominal.has_tool();
    let begin = match (found.effect(own), candidate.kind()) {
        // Exactly: a slope s pulls at a mass m with m g s.
        (EffectConfig::ConstantForce(force), EffectKind::TableTilt) => {
            let weight_n = weight_n(part, z);
            candidate.coordinates_of(&[force.force_x_n / weight_n, force.force_y_n / weight_n])
        }
        (EffectConfig::TableTilt(tilt), EffectKind::ConstantForce) => {
            let weight_n = weight_n(part, z);
            candidate.coordinates_of(&[tilt.slope_x_rad * weight_n, tilt.slope_y_rad * weight_n])
        }
        // What the spring pulls with where objects begin.
        (EffectConfig::Tether(tether), EffectKind::ConstantForce | EffectKind::TableTilt) => {
            let [x, y] = mean(starts(part));
            let pull = [x - tether.anchor_x_m, y - tether.anchor_y_m].map(|off| -tether.stiffness_npm * off);
            let weight_n = if candidate.kind() == EffectKind::TableTilt { weight_n(part, z) } else { 1.0 };
            candidate.coordinates_of(&pull.map(|force_n| force_n / weight_n))
        }
        // In free flight distances read s times as long are what a clock r times as fast reads, s = 1 / r².
        (EffectConfig::TimeBase(clock), EffectKind::PoseScale) if !has_tool => {
            candidate.coordinates_of(&[clock.rate.powi(-2)])
        }
        (EffectConfig::PoseScale(pose), EffectKind::TimeBase) if !has_tool => {
            candidate.coordinates_of(&[pose.scale.powf(-0.5)])
        }
        (EffectConfig::PoseOffset(pose), EffectKind::PoseScale) => {
            let offset = [pose.offset_x_m, pose.offset_y_m];
            candidate.coordinates_of(&[1.0 + as_multiple(starts(part), offset)?])
        }
        (EffectConfig::PoseOffset(pose), EffectKind::PoseRotation) => {
            let offset = [pose.offset_x_m, pose.offset_y_m];
            candidate.coordinates_of(&[as_multiple(starts(part).map(turned), offset)?])
        }
        (EffectConfig::PoseScale(pose), EffectKind::PoseOffset) => {
            let [x, y] = as_offset(starts(part), pose.scale - 1.0)?;
            candidate.coordinates_of(&[x, y, 0.0])
        }
        (EffectConfig::PoseRotation(pose), EffectKind::PoseOffset) => {
            let [x, y] = as_offset(starts(part).map(turned), pose.yaw_rad)?;
            candidate.coordinates_of(&[x, y, 0.0])
        }
        _ => translate(part, z, (found, own), candidate)?,
    };
    let at = |share: f64| {
        let own = begin.iter().zip(&candidate.coordinates).map(|(a, c)| (share * a).clamp(c.range[0], c.range[1]));
        let x: Vec<f64> = shared.iter().copied().chain(own).collect();
        let raw = part.raw(&model.hypothesis(&x));
        let cost = cost(&x, &part.white(&raw, model.engine_errors(&x)));
        (cost, Begin { x, raw: Some(raw), jacobian: Vec::new() })
    };
    [1.0, 1.5, 2.25].map(at).into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Where the object begins in each episode, x and y.
fn starts<'a>(part: &'a Study) -> impl Iterator<Item = [f64; 2]> + Clone + use<'a> {
    part.chosen.iter().map(|index| {
        let [x, y, _] = part.simulator.trials[*index].start.position_m;
        [x, y]
    })
}

/// Where a place goes when it is turned about the origin, for each radian of a small angle.
fn turned([x, y]: [f64; 2]) -> [f64; 2] {
    [-y, x]
}

fn mean(places: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    let (count, [x, y]) = places.fold((0.0, [0.0; 2]), |(n, [x, y]), place| (n + 1.0, [x + place[0], y + place[1]]));
    [x, y].map(|sum| sum / f64::max(count, 1.0))
}

fn squared([x, y]: [f64; 2]) -> f64 {
    x * x + y * y
}

/// The multiple of `ways` that comes nearest to the same offset everywhere, by least squares; `None` where it cannot do most of it.
fn as_multiple(ways: impl Iterator<Item = [f64; 2]> + Clone, offset: [f64; 2]) -> Option<f64> {
    let squares: f64 = ways.clone().map(squared).sum();
    let multiple = ways.clone().map(|[x, y]| x * offset[0] + y * offset[1]).sum::<f64>() / squares;
    let left: f64 = ways.map(|[x, y]| squared([offset[0] - multiple * x, offset[1] - multiple * y])).sum();
    let all = (left + multiple * multiple * squares).max(f64::MIN_POSITIVE);
    (multiple.is_finite() && left < MOST * all).then_some(multiple)
}

/// The offset that comes nearest to a multiple of `ways`, likewise.
fn as_offset(ways: impl Iterator<Item = [f64; 2]> + Clone, multiple: f64) -> Option<[f64; 2]> {
    let middle = mean(ways.clone());
    let (left, all) = ways.fold((0.0, f64::MIN_POSITIVE), |(left, all), way| {
        (left + squared([way[0] - middle[0], way[1] - middle[1]]), all + squared(way))
    });
    (left < MOST * all).then_some(middle.map(|way| multiple * way))
}

/// Weight of the object, N.
fn weight_n(part: &Study, z: &[f64]) -> f64 {
    let nominal = part.simulator.nominal;
    nominal.object(z, 0.0, &part.engine).mass_kg * nominal.header().gravity_mps2
}

/// Where the friction does what re-tuning had to make the object heavier or lighter for: a slow push feels their product. `None` where the mass is about
/// what it was taken for, or where the friction is re-tuned, too.
fn friction_for_mass(part: &Study, base: &Fit, candidate: &Candidate) -> Option<Vec<f64>> {
    let nominal = part.simulator.nominal;
    let place = nominal.tunables.iter().position(|tunable| tunable.key == "object.mass_kg")?;
    let z = base.x[place];
    if candidate.kind() != EffectKind::FrictionLevel || nominal.tunes("table.friction") || z.abs() < FAR_TUNED {
        return None;
    }
    let mass_kg = |z| nominal.tunables[place].value(z);
    // Known weights press on the table as well.
    let added_kg = part.chosen.iter().map(|place| part.simulator.trials[*place].added_mass_kg).sum::<f64>()
        / part.chosen.len().max(1) as f64;
    let ratio = (mass_kg(z) + added_kg) / (mass_kg(0.0) + added_kg);
    let mut x = base.x.clone();
    x[place] = 0.0;
    x.extend(candidate.coordinates_of(&[ratio * nominal.header().table.friction.mean()]));
    Some(x)
}

/// Delays that begin where re-tuning had a clock late for them, and beyond, where no clock goes. None where it is not late.
fn delay_for_clock<'a>(
    part: &'a Study,
    base: &'a Fit,
    candidate: &'a Candidate,
) -> impl Iterator<Item = Vec<f64>> + 'a {
    let nominal = part.simulator.nominal;
    nominal.replaced_by(candidate.kind()).flat_map(move |clock| {
        let late_secs = nominal.tunables[clock].value(base.x[clock]);
        let longer: &[f64] = if late_secs > 0.0 { &[1.0, 1.5, 2.25] } else { &[] };
        longer.iter().map(move |share| {
            let mut x = base.x.clone();
            x[clock] = 0.0;
            x.extend(candidate.coordinates_of(&[share * late_secs]));
            x
        })
    })
}

/// Where a candidate does what re-tuning had to do in its place.
fn in_place(part: &Study, base: &Fit, candidate: &Candidate) -> Vec<Vec<f64>> {
    friction_for_mass(part, base, candidate).into_iter().chain(delay_for_clock(part, base, candidate)).collect()
}

/// What re-tuning did in the place of an effect is what that promises, if it is more than what a small step does.
pub(crate) fn promise_in_place(part: &Study, base: &Fit, promises: &[Promise]) -> Vec<Promise> {
    let mut promises = promises.to_vec();
    for promise in &mut promises {
        let model = base.model.with(&promise.candidate);
        let share = promise.episodes as f64 / part.chosen.len() as f64;
        let gains = (in_place(part, base, &promise.candidate).into_iter())
            .map(|x| share * (base.cost() - simulated(part, &model, x).cost));
        promise.gain = gains.fold(promise.gain, f64::max);
    }
    promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    promises
}

/// What was compared before promises what it gains where it was then: beside another effect the changes of a scan do not add up.
pub(crate) fn promise_known(part: &Study, base: &Fit, mut promises: Vec<Promise>, known: &[Fit]) -> Vec<Promise> {
    if base.model.parts.is_empty() {
        return promises;
    }
    let mut variants = Vec::new();
    for (candidate, own) in known.iter().filter_map(Fit::added) {
        let Some(promise) = promises.iter_mut().find(|promise| promise.candidate == *candidate) else { continue };
        if candidate.begin.is_some() || variants.contains(&candidate.variant()) {
            continue;
        }
        variants.push(candidate.variant());
        let x = [base.x.as_slice(), own].concat();
        let gained = base.cost() - simulated(part, &base.model.with(candidate), x).cost;
        let gain = gained * promise.episodes as f64 / part.chosen.len() as f64;
        if gain > promise.gain {
            promise.gain = gain;
            promise.starts = vec![Start { shared: Vec::new(), own: own.to_vec() }];
        }
    }
    promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    promises
}

/// Coordinates that were simulated.
struct Place {
    cost: f64,
    x: Vec<f64>,
    raw: Vec<Vec<f64>>,
}

fn simulated(part: &Study, model: &Model, x: Vec<f64>) -> Place {
    let raw = part.raw(&model.hypothesis(&x));
    Place { cost: cost(&x, &part.white(&raw, model.engine_errors(&x))), x, raw }
}

/// The linear step of the screening as far as it helps: large effects are not linear. `stated`: where the screening began, if not at `base`.
pub(crate) fn begin(part: &Study, base: &Fit, stated: Option<&Fit>, model: &Model, promise: &Promise) -> Begin {
    let at = |share: f64| -> Vec<f64> {
        let own = promise.begin.iter().map(|a| if promise.candidate.begin.is_some() { *a } else { share * a });
        base.x.iter().copied().chain(own).collect()
    };
    let promised = promise.gain * part.chosen.len() as f64 / promise.episodes as f64;
    let before = base.cost();
    let simulated = |x: Vec<f64>| simulated(part, model, x);
    // Where re-tuning has gone far to do what an effect does, neither is right without the other.
    let together = |share: f64| -> Vec<f64> {
        let moved = base.x.iter().zip(&promise.beside).enumerate().map(|(index, (x, d))| {
            let [low, high] = model.range(index);
            (x + share * d).clamp(low, high)
        });
        moved.chain(promise.begin.iter().map(|a| share * a)).collect()
    };
    let good = |place: &Place| before - place.cost > 0.5 * promised;
    let mut tried: Vec<Place> = Vec::new();
    // Without the effect nothing is lost: a fit goes from there as far as it finds.
    let changes_nothing = promise.candidate.kind() != EffectKind::Restitution
        && part.simulator.nominal.replaced_by(promise.candidate.kind()).next().is_none();
    if promise.candidate.begin.is_none() && changes_nothing {
        tried.push(Place { cost: before, x: at(0.0), raw: base.raw.clone() });
    }
    for start in &promise.starts {
        let mut x = [base.x.as_slice(), &start.own].concat();
        x[..start.shared.len()].copy_from_slice(&start.shared);
        tried.push(simulated(x));
    }
    // From a border, where a strength may have no more effect, a fit does not find back.
    let at_border = (promise.begin.iter().zip(&promise.candidate.coordinates))
        .any(|(a, coordinate)| coordinate.strength && *a != 0.0 && coordinate.range.contains(a));
    let whole = if at_border { 0.5 } else { 1.0 };
    // Beside another effect, which has taken its share of what this one does, too.
    if !base.model.parts.is_empty() && promise.candidate.begin.is_none() {
        tried.push(simulated(together(whole)));
    }
    if !tried.iter().any(good) {
        for share in [whole, 0.4 * whole, 0.1 * whole] {
            tried.push(simulated(at(share)));
            if promise.candidate.begin.is_some() || (share < whole && tried.last().is_some_and(good)) {
                break;
            }
        }
    }
    if base.model.parts.is_empty() && promise.beside.iter().take(model.tunables).any(|d| d.abs() > FAR) {
        tried.extend([whole, 0.4 * whole].map(|share| simulated(together(share))));
    }
    let clips = promise.candidate.kind() == EffectKind::ForceSaturation;
    // Every bounce more or less is a ridge, whatever a scan promises of one.
    let bounces = promise.candidate.kind() == EffectKind::Restitution;
    if clips || bounces || !tried.iter().any(good) {
        for own in promise.candidate.elsewhere() {
            tried.push(simulated(base.x.iter().chain(&own).copied().collect()));
            // What re-tuning moved far to do what a sensor does is back where it was without it.
            if clips && base.x.iter().take(model.tunables).any(|z| z.abs() > FAR_TUNED) {
                let others = base.x.iter().skip(model.tunables);
                let back = std::iter::repeat_n(&0.0, model.tunables).chain(others);
                tried.push(simulated(back.chain(&own).copied().collect()));
            }
        }
    }
    tried.extend(in_place(part, base, &promise.candidate).into_iter().map(simulated));
    let best = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let Place { mut x, raw, .. } = best.unwrap_or_else(|| simulated(at(0.0)));
    // Derivatives of what is nearer.
    let far = |from: &Fit| -> f64 { from.x.iter().zip(&x).take(model.tunables).map(|(a, b)| (a - b).powi(2)).sum() };
    let nearer = stated.filter(|stated| far(stated) < far(base)).unwrap_or(base);
    let jacobian = beside(part, nearer, &promise.candidate);
    for clock in part.simulator.nominal.replaced_by(promise.candidate.kind()) {
        x[clock] = 0.0;
    }
    Begin { x, raw: Some(raw), jacobian }
}

/// Where a fit to all episodes begins: at one to some of them, with the derivatives of what the model was without its last effect. Steps mend those.
pub(crate) fn in_all(study: &Study, base: &Fit, some: &Fit) -> Begin {
    let jacobian = some.model.parts.last().map_or_else(Vec::new, |candidate| beside(study, base, candidate));
    Begin { x: some.x.clone(), raw: None, jacobian }
}

/// Derivatives by the coordinates of a model beside a candidate: a clock that gives way to it is not skewed, and changes nothing.
fn beside(study: &Study, base: &Fit, candidate: &Candidate) -> Vec<Stack> {
    let mut jacobian = base.jacobian.clone();
    for clock in study.simulator.nominal.replaced_by(candidate.kind()) {
        jacobian[clock].iter_mut().for_each(|episode| episode.fill(0.0));
    }
    jacobian
}

/// Coordinates at which `other` does roughly what `found` does at its coordinates `a`, beside the nominal model re-tuned to `z`; `None` where it
/// cannot do most of it. What one unit does is taken to be linear.
fn translate(part: &Study, z: &[f64], found: (&Candidate, &[f64]), other: &Candidate) -> Option<Vec<f64>> {
    let flat = |effects| -> DVector<f64> {
        let raw = part.raw(&Hypothesis { z: z.to_vec(), effects });
        DVector::from_iterator(raw.iter().map(Vec::len).sum(), raw.into_iter().flatten())
    };
    let base = flat(Vec::new());
    let change = flat(vec![found.0.effect(found.1)]) - &base;
    let strengths: Vec<usize> = other.strengths().collect();
    let slope = |index: &usize| {
        let [low, high] = other.coordinates[*index].range;
        let by = if high >= -low { high.min(1.0) } else { low.max(-1.0) };
        let mut a = vec![0.0; other.coordinates.len()];
        a[*index] = by;
        (flat(vec![other.effect(&a)]) - &base) / by
    };
    let slopes: Vec<DVector<f64>> = strengths.iter().map(slope).collect();
    let n = slopes.len();
    let gram = DMatrix::from_fn(n, n, |i, j| slopes[i].dot(&slopes[j]));
    let solution = gram.cholesky()?.solve(&DVector::from_fn(n, |i, _| slopes[i].dot(&change)));
    let mut coordinates = vec![0.0; other.coordinates.len()];
    let mut left = change.clone();
    for ((index, slope), value) in strengths.iter().zip(&slopes).zip(solution.iter()) {
        let [low, high] = other.coordinates[*index].range;
        coordinates[*index] = value.clamp(low, high);
        left.axpy(-coordinates[*index], slope, 1.0);
    }
    (left.norm_squared() < MOST * change.norm_squared()).then_some(coordinates)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_the_origin_a_frame_that_is_off_looks_like_an_offset() {
        let far = [[0.5, 0.05], [0.5, -0.05], [0.45, 0.0], [0.55, 0.0]];
        let near = |found: f64, expected: f64| (found - expected).abs() < 0.02 * expected.abs();
        // A scale of 0.95 moves what is half a metre away by 25 mm.
        assert!(near(as_multiple(far.into_iter(), [-0.025, 0.0]).unwrap(), -0.05));
        assert!(near(as_multiple(far.into_iter().map(turned), [0.0, 0.01]).unwrap(), 0.02));
        assert!(near(as_offset(far.into_iter(), -0.05).unwrap()[0], -0.025));
        assert!(near(as_offset(far.into_iter().map(turned), 0.02).unwrap()[1], 0.01));
        // To the side it does not, and about the origin neither.
        assert!(as_multiple(far.into_iter(), [0.0, 0.01]).is_none());
        let about = [[0.05, 0.0], [-0.05, 0.0], [0.0, 0.05], [0.0, -0.05]];
        assert!(as_multiple(about.into_iter(), [0.01, 0.0]).is_none() && as_offset(about.into_iter(), 0.05).is_none());
        assert!(as_multiple(std::iter::empty(), [0.01, 0.0]).is_none());
    }
}
