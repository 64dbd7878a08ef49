//! A rigid mass by the ten numbers in which torques are linear.

use nalgebra::{IsometryMatrix3, Matrix3, Vector3};
use urdf_file::Link;

/// A rigid mass, seen from the origin of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    /// kg.
    pub mass_kg: f64,
    /// Mass times place of its centre, kg·m.
    pub moment_kgm: Vector3<f64>,
    /// About the origin of the frame, kg·m².
    pub inertia_kgm2: Matrix3<f64>,
}

impl Mass {
    /// None.
    #[must_use]
    pub fn zero() -> Self {
        Self { mass_kg: 0.0, moment_kgm: Vector3::zeros(), inertia_kgm2: Matrix3::zeros() }
    }

    /// From its centre, m, and its inertia about that, kg·m².
    #[must_use]
    pub fn about_centre(mass_kg: f64, centre_m: Vector3<f64>, inertia_kgm2: Matrix3<f64>) -> Self {
        Self { mass_kg, moment_kgm: centre_m * mass_kg, inertia_kgm2: inertia_kgm2 + steiner(mass_kg, &centre_m) }
    }

    /// From [`Self::numbers`].
    #[must_use]
    pub fn from_numbers(numbers: &[f64; 10]) -> Self {
        let [mass_kg, x, y, z, xx, xy, xz, yy, yz, zz] = *numbers;
        let inertia_kgm2 = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Self { mass_kg, moment_kgm: Vector3::new(x, y, z), inertia_kgm2 }
    }

    pub(crate) fn of_link(link: &Link) -> Self {
        let inertial = &link.inertial;
        let [ixx, ixy, ixz, iyy, iyz, izz] = inertial.inertia;
        let inertia = Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz);
        Self::about_centre(inertial.mass_kg, Vector3::zeros(), inertia).moved(&crate::chain::placed(&inertial.origin))
    }

    /// The same mass seen from the outer side of `outer_from_inner`.
    #[must_use]
    pub fn moved(&self, outer_from_inner: &IsometryMatrix3<f64>) -> Self {
        let rotation = outer_from_inner.rotation.matrix();
        let place = outer_from_inner.translation.vector;
        let moment = rotation * self.moment_kgm;
        let turned = rotation * self.inertia_kgm2 * rotation.transpose();
        // I' = R I Rᵀ + the terms of Steiner's theorem about an origin that is not the centre of mass.
        let cross = |a: &Vector3<f64>, b: &Vector3<f64>| Matrix3::identity() * a.dot(b) - b * a.transpose();
        let moved = cross(&place, &moment) + cross(&moment, &place) + cross(&place, &place) * self.mass_kg;
        Self { mass_kg: self.mass_kg, moment_kgm: moment + place * self.mass_kg, inertia_kgm2: turned + moved }
    }

    /// Both as one.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        Self {
            mass_kg: self.mass_kg + other.mass_kg,
            moment_kgm: self.moment_kgm + other.moment_kgm,
            inertia_kgm2: self.inertia_kgm2 + other.inertia_kgm2,
        }
    }

    /// Centre, m; the origin where there is no mass.
    #[must_use]
    pub fn centre_m(&self) -> Vector3<f64> {
        if self.mass_kg > 0.0 { self.moment_kgm / self.mass_kg } else { Vector3::zeros() }
    }

    /// Inertia about the centre, kg·m².
    #[must_use]
    pub fn central_kgm2(&self) -> Matrix3<f64> {
        self.inertia_kgm2 - steiner(self.mass_kg, &self.centre_m())
    }

    /// m; m c_x, m c_y, m c_z; I_xx, I_xy, I_xz, I_yy, I_yz, I_zz about the origin.
    #[must_use]
    pub fn numbers(&self) -> [f64; 10] {
        let (h, i) = (&self.moment_kgm, &self.inertia_kgm2);
        [self.mass_kg, h.x, h.y, h.z, i.m11, i.m12, i.m13, i.m22, i.m23, i.m33]
    }
}

fn steiner(mass_kg: f64, centre_m: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * centre_m.norm_squared() - centre_m * centre_m.transpose()) * mass_kg
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Translation3};

    use super::*;

    #[test]
    fn a_mass_seen_from_elsewhere_keeps_its_centre_and_its_own_inertia() {
        let own = Matrix3::new(0.03, 0.002, -0.001, 0.002, 0.05, 0.004, -0.001, 0.004, 0.06);
        let mass = Mass::about_centre(2.0, Vector3::new(0.1, -0.2, 0.3), own);
        let outer_from_inner = IsometryMatrix3::from_parts(
            Translation3::new(0.4, 0.5, -0.6),
            Rotation3::from_euler_angles(0.3, -1.1, 2.0),
        );
        let seen = mass.moved(&outer_from_inner);
        let centre = outer_from_inner * nalgebra::Point3::new(0.1, -0.2, 0.3);
        assert!((seen.centre_m() - centre.coords).norm() < 1e-12);
        let rotation = outer_from_inner.rotation.matrix();
        assert!((seen.central_kgm2() - rotation * own * rotation.transpose()).norm() < 1e-12);
        assert_eq!(Mass::from_numbers(&seen.numbers()), seen);
        let back = seen.moved(&outer_from_inner.inverse());
        assert!((back.inertia_kgm2 - mass.inertia_kgm2).norm() < 1e-12);
    }
}
