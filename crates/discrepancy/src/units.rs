//! Units of the object that a log is about.
//!
//! What is small, and what is plausible, is so beside the object: 0.01 N is nothing to a box of half a kilogram and a third of the weight of
//! a table-tennis ball. The engine has tolerances of its own, too, of some tenths of a millimetre. So a log is diagnosed in units in which its object has the mass
//! and the size of the things that the catalogue's ranges are about, and what is found is told in the log's units again. Times stay as
//! they are: they are those of sensors and clocks.

use std::borrow::Cow;

use measured_log::{Channel, Header, Log, Noise, Number, Object, Robot, Shape, Table};
use physics_model::EffectConfig;

use crate::trial::Kind;

/// What the catalogue's ranges are about: a box, cylinder or ball of half a kilogram and some six centimetres.
const MASS_KG: f64 = 0.5;
const SIZE_M: f64 = 0.062;

/// Unit of mass, kg, and of length, m, of an object; that of time is the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Units {
    mass: f64,
    length: f64,
}

impl Default for Units {
    fn default() -> Self {
        Self { mass: 1.0, length: 1.0 }
    }
}

impl Units {
    /// Of the object of a log. An arm keeps its lengths, and where its joints' torques were read its masses, which are the arm's.
    #[must_use]
    pub(crate) fn of(log: &Log) -> Self {
        let Header { object, robot, .. } = &log.header;
        let torques = log.episodes.iter().any(|episode| episode.channels.contains_key(&Channel::JointTorque(0)));
        let [a, b, c] = object.shape.reach_m().map(|reach| 2.0 * reach);
        let (mass, length) = (object.mass_kg.mean() / MASS_KG, (a * b * c).cbrt() / SIZE_M);
        let arm = *robot != Robot::None;
        let positive = |value: f64| if value > 0.0 && value.is_finite() { value } else { 1.0 };
        Self {
            mass: if arm && torques { 1.0 } else { positive(mass) },
            length: if arm { 1.0 } else { positive(length) },
        }
    }

    /// How much a quantity of a unit such as `N·s²/m²` is, of this unit, if it is one in those of the object.
    #[must_use]
    pub(crate) fn factor(&self, unit: &str) -> f64 {
        let (above, below) = unit.split_once('/').unwrap_or((unit, ""));
        let product = |part: &str| part.split(['·', ' ']).map(|one| self.one(one)).product::<f64>();
        product(above) / product(below)
    }

    fn one(&self, unit: &str) -> f64 {
        let bare = unit.trim_end_matches(['²', '³']);
        let power = if unit.ends_with('²') {
            2
        } else if unit.ends_with('³') {
            3
        } else {
            1
        };
        let one: f64 = match bare {
            "kg" => self.mass,
            "m" => self.length,
            "N" => self.mass * self.length,
            _ => 1.0,
        };
        one.powi(power)
    }

    /// The other way: those of the log, in units of the object.
    #[must_use]
    pub(crate) fn inverse(&self) -> Self {
        Self { mass: self.mass.recip(), length: self.length.recip() }
    }

    /// An effect whose values are in units of the object, in those of the log.
    #[must_use]
    pub(crate) fn effect(&self, effect: &EffectConfig) -> EffectConfig {
        effect.scaled(|parameter| self.factor(parameter.unit))
    }

    /// A log whose values are in units of the object, in those of the log.
    #[must_use]
    pub(crate) fn log<'a>(&self, log: &'a Log) -> Cow<'a, Log> {
        if *self == Self::default() {
            return Cow::Borrowed(log);
        }
        let mut log = log.clone();
        log.header = self.header(&log.header);
        for episode in &mut log.episodes {
            for (channel, readings) in &mut episode.channels {
                let factor = self.factor(unit(*channel));
                if factor != 1.0 {
                    *readings = readings.iter().map(|reading| reading.map(|value| factor * value)).collect();
                }
            }
        }
        Cow::Owned(log)
    }

    /// The same of a header.
    #[must_use]
    pub(crate) fn header(&self, header: &Header) -> Header {
        let length = |number: Number| times(self.length, number);
        let shape = match &header.object.shape {
            Shape::Box { size_m } => Shape::Box { size_m: size_m.map(length) },
            Shape::Cylinder { radius_m, height_m } => {
                Shape::Cylinder { radius_m: length(*radius_m), height_m: length(*height_m) }
            }
            Shape::Sphere { radius_m } => Shape::Sphere { radius_m: length(*radius_m) },
            Shape::Prism { outline_m, height_m, feet_m } => {
                let points = |points: &[[f64; 2]]| points.iter().map(|point| point.map(|v| self.length * v)).collect();
                Shape::Prism { outline_m: points(outline_m), height_m: length(*height_m), feet_m: points(feet_m) }
            }
        };
        let inertia = |number: Number| times(self.mass * self.length * self.length, number);
        Header {
            robot: header.robot,
            period_secs: header.period_secs,
            tool_radius_m: header.tool_radius_m.map(|radius| self.length * radius),
            tool_friction: header.tool_friction,
            gravity_mps2: self.length * header.gravity_mps2,
            table: Table { height_m: length(header.table.height_m), friction: header.table.friction },
            object: Object {
                shape,
                mass_kg: times(self.mass, header.object.mass_kg),
                com_m: header.object.com_m.map(length),
                inertia_kgm2: header.object.inertia_kgm2.map(|all| all.map(inertia)),
                restitution: header.object.restitution,
            },
            noise: self.noise(&header.noise),
            split: header.split,
        }
    }

    fn noise(&self, noise: &Noise) -> Noise {
        let of = |kind: Kind, value: Option<f64>| value.map(|value| self.factor(kind.unit()) * value);
        Noise {
            object_position_m: of(Kind::ObjectPosition, noise.object_position_m),
            object_orientation_rad: noise.object_orientation_rad,
            object_velocity_mps: of(Kind::ObjectVelocity, noise.object_velocity_mps),
            object_spin_rps: noise.object_spin_rps,
            tool_position_m: of(Kind::ToolPosition, noise.tool_position_m),
            joint_position_rad: noise.joint_position_rad,
            wrist_force_n: of(Kind::WristForce, noise.wrist_force_n),
            wrist_torque_nm: of(Kind::WristTorque, noise.wrist_torque_nm),
            joint_torque_nm: of(Kind::JointTorque, noise.joint_torque_nm),
        }
    }
}

fn times(factor: f64, number: Number) -> Number {
    match number {
        Number::Fixed(value) => Number::Fixed(factor * value),
        Number::Uncertain { mean, stddev } => Number::Uncertain { mean: factor * mean, stddev: factor * stddev },
    }
}

fn unit(channel: Channel) -> &'static str {
    match channel {
        Channel::Command(_) | Channel::Tool(_) | Channel::ObjectPosition(_) => "m",
        Channel::ObjectVelocity(_) => "m/s",
        Channel::WristForce(_) => "N",
        Channel::WristTorque(_) | Channel::JointTorque(_) => "N·m",
        Channel::AddedMass => "kg",
        Channel::Joint(_) | Channel::ObjectOrientation(_) | Channel::ObjectSpin(_) => "",
    }
}

#[cfg(test)]
mod tests {
    use physics_model::EffectKind;

    use super::*;

    #[test]
    fn each_unit_of_the_catalogue_has_its_powers_of_mass_and_length() {
        let units = Units { mass: 3.0, length: 7.0 };
        let known = [
            ("", 1.0),
            ("s", 1.0),
            ("1/s", 1.0),
            ("Hz", 1.0),
            ("rad", 1.0),
            ("kg", 3.0),
            ("m", 7.0),
            ("m/s", 7.0),
            ("N", 21.0),
            ("N/s", 21.0),
            ("N/m", 3.0),
            ("N·s/m", 3.0),
            ("N·s²/m²", 3.0 / 7.0),
            ("N·m", 147.0),
            ("N·m·s/rad", 147.0),
            ("N m²", 1029.0),
            ("kg·m²", 147.0),
            ("N/N", 1.0),
        ];
        for (unit, expected) in known {
            assert!((units.factor(unit) / expected - 1.0).abs() < 1e-12, "{unit}: {}", units.factor(unit));
        }
        for parameter in EffectKind::ALL.iter().flat_map(|kind| kind.parameters()) {
            assert!(known.iter().any(|(unit, _)| *unit == parameter.unit), "{}", parameter.unit);
        }
        let damping = EffectKind::ViscousDamping.from_parameters(&[0.5]).unwrap();
        assert_eq!(units.effect(&damping).values(), [1.5]);
        assert_eq!(units.inverse().effect(&units.effect(&damping)), damping);
    }
}
