//! Where a body in the way explains most when it is simulated: votes place it to some millimetres, and an object that meets a body as much beside its place
//! goes another way.

use physics_model::effect::EffectConfig;

use super::{Place, RANGE_M, Seen, circles, climb};
use crate::budget::Budget;
use crate::candidate::bodies;
use crate::fit::Fit;
use crate::likelihood::{Stack, explained, mean_square};
use crate::screen::met;
use crate::study::Study;

/// Episodes that are simulated: of those that come near it the ones that the model without a body explains worst, and the nearest of the others.
const WORST: usize = 5;
const OTHERS: usize = 3;
/// How near, m, they come.
const NEAR_M: f64 = 0.025;
/// Distances, m, of a grid around what was voted; of its points those with most votes are simulated, at most so many, and so many of the best of them are moved.
/// Neighbours may end in different places.
const SPACING_M: f64 = 0.004;
const SIMULATED: usize = 40;
const MOVED: usize = 4;
/// Steps, m, by which they are moved and grown.
const STEPS_M: [f64; 3] = [0.003, 0.001_5, 0.000_7];
/// Simulated episodes after which the best so far is taken: the search for what is lacking needs the others.
const MOST: usize = 1000;

/// A body that was simulated.
#[derive(Clone, Copy)]
struct Tried {
    gain: f64,
    place: Place,
    /// Which of [`bodies`].
    body: usize,
}

/// Episodes with what the model without a body leaves of them.
struct Episodes<'a> {
    study: Study<'a>,
    before: Stack,
}

/// Where a simulated body near a place that was voted explains most, if that is another place. `null`: the model without one.
pub(crate) fn refined_place(study: &Study, null: &Fit, seen: &Seen, voted: Place) -> Option<Place> {
    let hypothesis = null.model.hypothesis(&null.x);
    let sizes = null.model.engine_errors(&null.x);
    let budget = Budget::new([MOST; 3]);
    let learnt = |places: Vec<usize>| {
        let mut study = study.part(&places).within(&budget);
        study.learn_errors(&hypothesis);
        let before = study.white(&study.raw(&hypothesis), sizes);
        Episodes { study, before }
    };
    let [worst, others] = near(study, null, seen, voted);
    let worst = learnt(worst);
    if worst.before.iter().all(explained) {
        return None;
    }
    let others = learnt(others);
    // What explains the worst less than something else does is not worth more simulations: beside the others it can only lose.
    let gain = |body: EffectConfig, least: f64| {
        let mut hypothesis = hypothesis.clone();
        hypothesis.effects.push(body);
        let of = |episodes: &Episodes| {
            let study = &episodes.study;
            met(&episodes.before, &study.white(&study.raw(&hypothesis), sizes))
        };
        let gain = of(&worst);
        let gain = if gain > least { gain + of(&others).min(0.0) } else { gain };
        if gain.is_finite() { gain } else { f64::NEG_INFINITY }
    };
    let tried = |place: Place, body: usize, least: f64| {
        let found = bodies(&place).nth(body).filter(|_| budget.has_fits())?;
        Some(Tried { gain: gain(found, least), place, body })
    };
    let mut found: Vec<Tried> = promising(seen, voted).into_iter().filter_map(|place| tried(place, 0, 0.0)).collect();
    sort(&mut found);
    let movable: Vec<Tried> = found.iter().take(2 * MOVED).filter_map(|fixed| tried(fixed.place, 1, 0.0)).collect();
    found.extend(movable);
    sort(&mut found);
    let begins = found.into_iter().take(MOVED).filter(|begin| begin.gain > 0.0);
    let moved = begins.map(|begin| descend(begin, tried));
    let best = moved.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    Some(best.place).filter(|place| *place != voted)
}

/// The best first.
fn sort(found: &mut [Tried]) {
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
}

/// Moves and grows a body by smaller and smaller steps as long as it explains more.
fn descend(begin: Tried, tried: impl Fn(Place, usize, f64) -> Option<Tried>) -> Tried {
    let around = |best: Tried, step_m: f64| {
        let ([x, y], radius_m) = best.place;
        let steps = [[step_m, 0.0, 0.0], [0.0, step_m, 0.0], [0.0, 0.0, step_m]].into_iter();
        let around = steps
            .flat_map(|[dx, dy, dr]| [1.0, -1.0].map(|sign| ([x + sign * dx, y + sign * dy], radius_m + sign * dr)));
        let within = around.filter(|place| (RANGE_M[0]..=RANGE_M[1]).contains(&place.1));
        within.filter_map(|place| tried(place, best.body, best.gain)).collect()
    };
    climb(begin, &STEPS_M, around, |tried| tried.gain)
}

/// Of a grid around a place those with most votes.
fn promising(seen: &Seen, place: Place) -> Vec<Place> {
    let circles = circles(place, SPACING_M, 2, RANGE_M);
    let mut voted: Vec<(f64, Place)> = circles.map(|place| (seen.votes(&place), place)).collect();
    voted.sort_by(|a, b| b.0.total_cmp(&a.0));
    voted.into_iter().take(SIMULATED).map(|(_, place)| place).collect()
}

/// Places in the study of the episodes that come near a body: those that the model leaves most of, and others.
fn near(study: &Study, null: &Fit, seen: &Seen, body: Place) -> [Vec<usize>; 2] {
    let white = study.white(&study.raw(&null.model.hypothesis(&null.x)), &[]);
    let apart_m = (0..study.chosen.len()).map(|place| seen.apart_m(place, body));
    let left: Vec<f64> = white.iter().map(|residuals| mean_square(std::slice::from_ref(residuals))).collect();
    choose(&left, &apart_m.collect::<Vec<_>>())
}

/// Of episodes, with what is left of each and how near it comes, the worst and the nearest of the others.
fn choose(left: &[f64], apart_m: &[f64]) -> [Vec<usize>; 2] {
    let mut near: Vec<usize> = (0..left.len()).filter(|place| apart_m[*place] < NEAR_M).collect();
    near.sort_by(|a, b| left[*b].total_cmp(&left[*a]));
    let mut others = near.split_off(WORST.min(near.len()));
    others.sort_by(|a, b| apart_m[*a].total_cmp(&apart_m[*b]));
    others.truncate(OTHERS);
    [near, others].map(|mut places| {
        places.sort_unstable();
        places
    })
}

#[cfg(test)]
mod tests {
    use super::super::distance;
    use super::*;

    #[test]
    fn the_worst_of_those_near_are_simulated_and_the_nearest_of_the_others() {
        let left = [9.0, 1.0, 1.1, 3.0, 8.0, 1.2, 2.0, 1.3, 7.0, 1.4];
        let apart_m = [0.5, 0.02, 0.01, -0.001, 0.0, 0.003, 0.001, f64::INFINITY, 0.002, 0.024];
        // 0 and 7 do not come near; of 1, 2 and 5, whatever they leave, all are left over.
        assert_eq!(choose(&left, &apart_m), [vec![3, 4, 6, 8, 9], vec![1, 2, 5]]);
        assert!(choose(&[2.0], &[0.03]).concat().is_empty());
    }

    #[test]
    fn a_descent_ends_where_a_body_explains_most() {
        let best = ([0.103, -0.047], 0.021);
        let gain =
            |(place, radius_m): Place| 100.0 - 1e6 * (distance(place, best.0).powi(2) + (radius_m - best.1).powi(2));
        let tried = |place: Place, body: usize, _: f64| Some(Tried { gain: gain(place), place, body });
        let begin = tried(([0.095, -0.04], 0.03), 1, 0.0).unwrap();
        let found = descend(begin, tried);
        assert!(distance(found.place.0, best.0) < 0.0007 && (found.place.1 - best.1).abs() < 0.0007);
        assert_eq!(found.body, 1);
        // Out of budget it stays where it is.
        assert_eq!(descend(begin, |_, _, _| None).place, begin.place);
    }
}
