//! Outlines and feet of prisms.

/// Corners of an outline at most; each pair of edges is compared.
const MOST_CORNERS: usize = 256;

type Point = [f64; 2];

/// Why the corners are no simple polygon of positive area.
pub(crate) fn check_outline(corners: &[Point]) -> Result<(), String> {
    let n = corners.len();
    if !(3..=MOST_CORNERS).contains(&n) {
        return Err(format!("expected 3 to {MOST_CORNERS} corners, found {n}"));
    }
    check_coordinates(corners)?;
    let edge = |i: usize| (corners[i], corners[(i + 1) % n]);
    for i in 0..n {
        let (a, b) = edge(i);
        if a == b {
            return Err(format!("expected corners that differ, found corner {} twice", i + 1));
        }
        // Neighbours share a corner; they must not fold back onto each other.
        let c = corners[(i + 2) % n];
        if cross(a, b, c) == 0.0 && dot(b, a, c) > 0.0 {
            return Err(format!("expected a simple outline, found that it folds back at corner {}", (i + 1) % n + 1));
        }
        for j in i + 2..n {
            if i == 0 && j == n - 1 {
                continue;
            }
            if meet(edge(i), edge(j)) {
                return Err(format!("expected a simple outline, found that edges {} and {} meet", i + 1, j + 1));
            }
        }
    }
    let area: f64 = (0..n).map(edge).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0;
    if area.abs() < 1e-12 {
        return Err(format!("expected an area of more than 1e-12 m², found {}", area.abs()));
    }
    Ok(())
}

/// Why nothing stands on the feet; none at all means the whole lower face.
pub(crate) fn check_feet(feet: &[Point]) -> Result<(), String> {
    if feet.is_empty() {
        return Ok(());
    }
    if !(3..=MOST_CORNERS).contains(&feet.len()) {
        return Err(format!("expected 3 to {MOST_CORNERS} feet, found {}", feet.len()));
    }
    check_coordinates(feet)?;
    let (a, b) = (feet[0], feet.iter().find(|p| **p != feet[0]).copied().unwrap_or(feet[0]));
    if feet.iter().all(|c| cross(a, b, *c).abs() < 1e-12) {
        return Err("expected feet that are not on one line".into());
    }
    Ok(())
}

fn check_coordinates(points: &[Point]) -> Result<(), String> {
    match points.iter().flatten().find(|v| v.is_nan() || v.abs() > 10.0) {
        Some(found) => Err(format!("expected coordinates of -10 to 10 m, found {found}")),
        None => Ok(()),
    }
}

/// Twice the signed area of the triangle a, b, c, m².
fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Scalar product of the ways from `from` to `a` and to `b`, m².
fn dot(from: Point, a: Point, b: Point) -> f64 {
    (a[0] - from[0]) * (b[0] - from[0]) + (a[1] - from[1]) * (b[1] - from[1])
}

/// Whether two segments share a point.
fn meet((a, b): (Point, Point), (c, d): (Point, Point)) -> bool {
    let sides = [cross(c, d, a), cross(c, d, b), cross(a, b, c), cross(a, b, d)];
    if sides[0] * sides[1] < 0.0 && sides[2] * sides[3] < 0.0 {
        return true;
    }
    let touches = |side: f64, p: Point, (s, e): (Point, Point)| side == 0.0 && dot(p, s, e) <= 0.0;
    touches(sides[0], a, (c, d))
        || touches(sides[1], b, (c, d))
        || touches(sides[2], c, (a, b))
        || touches(sides[3], d, (a, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simple_outlines_pass_in_both_directions_convex_or_not() {
        let triangle = [[-0.05, -0.05], [0.1, -0.05], [-0.05, 0.1]];
        let arrow = [[0.0, 0.0], [1.0, 1.0], [0.0, 0.5], [-1.0, 1.0]];
        for outline in [&triangle[..], &arrow[..]] {
            check_outline(outline).unwrap();
            let mut reverse = outline.to_vec();
            reverse.reverse();
            check_outline(&reverse).unwrap();
        }
    }

    #[test]
    fn outlines_that_enclose_nothing_or_cross_are_refused() {
        let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        let touching = [[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.5, 0.0], [0.0, 1.0]];
        let flat = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]];
        let twice = [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let far = [[0.0, 0.0], [1e9, 0.0], [0.0, 1.0]];
        let nan = [[0.0, 0.0], [f64::NAN, 0.0], [0.0, 1.0]];
        for outline in [&bow_tie[..], &touching[..], &flat[..], &twice[..], &far[..], &nan[..], &flat[..2]] {
            assert!(check_outline(outline).is_err(), "{outline:?}");
        }
    }

    #[test]
    fn feet_span_an_area_or_are_absent() {
        check_feet(&[]).unwrap();
        check_feet(&[[0.01, 0.01], [0.13, 0.01], [0.01, 0.13]]).unwrap();
        for feet in [&[[0.0, 0.0], [1.0, 0.0]][..], &[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], &[[0.5, 0.5]; 3]] {
            assert!(check_feet(feet).is_err(), "{feet:?}");
        }
    }
}
