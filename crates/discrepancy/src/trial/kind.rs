//! What is measured.

use measured_log::{Axis, Channel};
use serde::Serialize;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Object's position.
    ObjectPosition,
    /// Object's orientation.
    ObjectOrientation,
    /// Object's velocity.
    ObjectVelocity,
    /// Object's angular velocity.
    ObjectSpin,
    /// Place of the tool.
    ToolPosition,
    /// Joint positions.
    JointPosition,
    /// Force at the wrist.
    WristForce,
    /// Torque at the wrist.
    WristTorque,
    /// Torques of the joints.
    JointTorque,
}

impl Kind {
    /// All, in order.
    pub const ALL: [Self; 9] = [
        Self::ObjectPosition,
        Self::ObjectOrientation,
        Self::ObjectVelocity,
        Self::ObjectSpin,
        Self::ToolPosition,
        Self::JointPosition,
        Self::WristForce,
        Self::WristTorque,
        Self::JointTorque,
    ];

    /// Whether it is a force or a torque.
    #[must_use]
    pub fn is_force(self) -> bool {
        matches!(self, Self::WristForce | Self::WristTorque | Self::JointTorque)
    }

    /// Name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ObjectPosition => "object_position",
            Self::ObjectOrientation => "object_orientation",
            Self::ObjectVelocity => "object_velocity",
            Self::ObjectSpin => "object_spin",
            Self::ToolPosition => "tool_position",
            Self::JointPosition => "joint_position",
            Self::WristForce => "wrist_force",
            Self::WristTorque => "wrist_torque",
            Self::JointTorque => "joint_torque",
        }
    }

    /// Unit of a component.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::ObjectPosition | Self::ToolPosition => "m",
            Self::ObjectOrientation | Self::JointPosition => "rad",
            Self::ObjectVelocity => "m/s",
            Self::ObjectSpin => "rad/s",
            Self::WristForce => "N",
            Self::WristTorque | Self::JointTorque => "N·m",
        }
    }

    /// Its scalar columns for an arm with `joints` joints; none for the orientation, which is no sum of columns.
    pub(crate) fn channels(self, joints: usize) -> Vec<Channel> {
        let vector = |make: fn(Axis) -> Channel| Axis::ALL.map(make).to_vec();
        let joint = |make: fn(u8) -> Channel| (0..joints as u8).map(make).collect();
        match self {
            Self::ObjectPosition => vector(Channel::ObjectPosition),
            Self::ObjectOrientation => Vec::new(),
            Self::ObjectVelocity => vector(Channel::ObjectVelocity),
            Self::ObjectSpin => vector(Channel::ObjectSpin),
            Self::ToolPosition => vector(Channel::Tool),
            Self::JointPosition => joint(Channel::Joint),
            Self::WristForce => vector(Channel::WristForce),
            Self::WristTorque => vector(Channel::WristTorque),
            Self::JointTorque => joint(Channel::JointTorque),
        }
    }
}
