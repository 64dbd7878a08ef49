//! The joints' way through one action, what derives from positions one a control step, and the torques that it takes.

use nalgebra::Vector6;

use crate::effect::{Effects, Hooks};
use crate::robot::{JointVector, Robot};
use crate::state::MAX_JOINTS;
use crate::world::Wrench;

/// Share of a minimum-jerk move that is done after the share `time` in [0, 1] of its duration (Flash and Hogan 1985):
/// 10 t³ − 15 t⁴ + 6 t⁵.
#[must_use]
pub fn minimum_jerk(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// First derivative of [`minimum_jerk`] by `time`: 30 t² (1 − t)².
#[must_use]
pub fn minimum_jerk_rate(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    30.0 * t * t * (1.0 - t) * (1.0 - t)
}

/// Second derivative of [`minimum_jerk`] by `time`: 60 t (1 − t) (1 − 2 t).
#[must_use]
pub fn minimum_jerk_acceleration(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)
}

/// Joint positions as a quadratic function of the share of the tool's path: through its start, middle and end.
///
/// Over 2 cm the third-order term that is left out is below 10 µrad for both arms (tested).
#[derive(Clone, Copy, Debug)]
pub struct JointPath {
    count: usize,
    start: [f64; MAX_JOINTS],
    linear: [f64; MAX_JOINTS],
    quadratic: [f64; MAX_JOINTS],
}

/// Joint positions (rad), rates (rad/s) and accelerations (rad/s²) at one moment; places beyond the joint count are 0.
#[derive(Clone, Copy, Debug)]
pub struct JointMoment {
    count: usize,
    position: [f64; MAX_JOINTS],
    rate: [f64; MAX_JOINTS],
    acceleration: [f64; MAX_JOINTS],
}

impl JointPath {
    /// A path through three configurations, rad.
    #[must_use]
    pub fn through(start: &[f64], middle: &[f64], end: &[f64]) -> Self {
        let mut path = Self {
            count: start.len(),
            start: [0.0; MAX_JOINTS],
            linear: [0.0; MAX_JOINTS],
            quadratic: [0.0; MAX_JOINTS],
        };
        for j in 0..path.count {
            path.start[j] = start[j];
            path.linear[j] = 4.0 * middle[j] - 3.0 * start[j] - end[j];
            path.quadratic[j] = 2.0 * (start[j] + end[j] - 2.0 * middle[j]);
        }
        path
    }

    /// A path that does not leave `start`, rad.
    #[must_use]
    pub fn resting(start: &[f64]) -> Self {
        Self::through(start, start, start)
    }

    /// The arm after the share `time` in [0, 1] of a minimum-jerk move that takes `duration_secs`.
    #[must_use]
    pub fn moment(&self, time: f64, duration_secs: f64) -> JointMoment {
        let share = minimum_jerk(time);
        let share_rate = minimum_jerk_rate(time) / duration_secs;
        let share_acceleration = minimum_jerk_acceleration(time) / (duration_secs * duration_secs);
        let mut moment = self.stopped(share);
        for j in 0..self.count {
            let slope = self.linear[j] + 2.0 * self.quadratic[j] * share;
            moment.rate[j] = slope * share_rate;
            moment.acceleration[j] = slope * share_acceleration + 2.0 * self.quadratic[j] * share_rate * share_rate;
        }
        moment
    }

    /// The arm at rest after `share` in [0, 1] of the path.
    #[must_use]
    pub fn stopped(&self, share: f64) -> JointMoment {
        let mut moment = JointMoment {
            count: self.count,
            position: [0.0; MAX_JOINTS],
            rate: [0.0; MAX_JOINTS],
            acceleration: [0.0; MAX_JOINTS],
        };
        for j in 0..self.count {
            moment.position[j] = self.start[j] + share * (self.linear[j] + share * self.quadratic[j]);
        }
        moment
    }
}

impl JointMoment {
    /// At rest at `position_rad`.
    #[must_use]
    pub fn resting(position_rad: &[f64]) -> Self {
        JointPath::resting(position_rad).stopped(0.0)
    }

    /// Positions, rad, one a joint.
    #[must_use]
    pub fn position_rad(&self) -> &[f64] {
        &self.position[..self.count]
    }

    /// Positions, rad, one a joint, to be changed in place.
    pub fn position_rad_mut(&mut self) -> &mut [f64] {
        &mut self.position[..self.count]
    }

    /// Rates and accelerations of a motion that was at `before` a period ago.
    pub fn follow(&mut self, before: &Self, period_secs: f64) {
        for j in 0..self.count {
            self.rate[j] = (self.position[j] - before.position[j]) / period_secs;
            self.acceleration[j] = (self.rate[j] - before.rate[j]) / period_secs;
        }
    }

    /// Rates, rad/s, one a joint.
    #[must_use]
    pub fn rate_rps(&self) -> &[f64] {
        &self.rate[..self.count]
    }

    /// Accelerations, rad/s², one a joint.
    #[must_use]
    pub fn acceleration_rps2(&self) -> &[f64] {
        &self.acceleration[..self.count]
    }
}

/// The tool's acceleration from its places, one a control step, from rest.
pub struct ToolMotion {
    position_m: [f64; 3],
    velocity_mps: [f64; 3],
    period_secs: f64,
}

impl ToolMotion {
    /// A tool at rest at `position_m`, m, of which a place will be told every `period_secs`.
    #[must_use]
    pub fn new(position_m: [f64; 3], period_secs: f64) -> Self {
        Self { position_m, velocity_mps: [0.0; 3], period_secs }
    }

    /// Acceleration, m/s², of a tool that has got to `position_m`, m, in the last control step.
    pub fn acceleration(&mut self, position_m: [f64; 3]) -> [f64; 3] {
        let velocity: [f64; 3] = std::array::from_fn(|i| (position_m[i] - self.position_m[i]) / self.period_secs);
        let acceleration = std::array::from_fn(|i| (velocity[i] - self.velocity_mps[i]) / self.period_secs);
        (self.position_m, self.velocity_mps) = (position_m, velocity);
        acceleration
    }

    /// The same motion seen at `position_m`.
    pub fn shift_to(&mut self, position_m: [f64; 3]) {
        self.position_m = position_m;
    }
}

/// Torques that the motors give, N·m: M(q) q̈ + C(q, q̇) q̇ + g(q) − Jᵀw, and what effects add; unused places are 0.
#[must_use]
pub fn joint_torques(robot: &Robot, effects: Effects, moment: &JointMoment, wrench: &Wrench) -> JointVector {
    let q = moment.position_rad();
    let mut motion = robot.inverse_dynamics(q, moment.rate_rps(), moment.acceleration_rps2());
    if effects.hooks.contains(Hooks::JOINT_FRICTION) {
        for effect in effects.list {
            effect.joint_friction(moment.rate_rps(), &mut motion);
        }
    }
    let [fx, fy, fz] = wrench.force_n;
    let [tx, ty, tz] = wrench.torque_nm;
    let contact = robot.contact_torque(q, &Vector6::new(fx, fy, fz, tx, ty, tz));
    motion - contact
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_meets_its_three_points_and_its_derivatives_are_those_of_its_positions() {
        let path = JointPath::through(&[0.1, -0.4], &[0.3, -0.1], &[0.4, 0.6]);
        assert_eq!(path.stopped(0.0).position_rad(), [0.1, -0.4]);
        for (share, expected) in [(0.5, [0.3, -0.1]), (1.0, [0.4, 0.6])] {
            for (a, b) in path.stopped(share).position_rad().iter().zip(expected) {
                assert!((a - b).abs() < 1e-15);
            }
        }
        let (duration, h) = (0.4, 1e-5);
        for time in [0.2, 0.5, 0.9] {
            let [before, now, after] = [time - h, time, time + h].map(|t| path.moment(t, duration));
            for j in 0..2 {
                let rate = (after.position[j] - before.position[j]) / (2.0 * h * duration);
                let acceleration = (after.rate[j] - before.rate[j]) / (2.0 * h * duration);
                assert!((rate - now.rate[j]).abs() < 1e-7 && (acceleration - now.acceleration[j]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn minimum_jerk_starts_and_ends_at_rest_with_no_acceleration() {
        let h = 1e-4;
        for t in [0.1, 0.4, 0.7] {
            let rate = (minimum_jerk(t + h) - minimum_jerk(t - h)) / (2.0 * h);
            let acceleration = (minimum_jerk_rate(t + h) - minimum_jerk_rate(t - h)) / (2.0 * h);
            assert!((rate - minimum_jerk_rate(t)).abs() < 1e-6);
            assert!((acceleration - minimum_jerk_acceleration(t)).abs() < 1e-5);
        }
        assert_eq!(minimum_jerk(0.0), 0.0);
        assert_eq!(minimum_jerk(1.0), 1.0);
        assert!((minimum_jerk(0.5) - 0.5).abs() < 1e-15);
        // Velocity 1.875 of the mean at the middle (closed form), 0 at the ends; acceleration O(h) at the ends.
        assert!(((minimum_jerk(0.5 + h) - minimum_jerk(0.5 - h)) / (2.0 * h) - 1.875).abs() < 1e-6);
        assert!(minimum_jerk(h) / h < 1e-6);
        assert!((1.0 - minimum_jerk(1.0 - h)) / h < 1e-6);
    }
}
