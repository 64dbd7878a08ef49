//! Where the table may be rougher or smoother than elsewhere.
//!
//! While a tool pushes an object, the force on the tool says what friction is under the object: measured over simulated, less one, is what friction
//! is too low by. Circles on a grid are ranked by what two levels of it, inside and outside, explain more than one.

use physics_model::rig::RigReading;

use crate::obstacle::{Place, average, best_places, corners, distance};
use crate::trial::{Happened, Trial};

/// Distance of grid points, m.
const GRID_M: f64 = 0.015;
/// Radii of what is looked for, m.
const RADII_M: [f64; 5] = [0.03, 0.045, 0.065, 0.09, 0.12];
/// Rows that are averaged.
const ROWS: usize = 8;
/// A force, N, of a push: below it a ratio says nothing.
const PUSH_N: f64 = 0.4;
/// What a ratio counts for at most: at an impact it says nothing of friction.
const MOST: f64 = 2.0;
/// Readings that have to lie on either side of a border.
const LEAST: usize = 8;
/// How far apart, m, circles are that are worth trying both.
const APART_M: f64 = 0.03;

/// Friction under the object while it is pushed.
#[derive(Clone, Copy, Debug)]
struct Reading {
    place_m: [f64; 2],
    /// Measured over simulated force, less one.
    excess: f64,
}

/// Circles, the likeliest first, at most `count`; none without a force sensor. Each trial comes with its simulated readings.
#[must_use]
pub(crate) fn places(trials: &[(&Trial, Vec<RigReading>)], count: usize) -> Vec<Place> {
    let readings = trials.iter().flat_map(|(trial, readings)| pushed(&trial.happened(readings)));
    ranked(&readings.collect::<Vec<_>>(), count)
}

fn pushed(rows: &[Happened]) -> Vec<Reading> {
    let reading = |rows: &[Happened]| {
        let row = average(rows);
        let [fx, fy] = row.force_n;
        let size = fx.hypot(fy);
        let along = (row.surprise_n[0] * fx + row.surprise_n[1] * fy) / size;
        let [mx, my] = [fx + row.surprise_n[0], fy + row.surprise_n[1]];
        let pushes = size > PUSH_N && mx.hypot(my) > 0.5 * PUSH_N && row.surprise_n != [0.0; 2];
        pushes.then(|| Reading { place_m: row.object, excess: (along / size).clamp(-MOST, MOST) })
    };
    rows.chunks(ROWS).filter_map(reading).collect()
}

fn ranked(readings: &[Reading], count: usize) -> Vec<Place> {
    let Some(corners) = corners(readings.iter().map(|reading| reading.place_m), 0.0) else { return Vec::new() };
    let score = |place, radius_m| explained(readings, place, radius_m);
    best_places(corners, GRID_M, &RADII_M, score, |a, b| distance(a.0, b.0) <= APART_M, count)
}

/// By how much two levels of friction, inside a circle and outside, have less squares than one.
fn explained(readings: &[Reading], place: [f64; 2], radius_m: f64) -> f64 {
    let (mut inside, mut all) = ((0_usize, 0.0), (0_usize, 0.0));
    for reading in readings {
        all = (all.0 + 1, all.1 + reading.excess);
        if distance(reading.place_m, place) < radius_m {
            inside = (inside.0 + 1, inside.1 + reading.excess);
        }
    }
    let outside = (all.0 - inside.0, all.1 - inside.1);
    if inside.0 < LEAST || outside.0 < LEAST {
        return 0.0;
    }
    let (n, m) = (inside.0 as f64, outside.0 as f64);
    n * m / (n + m) * (inside.1 / n - outside.1 / m).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

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
                let excess = if distance(object, centre) < radius_m { 0.54 } else { 0.1 };
                let force_n = [-1.7 * cos, -1.7 * sin];
                Happened {
                    object,
                    simulated: object,
                    yaw_rad: 0.0,
                    tool: None,
                    surprise_n: force_n.map(|f| f * excess),
                    force_n,
                }
            });
            rows.collect::<Vec<_>>()
        };
        let readings: Vec<Reading> = (0..20).flat_map(|index| pushed(&push(index))).collect();
        let found = ranked(&readings, 3);
        let (place, found_m) = found[0];
        assert!(distance(place, centre) < 0.015 && (found_m - radius_m).abs() < 0.025, "{found:?}");
        // Without a sensor there is nothing to go by.
        let blind: Vec<Happened> = push(0).into_iter().map(|row| Happened { surprise_n: [0.0; 2], ..row }).collect();
        assert!(pushed(&blind).is_empty());
    }
}
