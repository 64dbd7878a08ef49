//! The ways of the object's centre past an obstacle, in the plane.

use std::f64::consts::TAU;

use nalgebra::Vector2;

use crate::way::Circle;

/// A way of a point past a circle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Route {
    pub(crate) length_m: f64,
    /// Where it goes first, a unit vector.
    pub(crate) heading: Vector2<f64>,
    /// Whether it goes round something.
    pub(crate) bent: bool,
}

/// The straight way, or, where `circle` is in between, the ways round it on either side: tangent, arc, tangent.
pub(crate) fn routes(from: Vector2<f64>, to: Vector2<f64>, circle: Option<Circle>) -> Vec<Route> {
    let line = to - from;
    let Some(heading) = line.try_normalize(1e-9) else { return Vec::new() };
    let straight = Route { length_m: line.norm(), heading, bent: false };
    let Some(circle) = circle else { return vec![straight] };
    let (near, far) = (from - circle.center, to - circle.center);
    // A point within the circle touches what it stands for: it goes along it.
    let radius_m = circle.radius_m.min(near.norm()).min(far.norm());
    let share = -near.dot(&line) / line.norm_squared();
    if share <= 0.0 || share >= 1.0 || (near + line * share).norm() >= radius_m {
        return vec![straight];
    }
    let angle = |v: Vector2<f64>| v.y.atan2(v.x);
    let turned =
        |v: Vector2<f64>, by: f64| Vector2::new(v.x * by.cos() - v.y * by.sin(), v.x * by.sin() + v.y * by.cos());
    // Angles at the centre between a point and where its tangent touches.
    let (first, last) = ((radius_m / near.norm()).acos(), (radius_m / far.norm()).acos());
    let round = |side: f64| {
        let sweep = (side * (angle(near) - angle(far))).rem_euclid(TAU);
        let arc = (sweep - first - last).max(0.0);
        let tangents_m = (near.norm_squared() - radius_m * radius_m).max(0.0).sqrt()
            + (far.norm_squared() - radius_m * radius_m).max(0.0).sqrt();
        Route {
            length_m: tangents_m + radius_m * arc,
            heading: turned(-near / near.norm(), side * (radius_m / near.norm()).asin()),
            bent: true,
        }
    };
    vec![round(1.0), round(-1.0)]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};

    use super::*;

    fn of(from: [f64; 2], to: [f64; 2], radius_m: f64) -> Vec<Route> {
        routes(from.into(), to.into(), Some(Circle { center: Vector2::zeros(), radius_m }))
    }

    #[test]
    fn what_is_beside_or_behind_does_not_bend_the_way() {
        for (from, to) in [([1.0, -2.0], [1.0, 2.0]), ([0.0, 1.5], [0.0, 3.0]), ([0.0, -3.0], [0.0, -1.0])] {
            let [route] = of(from, to, 1.0)[..] else { panic!("{from:?}") };
            assert_eq!(route.length_m, (to[1] - from[1]).abs());
            assert_eq!(route.heading, Vector2::new(0.0, 1.0));
        }
        assert_eq!(routes(Vector2::zeros(), Vector2::new(2.0, 0.0), None).len(), 1);
        assert!(of([1.0, 1.0], [1.0, 1.0], 1.0).is_empty());
    }

    #[test]
    fn a_way_round_is_two_tangents_and_an_arc() {
        // From two radii away the tangent leaves at 30° and touches after √3 radii; on both ends together 60° + 60° of the half circle are spared.
        let both = of([0.0, -2.0], [0.0, 2.0], 1.0);
        assert_eq!(both.len(), 2);
        for (route, side) in both.iter().zip([1.0, -1.0]) {
            assert!((route.length_m - (2.0 * 3.0_f64.sqrt() + PI / 3.0)).abs() < 1e-12, "{route:?}");
            let expected = Vector2::new(-side * FRAC_PI_6.sin(), FRAC_PI_6.cos());
            assert!((route.heading - expected).norm() < 1e-12, "{route:?}");
        }
    }

    #[test]
    fn off_the_middle_the_nearer_side_is_shorter() {
        let [left, right] = of([-0.5, -2.0], [-0.5, 2.0], 1.0)[..] else { panic!("two ways") };
        assert!(left.length_m < right.length_m && left.length_m > 4.0, "{left:?} {right:?}");
    }

    #[test]
    fn what_touches_the_circle_goes_along_it() {
        let [left, right] = of([0.0, -0.8], [0.0, 3.0], 1.0)[..] else { panic!("two ways") };
        assert!((left.heading - Vector2::new(-1.0, 0.0)).norm() < 1e-12, "{left:?}");
        assert!((right.heading - Vector2::new(1.0, 0.0)).norm() < 1e-12, "{right:?}");
        // A quarter of the circle and the rest of it up to the tangent.
        let tangent = (3.0_f64.powi(2) - 0.8 * 0.8).sqrt();
        let arc = 0.8 * (FRAC_PI_2 + FRAC_PI_2 - (0.8_f64 / 3.0).acos());
        assert!((left.length_m - tangent - arc).abs() < 1e-12, "{left:?}");
    }
}
