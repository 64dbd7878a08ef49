//! Where the table may be rougher or smoother than elsewhere.
//!
//! While a tool pushes an object, the force on the tool says what friction is under the object: measured over simulated, less one, is what friction
//! is too low by. An object stands on its corners or its rim, and a patch under some of them holds it back by their share. Circles on a grid are
//! ranked by how much of the squares a line through (share inside, excess) explains, and the best ones moved to where that is most.

use physics_model::rig::RigReading;

use crate::obstacle::{Outlines, Place, average, best_places, corners, distance, finer_places};
use crate::trial::{Happened, Trial};

/// Distance of grid points, m.
const GRID_M: f64 = 0.015;
/// Radii of what is looked for, m.
const RADII_M: [f64; 6] = [0.03, 0.045, 0.065, 0.09, 0.12, 0.16];
/// Least and largest radius, m.
const RANGE_M: [f64; 2] = [0.02, 0.2];
/// Steps, m, by which a circle on the grid is moved and grown.
const FINER_M: [f64; 3] = [0.006, 0.003, 0.0015];
/// Rows that are averaged.
const ROWS: usize = 8;
/// A force, N, of a push: below it a ratio says nothing.
const PUSH_N: f64 = 0.4;
/// What a ratio counts for at most: at an impact it says nothing of friction.
const MOST: f64 = 2.0;
/// Readings that have to lie on either side of a border.
const LEAST: f64 = 8.0;
/// How far apart, m, circles are that are worth trying both.
const APART_M: f64 = 0.03;
/// Circles whose centres are nearer than this, m, are the same.
const SAME_M: f64 = 0.01;

/// Friction under the object while it is pushed.
#[derive(Clone, Copy, Debug)]
struct Reading {
    /// What it stands on, as seen from above, m.
    feet_m: [[f64; 2]; 4],
    /// Measured over simulated force, less one.
    excess: f64,
}

/// Circles, the likeliest first, at most `count`; none without a force sensor. Each trial comes with its simulated readings.
#[must_use]
pub(crate) fn places(trials: &[(&Trial, Vec<RigReading>)], outlines: Outlines, count: usize) -> Vec<Place> {
    let readings = trials.iter().flat_map(|(trial, readings)| pushed(&trial.happened(readings), outlines));
    ranked(&readings.collect::<Vec<_>>(), count)
}

fn pushed(rows: &[Happened], outlines: Outlines) -> Vec<Reading> {
    let reading = |rows: &[Happened]| {
        let row = average(rows);
        let [fx, fy] = row.force_n;
        let size = fx.hypot(fy);
        let along = (row.surprise_n[0] * fx + row.surprise_n[1] * fy) / size;
        let [mx, my] = [fx + row.surprise_n[0], fy + row.surprise_n[1]];
        let pushes = size > PUSH_N && mx.hypot(my) > 0.5 * PUSH_N && row.surprise_n != [0.0; 2];
        pushes.then(|| Reading { feet_m: outlines.feet(&row), excess: (along / size).clamp(-MOST, MOST) })
    };
    rows.chunks(ROWS).filter_map(reading).collect()
}

fn ranked(readings: &[Reading], count: usize) -> Vec<Place> {
    let feet = readings.iter().flat_map(|reading| reading.feet_m);
    let Some(corners) = corners(feet, 0.0) else { return Vec::new() };
    let score = |place, radius_m| explained(readings, place, radius_m);
    let coarse = best_places(corners, GRID_M, &RADII_M, score, |a, b| distance(a.0, b.0) <= APART_M, count);
    finer_places(coarse, &FINER_M, RANGE_M, score, |a, b| distance(a.0, b.0) <= SAME_M)
}

/// By how much a line through the shares of an object's feet inside a circle and its excess has less squares than no slope.
fn explained(readings: &[Reading], place: [f64; 2], radius_m: f64) -> f64 {
    let (mut shares, mut squares, mut excess, mut products) = (0.0, 0.0, 0.0, 0.0);
    for reading in readings {
        let inside = reading.feet_m.iter().filter(|foot| distance(**foot, place) < radius_m).count() as f64;
        let share = inside / reading.feet_m.len() as f64;
        shares += share;
        squares += share * share;
        excess += reading.excess;
        products += share * reading.excess;
    }
    let n = readings.len() as f64;
    if shares < LEAST || n - shares < LEAST {
        return 0.0;
    }
    let spread = squares - shares * shares / n;
    if spread > 0.0 { (products - shares * excess / n).powi(2) / spread } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTLINES: Outlines = Outlines { sides_m: Some([0.04, 0.03]), object_m: 0.05, tool_m: 0.02 };

    fn nowhere() -> Happened {
        let [object, simulated, surprise_n, force_n] = [[0.0; 2]; 4];
        Happened { object, simulated, yaw_rad: 0.0, tool: None, surprise_n, force_n }
    }

    #[test]
    fn a_rough_circle_is_found_under_pushes_that_cross_it() {
        // Friction is 40 % too high in the circle, and 10 % everywhere.
        let (centre, radius_m) = ([0.05, -0.04], 0.07);
        let push = |index: i32| {
            let (sin, cos) = (f64::from(index) * 0.7).sin_cos();
            let from = [0.03 * f64::from(index % 5) - 0.06, 0.04 * f64::from(index % 3) - 0.04];
            let rows = (0..160).map(move |row| {
                let along = 0.0015 * f64::from(row) - 0.12;
                let object = [from[0] + along * cos, from[1] + along * sin];
                let at = Happened { object, yaw_rad: f64::from(index) * 0.7, ..nowhere() };
                let inside = OUTLINES.feet(&at).iter().filter(|foot| distance(**foot, centre) < radius_m).count();
                let excess = 0.1 + 1.1 * 0.4 * 0.25 * inside as f64;
                let force_n = [-1.7 * cos, -1.7 * sin];
                Happened { simulated: object, surprise_n: force_n.map(|f| f * excess), force_n, ..at }
            });
            rows.collect::<Vec<_>>()
        };
        let readings: Vec<Reading> = (0..20).flat_map(|index| pushed(&push(index), OUTLINES)).collect();
        let found = ranked(&readings, 3);
        let (place, found_m) = found[0];
        assert!(distance(place, centre) < 0.004 && (found_m - radius_m).abs() < 0.004, "{found:?}");
        // Without a sensor there is nothing to go by.
        let blind: Vec<Happened> = push(0).into_iter().map(|row| Happened { surprise_n: [0.0; 2], ..row }).collect();
        assert!(pushed(&blind, OUTLINES).is_empty());
    }
}
