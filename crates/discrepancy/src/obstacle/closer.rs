//! Where a body in the way explains most when it is simulated: votes place it to some millimetres, and an object that meets a body as much beside its place
//! goes another way.

use physics_model::effect::EffectConfig;

use super::{Place, RANGE_M, Seen};
use crate::candidate::bodies;
use crate::fit::Fit;
use crate::likelihood::mean_square;
use crate::screen::{EXPLAINED, met};
use crate::study::Study;

/// Episodes that are simulated: of those that come near it the ones that the model without a body explains worst, and the nearest of the others.
const FAILED: usize = 5;
const PASSED: usize = 3;
/// How near, m, they come.
const NEAR_M: f64 = 0.025;
/// Distances, m, of a grid around what was voted; of its points those with most votes are simulated, at most so many, and the best of them are moved.
const GRID_M: f64 = 0.004;
const SIMULATED: usize = 40;
const MOVED: usize = 4;
/// Steps, m, by which they are moved and grown.
const FINER_M: [f64; 3] = [0.003, 0.001_5, 0.000_7];

/// A place, as far as simulations tell.
#[derive(Clone, Copy)]
struct Scored {
    gain: f64,
    place: Place,
    /// Which of [`bodies`] explains most.
    body: usize,
}

/// Where a simulated body near a place that was voted explains most, if that is another place. `null`: the model without one.
pub(crate) fn closer(study: &Study, null: &Fit, seen: &Seen, voted: Place) -> Option<Place> {
    let hypothesis = null.model.hypothesis(&null.x);
    let sizes = null.model.engine_errors(&null.x);
    let [failed, passed] = near(study, null, seen, voted).map(|places| {
        let mut near = study.part(&places);
        near.learn_errors(&hypothesis);
        let before = near.white(&near.raw(&hypothesis), sizes);
        (near, before)
    });
    let explained = |mean_square: f64| mean_square < EXPLAINED;
    if failed.1.iter().all(|residuals| explained(mean_square(std::slice::from_ref(residuals)))) {
        return None;
    }
    // What explains those that failed less than something else does is not worth more simulations.
    let gain = |body: EffectConfig, least: f64| {
        let mut hypothesis = hypothesis.clone();
        hypothesis.effects.push(body);
        let of = |(near, before): &(Study, _)| met(before, &near.white(&near.raw(&hypothesis), sizes));
        let gain = of(&failed);
        if gain > least { gain + of(&passed) } else { gain }
    };
    let scored = |place: Place, body: usize, least: f64| {
        bodies(&place).nth(body).map(|found| Scored { gain: gain(found, least), place, body })
    };
    let sort = |found: &mut Vec<Scored>| found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut found: Vec<Scored> = promising(seen, voted).into_iter().filter_map(|place| scored(place, 0, 0.0)).collect();
    sort(&mut found);
    found.truncate(2 * MOVED);
    let movable: Vec<Scored> = found.iter().filter_map(|fixed| scored(fixed.place, 1, 0.0)).collect();
    found.extend(movable);
    sort(&mut found);
    let moved = found.into_iter().filter(|found| found.gain > 0.0).take(MOVED).map(|mut best| {
        for step in FINER_M {
            loop {
                let ([x, y], radius) = best.place;
                let around =
                    [[step, 0.0, 0.0], [0.0, step, 0.0], [0.0, 0.0, step]].into_iter().flat_map(|[dx, dy, dr]| {
                        [1.0, -1.0].map(|sign| ([x + sign * dx, y + sign * dy], radius + sign * dr))
                    });
                let within = around.filter(|place| (RANGE_M[0]..=RANGE_M[1]).contains(&place.1));
                let moved = within.filter_map(|place| scored(place, best.body, best.gain));
                match moved.max_by(|a, b| a.gain.total_cmp(&b.gain)) {
                    Some(most) if most.gain > best.gain => best = most,
                    _ => break,
                }
            }
        }
        best
    });
    moved.max_by(|a, b| a.gain.total_cmp(&b.gain)).map(|best| best.place).filter(|best| *best != voted)
}

/// Of a grid around a place those with most votes.
fn promising(seen: &Seen, (place, radius_m): Place) -> Vec<Place> {
    let grid = (0..125).map(|code| [code % 5, code / 5 % 5, code / 25].map(|n| GRID_M * (f64::from(n) - 2.0)));
    let moved = grid.map(|[x, y, radius]| ([place[0] + x, place[1] + y], radius_m + radius));
    let within = moved.filter(|place| (RANGE_M[0]..=RANGE_M[1]).contains(&place.1));
    let mut voted: Vec<(f64, Place)> = within.map(|place| (seen.votes(&place), place)).collect();
    voted.sort_by(|a, b| b.0.total_cmp(&a.0));
    voted.into_iter().take(SIMULATED).map(|(_, place)| place).collect()
}

/// Places in the study of the episodes that come near a body: those that the model fails, and others.
fn near(study: &Study, null: &Fit, seen: &Seen, body: Place) -> [Vec<usize>; 2] {
    let white = study.white(&study.raw(&null.model.hypothesis(&null.x)), &[]);
    let left = |place: usize| mean_square(&white[place..=place]);
    let apart_m = (study.chosen.iter().enumerate()).map(|(place, index)| (place, seen.apart_m(*index, body)));
    let mut near: Vec<(usize, f64)> = apart_m.filter(|(_, apart_m)| *apart_m < NEAR_M).collect();
    near.sort_by(|a, b| left(b.0).total_cmp(&left(a.0)));
    let mut others = near.split_off(FAILED.min(near.len()));
    others.sort_by(|a, b| a.1.total_cmp(&b.1));
    others.truncate(PASSED);
    [near, others].map(|near| {
        let mut places: Vec<usize> = near.into_iter().map(|(place, _)| place).collect();
        places.sort_unstable();
        places
    })
}
