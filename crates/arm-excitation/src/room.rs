//! Whether an arm meets itself or the floor.

use arm_dynamics::Arm;
use nalgebra::{Point3, Vector3};

/// Postures that say which links are near each other whatever the arm does.
const POSTURES: usize = 64;

/// Links as rods from joint to joint.
pub(crate) struct Rods {
    radius_m: f64,
    floor_m: Option<f64>,
    /// Pairs of rods that can meet and are not neighbours, and those that are near each other in all postures.
    pairs: Vec<(usize, usize)>,
    pub(crate) unwatched: Vec<(usize, usize)>,
    /// Rods that move and can come down to the floor.
    above: Vec<usize>,
}

impl Rods {
    /// `postures` are drawn within the limits.
    pub(crate) fn new(
        arm: &Arm,
        radius_m: f64,
        floor_m: Option<f64>,
        postures: impl Iterator<Item = Vec<f64>>,
    ) -> Self {
        let rods = arm.joints().len() + 1;
        let all = (0..rods).flat_map(|a| (a + 2..rods).map(move |b| (a, b)));
        let seen: Vec<Vec<Point3<f64>>> = postures.take(POSTURES).map(|q| arm.origins(&q)).collect();
        let always = |(a, b): &(usize, usize)| seen.iter().all(|origins| between(origins, *a, *b) < 2.0 * radius_m);
        // What is near in all postures is built so, as the joints of a wrist are.
        let (unwatched, pairs) = all.partition(always);
        // What stays at its height stands where it was put.
        let moves = |rod: usize| {
            let heights = seen.iter().map(|origins| lowest(origins, rod));
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
            high - low > 1e-6
        };
        let above = (1..rods).filter(|rod| floor_m.is_some() && moves(*rod));
        Self { radius_m, floor_m, pairs, unwatched, above: above.collect() }
    }

    /// How far rods go into each other and into the floor at `q`, m, summed; 0 where nothing is met.
    pub(crate) fn overlap(&self, arm: &Arm, q: &[f64]) -> f64 {
        let origins = arm.origins(q);
        let met = self.pairs.iter().map(|(a, b)| (2.0 * self.radius_m - between(&origins, *a, *b)).max(0.0));
        let floor = self.floor_m.map_or(f64::NEG_INFINITY, |floor| floor + self.radius_m);
        let down = self.above.iter().map(|rod| (floor - lowest(&origins, *rod)).max(0.0));
        met.chain(down).sum()
    }
}

/// Distance of two rods' axes. Rod `rod` goes from the place of one joint, or the base, to the next, or the tip.
fn between(origins: &[Point3<f64>], a: usize, b: usize) -> f64 {
    distance((origins[a], origins[a + 1]), (origins[b], origins[b + 1]))
}

/// Distance of two segments, by the closest points on each (Ericson 2005, section 5.1.9).
fn distance((p, p_end): (Point3<f64>, Point3<f64>), (q, q_end): (Point3<f64>, Point3<f64>)) -> f64 {
    let (d, e, r): (Vector3<f64>, Vector3<f64>, Vector3<f64>) = (p_end - p, q_end - q, p - q);
    let (a, c, b) = (d.dot(&d), e.dot(&e), d.dot(&e));
    let on = |value: f64| value.clamp(0.0, 1.0);
    let along = |numerator: f64, denominator: f64| if denominator > 1e-18 { on(numerator / denominator) } else { 0.0 };
    let s = along(b * e.dot(&r) - c * d.dot(&r), a * c - b * b);
    let t = along(b * s + e.dot(&r), c);
    // The best place on the first for that place on the second, which may have been cut off.
    let s = along(b * t - d.dot(&r), a);
    (r + d * s - e * t).norm()
}

fn lowest(origins: &[Point3<f64>], rod: usize) -> f64 {
    origins[rod].z.min(origins[rod + 1].z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_as_far_apart_as_their_nearest_points() {
        let point = |seed: usize| -> Point3<f64> {
            let number = |k: usize| ((seed * 7 + k * 13) as f64 * 0.731).sin();
            Point3::new(number(1), number(2), number(3))
        };
        for item in 0..200 {
            let (p, q) = ((point(4 * item), point(4 * item + 1)), (point(4 * item + 2), point(4 * item + 3)));
            let at = |(from, to): (Point3<f64>, Point3<f64>), i: usize| from + (to - from) * (i as f64 / 100.0);
            let grid = (0..=100).flat_map(|i| (0..=100).map(move |j| (at(p, i) - at(q, j)).norm()));
            let expected = grid.fold(f64::INFINITY, f64::min);
            let found = distance(p, q);
            assert!(found <= expected + 1e-12 && found > expected - 0.03, "{item}: {found} for {expected}");
        }
        // A point, twice, and a rod beside it.
        let o = Point3::origin();
        assert!((distance((o, o), (Point3::new(1.0, -1.0, 0.0), Point3::new(1.0, 1.0, 0.0))) - 1.0).abs() < 1e-12);
    }
}
