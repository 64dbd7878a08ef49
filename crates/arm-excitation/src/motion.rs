//! Fourier series that begin and end at rest.

use std::f64::consts::TAU;

use arm_dynamics::Arm;

/// Harmonics of a series.
pub(crate) const HARMONICS: usize = 5;
/// Numbers of a joint's series: sines and cosines, then how much of its room it uses and where.
pub(crate) const NUMBERS: usize = 2 * HARMONICS + 2;
/// Times at which limits are looked at.
const GRID: usize = 200;
/// Share of a joint's room, at both ends together, that is left free.
const MARGIN: f64 = 0.1;
/// Fastest rates of joints whose file says none: rad/s, and m/s of those that slide.
pub(crate) const RATE: [f64; 2] = [1.0, 0.2];

/// A joint at one time: rad, rad/s and rad/s² (m where it slides).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Position.
    pub position: f64,
    /// Rate.
    pub rate: f64,
    /// Acceleration.
    pub acceleration: f64,
}

/// q(t) = c + Σ a_k sin(2πkt/T) + b_k (cos(2πkt/T) − 1), of each joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    seconds: f64,
    joints: Vec<Series>,
}

#[derive(Clone, Debug, PartialEq)]
struct Series {
    centre: f64,
    sines: [f64; HARMONICS],
    cosines: [f64; HARMONICS],
}

/// Where a joint may be and how fast.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) rate: f64,
}

impl Room {
    /// Of each joint, at `speed` times its fastest.
    pub(crate) fn of(arm: &Arm, speed: f64) -> Vec<Self> {
        let room = |joint: &arm_dynamics::ArmJoint| {
            let (lower, upper) = joint.range();
            let free = 0.5 * MARGIN * (upper - lower).max(0.0);
            let usual = RATE[usize::from(joint.slides)];
            let rate = if joint.velocity.is_finite() && joint.velocity > 0.0 { joint.velocity } else { usual };
            Self { lower: lower + free, upper: upper - free, rate: speed * rate }
        };
        arm.joints().iter().map(room).collect()
    }
}

impl Motion {
    /// The motion that `numbers`, [`NUMBERS`] for each joint, stand for: any numbers keep positions and rates within `rooms`.
    pub(crate) fn of(numbers: &[f64], rooms: &[Room], seconds: f64) -> Self {
        let joints = numbers.chunks(NUMBERS).zip(rooms).map(|(numbers, room)| Series::of(numbers, room, seconds));
        Self { seconds, joints: joints.collect() }
    }

    /// Length, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// All joints at a time, s.
    #[must_use]
    pub fn at(&self, time: f64) -> Vec<Sample> {
        self.joints.iter().map(|series| series.at(time, self.seconds)).collect()
    }
}

impl Series {
    fn of(numbers: &[f64], room: &Room, seconds: f64) -> Self {
        let mut series = Self { centre: 0.0, sines: [0.0; HARMONICS], cosines: [0.0; HARMONICS] };
        for harmonic in 0..HARMONICS {
            // Numbers of one size give rates of one size.
            let k = (harmonic + 1) as f64;
            series.sines[harmonic] = numbers[2 * harmonic] / k;
            series.cosines[harmonic] = numbers[2 * harmonic + 1] / k;
        }
        // At rest at the ends: no rate, no acceleration. The nearest series that has none.
        let squares = |power: i32| (1..=HARMONICS).map(|k| (k as f64).powi(2 * power)).sum::<f64>();
        let rate: f64 = series.sines.iter().enumerate().map(|(i, a)| (i + 1) as f64 * a).sum();
        let acceleration: f64 = series.cosines.iter().enumerate().map(|(i, b)| ((i + 1) as f64).powi(2) * b).sum();
        for harmonic in 0..HARMONICS {
            let k = (harmonic + 1) as f64;
            series.sines[harmonic] -= k * rate / squares(1);
            series.cosines[harmonic] -= k * k * acceleration / squares(2);
        }
        let grid = || (0..GRID).map(|i| series.at(i as f64 * seconds / GRID as f64, seconds));
        let low = grid().map(|sample| sample.position).fold(f64::INFINITY, f64::min);
        let high = grid().map(|sample| sample.position).fold(f64::NEG_INFINITY, f64::max);
        let fastest = grid().map(|sample| sample.rate.abs()).fold(1e-12, f64::max);
        let span = (high - low).max(1e-12);
        let most = ((room.upper - room.lower) / span).min(room.rate / fastest).max(0.0);
        let share = |number: f64| 1.0 / (1.0 + (-number).exp());
        let scale = most * share(2.0 + numbers[2 * HARMONICS]);
        let free = (room.upper - room.lower - scale * span).max(0.0);
        let scaled = |values: [f64; HARMONICS]| values.map(|value| scale * value);
        Self {
            centre: room.lower - scale * low + free * share(numbers[2 * HARMONICS + 1]),
            sines: scaled(series.sines),
            cosines: scaled(series.cosines),
        }
    }

    fn at(&self, time: f64, seconds: f64) -> Sample {
        let mut sample = Sample { position: self.centre, ..Sample::default() };
        for (harmonic, (a, b)) in self.sines.iter().zip(&self.cosines).enumerate() {
            let omega = TAU * (harmonic + 1) as f64 / seconds;
            let (sin, cos) = (omega * time).sin_cos();
            sample.position += a * sin + b * (cos - 1.0);
            sample.rate += omega * (a * cos - b * sin);
            sample.acceleration -= omega * omega * (a * sin + b * cos);
        }
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_numbers_begin_and_end_at_rest_within_the_room() {
        let room = Room { lower: -1.0, upper: 0.5, rate: 0.7 };
        for item in 0..50 {
            let numbers: Vec<f64> =
                (0..NUMBERS).map(|i| 3.0 * (f64::from(item) * 1.7 + i as f64 * 2.3).sin()).collect();
            let motion = Motion::of(&numbers, &[room], 8.0);
            for end in [0.0, 8.0] {
                let sample = motion.at(end)[0];
                assert!(sample.rate.abs() < 1e-9 && sample.acceleration.abs() < 1e-9, "{sample:?}");
            }
            for i in 0..4000 {
                let sample = motion.at(f64::from(i) * 0.002)[0];
                assert!((-1.01..=0.51).contains(&sample.position) && sample.rate.abs() < 0.71, "{sample:?}");
            }
        }
    }

    #[test]
    fn rates_and_accelerations_are_derivatives() {
        let numbers: Vec<f64> = (0..NUMBERS).map(|i| (i as f64).sin()).collect();
        let motion = Motion::of(&numbers, &[Room { lower: -2.0, upper: 2.0, rate: 1.0 }], 5.0);
        let at = |time: f64| motion.at(time)[0];
        for i in 1..50 {
            let (time, step) = (0.1 * f64::from(i), 1e-4);
            let rate = (at(time + step).position - at(time - step).position) / (2.0 * step);
            let acceleration = (at(time + step).rate - at(time - step).rate) / (2.0 * step);
            assert!((rate - at(time).rate).abs() < 1e-6 && (acceleration - at(time).acceleration).abs() < 1e-5);
        }
    }
}
