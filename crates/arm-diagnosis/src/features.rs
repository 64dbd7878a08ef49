//! The torques that each hypothesis would add, as columns of a linear model: nuisance values first, then what can be named.
//!
//! A hypothesis that is not linear in a value, such as the speed of the Stribeck effect, stands in several settings of that value.

use arm_dynamics::PARAMETERS;

use crate::effect::{EFFECTS, Effect};
use crate::gear::{Gear, Lag, lag};
use crate::prepared::{Prepared, mean};

/// A column: torques of one joint, a value a window, or of all joints, joint after joint.
#[derive(Clone, Debug)]
pub(crate) struct Feature {
    pub(crate) joint: Option<usize>,
    pub(crate) values: Vec<f64>,
    /// Standard deviation of its coefficient before the log is seen.
    pub(crate) stddev: f64,
    /// Whether the coefficient cannot be negative.
    pub(crate) positive: bool,
    /// The nuisance that is the same column with a narrower prior.
    pub(crate) twin: Option<usize>,
}

/// An effect in a joint, with a setting of what is not linear in it.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub(crate) effect: &'static Effect,
    pub(crate) joint: Option<usize>,
    pub(crate) setting: f64,
    /// Of the Stribeck effect, a second setting; 0 of others.
    pub(crate) curvature: f64,
    /// Places of its columns; those of Coulomb and viscous friction are shared with others.
    pub(crate) features: Vec<usize>,
}

/// All columns: `nuisances` are those of what is re-tuned and never named.
#[derive(Debug, Default)]
pub(crate) struct Catalogue {
    pub(crate) features: Vec<Feature>,
    pub(crate) nuisances: Vec<usize>,
    /// Those of `nuisances` that are masses of links, whose spread is learnt.
    pub(crate) masses: Vec<usize>,
    /// Of each link, how its numbers change by the coefficients of its ten columns of `masses`.
    pub(crate) mass_ways: Vec<[[f64; PARAMETERS]; PARAMETERS]>,
    /// The same of a payload.
    pub(crate) payload_ways: Vec<[f64; PARAMETERS]>,
    pub(crate) candidates: Vec<Candidate>,
}

/// Settings, one to four a decade: what gears give under a joint's typical torque, rad, with and without play; play, rad; their damping ratios. The prior
/// spread of a size is a multiple of its setting.
const GIVES_RAD: [f64; 9] = [0.001, 0.0018, 0.0032, 0.0056, 0.01, 0.018, 0.032, 0.056, 0.1];
const FLANK_GIVES_RAD: [f64; 3] = [0.0002, 0.001, 0.005];
const PLAYS_RAD: [f64; 6] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05];
const GIVE_DAMPING: [f64; 2] = [0.3, 1.0];
const FLANK_DAMPING: f64 = 0.3;
const SPREAD: f64 = 1.5;
/// Largest lag that torques are taken as linear in.
const MOST_LAG_RAD: f64 = 0.5;

/// Spreads of what a nominal model is wrong about although nothing is missing.
pub(crate) mod nuisance {
    /// Mass and inertia, relative; centre of mass, m.
    pub(crate) const MASS: f64 = 0.05;
    pub(crate) const COM_M: f64 = 0.005;
    pub(crate) const INERTIA: f64 = 0.1;
    /// Torque constants, relative, and zeros of torque, of what is usual there.
    pub(crate) const GAIN: f64 = 0.02;
    pub(crate) const OFFSET: f64 = 0.01;
    /// Friction that the file gives, relative.
    pub(crate) const FRICTION: f64 = 0.15;
    /// Zeros of angles, rad; clocks, s; the base's level, rad.
    pub(crate) const ANGLE_RAD: f64 = 1e-3;
    pub(crate) const CLOCK_SECS: f64 = 1e-3;
    pub(crate) const LEVEL_RAD: f64 = 2e-3;
    /// Gains of a servo, relative.
    pub(crate) const SERVO: f64 = 0.06;
}

impl Catalogue {
    pub(crate) fn new(prepared: &Prepared) -> Self {
        let mut catalogue = Self::default();
        catalogue.add_masses(prepared);
        catalogue.add_nuisances(prepared);
        for joint in (0..prepared.joints()).filter(|joint| prepared.is_read(*joint)) {
            catalogue.add_friction(prepared, joint);
            catalogue.add_motor(prepared, joint);
            catalogue.add_gear(prepared, joint);
        }
        catalogue.add_arm(prepared);
        catalogue
    }

    pub(crate) fn push(&mut self, joint: Option<usize>, values: Vec<f64>, stddev: f64, positive: bool) -> usize {
        let same = |nuisance: &&usize| {
            let other = &self.features[**nuisance];
            other.joint == joint && !self.masses.contains(nuisance) && other.values == values
        };
        let twin = self.nuisances.iter().find(same).copied();
        self.features.push(Feature { joint, values, stddev, positive, twin });
        self.features.len() - 1
    }

    pub(crate) fn nuisance(&mut self, joint: Option<usize>, values: Vec<f64>, stddev: f64) {
        let place = self.push(joint, values, stddev, false);
        self.nuisances.push(place);
    }

    pub(crate) fn candidate(&mut self, name: &str, joint: Option<usize>, setting: f64, features: Vec<usize>) {
        self.shaped(name, joint, (setting, 0.0), features);
    }

    /// A candidate with two settings.
    pub(crate) fn shaped(&mut self, name: &str, joint: Option<usize>, shape: (f64, f64), features: Vec<usize>) {
        let effect = EFFECTS.iter().find(|effect| effect.name == name).expect("the name of an effect");
        self.candidates.push(Candidate { effect, joint, setting: shape.0, curvature: shape.1, features });
    }

    fn add_nuisances(&mut self, prepared: &Prepared) {
        for joint in 0..prepared.joints() {
            let own = Some(joint);
            let scale = prepared.scale[joint];
            let gain = if prepared.servo_damping.is_some() { nuisance::SERVO } else { nuisance::GAIN };
            self.nuisance(own, prepared.means(&given(prepared, joint)), gain);
            self.nuisance(own, vec![1.0; prepared.windows.len()], nuisance::OFFSET * scale);
            let known = &prepared.log.arm.joints()[joint];
            if known.friction > 0.0 {
                self.nuisance(own, read(prepared, joint, &prepared.signs(joint)), nuisance::FRICTION * known.friction);
            }
            if known.damping > 0.0 {
                self.nuisance(
                    own,
                    read(prepared, joint, &prepared.motion[joint].rate),
                    nuisance::FRICTION * known.damping,
                );
            }
            let inertia = prepared.reflected_inertia(joint);
            if inertia > 0.0 {
                self.nuisance(
                    own,
                    read(prepared, joint, &prepared.motion[joint].acceleration),
                    nuisance::INERTIA * inertia,
                );
            }
            if let Some(damped) = &prepared.servo_damping {
                self.nuisance(own, prepared.means(&damped[joint]), nuisance::SERVO);
            }
            self.nuisance(None, turned(prepared, joint, &vec![1.0; prepared.ticks.count()], None), nuisance::ANGLE_RAD);
        }
        let clock = clock(prepared);
        self.nuisance(None, clock, nuisance::CLOCK_SECS);
        for values in tilted(prepared) {
            self.nuisance(None, values, nuisance::LEVEL_RAD);
        }
    }

    fn add_motor(&mut self, prepared: &Prepared, joint: usize) {
        let own = Some(joint);
        let (scale, windows) = (prepared.scale[joint], prepared.windows.len());
        let motion = &prepared.motion[joint];
        let own_inertia = mean(&prepared.inertia[joint][joint]).max(1e-9);
        let place = self.push(own, read(prepared, joint, &motion.acceleration), own_inertia, true);
        self.candidate("reflected_inertia", own, 0.0, vec![place]);
        for cycles in 1..=120_u32 {
            let cycles = f64::from(cycles);
            let wave =
                |phase: f64| -> Vec<f64> { motion.position.iter().map(|q| (cycles * q + phase).sin()).collect() };
            let quarter = std::f64::consts::FRAC_PI_2;
            let features = [0.0, quarter].map(|phase| self.push(own, prepared.means(&wave(phase)), 0.1 * scale, false));
            self.candidate("torque_ripple", own, cycles, features.to_vec());
        }
        let gain = self.push(own, prepared.means(&given(prepared, joint)), 0.4, false);
        let offset = self.push(own, vec![1.0; windows], 0.2 * scale, false);
        self.candidate("torque_offset", own, 0.0, vec![offset]);
        self.add_saturation(prepared, joint);
        if prepared.servo_damping.is_some() {
            self.candidate("servo_gain", own, 0.0, vec![gain]);
            return;
        }
        self.candidate("torque_gain", own, 0.0, vec![gain]);
        let last = prepared.elapsed_secs.last().copied().unwrap_or(1.0).max(1.0);
        let drift = self.push(own, prepared.means(&prepared.elapsed_secs), 0.2 * scale / last, false);
        self.candidate("torque_drift", own, 0.0, vec![offset, drift]);
    }

    /// What is commanded beyond a limit. The motion must not show more than the limit, or it is none.
    fn add_saturation(&mut self, prepared: &Prepared, joint: usize) {
        let sorted = |values: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            let mut sizes: Vec<f64> = values.map(f64::abs).filter(|size| size.is_finite()).collect();
            sizes.sort_by(f64::total_cmp);
            sizes
        };
        let commanded = sorted(&mut prepared.measured[joint].iter().copied());
        let shown = sorted(&mut given(prepared, joint).into_iter());
        let tick_noise =
            prepared.noise[joint] * (prepared.windows.first().map_or(1, ExactSizeIterator::len) as f64).sqrt();
        let at = |sizes: &[f64], share: f64| sizes.get((share * sizes.len() as f64) as usize).copied().unwrap_or(0.0);
        for share in [0.5, 0.6, 0.7, 0.8, 0.88, 0.94, 0.97] {
            let limit = at(&commanded, share);
            // A column of measured torques has their noise, which must not be what exceeds the limit.
            if at(&shown, 0.99) > 1.1 * limit || limit < 10.0 * tick_noise {
                continue;
            }
            let beyond = prepared.measured[joint].iter().map(|torque| torque - torque.clamp(-limit, limit));
            let place = self.push(Some(joint), prepared.means(&beyond.collect::<Vec<_>>()), 1.0, true);
            self.candidate("torque_saturation", Some(joint), limit, vec![place]);
        }
    }

    fn add_gear(&mut self, prepared: &Prepared, joint: usize) {
        let own = Some(joint);
        let motion = &prepared.motion[joint];
        let count = prepared.ticks.count();
        let offset = self.push(None, turned(prepared, joint, &vec![1.0; count], None), 0.05, false);
        self.candidate("encoder_offset", own, 0.0, vec![offset]);
        let quarter = std::f64::consts::FRAC_PI_2;
        let waves = [0.0, quarter].map(|phase| {
            let wave: Vec<f64> = motion.position.iter().map(|q| (q + phase).sin()).collect();
            let second = (0..count).map(|tick| {
                let (sin, cos) = (motion.position[tick] + phase).sin_cos();
                cos * motion.acceleration[tick] - sin * motion.rate[tick].powi(2)
            });
            self.push(None, turned(prepared, joint, &wave, Some(&second.collect::<Vec<_>>())), 0.03, false)
        });
        self.candidate("encoder_eccentricity", own, 0.0, waves.to_vec());
        self.add_held(prepared, joint);
    }

    /// What holds the link: the coefficient of a column is the size itself, and its motion is that of the setting.
    fn add_held(&mut self, prepared: &Prepared, joint: usize) {
        let scale = prepared.scale[joint];
        let mut held = |name: &str, shape: (f64, f64), size: f64, gear: Gear| {
            let Lag { angle, second } = lag(prepared, joint, gear);
            // So soft a gear lets its link fall, and torques are not linear in what it gives.
            if !angle.iter().chain(&second).all(|value| value.is_finite())
                || angle.iter().any(|lag| lag.abs() > MOST_LAG_RAD)
            {
                return;
            }
            let column = turned(prepared, joint, &angle, Some(&second));
            let per_size = column.iter().map(|value| value / size).collect();
            let place = self.push(None, per_size, SPREAD * size, true);
            self.shaped(name, Some(joint), shape, vec![place]);
        };
        for give in GIVES_RAD {
            for damping_ratio in GIVE_DAMPING {
                let gear = Gear { stiffness: scale / give, play: 0.0, damping_ratio };
                held("joint_elasticity", (gear.stiffness, damping_ratio), give / scale, gear);
            }
        }
        for give in FLANK_GIVES_RAD {
            for play in PLAYS_RAD {
                let gear = Gear { stiffness: scale / give, play, damping_ratio: FLANK_DAMPING };
                held("backlash", (gear.stiffness, play), play, gear);
            }
        }
    }

    fn add_arm(&mut self, prepared: &Prepared) {
        let clock = self.push(None, clock(prepared), 0.02, false);
        if prepared.servo_damping.is_some() {
            // Commands have no noise, so a delay may be taken as it is.
            for step in 1..=12 {
                let delay = 0.006 * f64::from(step);
                let place = self.push(None, commanded_late(prepared, delay), 1.0, true);
                self.candidate("command_delay", None, delay, vec![place]);
            }
        } else {
            self.candidate("torque_delay", None, 0.0, vec![clock]);
            let gravity = (0..prepared.joints()).flat_map(|joint| {
                prepared.means(&prepared.gravity[joint]).into_iter().map(|torque| -torque).collect::<Vec<_>>()
            });
            let place = self.push(None, gravity.collect(), 0.7, true);
            self.candidate("gravity_compensation", None, 0.0, vec![place]);
        }
        let features = tilted(prepared).map(|values| self.push(None, values, 0.05, false));
        self.candidate("base_tilt", None, 0.0, features.to_vec());
    }
}

/// What the motor gives: with the friction that is known.
fn given(prepared: &Prepared, joint: usize) -> Vec<f64> {
    let (known, gain) = (prepared.known_friction(joint), prepared.gain(joint));
    prepared.rigid[joint].iter().zip(known).map(|(rigid, friction)| rigid / gain + friction).collect()
}

/// A series as a sensor with the joint's gain reads it.
pub(crate) fn read(prepared: &Prepared, joint: usize, series: &[f64]) -> Vec<f64> {
    let gain = prepared.gain(joint);
    prepared.means(series).into_iter().map(|value| gain * value).collect()
}

/// What all torques change by where the link is behind the reading of a joint by `angle` (times the coefficient), with `second` its second derivative.
fn turned(prepared: &Prepared, moved: usize, angle: &[f64], second: Option<&[f64]>) -> Vec<f64> {
    let column = |joint: usize| {
        let (stiffness, inertia) = (&prepared.stiffness[moved][joint], &prepared.inertia[moved][joint]);
        let change = (0..angle.len()).map(|tick| {
            let moving = second.map_or(0.0, |second| inertia[tick] * second[tick]);
            -(stiffness[tick] * angle[tick] + moving)
        });
        prepared.means(&change.collect::<Vec<_>>())
    };
    (0..prepared.joints()).flat_map(column).collect()
}

/// What torques change by for each second that they are read late; of a servo, what its commands say too much for each second that they act late.
fn clock(prepared: &Prepared) -> Vec<f64> {
    let servo = prepared.log.header.servo.as_ref().filter(|_| prepared.servo_damping.is_some());
    let column = |joint: usize| {
        let change: Vec<f64> = match servo.and_then(|servo| servo.stiffness_nmprad.of(joint)) {
            Some(stiffness) => {
                derivative(prepared, &prepared.ticks.command[joint]).iter().map(|rate| rate * stiffness).collect()
            }
            None => {
                // As good as a derivative for a short delay, and exact for the one that a first fit has found.
                let delay = if prepared.delay_secs.abs() > 2e-3 { prepared.delay_secs } else { 2e-3 };
                let calm = calm(prepared, &given(prepared, joint));
                shifted(prepared, &calm, delay).iter().zip(&calm).map(|(then, now)| (then - now) / delay).collect()
            }
        };
        prepared.means(&change)
    };
    (0..prepared.joints()).flat_map(column).collect()
}

/// Means over a window about each tick: what is quicker in a smoothed motion is mostly noise, and the gap has the same noise.
fn calm(prepared: &Prepared, series: &[f64]) -> Vec<f64> {
    let wide = prepared.windows.first().map_or(1, ExactSizeIterator::len);
    let mut all = Vec::with_capacity(series.len());
    for span in prepared.ticks.spans() {
        for tick in span.clone() {
            // As far on one side as on the other.
            let reach = wide.min(tick - span.start).min(span.end - 1 - tick);
            all.push(mean(&series[tick - reach..=tick + reach]));
        }
    }
    all
}

/// Change per second of a series, over about 0.08 s: what is quicker in a smoothed motion is mostly noise, and the gap has the same noise.
fn derivative(prepared: &Prepared, series: &[f64]) -> Vec<f64> {
    around(prepared, series, |[before, _, after], step| (after - before) / (2.0 * step))
}

/// What the servo's law says too much where its commands act `delay` seconds late.
fn commanded_late(prepared: &Prepared, delay: f64) -> Vec<f64> {
    let servo = prepared.log.header.servo.as_ref();
    let column = |joint: usize| {
        let stiffness = servo.and_then(|servo| servo.stiffness_nmprad.of(joint)).unwrap_or(0.0);
        let series = &prepared.ticks.command[joint];
        let change = shifted(prepared, series, delay)
            .iter()
            .zip(series)
            .map(|(then, now)| (now - then) * stiffness)
            .collect::<Vec<_>>();
        prepared.means(&change)
    };
    (0..prepared.joints()).flat_map(column).collect()
}

/// A series as it was `delay` seconds before each tick; before the first and after the last it stood still.
fn shifted(prepared: &Prepared, series: &[f64], delay: f64) -> Vec<f64> {
    let mut all = vec![0.0; series.len()];
    for span in prepared.ticks.spans() {
        let times = &prepared.ticks.time_secs[span.clone()];
        let values = &series[span.clone()];
        for (tick, time) in times.iter().enumerate() {
            let then = time - delay;
            let after = times.partition_point(|other| *other < then);
            all[span.start + tick] = match after.checked_sub(1) {
                Some(before) if after < times.len() => {
                    let share = (then - times[before]) / (times[after] - times[before]);
                    values[before] + share * (values[after] - values[before])
                }
                Some(before) => values[before],
                None => values[0],
            };
        }
    }
    all
}

/// What torques change by for a unit of gravity's slope along the base's x and y.
fn tilted(prepared: &Prepared) -> [Vec<f64>; 2] {
    let (count, windows) = (prepared.joints(), prepared.windows.len());
    let strength = prepared.log.header.gravity_mps2;
    [nalgebra::Vector3::x(), nalgebra::Vector3::y()].map(|way| {
        let mut column = vec![0.0; count * windows];
        let zero = vec![0.0; count];
        for (window, ticks) in prepared.windows.iter().enumerate() {
            let middle = (ticks.start + ticks.end) / 2;
            let [q, _, _] = prepared.state(middle);
            let torques = prepared.arm().inverse_dynamics(&q, &zero, &zero, &(way * strength));
            for joint in 0..count {
                column[joint * windows + window] = prepared.gain(joint) * torques[joint];
            }
        }
        column
    })
}

/// A function of a series some time before each tick, at it and after, and of that time, s; 0 at the ends of episodes.
fn around(prepared: &Prepared, series: &[f64], function: impl Fn([f64; 3], f64) -> f64) -> Vec<f64> {
    let mut all = vec![0.0; series.len()];
    let wide = prepared.windows.first().map_or(1, ExactSizeIterator::len);
    for span in prepared.ticks.spans() {
        let times = &prepared.ticks.time_secs;
        for tick in span.clone() {
            let Some(before) = tick.checked_sub(wide).filter(|before| *before >= span.start) else { continue };
            let after = tick + wide;
            if after < span.end {
                all[tick] =
                    function([series[before], series[tick], series[after]], 0.5 * (times[after] - times[before]));
            }
        }
    }
    all
}
