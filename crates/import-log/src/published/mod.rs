//! Published measurements of others as logs: units and axes are changed, nothing else. `docs/src/results/published-logs.md`
//! says what was found in the data.

mod cmu_push;
mod contactnets;

pub use cmu_push::{HARD_BOARD_N, cmu_push};
pub use contactnets::contactnets;

/// A vector in world axes from one in the axes of a body with the orientation `q` (unit quaternion x, y, z, w, body to world).
fn rotate(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [x, y, z, w] = q;
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let u = [x, y, z];
    let t = cross(u, v).map(|c| 2.0 * c);
    let s = cross(u, t);
    [0, 1, 2].map(|i| v[i] + w * t[i] + s[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turned = rotate([0.0, 0.0, half, half], [1.0, 2.0, 3.0]);
        for (found, expected) in turned.iter().zip([-2.0, 1.0, 3.0]) {
            assert!((found - expected).abs() < 1e-15, "{turned:?}");
        }
    }
}
