//! Which torques a motion takes: recursive Newton–Euler (Luh, Walker and Paul 1980), written so that the torques stay linear in the ten numbers of each
//! mass (Atkeson, An and Hollerbach 1986).

use nalgebra::{IsometryMatrix3, Matrix3, Vector3};

use crate::arm::Arm;
use crate::{MOST_JOINTS, PerJoint};

/// Numbers of a rigid mass; see [`crate::Mass::numbers`].
pub const PARAMETERS: usize = 10;

/// One link in motion.
#[derive(Clone, Copy, Debug)]
struct Moving {
    base_from_link: IsometryMatrix3<f64>,
    /// Axis of its joint, base axes.
    axis: Vector3<f64>,
    /// Rate of turning, rad/s, its change, rad/s², and acceleration of the origin less that of free fall, m/s²; all in the link's own axes.
    spin: Vector3<f64>,
    spin_rate: Vector3<f64>,
    acceleration: Vector3<f64>,
}

/// An arm at one instant: where each link is and how it moves.
#[derive(Debug)]
pub struct Motion<'a> {
    arm: &'a Arm,
    links: Vec<Moving>,
}

impl Arm {
    /// The arm at positions `q` (rad), rates `rate` (rad/s) and accelerations `acceleration` (rad/s²), with `gravity` the acceleration of free fall in base
    /// axes (m/s²).
    ///
    /// # Panics
    ///
    /// If a slice has not one value for each joint.
    #[must_use]
    pub fn motion(&self, q: &[f64], rate: &[f64], acceleration: &[f64], gravity: &Vector3<f64>) -> Motion<'_> {
        let count = self.joints().len();
        assert!(
            q.len() == count && rate.len() == count && acceleration.len() == count,
            "positions, rates and accelerations of {count} joints"
        );
        let mut links = Vec::with_capacity(count);
        let mut base_from_parent = IsometryMatrix3::identity();
        let (mut spin, mut spin_rate, mut linear) = (Vector3::zeros(), Vector3::zeros(), -gravity);
        for (i, segment) in self.segments().iter().enumerate() {
            let base_from_link = base_from_parent * segment.parent_from_link(q[i]);
            let axis = base_from_link.rotation.matrix().column(2).into_owned();
            let arm = base_from_link.translation.vector - base_from_parent.translation.vector;
            linear += spin_rate.cross(&arm) + spin.cross(&spin.cross(&arm));
            if segment.slides {
                linear += axis * acceleration[i] + spin.cross(&axis) * (2.0 * rate[i]);
            } else {
                spin_rate += axis * acceleration[i] + spin.cross(&axis) * rate[i];
                spin += axis * rate[i];
            }
            let back = base_from_link.rotation.inverse();
            links.push(Moving {
                base_from_link,
                axis,
                spin: back * spin,
                spin_rate: back * spin_rate,
                acceleration: back * linear,
            });
            base_from_parent = base_from_link;
        }
        Motion { arm: self, links }
    }

    /// M(q) q̈ + C(q, q̇) q̇ + g(q), N·m: what the motors give without friction.
    ///
    /// # Panics
    ///
    /// If a slice has not one value for each joint.
    #[must_use]
    pub fn inverse_dynamics(&self, q: &[f64], rate: &[f64], acceleration: &[f64], gravity: &Vector3<f64>) -> PerJoint {
        self.motion(q, rate, acceleration, gravity).torques()
    }

    /// Column `joint` of the mass matrix, kg·m², at `q` (rad): the torques of a unit acceleration of that joint alone.
    #[must_use]
    pub fn mass_column(&self, q: &[f64], joint: usize) -> PerJoint {
        let (zero, mut unit) = (vec![0.0; q.len()], vec![0.0; q.len()]);
        unit[joint] = 1.0;
        self.inverse_dynamics(q, &zero, &unit, &Vector3::zeros())
    }
}

impl Motion<'_> {
    /// Torques, N·m, of the arm's own masses.
    #[must_use]
    pub fn torques(&self) -> PerJoint {
        let mut torques = [0.0; MOST_JOINTS];
        for (i, link) in self.links.iter().enumerate() {
            let mass = &self.arm.segments()[i].mass;
            let (force, moment) = link.load(mass.mass_kg, &mass.moment_kgm, &mass.inertia_kgm2);
            for (k, torque) in torques.iter_mut().enumerate().take(i + 1) {
                let [by_force, by_moment] = self.levers(i, k);
                *torque += by_force.dot(&force) + by_moment.dot(&moment);
            }
        }
        torques
    }

    /// Torques, N·m, per unit of each of the ten numbers of link `link`'s mass.
    #[must_use]
    pub fn regressor(&self, link: usize) -> [PerJoint; PARAMETERS] {
        let moving = &self.links[link];
        let loads: [_; PARAMETERS] = std::array::from_fn(|p| unit_load(moving, p));
        let mut columns = [[0.0; MOST_JOINTS]; PARAMETERS];
        for k in 0..=link {
            let [by_force, by_moment] = self.levers(link, k);
            for (column, (force, moment)) in columns.iter_mut().zip(&loads) {
                column[k] = by_force.dot(force) + by_moment.dot(moment);
            }
        }
        columns
    }

    /// What joint `k` feels of a force at the origin of link `i`, and of a moment, both in that link's axes.
    fn levers(&self, i: usize, k: usize) -> [Vector3<f64>; 2] {
        let (link, joint) = (&self.links[i], &self.links[k]);
        let back = link.base_from_link.rotation.inverse();
        if self.arm.segments()[k].slides {
            return [back * joint.axis, Vector3::zeros()];
        }
        let lever = link.base_from_link.translation.vector - joint.base_from_link.translation.vector;
        [back * joint.axis.cross(&lever), back * joint.axis]
    }
}

impl Moving {
    /// Force, N, and moment about the link's origin, N·m, that a mass needs, in the link's axes.
    fn load(&self, mass_kg: f64, moment_kgm: &Vector3<f64>, inertia: &Matrix3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let force = self.acceleration * mass_kg
            + self.spin_rate.cross(moment_kgm)
            + self.spin.cross(&self.spin.cross(moment_kgm));
        let moment =
            inertia * self.spin_rate + self.spin.cross(&(inertia * self.spin)) + moment_kgm.cross(&self.acceleration);
        (force, moment)
    }
}

fn unit_load(link: &Moving, parameter: usize) -> (Vector3<f64>, Vector3<f64>) {
    let (mut mass, mut moment, mut inertia) = (0.0, Vector3::zeros(), Matrix3::zeros());
    match parameter {
        0 => mass = 1.0,
        1..=3 => moment[parameter - 1] = 1.0,
        _ => {
            let (row, column) = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)][parameter - 4];
            inertia[(row, column)] = 1.0;
            inertia[(column, row)] = 1.0;
        }
    }
    link.load(mass, &moment, &inertia)
}
