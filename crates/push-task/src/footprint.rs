//! What a thing covers of the table.

use nalgebra::{Rotation2, Vector2};
use physics_model::BodyState;
use physics_model::theta::ObjectShape;

use crate::way::Circle;

/// Where a thing stands, with its outline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// The circle around it.
    pub(crate) circle: Circle,
    /// Half sizes along its own axes, m, and its yaw, rad; `None` where it is the circle.
    faces: Option<(Vector2<f64>, f64)>,
}

impl Footprint {
    pub(crate) fn new(shape: ObjectShape, size_m: [f64; 3], body: &BodyState) -> Self {
        let center = Vector2::new(body.position_m[0], body.position_m[1]);
        let circle = Circle { center, radius_m: shape.footprint_radius_m(size_m) };
        let faces =
            matches!(shape, ObjectShape::Box).then(|| (Vector2::new(size_m[0], size_m[1]) / 2.0, body.yaw_rad()));
        Self { circle, faces }
    }

    /// Radius, m, of the largest circle around its centre that it covers.
    pub(crate) fn inner_radius_m(&self) -> f64 {
        self.faces.map_or(self.circle.radius_m, |(half, _)| half.x.min(half.y))
    }

    /// From the nearest point of the thing to `point`; zero inside.
    pub(crate) fn gap(&self, point: Vector2<f64>) -> Vector2<f64> {
        let from_center = point - self.circle.center;
        match self.faces {
            Some((half, yaw)) => {
                let turn = Rotation2::new(yaw);
                let own = turn.inverse() * from_center;
                let nearest = Vector2::new(own.x.clamp(-half.x, half.x), own.y.clamp(-half.y, half.y));
                turn * (own - nearest)
            }
            None => {
                let distance_m = from_center.norm();
                from_center * ((distance_m - self.circle.radius_m).max(0.0) / distance_m.max(1e-12))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_4;

    use super::*;

    #[test]
    fn gaps_are_measured_from_the_outline() {
        let cylinder =
            Footprint::new(ObjectShape::Cylinder, [0.03, 0.1, 0.0], &BodyState::at_rest([0.1, 0.2, 0.0], 0.0));
        assert!((cylinder.gap(Vector2::new(0.1, 0.3)) - Vector2::new(0.0, 0.07)).norm() < 1e-12);
        assert_eq!(cylinder.gap(Vector2::new(0.11, 0.2)), Vector2::zeros());
        // A square on its corner: along an axis the corner is nearest, along a diagonal a face.
        let square = Footprint::new(ObjectShape::Box, [0.2, 0.2, 0.1], &BodyState::at_rest([0.0, 0.0, 0.0], FRAC_PI_4));
        assert!((square.gap(Vector2::new(0.2, 0.0)).norm() - (0.2 - 0.02_f64.sqrt())).abs() < 1e-12);
        assert!((square.gap(Vector2::new(0.2, 0.2)).norm() - (0.08_f64.sqrt() - 0.1)).abs() < 1e-12);
        assert_eq!(square.gap(Vector2::new(0.0, 0.1)), Vector2::zeros());
    }
}
