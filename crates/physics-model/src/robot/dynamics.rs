//! Inverse dynamics of a chain: which torques a motion takes.

use nalgebra::{Matrix3, Vector3};

use super::chain::{Chain, GRAVITY_MPS2, JointVector};
use crate::state::MAX_JOINTS;

impl Chain {
    /// Torques, N·m, of M(q) q̈ + C(q, q̇) q̇ + g(q): recursive Newton–Euler (Luh, Walker and Paul 1980; Featherstone 2008, chapter 5),
    /// with all vectors in base axes. `q` rad, `rate` rad/s, `acceleration` rad/s².
    pub(super) fn inverse_dynamics(&self, q: &[f64], rate: &[f64], acceleration: &[f64]) -> JointVector {
        let posture = self.posture(q);
        let count = self.segments.len();
        assert!(rate.len() == count && acceleration.len() == count, "rates and accelerations of {count} joints");
        let mut loads = [(Vector3::zeros(), Vector3::zeros()); MAX_JOINTS];
        let (mut spin, mut spin_rate) = (Vector3::zeros(), Vector3::zeros());
        // A base that accelerates upwards stands for gravity.
        let mut linear = Vector3::new(0.0, 0.0, GRAVITY_MPS2);
        let mut origin = Vector3::zeros();
        for (i, segment) in self.segments.iter().enumerate() {
            let frame = posture.frame(i);
            let arm = frame.position - origin;
            linear += spin_rate.cross(&arm) + spin.cross(&spin.cross(&arm));
            origin = frame.position;
            let axis = frame.rotation.column(2).into_owned();
            spin_rate += axis * acceleration[i] + spin.cross(&axis) * rate[i];
            spin += axis * rate[i];
            let inertia = segment.inertia.moved(frame);
            let arm = inertia.com - frame.position;
            let force = (linear + spin_rate.cross(&arm) + spin.cross(&spin.cross(&arm))) * inertia.mass_kg;
            let moment: Matrix3<f64> = inertia.moment;
            loads[i] = (force, moment * spin_rate + spin.cross(&(moment * spin)) + arm.cross(&force));
        }
        let mut torque = JointVector::zeros();
        let (mut force, mut moment, mut above) = (Vector3::zeros(), Vector3::zeros(), origin);
        for i in (0..count).rev() {
            let frame = posture.frame(i);
            // The load of the joints above, moved to this joint's origin, and this segment's own.
            moment += (above - frame.position).cross(&force) + loads[i].1;
            force += loads[i].0;
            above = frame.position;
            torque[i] = frame.rotation.column(2).dot(&moment);
        }
        torque
    }
}
