//! Other ways in which the numbers of a log can be meant.

use measured_log::{Axis, Channel, Component, Episode, Log, Number, Readings, Shape};
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::Serialize;

use crate::motion::rotation;

/// What the numbers of a log may stand for instead of what the format says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reading {
    /// The quaternion leads from base to body.
    Conjugate,
    /// The columns of the quaternion hold w, x, y, z.
    RealFirst,
    /// Both.
    ConjugateRealFirst,
    /// The columns of the quaternion hold y, z, w, x: undoes [`Self::RealFirst`], and makes such a log of a good one.
    RealLast,
    /// Object poses are in a frame turned about z by so many quarters.
    TrackerTurned(u8),
    /// The object's own axes are turned about z by so many quarters.
    BodyTurned(u8),
    /// Object poses are in a frame of which an axis points the other way.
    Mirrored(usize),
    /// An axis of the object's positions points the other way, and its turns do not show it.
    PositionMirrored(usize),
    /// Object poses are in a frame that lies elsewhere: they are to be turned about the vertical through the origin, then moved.
    Moved {
        /// m.
        translation_m: [f64; 3],
        /// rad.
        yaw_rad: f64,
    },
    /// x and y of the object's positions are exchanged.
    PositionSwapped,
    /// Positions of the object in another unit of length: times this they are metres.
    PositionScaled(f64),
    /// Two lengths of `object.size_m` are exchanged.
    LengthsSwapped(usize, usize),
    /// All lengths of the object times this: half lengths for full ones, or the reverse.
    LengthsScaled(f64),
    /// The radius of a cylinder times this: a diameter for a radius, or the reverse.
    RadiusScaled(f64),
    /// The radius of the tool times this.
    ToolRadiusScaled(f64),
    /// The pose is of the middle of the lower (−1) or the upper (1) face, not of the centre.
    OriginAt(f64),
    /// The table's height in the frame of the object, m.
    TableAt(f64),
    /// The wrench in other axes: of component i the axis (0 to 2) and the sign.
    Wrench([(u8, i8); 3]),
    /// Forces times this.
    ForceScaled(f64),
    /// Torques about a point from which the tool centre lies so, m.
    TorqueAbout([f64; 3]),
    /// Torques times this.
    TorqueScaled(f64),
    /// Added masses times this.
    AddedMassScaled(f64),
    /// Joint angles in degrees.
    JointsInDegrees,
    /// Two joints exchanged.
    JointsSwapped(u8, u8),
    /// A joint's angle plus this, rad.
    JointOffset(u8, f64),
    /// A joint's angle counted the other way.
    JointReversed(u8),
}

impl Reading {
    /// As a condition: `with the quaternion taken as its conjugate`.
    #[must_use]
    pub fn words(&self) -> String {
        let axis = |i: usize| ["x", "y", "z"][i.min(2)];
        match self {
            Self::Conjugate => "with the quaternion taken as leading from base to body (its conjugate)".into(),
            Self::RealFirst => "with the quaternion read in the order w, x, y, z".into(),
            Self::ConjugateRealFirst => {
                "with the quaternion read in the order w, x, y, z, and from base to body".into()
            }
            Self::RealLast => "with the quaternion read in the order y, z, w, x".into(),
            Self::TrackerTurned(quarters) => {
                format!("with the object's poses turned by {}° about z", 90 * u32::from(*quarters))
            }
            Self::BodyTurned(quarters) => {
                format!("with the object's own axes turned by {}° about z", 90 * u32::from(*quarters))
            }
            Self::Mirrored(i) => format!("with the {} axis of the object's poses reversed", axis(*i)),
            Self::PositionMirrored(i) => format!("with the sign of object_{}_m reversed", axis(*i)),
            Self::Moved { translation_m: [x, y, z], yaw_rad } => format!(
                "with the object's poses turned by {:.2}° about z and moved by ({:.1}, {:.1}, {:.1}) mm",
                yaw_rad.to_degrees(),
                1e3 * x,
                1e3 * y,
                1e3 * z
            ),
            Self::PositionSwapped => "with object_x_m and object_y_m exchanged".into(),
            Self::PositionScaled(factor) => format!("with the object's positions times {factor}"),
            Self::LengthsSwapped(a, b) => {
                format!("with the lengths of the object along {} and {} exchanged", axis(*a), axis(*b))
            }
            Self::LengthsScaled(factor) => format!("with all lengths of the object times {factor}"),
            Self::RadiusScaled(factor) => format!("with the radius of the object times {factor}"),
            Self::ToolRadiusScaled(factor) => format!("with tool_radius_m times {factor}"),
            Self::OriginAt(side) => {
                format!(
                    "with the pose taken as that of the object's {} face",
                    if *side < 0.0 { "lower" } else { "upper" }
                )
            }
            Self::TableAt(height_m) => format!("with table.height_m = {height_m:.4}"),
            Self::Wrench(axes) => wrench_words(axes),
            Self::ForceScaled(factor) => format!("with forces times {factor}"),
            Self::TorqueAbout(at) => {
                format!(
                    "with torques taken about a point at ({:.3}, {:.3}, {:.3}) m from the tool's centre",
                    -at[0], -at[1], -at[2]
                )
            }
            Self::TorqueScaled(factor) => format!("with torques times {factor}"),
            Self::AddedMassScaled(factor) => format!("with added_mass_kg times {factor}"),
            Self::JointsInDegrees => "with joint angles taken as degrees".into(),
            Self::JointsSwapped(a, b) => format!("with joints {a} and {b} exchanged"),
            Self::JointOffset(joint, offset) => format!("with {offset:.3} rad added to joint {joint}"),
            Self::JointReversed(joint) => format!("with joint {joint} counted the other way"),
        }
    }

    /// The pose of the object that a pose of the log then stands for. `half_m`: half lengths of the object.
    pub(crate) fn pose(&self, pose: &Isometry3<f64>, half_m: [f64; 3]) -> Isometry3<f64> {
        let (place, turn) = (pose.translation.vector, pose.rotation);
        let new = |place: Vector3<f64>, turn: UnitQuaternion<f64>| Isometry3::from_parts(place.into(), turn);
        match self {
            Self::Conjugate => new(place, turn.inverse()),
            Self::RealFirst => new(place, real_first(&turn)),
            Self::ConjugateRealFirst => new(place, real_first(&turn).inverse()),
            Self::RealLast => new(place, real_first(&real_first(&real_first(&turn)))),
            Self::TrackerTurned(quarters) => {
                let turned = quarter_turns(*quarters);
                new(turned * place, turned * turn)
            }
            Self::BodyTurned(quarters) => new(place, turn * quarter_turns(*quarters)),
            Self::Mirrored(axis) => {
                let mirror = mirror(*axis);
                let matrix = mirror * turn.to_rotation_matrix().matrix() * mirror;
                let turn = Rotation3::from_matrix_unchecked(matrix);
                new(mirror * place, UnitQuaternion::from_rotation_matrix(&turn))
            }
            Self::PositionMirrored(axis) => new(mirror(*axis) * place, turn),
            Self::Moved { translation_m, yaw_rad } => {
                let turned = UnitQuaternion::from_scaled_axis(Vector3::z() * *yaw_rad);
                new(turned * place + Vector3::from(*translation_m), turned * turn)
            }
            Self::PositionSwapped => new(Vector3::new(place.y, place.x, place.z), turn),
            Self::PositionScaled(factor) => new(place * *factor, turn),
            // From the face to the centre, along the object's own axis that is nearest to the vertical.
            Self::OriginAt(side) => new(place - up(&turn, half_m) * *side, turn),
            _ => *pose,
        }
    }

    /// The velocity and angular velocity of the object that those of the log then stand for.
    fn rates(&self, velocity: Vector3<f64>, spin: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        match self {
            Self::TrackerTurned(quarters) => (quarter_turns(*quarters) * velocity, quarter_turns(*quarters) * spin),
            Self::Moved { yaw_rad, .. } => {
                let turned = UnitQuaternion::from_scaled_axis(Vector3::z() * *yaw_rad);
                (turned * velocity, turned * spin)
            }
            // A turn about an axis changes its sense in a mirror.
            Self::Mirrored(axis) => (mirror(*axis) * velocity, -(mirror(*axis) * spin)),
            Self::PositionMirrored(axis) => (mirror(*axis) * velocity, spin),
            Self::PositionSwapped => (Vector3::new(velocity.y, velocity.x, velocity.z), spin),
            Self::PositionScaled(factor) => (velocity * *factor, spin),
            _ => (velocity, spin),
        }
    }

    /// The wrench that one of the log then stands for: force, N, and torque, N·m.
    pub(crate) fn wrench(&self, force: Vector3<f64>, torque: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        match self {
            Self::Wrench(axes) => {
                let turned =
                    |v: Vector3<f64>| Vector3::from_fn(|i, _| f64::from(axes[i].1) * v[usize::from(axes[i].0).min(2)]);
                (turned(force), turned(torque))
            }
            Self::ForceScaled(factor) => (force * *factor, torque),
            Self::TorqueScaled(factor) => (force, torque * *factor),
            Self::TorqueAbout(at) => (force, torque - Vector3::from(*at).cross(&force)),
            _ => (force, torque),
        }
    }

    /// Joint angles that those of the log then stand for, rad.
    pub(crate) fn joints(&self, joints: &mut [f64]) {
        match self {
            Self::JointsInDegrees => joints.iter_mut().for_each(|angle| *angle = angle.to_radians()),
            Self::JointsSwapped(a, b) => joints.swap(usize::from(*a), usize::from(*b)),
            Self::JointOffset(joint, offset) => joints[usize::from(*joint)] += offset,
            Self::JointReversed(joint) => joints[usize::from(*joint)] *= -1.0,
            _ => {}
        }
    }

    /// The object's shape, as it is then.
    pub(crate) fn shape(&self, shape: &mut Shape) {
        match (self, shape) {
            (Self::LengthsSwapped(a, b), Shape::Box { size_m }) => size_m.swap(*a, *b),
            (Self::LengthsScaled(factor), shape) => scale(shape, *factor, *factor),
            (Self::RadiusScaled(factor), shape) => scale(shape, *factor, 1.0),
            _ => {}
        }
    }

    /// The tool's radius, as it is then, m.
    pub(crate) fn tool_radius_m(&self, radius_m: f64) -> f64 {
        if let Self::ToolRadiusScaled(factor) = self { factor * radius_m } else { radius_m }
    }

    /// The log that says so in the format's own terms.
    #[must_use]
    pub fn apply(&self, log: &Log) -> Log {
        let mut log = log.clone();
        self.shape(&mut log.header.object.shape);
        log.header.tool_radius_m = log.header.tool_radius_m.map(|radius_m| self.tool_radius_m(radius_m));
        if let Self::TableAt(height_m) = self {
            let stddev = log.header.table.height_m.stddev();
            log.header.table.height_m =
                if stddev > 0.0 { Number::Uncertain { mean: *height_m, stddev } } else { Number::Fixed(*height_m) };
        }
        let half_m = log.header.object.shape.reach_m();
        for episode in &mut log.episodes {
            self.apply_to(episode, half_m);
        }
        log
    }

    fn apply_to(&self, episode: &mut Episode, half_m: [f64; 3]) {
        let rows = episode.rows();
        let joints = (0..u8::MAX).take_while(|joint| episode.channels.contains_key(&Channel::Joint(*joint))).count();
        let mut changed: Vec<(Channel, Vec<Option<f64>>)> = Vec::new();
        let mut set = |channel: Channel, row: usize, value: f64| {
            let index = changed.iter().position(|(known, _)| *known == channel).unwrap_or_else(|| {
                changed.push((channel, vec![None; rows]));
                changed.len() - 1
            });
            changed[index].1[row] = Some(value);
        };
        for row in 0..rows {
            let turn = episode.orientation(row);
            if let Some(place) = episode.vector(Channel::ObjectPosition, row) {
                let pose = Isometry3::from_parts(
                    Vector3::from(place).into(),
                    turn.map_or_else(UnitQuaternion::identity, rotation),
                );
                let pose = self.pose(&pose, half_m);
                Axis::ALL
                    .iter()
                    .enumerate()
                    .for_each(|(i, axis)| set(Channel::ObjectPosition(*axis), row, pose.translation.vector[i]));
                if turn.is_some() {
                    let q = pose.rotation.coords;
                    Component::ALL
                        .iter()
                        .enumerate()
                        .for_each(|(i, part)| set(Channel::ObjectOrientation(*part), row, q[i]));
                }
            }
            if let Some(force) = episode.vector(Channel::WristForce, row) {
                let torque = episode.vector(Channel::WristTorque, row);
                let (new, turned) =
                    self.wrench(Vector3::from(force), torque.map_or_else(Vector3::zeros, Vector3::from));
                Axis::ALL.iter().enumerate().for_each(|(i, axis)| set(Channel::WristForce(*axis), row, new[i]));
                if torque.is_some() {
                    Axis::ALL.iter().enumerate().for_each(|(i, axis)| set(Channel::WristTorque(*axis), row, turned[i]));
                }
            }
            for (channel, spins) in
                [(Channel::ObjectVelocity as fn(Axis) -> Channel, false), (Channel::ObjectSpin, true)]
            {
                if let Some(rate) = episode.vector(channel, row) {
                    let (velocity, spin) = self.rates(Vector3::from(rate), Vector3::from(rate));
                    let new = if spins { spin } else { velocity };
                    Axis::ALL.iter().enumerate().for_each(|(i, axis)| set(channel(*axis), row, new[i]));
                }
            }
            let angles: Option<Vec<f64>> =
                (0..joints as u8).map(|joint| episode.get(Channel::Joint(joint), row)).collect();
            if let Some(mut angles) = angles.filter(|angles| !angles.is_empty()) {
                self.joints(&mut angles);
                angles.iter().enumerate().for_each(|(joint, angle)| set(Channel::Joint(joint as u8), row, *angle));
            }
            if let (Self::AddedMassScaled(factor), Some(mass)) = (self, episode.get(Channel::AddedMass, row)) {
                set(Channel::AddedMass, row, factor * mass);
            }
        }
        for (channel, values) in changed {
            if let Some(readings) = episode.channels.get_mut(&channel) {
                // A row in which only a part was read keeps it.
                *readings = values.iter().zip(readings.iter()).map(|(new, old)| new.or(old)).collect::<Readings>();
            }
        }
    }
}

/// Half the object, from its centre up: along its own axis that is nearest to the vertical, as long as that half length.
pub(crate) fn up(turn: &UnitQuaternion<f64>, half_m: [f64; 3]) -> Vector3<f64> {
    let vertical = turn.inverse() * Vector3::z();
    let axis = vertical.iamax();
    let mut own = Vector3::zeros();
    own[axis] = half_m[axis] * vertical[axis].signum();
    turn * own
}

/// A quaternion whose columns x, y, z, w hold w, x, y, z.
fn real_first(turn: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let q = turn.coords;
    rotation([q[1], q[2], q[3], q[0]])
}

fn quarter_turns(quarters: u8) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2 * f64::from(quarters))
}

fn mirror(axis: usize) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from_fn(|i, _| if i == axis { -1.0 } else { 1.0 }))
}

fn scale(shape: &mut Shape, across: f64, along: f64) {
    let times = |number: &mut Number, factor: f64| {
        *number = match *number {
            Number::Fixed(value) => Number::Fixed(factor * value),
            Number::Uncertain { mean, stddev } => Number::Uncertain { mean: factor * mean, stddev: factor * stddev },
        };
    };
    match shape {
        Shape::Box { size_m } => size_m.iter_mut().for_each(|size| times(size, across)),
        Shape::Cylinder { radius_m, height_m } => {
            times(radius_m, across);
            times(height_m, along);
        }
        Shape::Sphere { radius_m } => times(radius_m, across),
        Shape::Prism { outline_m, height_m, feet_m } => {
            outline_m.iter_mut().chain(feet_m).flatten().for_each(|coordinate| *coordinate *= across);
            times(height_m, along);
        }
    }
}

fn wrench_words(axes: &[(u8, i8); 3]) -> String {
    let name = |(axis, sign): (u8, i8)| {
        format!("{}{}", if sign < 0 { "−" } else { "" }, ["x", "y", "z"][usize::from(axis).min(2)])
    };
    if axes.iter().enumerate().all(|(i, (axis, sign))| usize::from(*axis) == i && *sign < 0) {
        return "with the wrench reversed".into();
    }
    let names = axes.map(name);
    format!("with the wrench's x, y, z taken from its {}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings that are undone by another one.
    #[test]
    fn a_log_that_is_read_back_is_the_same() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mujoco-logs/logs/set-002");
        let log = measured_log::read(folder.as_ref()).unwrap();
        let pairs = [
            (Reading::Conjugate, Reading::Conjugate),
            (Reading::RealFirst, Reading::RealLast),
            (Reading::TrackerTurned(1), Reading::TrackerTurned(3)),
            (Reading::BodyTurned(1), Reading::BodyTurned(3)),
            (Reading::Mirrored(1), Reading::Mirrored(1)),
            (Reading::PositionSwapped, Reading::PositionSwapped),
            (Reading::PositionScaled(100.0), Reading::PositionScaled(0.01)),
            (Reading::LengthsSwapped(0, 2), Reading::LengthsSwapped(0, 2)),
            (Reading::Wrench([(1, -1), (0, 1), (2, 1)]), Reading::Wrench([(1, 1), (0, -1), (2, 1)])),
            (Reading::TorqueAbout([0.0, 0.1, 0.2]), Reading::TorqueAbout([0.0, -0.1, -0.2])),
        ];
        for (there, back) in pairs {
            let changed = there.apply(&log);
            assert_ne!(changed, log, "{there:?}");
            let again = back.apply(&changed);
            assert_eq!(again.header, log.header, "{there:?}");
            for (a, b) in again.episodes.iter().zip(&log.episodes) {
                for (channel, cells) in &b.channels {
                    let other = a.channels[channel].iter();
                    // A quaternion may have changed its sign, and its length of a rounded reading.
                    let near = |a: f64, b: f64| (a.abs() - b.abs()).abs() < 2e-3 * (1.0 + b.abs());
                    let same = cells.iter().zip(other).all(|(a, b)| a.zip(b).is_none_or(|(a, b)| near(a, b)));
                    assert!(same, "{there:?} {channel:?}");
                }
            }
        }
    }
}
