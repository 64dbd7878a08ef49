//! Rotations and rigid transforms.

use serde::Deserialize;

pub(crate) type Vec3 = [f64; 3];
/// Unit quaternion x, y, z, w.
pub(crate) type Quaternion = [f64; 4];

/// How far rows of a rotation may be from orthonormal, and a quaternion from unit length: what rounding to 3 decimals leaves.
const TOLERANCE: f64 = 5e-3;

/// A rotation, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rigid {
    pub(crate) translation_m: Vec3,
    pub(crate) rotation: Quaternion,
}

/// As it stands in a mapping.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRigid {
    #[serde(default)]
    pub(crate) translation_m: Vec3,
    pub(crate) quaternion_xyzw: Option<Quaternion>,
    pub(crate) rpy_deg: Option<Vec3>,
    pub(crate) matrix: Option<[Vec3; 3]>,
}

impl RawRigid {
    /// The transform, or the key below this one that is wrong, and why.
    pub(crate) fn resolve(&self) -> Result<Rigid, (&'static str, String)> {
        if let Some(wrong) = self.translation_m.iter().find(|v| !(-1000.0..=1000.0).contains(*v)) {
            return Err(("translation_m", format!("expected -1000 to 1000 m, found {wrong}")));
        }
        let rotation = match (self.quaternion_xyzw, self.rpy_deg, self.matrix) {
            (None, None, None) => [0.0, 0.0, 0.0, 1.0],
            (Some(q), None, None) => {
                let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
                if (norm - 1.0).abs() >= TOLERANCE || norm.is_nan() {
                    return Err(("quaternion_xyzw", format!("expected a unit quaternion, found one of norm {norm}")));
                }
                q.map(|v| v / norm)
            }
            (None, Some(rpy), None) => {
                if let Some(wrong) = rpy.iter().find(|v| !(-1e4..=1e4).contains(*v)) {
                    return Err(("rpy_deg", format!("expected angles in degrees, found {wrong:e}")));
                }
                from_rpy(rpy.map(f64::to_radians))
            }
            (None, None, Some(matrix)) => from_matrix(&matrix).map_err(|reason| ("matrix", reason))?,
            _ => return Err(("rpy_deg", "expected one of quaternion_xyzw, rpy_deg and matrix, found two".into())),
        };
        Ok(Rigid { translation_m: self.translation_m, rotation })
    }
}

impl Rigid {
    pub(crate) fn point(&self, p: Vec3) -> Vec3 {
        add(rotate(self.rotation, p), self.translation_m)
    }
}

pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A vector in world axes from one in the axes of a body with the orientation `q`, body to world.
pub(crate) fn rotate(q: Quaternion, v: Vec3) -> Vec3 {
    let u = [q[0], q[1], q[2]];
    let t = cross(u, v).map(|c| 2.0 * c);
    let s = cross(u, t);
    [0, 1, 2].map(|i| v[i] + q[3] * t[i] + s[i])
}

/// First `b`, then `a`.
pub(crate) fn multiply(a: Quaternion, b: Quaternion) -> Quaternion {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// Roll about x, then pitch about y, then yaw about z, all of the fixed frame, rad.
pub(crate) fn from_rpy([roll, pitch, yaw]: Vec3) -> Quaternion {
    let about = |axis: usize, angle: f64| {
        let mut q = [0.0, 0.0, 0.0, (0.5 * angle).cos()];
        q[axis] = (0.5 * angle).sin();
        q
    };
    multiply(about(2, yaw), multiply(about(1, pitch), about(0, roll)))
}

fn from_matrix(m: &[Vec3; 3]) -> Result<Quaternion, String> {
    let dot = |i: usize, j: usize| (0..3).map(|k| m[i][k] * m[j][k]).sum::<f64>();
    for i in 0..3 {
        for j in i..3 {
            let expected = if i == j { 1.0 } else { 0.0 };
            if (dot(i, j) - expected).abs() >= TOLERANCE || dot(i, j).is_nan() {
                return Err(format!("expected orthonormal rows, found {} for rows {} and {}", dot(i, j), i + 1, j + 1));
            }
        }
    }
    let c = cross(m[0], m[1]);
    if (0..3).map(|k| c[k] * m[2][k]).sum::<f64>() < 0.0 {
        return Err("expected a rotation, found a mirror".into());
    }
    // The largest of the four squares is at least a quarter, so nothing small is divided by.
    let (xx, yy, zz) = (m[0][0], m[1][1], m[2][2]);
    let squares = [1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz, 1.0 + xx + yy + zz];
    let largest = (0..4).max_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap_or(3);
    let q = match largest {
        0 => [squares[0], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]],
        1 => [m[0][1] + m[1][0], squares[1], m[1][2] + m[2][1], m[0][2] - m[2][0]],
        2 => [m[0][2] + m[2][0], m[1][2] + m[2][1], squares[2], m[1][0] - m[0][1]],
        _ => [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], squares[3]],
    };
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    Ok(q.map(|v| v / norm))
}

/// Between two unit quaternions on the shorter way, `share` of it from `a` (Shoemake, SIGGRAPH 1985).
pub(crate) fn slerp(a: Quaternion, b: Quaternion, share: f64) -> Quaternion {
    let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    let b = if dot < 0.0 { b.map(|v| -v) } else { b };
    let angle = dot.abs().min(1.0).acos();
    // Neighbours are close as a rule: the chord is the arc, to rounding.
    let (from, to) = if angle < 1e-6 {
        (1.0 - share, share)
    } else {
        (((1.0 - share) * angle).sin() / angle.sin(), (share * angle).sin() / angle.sin())
    };
    [0, 1, 2, 3].map(|i| from * a[i] + to * b[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12)
    }

    fn raw() -> RawRigid {
        RawRigid { translation_m: [1.0, 2.0, 3.0], quaternion_xyzw: None, rpy_deg: None, matrix: None }
    }

    #[test]
    fn the_three_ways_to_write_a_rotation_agree() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let quaternion = RawRigid { quaternion_xyzw: Some([0.0, 0.0, half, half]), ..raw() }.resolve().unwrap();
        let rpy = RawRigid { rpy_deg: Some([0.0, 0.0, 90.0]), ..raw() }.resolve().unwrap();
        let matrix = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let matrix = RawRigid { matrix: Some(matrix), ..raw() }.resolve().unwrap();
        for rigid in [quaternion, rpy, matrix] {
            assert!(close(&rigid.point([1.0, 0.0, 0.0]), &[1.0, 3.0, 3.0]), "{rigid:?}");
        }
        // Roll comes first: y turns to z, and the yaw leaves it there.
        assert!(close(&rotate(from_rpy([half.acos() * 2.0, 0.0, 1.0]), [0.0, 1.0, 0.0]), &[0.0, 0.0, 1.0]));
    }

    #[test]
    fn half_turns_come_out_of_matrices() {
        for axis in 0..3 {
            let mut matrix = [[0.0; 3]; 3];
            for (i, row) in matrix.iter_mut().enumerate() {
                row[i] = if i == axis { 1.0 } else { -1.0 };
            }
            let q = from_matrix(&matrix).unwrap();
            assert!((q[axis].abs() - 1.0).abs() < 1e-12, "{q:?}");
        }
    }

    #[test]
    fn mirrors_and_stretched_frames_are_refused() {
        let mirror = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
        let (key, reason) = RawRigid { matrix: Some(mirror), ..raw() }.resolve().unwrap_err();
        assert_eq!((key, reason.as_str()), ("matrix", "expected a rotation, found a mirror"));
        let stretched = RawRigid { quaternion_xyzw: Some([0.0, 0.0, 1.0, 1.0]), ..raw() };
        assert_eq!(stretched.resolve().unwrap_err().0, "quaternion_xyzw");
        let two = RawRigid { rpy_deg: Some([0.0; 3]), matrix: Some(mirror), ..raw() };
        assert!(two.resolve().unwrap_err().1.contains("found two"));
    }

    #[test]
    fn halfway_is_half_the_turn_whatever_the_sign() {
        let a = from_rpy([0.0, 0.0, 0.2]);
        let b = from_rpy([0.0, 0.0, 1.0]).map(|v| -v);
        assert!(close(&slerp(a, b, 0.5), &from_rpy([0.0, 0.0, 0.6])));
        assert!(close(&slerp(a, a, 0.3), &a));
    }
}
