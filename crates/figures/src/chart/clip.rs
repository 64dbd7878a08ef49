//! What of lines and areas is inside a rectangle.

use crate::scene::{Point, Rect};

/// The part of a segment inside, after Liang and Barsky (1984).
pub(super) fn segment(from: Point, to: Point, area: &Rect) -> Option<(Point, Point)> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (speed, room) in
        [(-dx, from.0 - area.left), (dx, area.right - from.0), (-dy, from.1 - area.top), (dy, area.bottom - from.1)]
    {
        if speed == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if speed < 0.0 {
            enter = enter.max(room / speed);
        } else {
            leave = leave.min(room / speed);
        }
    }
    let at = |share: f64| (from.0 + share * dx, from.1 + share * dy);
    (enter <= leave).then(|| (if enter > 0.0 { at(enter) } else { from }, if leave < 1.0 { at(leave) } else { to }))
}

/// The parts of a line inside.
pub(crate) fn line(points: &[Point], area: &Rect) -> Vec<Vec<Point>> {
    let mut parts: Vec<Vec<Point>> = Vec::new();
    for pair in points.windows(2) {
        let Some((from, to)) = segment(pair[0], pair[1], area) else { continue };
        match parts.last_mut() {
            Some(part) if part.last() == Some(&from) => part.push(to),
            _ => parts.push(vec![from, to]),
        }
    }
    parts
}

/// The part of a polygon inside, after Sutherland and Hodgman (1974).
pub(crate) fn polygon(points: &[Point], area: &Rect) -> Vec<Point> {
    let inside: [&dyn Fn(&Point) -> f64; 4] =
        [&|p| p.0 - area.left, &|p| area.right - p.0, &|p| p.1 - area.top, &|p| area.bottom - p.1];
    let mut points = points.to_vec();
    for room in inside {
        let mut kept = Vec::with_capacity(points.len() + 4);
        for (i, to) in points.iter().enumerate() {
            let from = &points[(i + points.len() - 1) % points.len()];
            let (a, b) = (room(from), room(to));
            if (a < 0.0) != (b < 0.0) {
                let share = a / (a - b);
                kept.push((from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share));
            }
            if b >= 0.0 {
                kept.push(*to);
            }
        }
        points = kept;
    }
    points
}

/// Whether a point is inside or on the edge.
pub(super) fn contains(area: &Rect, (x, y): Point) -> bool {
    let near = 1e-6;
    (area.left - near..=area.right + near).contains(&x) && (area.top - near..=area.bottom + near).contains(&y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Rect = Rect { left: 0.0, top: 0.0, right: 10.0, bottom: 10.0 };

    #[test]
    fn a_line_that_leaves_and_returns_has_two_parts() {
        let parts = line(&[(-5.0, 5.0), (5.0, 5.0), (5.0, 15.0), (7.0, 15.0), (7.0, 1.0)], &AREA);
        assert_eq!(parts, [vec![(0.0, 5.0), (5.0, 5.0), (5.0, 10.0)], vec![(7.0, 10.0), (7.0, 1.0)]]);
        assert!(line(&[(-5.0, -1.0), (20.0, -1.0)], &AREA).is_empty());
    }

    #[test]
    fn a_polygon_keeps_the_area_inside() {
        let shoelace = |p: &[Point]| {
            let n = p.len();
            (0..n).map(|i| p[i].0 * p[(i + 1) % n].1 - p[(i + 1) % n].0 * p[i].1).sum::<f64>().abs() / 2.0
        };
        // A square half outside on the right, and a triangle of which a corner is cut.
        assert_eq!(shoelace(&polygon(&[(5.0, 2.0), (15.0, 2.0), (15.0, 8.0), (5.0, 8.0)], &AREA)), 30.0);
        assert_eq!(shoelace(&polygon(&[(0.0, 0.0), (20.0, 0.0), (0.0, 20.0)], &AREA)), 100.0);
        assert!(polygon(&[(11.0, 0.0), (20.0, 0.0), (15.0, 20.0)], &AREA).is_empty());
    }
}
