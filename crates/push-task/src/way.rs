//! The shortest way of the tool round things that stand on the table, in the plane.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use physics_model::robot::{Robot, ToolShape};

use crate::config::ReachConfig;

/// Corners round a thing. The straight line between neighbours comes 3.4 % nearer to it than they are.
const CORNERS: usize = 12;
/// Room, m, between the tool and a thing that it passes.
pub(crate) const ROOM_M: f64 = 0.01;
/// What a tool on its way may come nearer to a thing, m: contacts give way, and a thing that is touched lightly hardly moves.
const DEPTH_M: f64 = 0.005;

/// A thing on the table: the circle around its footprint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Circle {
    pub(crate) center: Vector2<f64>,
    pub(crate) radius_m: f64,
}

/// A way from the tool to a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Way {
    pub(crate) length_m: f64,
    /// Where it first turns; the place itself where nothing is in between.
    pub(crate) first: Vector2<f64>,
}

/// Where a tool that never turns may go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) reach: &'a ReachConfig,
    pub(crate) height_m: f64,
}

impl Ground<'_> {
    pub(crate) fn reaches(&self, place: Vector2<f64>) -> bool {
        self.reach.contains([place.x, place.y, self.height_m])
    }

    /// How far the tool reaches from its centre in the horizontal unit `direction`, m.
    pub(crate) fn extent_m(&self, direction: Vector2<f64>) -> f64 {
        // The tool never turns with respect to the base, so its commanded attitude will do.
        let [x, y, _] = self.robot.tool_rotation();
        let reach = |point: &[f64; 3]| {
            let row = |r: [f64; 3]| r[0] * point[0] + r[1] * point[1] + r[2] * point[2];
            row(x) * direction.x + row(y) * direction.y
        };
        let extents = self.robot.tool_shapes().iter().map(|shape| match shape {
            ToolShape::Ball { center_m, radius_m } => reach(center_m) + radius_m,
            ToolShape::Capsule { a_m, b_m, radius_m } => reach(a_m).max(reach(b_m)) + radius_m,
        });
        extents.fold(0.0, f64::max)
    }

    /// Whether the tool meets `thing` on the straight line from `from` to `to`. A tool that goes away from it does not.
    fn meets(&self, thing: &Circle, from: Vector2<f64>, to: Vector2<f64>) -> bool {
        let line = to - from;
        let share = (thing.center - from).dot(&line) / line.norm_squared().max(1e-12);
        if share <= 0.0 {
            return false;
        }
        let gap = thing.center - (from + line * share.min(1.0));
        let extent_m = gap.try_normalize(1e-9).map_or(0.0, |direction| self.extent_m(direction));
        gap.norm() < thing.radius_m + extent_m - DEPTH_M
    }

    /// `thing`, no larger than the tool at `from` leaves room for.
    fn beside(&self, thing: &Circle, from: Vector2<f64>) -> Circle {
        let gap = thing.center - from;
        let room_m = gap.try_normalize(1e-9).map_or(0.0, |direction| gap.norm() - self.extent_m(direction));
        Circle { radius_m: thing.radius_m.min(room_m.max(0.0)), ..*thing }
    }

    /// Whether the straight line meets none of the things.
    pub(crate) fn free(&self, things: &[Circle], from: Vector2<f64>, to: Vector2<f64>) -> bool {
        things.iter().all(|thing| !self.meets(thing, from, to))
    }

    /// The shortest way from `from` to `to` with the tool down: straight, or by corners round the things. `None` where there is none.
    pub(crate) fn way(&self, things: &[Circle], from: Vector2<f64>, to: Vector2<f64>) -> Option<Way> {
        // Where the tool is, the thing is not: boxes leave room in their circles.
        let solid: Vec<Circle> = things.iter().map(|thing| self.beside(thing, from)).collect();
        if self.free(&solid, from, to) {
            return Some(Way { length_m: (to - from).norm(), first: to });
        }
        let corners = things.iter().flat_map(|thing| {
            (0..CORNERS).map(move |corner| {
                let (sin, cos) = (TAU * corner as f64 / CORNERS as f64).sin_cos();
                let out = Vector2::new(cos, sin);
                thing.center + out * (thing.radius_m + self.extent_m(-out) + ROOM_M)
            })
        });
        // Dijkstra's algorithm on the corners and the place, without a queue: they are few.
        let mut nodes: Vec<Node> = corners
            .filter(|&corner| self.reaches(corner))
            .chain([to])
            .map(|place| Node { place, length_m: f64::INFINITY, first: place, done: false })
            .collect();
        let last = nodes.len() - 1;
        let mut at = (from, 0.0, None);
        loop {
            let (here, so_far_m, first) = at;
            for node in nodes.iter_mut().filter(|node| !node.done) {
                let length_m = so_far_m + (node.place - here).norm();
                if length_m < node.length_m && self.free(&solid, here, node.place) {
                    (node.length_m, node.first) = (length_m, first.unwrap_or(node.place));
                }
            }
            let open = nodes.iter_mut().enumerate().filter(|(_, node)| !node.done && node.length_m.is_finite());
            let (index, node) = open.min_by(|(_, a), (_, b)| a.length_m.total_cmp(&b.length_m))?;
            if index == last {
                return Some(Way { length_m: node.length_m, first: node.first });
            }
            node.done = true;
            at = (node.place, node.length_m, Some(node.first));
        }
    }
}

/// A place on the way.
struct Node {
    place: Vector2<f64>,
    /// Of the shortest way to it that is known.
    length_m: f64,
    /// First turn of that way.
    first: Vector2<f64>,
    done: bool,
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;

    const REACH: ReachConfig = ReachConfig { x_m: [0.3, 0.8], y_m: [-0.5, 0.5], z_m: [0.0, 0.1] };

    /// The Sawyer, whose tool is round: 12 mm.
    fn robot() -> Robot {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
        let text = std::fs::read_to_string(root.join("scenarios/robots/sawyer.toml")).unwrap();
        let file: toml::Table = toml::from_str(&text).unwrap();
        Robot::load(&file["robot"].clone().try_into().unwrap(), root).unwrap()
    }

    fn way(things: &[Circle], from: [f64; 2], to: [f64; 2]) -> Option<Way> {
        Ground { robot: &robot(), reach: &REACH, height_m: 0.05 }.way(things, from.into(), to.into())
    }

    fn circle(x_m: f64, y_m: f64, radius_m: f64) -> Circle {
        Circle { center: Vector2::new(x_m, y_m), radius_m }
    }

    /// Length of a taut string round a circle between two points that are `d` away from its centre, on opposite sides: two tangents and the arc.
    fn taut(radius: f64, d: f64) -> f64 {
        2.0 * (d * d - radius * radius).sqrt() + radius * (std::f64::consts::PI - 2.0 * (radius / d).acos())
    }

    #[test]
    fn a_way_with_nothing_in_between_is_straight() {
        let beside = circle(0.62, 0.0, 0.05);
        let straight = way(&[beside], [0.5, -0.2], [0.5, 0.2]).unwrap();
        assert_eq!(straight, Way { length_m: 0.4, first: Vector2::new(0.5, 0.2) });
    }

    #[test]
    fn a_way_round_a_thing_is_as_long_as_a_string_pulled_tight() {
        for d in [0.08, 0.1, 0.2] {
            let round = way(&[circle(0.55, 0.0, 0.05)], [0.55, -d], [0.55, d]).unwrap();
            // The tool touches at 0.062 m; corners lie 0.01 m farther out.
            let (least, most) = (taut(0.05 + 0.012 - DEPTH_M, d), taut(0.05 + 0.012 + ROOM_M, d) * 1.1);
            assert!((least..most).contains(&round.length_m), "{d}: {round:?} is not within {least} and {most}");
            assert!(round.first.x != 0.55);
        }
    }

    #[test]
    fn a_gap_too_narrow_for_the_tool_is_no_way_and_neither_is_what_lies_out_of_reach() {
        let object = circle(0.5, 0.0, 0.05);
        let round = |thing: Circle| way(&[object, thing], [0.53, -0.1], [0.5, 0.1]).unwrap().first.x;
        assert!(round(circle(0.9, 0.0, 0.01)) > 0.53, "the nearer side");
        assert!(round(circle(0.58, 0.0, 0.02)) < 0.5, "the other side, where something closes the nearer one");
        // Nothing leads past what fills the whole width.
        assert_eq!(way(&[circle(0.55, 0.0, 0.4)], [0.55, -0.45], [0.55, 0.45]), None);
    }

    proptest! {
        #[test]
        fn a_way_is_never_shorter_than_the_straight_line_and_the_same_backwards(
            (x, y, radius_m) in (0.4..0.7_f64, -0.1..0.1_f64, 0.02..0.08_f64), (a, b) in (0.35..0.75_f64, 0.35..0.75_f64)
        ) {
            let things = [circle(x, y, radius_m), circle(0.55, 0.25, 0.04)];
            let (from, to) = ([a, -0.3], [b, 0.4]);
            let (there, back) = (way(&things, from, to).unwrap(), way(&things, to, from).unwrap());
            let straight = Vector2::from(from) - Vector2::from(to);
            prop_assert!(there.length_m >= straight.norm() - 1e-12);
            prop_assert!((there.length_m - back.length_m).abs() < 1e-9, "{there:?} {back:?}");
        }
    }
}
