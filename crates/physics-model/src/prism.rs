//! Prisms: an outline in the object's xy plane, extruded by half the height to both sides.
//!
//! A triangle or a convex quadrangle stands on its lower face, like a box. The engine looks at four corners of a face at most, so that other
//! prisms stand on support points at up to eight corners of their convex hull; upside down they stand on what the engine finds. An outline that
//! is not convex becomes one shape for each triangle that its ears make.

use nalgebra::Matrix3;
use rapier3d::prelude::{Pose, SharedShape, Vector};

use crate::bodies::SOLE_GAP_M;
use crate::rig::RigError;
use crate::world::vector;

/// Most support points at the corners of a sole.
const MOST_SUPPORTS: usize = 8;
/// Most corners of an outline, and most feet.
const MOST_POINTS: usize = 256;
/// Largest coordinate, m.
const LARGEST_M: f64 = 10.0;

type Point = [f64; 2];

/// An extruded outline, ready for worlds: make one and share it between hypotheses.
#[derive(Clone, Debug)]
pub struct Prism {
    outline_m: Vec<Point>,
    height_m: f64,
    feet_m: Vec<Point>,
    /// Where the sole bears, m: feet, or corners of the convex hull.
    sole_m: Vec<Point>,
    on_points: bool,
    /// ∫ (x², y², x y) dA / A about the centroid, m².
    spread_m2: [f64; 3],
    whole: SharedShape,
    /// The same without the slice under which support points end.
    raised: SharedShape,
}

impl Prism {
    /// A prism of the simple polygon `outline_m` (corners in order, either way round; m, object frame) and the full height `height_m`, its
    /// middle at the origin of the object frame. It stands on `feet_m`, or on its lower face where there are none.
    ///
    /// # Errors
    ///
    /// [`RigError::Object`] for values that the engine cannot make a shape of.
    pub fn new(outline_m: Vec<Point>, height_m: f64, feet_m: Vec<Point>) -> Result<Self, RigError> {
        let good = |points: &[Point]| points.iter().flatten().all(|v| v.abs() <= LARGEST_M);
        if !(3..=MOST_POINTS).contains(&outline_m.len()) || !good(&outline_m) {
            return Err(problem("outline", "3 to 256 corners within 10 m"));
        }
        if feet_m.len() > MOST_POINTS || !good(&feet_m) {
            return Err(problem("feet", "up to 256 points within 10 m"));
        }
        if !(height_m > SOLE_GAP_M && height_m <= LARGEST_M) {
            return Err(problem("height", "more than 0.3 mm, up to 10 m"));
        }
        let mut corners = outline_m.clone();
        let (area, spread_m2) = moments(&corners);
        if area.abs() < 1e-12 {
            return Err(problem("outline", "an area of more than 1e-12 m²"));
        }
        if area < 0.0 {
            corners.reverse();
        }
        let convex = is_convex(&corners);
        let parts = if convex { vec![corners.clone()] } else { ears(corners.clone()) };
        let [low, high] = [-0.5 * height_m, 0.5 * height_m];
        let whole = extruded(&parts, low, high).ok_or_else(|| problem("outline", "a simple polygon"))?;
        let raised = extruded(&parts, low + SOLE_GAP_M, high).ok_or_else(|| problem("outline", "a simple polygon"))?;
        let sole_m = if feet_m.is_empty() { extremes(&corners) } else { feet_m.clone() };
        let on_points = !feet_m.is_empty() || !convex || corners.len() > 4;
        Ok(Self { outline_m, height_m, feet_m, sole_m, on_points, spread_m2, whole, raised })
    }

    /// Corners, m, object frame, as given.
    #[must_use]
    pub fn outline_m(&self) -> &[Point] {
        &self.outline_m
    }

    /// Full height, m.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Points that it stands on, m, object frame; empty where it stands on its lower face.
    #[must_use]
    pub fn feet_m(&self) -> &[Point] {
        &self.feet_m
    }

    /// Up to eight corners of its convex hull, m, object frame: those that it stands on where it has no feet, and tips over.
    #[must_use]
    pub fn extremes_m(&self) -> Vec<Point> {
        extremes(&self.outline_m)
    }

    /// Full lengths, m, of the box around it along the object's axes.
    #[must_use]
    pub fn size_m(&self) -> [f64; 3] {
        let length = |axis: usize| {
            let values = self.outline_m.iter().map(|p| p[axis]);
            values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
        };
        [length(0), length(1), self.height_m]
    }

    /// Inertia, kg m², of a uniform solid of `mass_kg` about its centroid, object axes.
    #[must_use]
    pub fn inertia_kgm2(&self, mass_kg: f64) -> Matrix3<f64> {
        let [xx, yy, xy] = self.spread_m2;
        let zz = self.height_m * self.height_m / 12.0;
        Matrix3::new(yy + zz, -xy, 0.0, -xy, xx + zz, 0.0, 0.0, 0.0, xx + yy) * mass_kg
    }

    /// Where support points are, m, if it stands on any: `share` of the way from their middle to feet or corners.
    pub(crate) fn support_points_m(&self, share: Option<f64>) -> Vec<Point> {
        let Some(share) = share else {
            return if self.on_points { self.sole_m.clone() } else { Vec::new() };
        };
        let count = self.sole_m.len() as f64;
        let middle: Point = std::array::from_fn(|i| self.sole_m.iter().map(|p| p[i]).sum::<f64>() / count);
        self.sole_m.iter().map(|p| std::array::from_fn(|i| middle[i] + share * (p[i] - middle[i]))).collect()
    }

    pub(crate) fn shape(&self, raised: bool) -> SharedShape {
        if raised { self.raised.clone() } else { self.whole.clone() }
    }
}

fn problem(what: &'static str, expected: &'static str) -> RigError {
    RigError::Object { what, expected }
}

/// Twice the area of the triangle, m², positive if it turns left.
fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Signed area, m², and ∫ (x², y², x y) dA / A about the centroid, m².
fn moments(corners: &[Point]) -> (f64, [f64; 3]) {
    let (mut area, mut first, mut second) = (0.0, [0.0; 2], [0.0; 3]);
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let turn = a[0] * b[1] - b[0] * a[1];
        area += turn / 2.0;
        for axis in 0..2 {
            first[axis] += turn * (a[axis] + b[axis]) / 6.0;
            second[axis] += turn * (a[axis] * a[axis] + a[axis] * b[axis] + b[axis] * b[axis]) / 12.0;
        }
        second[2] += turn * (a[0] * b[1] + 2.0 * a[0] * a[1] + 2.0 * b[0] * b[1] + b[0] * a[1]) / 24.0;
    }
    let [x, y] = first.map(|v| v / area);
    let [xx, yy, xy] = second.map(|v| v / area);
    (area, [xx - x * x, yy - y * y, xy - x * y])
}

fn is_convex(corners: &[Point]) -> bool {
    let n = corners.len();
    (0..n).all(|i| cross(corners[i], corners[(i + 1) % n], corners[(i + 2) % n]) >= 0.0)
}

/// The triangles of a simple polygon that turns left, by clipping ears.
fn ears(mut corners: Vec<Point>) -> Vec<Vec<Point>> {
    let mut triangles = Vec::with_capacity(corners.len());
    while corners.len() > 3 {
        let n = corners.len();
        let at = |i: usize| corners[i % n];
        let ear = (0..n).find(|i| {
            let (a, b, c) = (at(i + n - 1), at(*i), at(i + 1));
            let inside = |p: &Point| cross(a, b, *p) >= 0.0 && cross(b, c, *p) >= 0.0 && cross(c, a, *p) >= 0.0;
            let others = corners.iter().filter(|p| **p != a && **p != b && **p != c);
            cross(a, b, c) >= 0.0 && !others.into_iter().any(inside)
        });
        // A polygon that is not simple may have none: its triangles are wrong then, but they end.
        let i = ear.unwrap_or(0);
        let triangle = vec![at(i + n - 1), at(i), at(i + 1)];
        if cross(triangle[0], triangle[1], triangle[2]) > 0.0 {
            triangles.push(triangle);
        }
        corners.remove(i);
    }
    triangles.push(corners);
    triangles
}

/// Corners that lie farthest in one of eight directions, each once.
fn extremes(corners: &[Point]) -> Vec<Point> {
    let mut found: Vec<Point> = Vec::with_capacity(MOST_SUPPORTS);
    // Off the axes, so that the corners of a rectangle are found, and no two of them tie.
    let directions = (0..MOST_SUPPORTS).map(|i| (i as f64 + 0.4) * std::f64::consts::TAU / MOST_SUPPORTS as f64);
    for (sin, cos) in directions.map(f64::sin_cos) {
        let reach = |p: &&Point| p[0] * cos + p[1] * sin;
        let farthest = corners.iter().max_by(|a, b| reach(a).total_cmp(&reach(b)));
        if let Some(corner) = farthest.filter(|corner| !found.contains(corner)) {
            found.push(*corner);
        }
    }
    found
}

fn extruded(parts: &[Vec<Point>], low_m: f64, high_m: f64) -> Option<SharedShape> {
    let hull = |corners: &Vec<Point>| {
        let points: Vec<Vector> =
            [low_m, high_m].iter().flat_map(|z| corners.iter().map(|[x, y]| vector([*x, *y, *z]))).collect();
        SharedShape::convex_hull(&points)
    };
    match parts {
        [corners] => hull(corners),
        parts => {
            let hulls: Option<Vec<_>> = parts.iter().map(|part| Some((Pose::IDENTITY, hull(part)?))).collect();
            hulls.map(SharedShape::compound)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_a_box_and_of_a_right_triangle() {
        let corners = vec![[0.01, -0.02], [0.09, -0.02], [0.09, 0.04], [0.01, 0.04]];
        let prism = Prism::new(corners, 0.05, vec![]).unwrap();
        let inertia = prism.inertia_kgm2(1.2);
        for (i, (a, b)) in [(0.06, 0.05), (0.08, 0.05), (0.08, 0.06)].into_iter().enumerate() {
            assert!((inertia[(i, i)] - 0.1 * (a * a + b * b)).abs() < 1e-15, "{inertia}");
        }
        assert!(inertia[(0, 1)].abs() < 1e-18, "{inertia}");
        // Legs a: a²/18 along either, −a²/36 for the product.
        let triangle = Prism::new(vec![[-0.05, 0.1], [0.1, -0.05], [-0.05, -0.05]], 0.01, vec![]).unwrap();
        let inertia = triangle.inertia_kgm2(1.0);
        assert!((inertia[(2, 2)] - 0.0225 / 9.0).abs() < 1e-15 && (inertia[(0, 1)] - 0.0225 / 36.0).abs() < 1e-15);
    }

    #[test]
    fn ears_cover_an_outline_that_is_not_convex() {
        let ell = vec![[0.0, 0.0], [0.3, 0.0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.3], [0.0, 0.3]];
        let triangles = ears(ell.clone());
        let area: f64 = triangles.iter().map(|t| moments(t).0).sum();
        assert!(!is_convex(&ell) && triangles.len() == 4 && (area - 0.05).abs() < 1e-15, "{triangles:?}");
        let prism = Prism::new(ell, 0.02, vec![]).unwrap();
        assert_eq!(prism.support_points_m(None).len(), 5, "the corners of the hull");
    }

    #[test]
    fn what_makes_no_prism_is_an_error() {
        let square = vec![[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]];
        for (outline, height) in [
            (square[..2].to_vec(), 0.1),
            (square.clone(), 0.0),
            (square.clone(), f64::NAN),
            (vec![[0.0, 0.0], [0.1, 0.1], [0.2, 0.2]], 0.1),
            (vec![[0.0, 0.0], [f64::INFINITY, 0.1], [0.2, 0.2]], 0.1),
        ] {
            assert!(Prism::new(outline, height, vec![]).is_err());
        }
    }
}
