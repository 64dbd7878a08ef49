//! A serial chain of revolute joints: forward kinematics, Jacobian, gravity torque, mass matrix. No heap in any call.
//!
//! Frames: segment i turns about its own +z, whatever axis the URDF gives (see [`super::urdf`]); its frame sits on the joint.

use nalgebra::{Isometry3, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use crate::state::MAX_JOINTS;

/// One value per joint, unit by context; places beyond the joint count are 0.
pub type JointVector = SVector<f64, MAX_JOINTS>;

/// Geometric Jacobian in base axes. Rows 0–2: linear velocity of the frame's origin (m/rad); rows 3–5: angular velocity.
/// Columns beyond the joint count are 0.
pub type Jacobian = SMatrix<f64, 6, MAX_JOINTS>;

/// Joint-space mass matrix, kg·m²; rows and columns beyond the joint count are 0.
pub type MassMatrix = SMatrix<f64, MAX_JOINTS, MAX_JOINTS>;

/// Gravity along −z of the base, m/s², as in the reference vectors.
pub const GRAVITY_MPS2: f64 = 9.81;

/// A rigid transform with a matrix inside: composing these is faster than composing quaternions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// R(outer ← inner).
    pub(super) rotation: Matrix3<f64>,
    /// Origin of inner, m, in outer.
    pub(super) position: Vector3<f64>,
}

impl Frame {
    pub(super) fn identity() -> Self {
        Self { rotation: Matrix3::identity(), position: Vector3::zeros() }
    }

    /// From URDF `xyz` (m) and fixed-axis `rpy` (rad): R = Rz(yaw) Ry(pitch) Rx(roll).
    pub(super) fn from_xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Self {
        let rotation = *Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]).matrix();
        Self { rotation, position: Vector3::from(xyz) }
    }

    /// outer ← inner, then inner ← innermost.
    pub(super) fn then(&self, inner: &Self) -> Self {
        Self { rotation: self.rotation * inner.rotation, position: self.position + self.rotation * inner.position }
    }

    pub(super) fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, position: -(rotation * self.position) }
    }

    pub(super) fn point(&self, inner: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * inner + self.position
    }

    pub(super) fn quaternion(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation))
    }

    pub(super) fn isometry(&self) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.position), self.quaternion())
    }

    fn z(&self) -> Vector3<f64> {
        self.rotation.column(2).into_owned()
    }
}

/// A rigid mass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertia {
    /// Mass, kg.
    pub(super) mass_kg: f64,
    /// Centre of mass, m.
    pub(super) com: Vector3<f64>,
    /// About the centre of mass, kg·m².
    pub(super) moment: Matrix3<f64>,
}

impl Inertia {
    pub(super) fn zero() -> Self {
        Self { mass_kg: 0.0, com: Vector3::zeros(), moment: Matrix3::zeros() }
    }

    /// The same mass seen from the outer side of `frame`.
    pub(super) fn moved(&self, frame: &Frame) -> Self {
        Self {
            mass_kg: self.mass_kg,
            com: frame.point(&self.com),
            moment: frame.rotation * self.moment * frame.rotation.transpose(),
        }
    }

    /// Both masses as one (parallel-axis theorem).
    pub(super) fn joined(&self, other: &Self) -> Self {
        let mass_kg = self.mass_kg + other.mass_kg;
        if mass_kg <= 0.0 {
            return *self;
        }
        let com = (self.com * self.mass_kg + other.com * other.mass_kg) / mass_kg;
        let about = |part: &Self| {
            let d = part.com - com;
            part.moment + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * part.mass_kg
        };
        Self { mass_kg, com, moment: about(self) + about(other) }
    }
}

/// A joint and everything that it carries rigidly.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    /// Previous segment's frame ← this frame at joint position 0.
    pub(super) mount: Frame,
    /// Mass in this frame.
    pub(super) inertia: Inertia,
}

/// The chain, base first.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) segments: Vec<Segment>,
}

/// Base ← segment, for all segments at one configuration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posture {
    frames: [Frame; MAX_JOINTS],
    count: usize,
}

impl Chain {
    /// Base ← segment frames at `q` (rad).
    pub(super) fn posture(&self, q: &[f64]) -> Posture {
        assert_eq!(q.len(), self.segments.len(), "an arm of {} joints", self.segments.len());
        let mut frames = [Frame::identity(); MAX_JOINTS];
        let mut previous = Frame::identity();
        for ((frame, segment), angle) in frames.iter_mut().zip(&self.segments).zip(q) {
            let at = previous.then(&segment.mount);
            let (sin, cos) = angle.sin_cos();
            let (x, y) = (at.rotation.column(0), at.rotation.column(1));
            let rotation = Matrix3::from_columns(&[x * cos + y * sin, y * cos - x * sin, at.z()]);
            previous = Frame { rotation, position: at.position };
            *frame = previous;
        }
        Posture { frames, count: self.segments.len() }
    }

    /// dU/dq at the posture, N·m: what the motors must hold.
    pub(super) fn gravity_torque(&self, posture: &Posture) -> JointVector {
        let mut torque = JointVector::zeros();
        let (mut mass, mut moment) = (0.0, Vector3::zeros());
        for (i, segment) in self.segments.iter().enumerate().rev() {
            let frame = &posture.frames[i];
            mass += segment.inertia.mass_kg;
            moment += frame.point(&segment.inertia.com) * segment.inertia.mass_kg;
            let z = frame.z();
            let lever = moment - frame.position * mass;
            // z component of z × lever.
            torque[i] = GRAVITY_MPS2 * (z.x * lever.y - z.y * lever.x);
        }
        torque
    }

    /// Potential energy in gravity, J, relative to the base origin.
    pub(super) fn potential_energy(&self, posture: &Posture) -> f64 {
        let height = |(s, f): (&Segment, &Frame)| s.inertia.mass_kg * f.point(&s.inertia.com).z;
        GRAVITY_MPS2 * self.segments.iter().zip(&posture.frames).map(height).sum::<f64>()
    }

    /// M(q) = Σ m Jvᵀ Jv + Jωᵀ I Jω over the segments.
    pub(super) fn mass_matrix(&self, posture: &Posture) -> MassMatrix {
        let mut total = MassMatrix::zeros();
        for (i, segment) in self.segments.iter().enumerate() {
            let inertia = segment.inertia.moved(&posture.frames[i]);
            let jacobian = posture.jacobian_at(i + 1, &inertia.com);
            let linear = jacobian.fixed_rows::<3>(0);
            let angular = jacobian.fixed_rows::<3>(3);
            total += linear.transpose() * linear * inertia.mass_kg + angular.transpose() * inertia.moment * angular;
        }
        total
    }
}

impl Posture {
    /// Base ← segment `index`.
    pub(super) fn frame(&self, index: usize) -> &Frame {
        &self.frames[index]
    }

    /// Jacobian of a base-frame point (m) that moves with the first `moving` joints.
    pub(super) fn jacobian_at(&self, moving: usize, point: &Vector3<f64>) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (j, frame) in self.frames[..moving.min(self.count)].iter().enumerate() {
            let z = frame.z();
            let linear = z.cross(&(point - frame.position));
            jacobian.fixed_view_mut::<3, 1>(0, j).copy_from(&linear);
            jacobian.fixed_view_mut::<3, 1>(3, j).copy_from(&z);
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_masses_of_a_dumbbell_follow_the_parallel_axis_theorem() {
        let ball = |x| Inertia { mass_kg: 2.0, com: Vector3::new(x, 0.0, 0.0), moment: Matrix3::identity() * 0.1 };
        let both = ball(-0.5).joined(&ball(0.5));
        assert_eq!(both.com, Vector3::zeros());
        assert_eq!(both.mass_kg, 4.0);
        assert!((both.moment - Matrix3::from_diagonal(&Vector3::new(0.2, 1.2, 1.2))).norm() < 1e-15);
    }

    #[test]
    fn pendulum_follows_its_closed_form() {
        // A rod along x of the joint, turned about the base's −y: height = L sin q.
        let mount = Frame::from_xyz_rpy([0.0; 3], [std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        let inertia = Inertia { mass_kg: 3.0, com: Vector3::new(0.4, 0.0, 0.0), moment: Matrix3::identity() * 0.02 };
        let chain = Chain { segments: vec![Segment { mount, inertia }] };
        for q in [-1.0, 0.0, 0.3, 2.0_f64] {
            let posture = chain.posture(&[q]);
            assert!((chain.potential_energy(&posture) - 3.0 * 9.81 * 0.4 * q.sin()).abs() < 1e-12);
            assert!((chain.gravity_torque(&posture)[0] - 3.0 * 9.81 * 0.4 * q.cos()).abs() < 1e-12);
            assert!((chain.mass_matrix(&posture)[(0, 0)] - (0.02 + 3.0 * 0.16)).abs() < 1e-12);
        }
    }
}
