//! Whether an arm meets itself or the floor.

use arm_dynamics::Arm;
use nalgebra::Point3;

/// Points on a link's rod, its ends included.
const POINTS: usize = 5;
/// Postures that say which links are near each other whatever the arm does.
const POSTURES: usize = 64;

/// Links as rods from joint to joint.
pub(crate) struct Rods {
    radius_m: f64,
    floor_m: Option<f64>,
    /// Pairs of rods that can meet and are not neighbours.
    pairs: Vec<(usize, usize)>,
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
        let often = |near: &dyn Fn(&[Point3<f64>]) -> bool| {
            2 * seen.iter().filter(|origins| near(origins)).count() > seen.len()
        };
        // What is that near in most postures is built so, as the joints of a wrist are.
        let pairs = all.filter(|(a, b)| !often(&|origins| between(origins, *a, *b) < 2.0 * radius_m)).collect();
        // What stays at its height stands where it was put.
        let moves = |rod: usize| {
            let heights = seen.iter().map(|origins| lowest(origins, rod));
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
            high - low > 1e-6
        };
        let above = (1..rods).filter(|rod| floor_m.is_some() && moves(*rod));
        Self { radius_m, floor_m, pairs, above: above.collect() }
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

/// Points of rod `rod`: from the place of one joint, or the base, to the next, or the tip.
fn points(origins: &[Point3<f64>], rod: usize) -> impl Iterator<Item = Point3<f64>> + Clone {
    let (from, to) = (origins[rod], origins[rod + 1]);
    (0..POINTS).map(move |i| from + (to - from) * (i as f64 / (POINTS - 1) as f64))
}

fn between(origins: &[Point3<f64>], a: usize, b: usize) -> f64 {
    let others = points(origins, b);
    points(origins, a).flat_map(|p| others.clone().map(move |q| (p - q).norm())).fold(f64::INFINITY, f64::min)
}

fn lowest(origins: &[Point3<f64>], rod: usize) -> f64 {
    points(origins, rod).map(|p| p.z).fold(f64::INFINITY, f64::min)
}
