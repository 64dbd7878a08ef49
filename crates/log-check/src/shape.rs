//! How far a point is from the surface of the object.

use measured_log::Shape;
use nalgebra::Vector3;

/// The object's shape with its mean sizes, about its centre.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Solid {
    /// Half lengths, m.
    Box([f64; 3]),
    /// Radius and half height, m; the axis is z.
    Cylinder(f64, f64),
    /// Radius, m.
    Sphere(f64),
    /// Corners in order and half height, m.
    Prism(Vec<[f64; 2]>, f64),
}

impl Solid {
    pub(crate) fn new(shape: &Shape) -> Self {
        match shape {
            Shape::Box { size_m } => Self::Box(size_m.map(|size| 0.5 * size.mean())),
            Shape::Cylinder { radius_m, height_m } => Self::Cylinder(radius_m.mean(), 0.5 * height_m.mean()),
            Shape::Sphere { radius_m } => Self::Sphere(radius_m.mean()),
            Shape::Prism { outline_m, height_m, .. } => Self::Prism(outline_m.clone(), 0.5 * height_m.mean()),
        }
    }

    /// Half extent along each of its axes, m.
    pub(crate) fn half_m(&self) -> [f64; 3] {
        match self {
            Self::Box(half) => *half,
            Self::Cylinder(radius, half) => [*radius, *radius, *half],
            Self::Sphere(radius) => [*radius; 3],
            Self::Prism(outline, half) => {
                let reach = |axis: usize| outline.iter().map(|corner| corner[axis].abs()).fold(0.0, f64::max);
                [reach(0), reach(1), *half]
            }
        }
    }

    /// Signed distance of a point in the object's axes from its surface, m: negative inside. Exact outside and on the surface.
    pub(crate) fn distance_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Box(half) => corner(std::array::from_fn::<f64, 3, _>(|i| point[i].abs() - half[i])),
            Self::Cylinder(radius, half) => corner([point.xy().norm() - radius, point.z.abs() - half]),
            Self::Sphere(radius) => point.norm() - radius,
            Self::Prism(outline, half) => corner([polygon(outline, [point.x, point.y]), point.z.abs() - half]),
        }
    }

    /// How far the lowest point lies below the centre, m. `vertical`: up, in the object's axes.
    pub(crate) fn below_m(&self, vertical: &Vector3<f64>) -> f64 {
        match self {
            Self::Box(half) => (0..3).map(|i| (half[i] * vertical[i]).abs()).sum(),
            Self::Cylinder(radius, half) => half * vertical.z.abs() + radius * vertical.xy().norm(),
            Self::Sphere(radius) => *radius,
            Self::Prism(outline, half) => {
                let corner = |[x, y]: &[f64; 2]| -(x * vertical.x + y * vertical.y);
                half * vertical.z.abs() + outline.iter().map(corner).fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }

    /// How far it is from lying on a face, rad: 0 for a ball, and for a cylinder that stands or lies.
    pub(crate) fn tilt_rad(&self, vertical: &Vector3<f64>) -> f64 {
        let standing = vertical.z.abs().min(1.0).acos();
        match self {
            Self::Box(_) => vertical.amax().min(1.0).acos(),
            Self::Cylinder(..) => standing.min(std::f64::consts::FRAC_PI_2 - standing),
            Self::Sphere(_) => 0.0,
            Self::Prism(..) => standing,
        }
    }

    /// The vertical as it is where the object lies on the face that is nearest to the table, if it almost does.
    pub(crate) fn resting(&self, vertical: &Vector3<f64>) -> Vector3<f64> {
        const ALMOST_RAD: f64 = 0.1;
        if self.tilt_rad(vertical) > ALMOST_RAD {
            return *vertical;
        }
        let axis = vertical.iamax();
        match self {
            Self::Sphere(_) => *vertical,
            // It may lie on any line of its side.
            Self::Cylinder(..) if axis < 2 => Vector3::new(vertical.x, vertical.y, 0.0).normalize(),
            _ => Vector3::from_fn(|i, _| if i == axis { vertical[axis].signum() } else { 0.0 }),
        }
    }

    /// Direction in which the distance grows fastest, object axes.
    pub(crate) fn outward(&self, point: &Vector3<f64>) -> Vector3<f64> {
        const STEP_M: f64 = 1e-6;
        let slope = |axis: usize| {
            let mut step = Vector3::zeros();
            step[axis] = STEP_M;
            self.distance_m(&(point + step)) - self.distance_m(&(point - step))
        };
        Vector3::from_fn(|axis, _| slope(axis)).try_normalize(1e-12).unwrap_or_else(Vector3::zeros)
    }
}

/// Distance from a corner of which these are the distances from its sides, each negative inside.
fn corner<const N: usize>(sides: [f64; N]) -> f64 {
    let outside = sides.iter().map(|side| side.max(0.0).powi(2)).sum::<f64>().sqrt();
    outside + sides.into_iter().fold(f64::NEG_INFINITY, f64::max).min(0.0)
}

/// Signed distance of a point from a polygon.
fn polygon(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let (mut nearest, mut inside) = (f64::INFINITY, false);
    for (i, [ax, ay]) in outline.iter().copied().enumerate() {
        let [bx, by] = outline[(i + 1) % outline.len()];
        let (ux, uy) = (bx - ax, by - ay);
        let along = (((x - ax) * ux + (y - ay) * uy) / (ux * ux + uy * uy).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        nearest = nearest.min((x - ax - along * ux).hypot(y - ay - along * uy));
        if (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * ux {
            inside = !inside;
        }
    }
    if inside { -nearest } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_closed_forms() {
        let close = |solid: &Solid, point: [f64; 3], expected: f64| {
            let found = solid.distance_m(&Vector3::from(point));
            assert!((found - expected).abs() < 1e-12, "{solid:?} {point:?}: {found}, expected {expected}");
        };
        let cube = Solid::Box([0.1, 0.2, 0.3]);
        close(&cube, [0.0, 0.0, 0.0], -0.1);
        close(&cube, [0.4, 0.6, 0.0], 0.5);
        close(&cube, [0.05, 0.0, 0.4], 0.1);
        close(&Solid::Cylinder(0.1, 0.2), [0.3, 0.4, 0.0], 0.4);
        close(&Solid::Cylinder(0.1, 0.2), [0.4, 0.0, 0.6], 0.5);
        close(&Solid::Sphere(0.1), [0.0, 0.0, 0.04], -0.06);
        // The square of the box above, as a prism.
        let prism = Solid::Prism(vec![[-0.1, -0.2], [0.1, -0.2], [0.1, 0.2], [-0.1, 0.2]], 0.3);
        for point in [[0.0, 0.0, 0.0], [0.4, 0.6, 0.0], [0.05, 0.0, 0.4], [0.02, 0.1, -0.1]] {
            close(&prism, point, cube.distance_m(&Vector3::from(point)));
        }
        assert!((cube.outward(&Vector3::new(0.15, 0.0, 0.0)) - Vector3::x()).norm() < 1e-6);
    }
}
