//! What a log says and what the nominal arm would have said, in windows of some hundredths of a second.

use std::ops::Range;

use arm_dynamics::{Arm, Mass};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::log::{Log, median};
use crate::smooth::{MEDIAN_SQUARE, Readings, Smooth, WINDOW_SECS};
use crate::ticks::Ticks;

/// Length of a piece, s: what is held out, and what errs together.
const PIECE_SECS: f64 = 2.0;
/// A joint that is slower than this, rad/s, stands: what its friction holds is not known.
const STANDS_RPS: f64 = 2e-3;

/// One value a tick, for each joint.
pub(crate) type Series = Vec<Vec<f64>>;

/// A log beside its nominal arm.
pub(crate) struct Prepared<'a> {
    pub(crate) log: &'a Log,
    /// The arm about whose masses torques are taken as linear: that of the file, then the one that fits.
    arm: Arm,
    /// Factor by which the torques of each joint are read too large.
    gain: Vec<f64>,
    /// Delay of torques about which they are taken as linear, s.
    pub(crate) delay_secs: f64,
    pub(crate) ticks: Ticks,
    pub(crate) motion: Vec<Smooth>,
    /// s since the first tick, over all episodes.
    pub(crate) elapsed_secs: Vec<f64>,
    /// Torques of the arm as its file has it, N·m.
    pub(crate) nominal: Series,
    /// Torques of `arm`, and of gravity alone, N·m.
    pub(crate) rigid: Series,
    pub(crate) gravity: Series,
    /// Measured torques, or those of the servo's law.
    pub(crate) measured: Series,
    /// Torques of a servo's damping, N·m, where torques are not measured.
    pub(crate) servo_damping: Option<Series>,
    /// Change of all torques with one joint's position, N·m/rad, and with its acceleration, kg·m²: `[joint moved][joint][tick]`.
    pub(crate) stiffness: Vec<Series>,
    pub(crate) inertia: Vec<Series>,
    /// Ticks of each window, and the piece that it belongs to.
    pub(crate) windows: Vec<Range<usize>>,
    pub(crate) piece: Vec<usize>,
    pub(crate) pieces: usize,
    /// Typical torque of each joint, N·m.
    pub(crate) scale: Vec<f64>,
    /// Typical rate of each joint, rad/s.
    pub(crate) usual_rate: Vec<f64>,
    /// Standard deviation of a window's mean of measured less simulated torque, as far as noise of sensors makes it, N·m, for each joint.
    pub(crate) noise: Vec<f64>,
}

impl<'a> Prepared<'a> {
    pub(crate) fn new(log: &'a Log) -> Self {
        let mut ticks = Ticks::new(log);
        // A command that is missing is the one before.
        for values in &mut ticks.command {
            let mut last = values.iter().copied().find(|value| value.is_finite()).unwrap_or(0.0);
            for value in values {
                last = if value.is_finite() { *value } else { last };
                *value = last;
            }
        }
        let spans: Vec<Range<usize>> = ticks.spans().filter(|span| !span.is_empty()).collect();
        let count = log.joints();
        let shrink = (ticks.rows as f64).sqrt();
        let known = |numbers: &Option<crate::header::Numbers>, joint: usize| {
            numbers.as_ref().and_then(|numbers| numbers.of(joint)).map(|stddev| stddev / shrink)
        };
        let motion: Vec<Smooth> = (0..count)
            .into_par_iter()
            .map(|joint| {
                let noise = &log.header.noise;
                Readings {
                    spans: &spans,
                    time_secs: &ticks.time_secs,
                    position: &ticks.position[joint],
                    velocity: ticks.velocity.get(joint).map_or(&[], Vec::as_slice),
                }
                .smooth(known(&noise.joint_position_rad, joint), known(&noise.joint_velocity_rps, joint))
            })
            .collect();
        let mut prepared = Self {
            log,
            arm: log.arm.clone(),
            gain: vec![1.0; count],
            delay_secs: 0.0,
            nominal: Vec::new(),
            elapsed_secs: elapsed(&ticks),
            rigid: Vec::new(),
            gravity: Vec::new(),
            measured: Vec::new(),
            servo_damping: None,
            stiffness: Vec::new(),
            inertia: Vec::new(),
            windows: Vec::new(),
            piece: Vec::new(),
            pieces: 0,
            scale: Vec::new(),
            usual_rate: motion.iter().map(|joint| rms(&joint.rate).max(1e-3)).collect(),
            noise: Vec::new(),
            motion,
            ticks,
        };
        prepared.simulate();
        prepared.nominal.clone_from(&prepared.rigid);
        prepared.measure();
        prepared.cut();
        let most = prepared.measured.iter().map(|values| rms(values)).fold(0.0, f64::max);
        prepared.scale = prepared.measured.iter().map(|values| rms(values).max(0.01 * most).max(1e-6)).collect();
        prepared.estimate_noise();
        prepared
    }

    /// Takes torques as linear about other masses, gains and another delay: what a first fit has found. Products of two unknowns are small then.
    pub(crate) fn linearise(&mut self, masses: &[Mass], gain: Vec<f64>, delay_secs: f64) {
        self.arm = self.log.arm.with_masses(masses);
        self.gain = gain;
        self.delay_secs = delay_secs;
        self.simulate();
    }

    /// Factor by which the torques of a joint are read too large; `rigid` and what depends on it have it already.
    pub(crate) fn gain(&self, joint: usize) -> f64 {
        self.gain[joint]
    }

    /// The arm about whose masses torques are taken as linear.
    pub(crate) fn arm(&self) -> &Arm {
        &self.arm
    }

    /// Whether there are pieces to fit and one to hold out, and a joint moves.
    pub(crate) fn says_something(&self) -> bool {
        /// Windows, 4 s.
        const FEWEST: usize = 100;
        self.pieces >= 2
            && self.windows.len() >= FEWEST
            && self.motion.iter().any(|joint| rms(&joint.rate) > 2.0 * STANDS_RPS.max(joint.rate_stddev))
    }

    /// Whether there are torques of a joint to compare with.
    pub(crate) fn is_read(&self, joint: usize) -> bool {
        self.measured[joint].iter().any(|torque| torque.is_finite())
    }

    pub(crate) fn joints(&self) -> usize {
        self.log.joints()
    }

    pub(crate) fn gravity_vector(&self) -> Vector3<f64> {
        Vector3::new(0.0, 0.0, -self.log.header.gravity_mps2)
    }

    /// Positions, rates and accelerations of all joints at a tick.
    pub(crate) fn state(&self, tick: usize) -> [Vec<f64>; 3] {
        [
            self.motion.iter().map(|joint| joint.position[tick]).collect(),
            self.motion.iter().map(|joint| joint.rate[tick]).collect(),
            self.motion.iter().map(|joint| joint.acceleration[tick]).collect(),
        ]
    }

    /// Means of a series over the windows.
    pub(crate) fn means(&self, series: &[f64]) -> Vec<f64> {
        self.windows.iter().map(|window| mean(&series[window.clone()])).collect()
    }

    /// Whether a joint stands in each window.
    pub(crate) fn stands(&self, joint: usize) -> Vec<bool> {
        let slow = STANDS_RPS.max(3.0 * self.motion[joint].rate_stddev);
        let slowest = |window: &Range<usize>| {
            self.motion[joint].rate[window.clone()].iter().map(|rate| rate.abs()).fold(f64::INFINITY, f64::min)
        };
        self.windows.iter().map(|window| slowest(window) < slow).collect()
    }

    /// What the nominal model says beside the rigid arm: the friction that its file has, and a servo's damping.
    pub(crate) fn known_friction(&self, joint: usize) -> Vec<f64> {
        let known = &self.log.arm.joints()[joint];
        let signs = self.signs(joint);
        let rates = &self.motion[joint].rate;
        let damping = |tick: usize| self.servo_damping.as_ref().map_or(0.0, |damping| damping[joint][tick]);
        let friction = signs.iter().zip(rates).map(|(sign, rate)| known.friction * sign + known.damping * rate);
        friction.enumerate().map(|(tick, friction)| friction + damping(tick)).collect()
    }

    /// Inertia of a motor that the log's header gives, kg·m².
    pub(crate) fn reflected_inertia(&self, joint: usize) -> f64 {
        self.log.header.gear.reflected_inertia_kgm2.as_ref().and_then(|numbers| numbers.of(joint)).unwrap_or(0.0)
    }

    /// Expected sign of the rate of a joint, as it is known up to its standard deviation.
    pub(crate) fn signs(&self, joint: usize) -> Vec<f64> {
        let motion = &self.motion[joint];
        let width = motion.rate_stddev.max(1e-4) * std::f64::consts::SQRT_2;
        motion.rate.iter().map(|rate| statrs::function::erf::erf(rate / width)).collect()
    }

    fn simulate(&mut self) {
        /// Of the difference quotients, rad.
        const STEP: f64 = 1e-5;
        let (count, gravity) = (self.joints(), self.gravity_vector());
        let arm = &self.arm;
        let at = |tick: usize| {
            let [q, rate, acceleration] = self.state(tick);
            let zero = vec![0.0; count];
            let mut rigid = arm.inverse_dynamics(&q, &rate, &acceleration, &gravity);
            for joint in 0..count {
                rigid[joint] += self.reflected_inertia(joint) * acceleration[joint];
            }
            let still = arm.inverse_dynamics(&q, &zero, &zero, &gravity);
            let mut sensitive = Vec::with_capacity(2 * count);
            for moved in 0..count {
                let mut beside = q.clone();
                beside[moved] = q[moved] + STEP;
                let up = arm.inverse_dynamics(&beside, &rate, &acceleration, &gravity);
                beside[moved] = q[moved] - STEP;
                let down = arm.inverse_dynamics(&beside, &rate, &acceleration, &gravity);
                sensitive.push(std::array::from_fn(|j| (up[j] - down[j]) / (2.0 * STEP)));
            }
            for moved in 0..count {
                sensitive.push(arm.mass_column(&q, moved));
            }
            let read = |torques: arm_dynamics::PerJoint| -> arm_dynamics::PerJoint {
                std::array::from_fn(|j| torques[j] * self.gain.get(j).copied().unwrap_or(1.0))
            };
            (read(rigid), read(still), sensitive.into_iter().map(read).collect())
        };
        let all: Vec<(arm_dynamics::PerJoint, arm_dynamics::PerJoint, Vec<arm_dynamics::PerJoint>)> =
            (0..self.ticks.count()).into_par_iter().map(at).collect();
        let series = |pick: &dyn Fn(&(_, _, Vec<arm_dynamics::PerJoint>), usize) -> f64| -> Series {
            (0..count).map(|joint| all.iter().map(|tick| pick(tick, joint)).collect()).collect()
        };
        let rigid = series(&|tick: &(arm_dynamics::PerJoint, arm_dynamics::PerJoint, Vec<_>), joint| tick.0[joint]);
        let still = series(&|tick: &(arm_dynamics::PerJoint, arm_dynamics::PerJoint, Vec<_>), joint| tick.1[joint]);
        let stiffness = (0..count).map(|moved| series(&|tick, joint| tick.2[moved][joint])).collect();
        let inertia = (0..count).map(|moved| series(&|tick, joint| tick.2[count + moved][joint])).collect();
        (self.rigid, self.gravity, self.stiffness, self.inertia) = (rigid, still, stiffness, inertia);
    }

    /// Without torques, what the servo's law says by the error of position alone; its damping is part of what the error has to overcome. So a stiffness that is
    /// not as said scales what is predicted, and cannot explain the errors away.
    fn measure(&mut self) {
        let Some(servo) = self.log.header.servo.as_ref().filter(|_| self.log.torque.is_empty()) else {
            self.measured.clone_from(&self.ticks.torque);
            return;
        };
        self.measured = (0..self.joints())
            .map(|joint| {
                let stiffness = servo.stiffness_nmprad.of(joint).unwrap_or(0.0);
                let errors = self.ticks.command[joint].iter().zip(&self.motion[joint].position);
                errors.map(|(command, position)| stiffness * (command - position)).collect()
            })
            .collect();
        let damped = |joint: usize| {
            let damping = servo.damping_nmsprad.of(joint).unwrap_or(0.0);
            self.motion[joint].rate.iter().map(|rate| damping * rate).collect()
        };
        self.servo_damping = Some((0..self.joints()).map(damped).collect());
    }

    /// Windows of each episode, and pieces of windows.
    fn cut(&mut self) {
        let steps = self.ticks.time_secs.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
        let step = median(steps.collect());
        let long = (WINDOW_SECS / step).round().max(1.0) as usize;
        let spans: Vec<Range<usize>> = self.ticks.spans().collect();
        let mut piece = 0;
        for span in spans {
            let count = span.len() / long;
            let in_piece = (PIECE_SECS / (long as f64 * step)).round().max(4.0) as usize;
            // No rest of a piece shorter than half of one.
            let pieces = ((count as f64 / in_piece as f64).round() as usize).max(1);
            for window in 0..count {
                let start = span.start + window * long;
                self.windows.push(start..start + long);
                self.piece.push(piece + window * pieces / count);
            }
            piece += pieces;
        }
        self.pieces = piece;
    }

    /// Standard deviation that rounding of a joint's torques makes in the mean of a window, N·m. Readings that repeat have the same error, so a mean is as good as its
    /// different readings make it.
    fn rounding(&self, joint: usize) -> f64 {
        let Some((step, share)) = self.log.torque.get(joint).and_then(|values| resolution(values)) else { return 0.0 };
        let rows = (self.windows.first().map_or(1, Range::len) * self.ticks.rows) as f64;
        let different = (rows * share).max(1.0);
        step / 12.0_f64.sqrt() / different.sqrt()
    }

    /// Standard deviation of measured less simulated torque in a window, N·m, from how well the motion is known. What rounding hides of a
    /// position lasts while the joint is slow. It errs in the servo's torque, of this `stiffness`, as in the model's. Neighbours share it, so that
    /// halves of the readings cannot tell the error of acceleration where rounding is most of the noise.
    fn motion_noise(&self, joint: usize, stiffness: f64, rounding: &[f64]) -> f64 {
        let square = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value * value, count + 1));
            sum / f64::from(count.max(1))
        };
        let of_moved = |moved: usize| {
            let own = |value: f64| if moved == joint { value } else { 0.0 };
            let rounded = rounding[moved];
            let motion = &self.motion[moved];
            let acceleration =
                if rounded > 0.5 * motion.noise { motion.tick_acceleration_stddev } else { motion.acceleration_stddev };
            let reflected = own(self.reflected_inertia(joint) * self.gain(joint));
            let inertia = self.inertia[moved][joint].iter().map(|inertia| inertia + reflected);
            let gradient = self.stiffness[moved][joint].iter().map(|gradient| gradient + own(stiffness));
            square(&mut { inertia }) * acceleration.powi(2) + square(&mut { gradient }) * rounded.powi(2)
        };
        (0..self.joints()).map(of_moved).sum::<f64>().sqrt()
    }

    /// Of torques by third differences of ticks: what is white in them is noise.
    fn estimate_noise(&mut self) {
        /// Least noise, as a share of a joint's typical torque. Simulators have none, but what is smaller than the errors of good torque sensors, some thousandths of
        /// their range, is no gap that matters.
        const LEAST: f64 = 1e-3;
        let long = self.windows.first().map_or(1, Range::len) as f64;
        // Of each joint's positions, rad.
        let rounding: Vec<f64> =
            self.log.position.iter().map(|v| resolution(v).map_or(0.0, |(step, _)| step / 12.0_f64.sqrt())).collect();
        self.noise = (0..self.joints())
            .map(|joint| {
                if let Some(servo) = self.log.header.servo.as_ref().filter(|_| self.servo_damping.is_some()) {
                    // The error of position is read with the noise of positions.
                    let stiffness = servo.stiffness_nmprad.of(joint).unwrap_or(0.0);
                    return (stiffness * self.motion[joint].noise / long.sqrt())
                        .hypot(self.motion_noise(joint, stiffness, &rounding))
                        .max(LEAST * self.scale[joint]);
                }
                let given = self.log.header.noise.joint_torque_nm.as_ref().and_then(|numbers| numbers.of(joint));
                let read = match given {
                    Some(stddev) => stddev / (self.ticks.rows as f64).sqrt(),
                    None => {
                        let thirds = self.measured[joint].windows(4);
                        let squares = thirds
                            .map(|four| (four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]).powi(2) / 20.0)
                            .filter(|square| square.is_finite());
                        (median(squares.collect()) / MEDIAN_SQUARE).sqrt()
                    }
                };
                let read = (read / long.sqrt()).max(self.rounding(joint));
                read.hypot(self.motion_noise(joint, 0.0, &rounding)).max(LEAST * self.scale[joint])
            })
            .collect();
    }
}

/// The step to which readings are rounded, and the share of rows that differ from the one before; `None` where they are not rounded: changes are no multiples.
fn resolution(values: &[f64]) -> Option<(f64, f64)> {
    /// Share of the changes that are smaller than the one that is taken, or no multiples of it: a stray one is not the sensor's.
    const STRAY: f64 = 0.02;
    /// Steps in the least change, at most: readings that are never at rest, and seldom.
    const MOST: u32 = 8;
    /// How far from a whole number, at most, a multiple is: of 10 % of other numbers.
    const OFF: f64 = 0.05;
    let pairs = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| step.is_finite());
    let all = pairs.clone().count().max(1) as f64;
    let mut changes: Vec<f64> = pairs.filter(|step| *step > 1e-12).collect();
    changes.sort_by(f64::total_cmp);
    let least = *changes.get((STRAY * changes.len() as f64) as usize)?;
    // Large multiples show the digits that were written, not the sensor's.
    let small = || changes.iter().map(|change| change / least).take_while(|multiple| *multiple < f64::from(MOST));
    let off = |parts: u32| {
        let others = small().map(|multiple| multiple * f64::from(parts)).filter(|m| (m - m.round()).abs() > OFF);
        others.count() as f64
    };
    let parts = (1..=MOST).find(|parts| off(*parts) <= 2.0 * STRAY * small().count() as f64)?;
    Some((least / f64::from(parts), changes.len() as f64 / all))
}

fn elapsed(ticks: &Ticks) -> Vec<f64> {
    let mut before = 0.0;
    let mut all = Vec::with_capacity(ticks.count());
    for span in ticks.spans() {
        let here = &ticks.time_secs[span];
        let first = here.first().copied().unwrap_or(0.0);
        all.extend(here.iter().map(|time| before + time - first));
        before = all.last().copied().unwrap_or(0.0);
    }
    all
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

pub(crate) fn rms(values: &[f64]) -> f64 {
    let there = values.iter().filter(|value| value.is_finite());
    (there.clone().map(|value| value * value).sum::<f64>() / there.count().max(1) as f64).sqrt()
}
