//! The arm as rigid bodies joined by its joints, for a simulator of articulated bodies.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::Robot;
use super::chain::Frame;

/// What one joint moves up to the next one. Its frame is that of the joint; for the last body it is the tool's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArmBody {
    /// Pose, m, base frame.
    pub(crate) base_from_body: Isometry3<f64>,
    /// The joint's frame, +z its axis, m, in the frame of the body before (the base for the first).
    pub(crate) parent_from_joint: Isometry3<f64>,
    /// The same frame, m, in this body.
    pub(crate) body_from_joint: Isometry3<f64>,
    /// Mass, kg.
    pub(crate) mass_kg: f64,
    /// Centre of mass, m, in this body.
    pub(crate) com_m: Vector3<f64>,
    /// Moment of inertia about the centre of mass, kg·m², axes of this body.
    pub(crate) moment_kgm2: Matrix3<f64>,
}

impl Robot {
    /// The bodies at joint positions `q` (rad), base first: the joints' frames are those of this posture, as if it were their zero.
    pub(crate) fn bodies(&self, q: &[f64]) -> Vec<ArmBody> {
        let posture = self.chain.posture(q);
        let last = self.joint_count() - 1;
        let mut parent = Frame::identity();
        let segments = self.chain.segments.iter().enumerate();
        segments
            .map(|(i, segment)| {
                let joint = *posture.frame(i);
                let parent_from_joint = parent.inverse().then(&joint);
                parent = joint;
                let joint_from_body =
                    if i == last { self.links[self.tool.0].segment_from_link } else { Frame::identity() };
                let body_from_joint = joint_from_body.inverse();
                let inertia = segment.inertia.moved(&body_from_joint);
                ArmBody {
                    base_from_body: joint.then(&joint_from_body).isometry(),
                    parent_from_joint: parent_from_joint.isometry(),
                    body_from_joint: body_from_joint.isometry(),
                    mass_kg: inertia.mass_kg,
                    com_m: inertia.com,
                    moment_kgm2: inertia.moment,
                }
            })
            .collect()
    }
}
