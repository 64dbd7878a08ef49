//! The columns of a log, each with its name and unit.

use crate::Robot;

/// World axis of a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Axis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

impl Axis {
    /// All three, in order.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    fn letter(self) -> char {
        match self {
            Self::X => 'x',
            Self::Y => 'y',
            Self::Z => 'z',
        }
    }
}

/// Component of a quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Component {
    /// i.
    X,
    /// j.
    Y,
    /// k.
    Z,
    /// Real part.
    W,
}

impl Component {
    /// All four in the order of the columns: x, y, z, w.
    pub const ALL: [Self; 4] = [Self::X, Self::Y, Self::Z, Self::W];
}

/// A column of readings. `episode`, `time_secs` and `action` are not channels: see [`crate::Episode`]. Columns are
/// written in the order of the variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Commanded tool centre, m, base axes.
    Command(Axis),
    /// Measured tool centre, m, base axes.
    Tool(Axis),
    /// Measured joint position, rad.
    Joint(u8),
    /// Force that the world exerts on the tool at its centre, N, base axes.
    WristForce(Axis),
    /// Torque that the world exerts on the tool about its centre, N·m, base axes.
    WristTorque(Axis),
    /// Measured joint torque, N·m.
    JointTorque(u8),
    /// Measured centre of the object's shape, m, base axes.
    ObjectPosition(Axis),
    /// Measured orientation of the object: body to base, a unit quaternion.
    ObjectOrientation(Component),
    /// Measured velocity of the object's centre, m/s, base axes.
    ObjectVelocity(Axis),
    /// Measured angular velocity of the object, rad/s, base axes.
    ObjectSpin(Axis),
    /// Known weight fixed at the object's centre in this episode, kg.
    AddedMass,
}

impl Channel {
    /// Every channel that a log of `robot` may have, in the order of the columns.
    #[must_use]
    pub fn all(robot: Robot) -> Vec<Self> {
        let joints = 0..robot.joints();
        let vector = |make: fn(Axis) -> Self| Axis::ALL.map(make);
        let mut all = Vec::new();
        all.extend(vector(Self::Command));
        all.extend(vector(Self::Tool));
        all.extend(joints.clone().map(Self::Joint));
        all.extend(vector(Self::WristForce));
        all.extend(vector(Self::WristTorque));
        all.extend(joints.map(Self::JointTorque));
        all.extend(vector(Self::ObjectPosition));
        all.extend(Component::ALL.map(Self::ObjectOrientation));
        all.extend(vector(Self::ObjectVelocity));
        all.extend(vector(Self::ObjectSpin));
        all.push(Self::AddedMass);
        all
    }

    /// Name of its column, which ends in its unit.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Command(a) => format!("command_{}_m", a.letter()),
            Self::Tool(a) => format!("tool_{}_m", a.letter()),
            Self::Joint(j) => format!("joint_{j}_rad"),
            Self::WristForce(a) => format!("wrist_f{}_n", a.letter()),
            Self::WristTorque(a) => format!("wrist_t{}_nm", a.letter()),
            Self::JointTorque(j) => format!("joint_torque_{j}_nm"),
            Self::ObjectPosition(a) => format!("object_{}_m", a.letter()),
            Self::ObjectOrientation(c) => {
                let letter = match c {
                    Component::X => 'x',
                    Component::Y => 'y',
                    Component::Z => 'z',
                    Component::W => 'w',
                };
                format!("object_q{letter}")
            }
            Self::ObjectVelocity(a) => format!("object_v{}_mps", a.letter()),
            Self::ObjectSpin(a) => format!("object_w{}_rps", a.letter()),
            Self::AddedMass => "added_mass_kg".into(),
        }
    }

    /// Largest accepted magnitude, in the channel's unit. A table-top experiment stays below it; a larger value means a
    /// wrong unit or damage.
    #[must_use]
    pub fn limit(self) -> f64 {
        match self {
            Self::Command(_) | Self::Tool(_) | Self::ObjectPosition(_) | Self::AddedMass => 1e3,
            Self::ObjectOrientation(_) => 1.0 + crate::UNIT_TOLERANCE,
            Self::Joint(_) | Self::ObjectVelocity(_) => 1e3,
            Self::ObjectSpin(_) => 1e4,
            Self::WristForce(_) | Self::WristTorque(_) | Self::JointTorque(_) => 1e6,
        }
    }

    /// The columns that must be present together: those of a position or an orientation. Forces are left out, because
    /// some rigs measure only two axes.
    pub(crate) fn group(self) -> Vec<Self> {
        match self {
            Self::Command(_) => Axis::ALL.map(Self::Command).to_vec(),
            Self::Tool(_) => Axis::ALL.map(Self::Tool).to_vec(),
            Self::ObjectPosition(_) => Axis::ALL.map(Self::ObjectPosition).to_vec(),
            Self::ObjectOrientation(_) => Component::ALL.map(Self::ObjectOrientation).to_vec(),
            Self::ObjectVelocity(_) => Axis::ALL.map(Self::ObjectVelocity).to_vec(),
            Self::ObjectSpin(_) => Axis::ALL.map(Self::ObjectSpin).to_vec(),
            _ => vec![self],
        }
    }
}

/// The known name that shares the longest beginning with `name`, as a suggestion.
pub(crate) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let shared = |other: &str| name.bytes().zip(other.bytes()).take_while(|(a, b)| a == b).count();
    let mut best = None;
    for other in known {
        // The first of equals, so that the answer does not depend on what follows.
        if best.is_none_or(|b| shared(other) > shared(b)) {
            best = Some(other);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_carry_their_unit() {
        for robot in [Robot::Sawyer, Robot::Jaco, Robot::None] {
            let all = Channel::all(robot);
            let names: std::collections::BTreeSet<String> = all.iter().map(|c| c.name()).collect();
            assert_eq!(names.len(), 26 + 2 * usize::from(robot.joints()));
            assert!(all.is_sorted());
        }
        assert_eq!(Channel::ObjectSpin(Axis::Z).name(), "object_wz_rps");
        assert_eq!(Channel::WristTorque(Axis::X).name(), "wrist_tx_nm");
        assert_eq!(Channel::JointTorque(6).name(), "joint_torque_6_nm");
    }

    #[test]
    fn a_wrong_unit_is_answered_with_the_right_one() {
        let names: Vec<String> = Channel::all(Robot::Jaco).iter().map(|c| c.name()).collect();
        let known = || names.iter().map(String::as_str);
        assert_eq!(nearest("tool_y_mm", known()), Some("tool_y_m"));
        assert_eq!(nearest("joint_3_deg", known()), Some("joint_3_rad"));
    }
}
