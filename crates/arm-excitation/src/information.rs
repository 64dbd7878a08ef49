//! How much a motion's log tells.

use arm_dynamics::{Arm, GRAVITY, PARAMETERS, PerJoint};
use nalgebra::{Cholesky, DMatrix};

use crate::motion::Motion;

/// Readings that a motion is taken for, per second: what is left by a model errs alike for about so long.
const READINGS: f64 = 10.0;
/// Standard deviation of a reading's torque, as a share of the joint's typical torque.
const NOISE: f64 = 0.02;
/// Share of a joint's fastest rate at which Coulomb friction has turned to the other sign.
const TURNS: f64 = 0.01;
/// Shortest length that a link is taken for, m.
const SHORTEST_M: f64 = 1e-4;

/// What a log should tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Question {
    /// Coulomb and viscous friction of all joints.
    Friction,
    /// Mass, centre and inertia of a body at the tip.
    Payload,
    /// Masses, centres and inertias of the links.
    Masses,
    /// Inertias of the motors, seen through the gears.
    MotorInertia,
    /// Factors by which torques are read too large.
    TorqueGain,
    /// Torques that are read with an offset.
    TorqueOffset,
    /// All of these.
    All,
}

/// How well one number would be known.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// What it is, with the joint's name.
    pub name: String,
    /// SI.
    pub unit: &'static str,
    /// Standard deviation before the log is seen.
    pub before: f64,
    /// And after, with all other numbers unknown as well: those of a payload too, but where the links' masses are asked for.
    pub after: f64,
}

/// A number that torques are linear in.
struct Number {
    question: Question,
    name: String,
    unit: &'static str,
    before: f64,
}

/// The numbers of an arm, with what is usual about them.
pub(crate) struct Unknowns<'a> {
    arm: &'a Arm,
    numbers: Vec<Number>,
    usual: Vec<Usual>,
    question: Question,
}

/// What is usual in a joint, SI.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Usual {
    pub(crate) torque: f64,
    /// Of all that it carries, about its axis.
    pub(crate) inertia: f64,
    /// Its fastest.
    pub(crate) rate: f64,
    /// From it to the next joint or to the centre of its link, whatever is longer.
    pub(crate) length_m: f64,
}

impl<'a> Unknowns<'a> {
    pub(crate) fn new(arm: &'a Arm, usual: Vec<Usual>, question: Question) -> Self {
        const MASS: [(&str, &str); PARAMETERS] = [
            ("mass", "kg"),
            ("first moment x", "kg m"),
            ("first moment y", "kg m"),
            ("first moment z", "kg m"),
            ("inertia xx", "kg m2"),
            ("inertia xy", "kg m2"),
            ("inertia xz", "kg m2"),
            ("inertia yy", "kg m2"),
            ("inertia yz", "kg m2"),
            ("inertia zz", "kg m2"),
        ];
        let total: f64 = arm.masses().map(|mass| mass.mass_kg).sum::<f64>().max(0.1);
        let mut numbers = Vec::new();
        let mut add = |question, name: String, unit, before| numbers.push(Number { question, name, unit, before });
        let asked = matches!(question, Question::Masses | Question::All);
        for ((joint, mass), usual) in arm.joints().iter().zip(arm.masses()).zip(&usual) {
            let length = usual.length_m.max(SHORTEST_M);
            // A file's masses are within a tenth where they are not asked for, and within half where they are.
            let share = if asked { 0.5 } else { 0.1 };
            let weight = share * mass.mass_kg.max(0.02 * total / arm.joints().len() as f64);
            for (place, (name, unit)) in MASS.iter().enumerate() {
                let before = weight * [1.0, length, length * length][usize::from(place > 0) + usize::from(place > 3)];
                add(Question::Masses, format!("{name} at {}", joint.name), unit, before);
            }
        }
        // As far from the tip's joint as links are long.
        let length = usual.iter().map(|usual| usual.length_m).sum::<f64>() / usual.len() as f64;
        let length = length.max(SHORTEST_M);
        // A payload is all that the last link's masses could be told from: who asks for these carries none.
        let carried = if question == Question::Masses { &[][..] } else { &MASS[..] };
        for (place, (name, unit)) in carried.iter().enumerate() {
            let before = 0.1 * total * [1.0, length, length * length][usize::from(place > 0) + usize::from(place > 3)];
            add(Question::Payload, format!("payload's {name}"), unit, before);
        }
        for (joint, usual) in arm.joints().iter().zip(&usual) {
            let of = |what: &str| format!("{what} of {}", joint.name);
            let (force, rate, inertia) =
                if joint.slides { ("N", "N s/m", "kg") } else { ("N m", "N m s/rad", "kg m2") };
            add(Question::Friction, of("Coulomb friction"), force, 0.2 * usual.torque);
            add(Question::Friction, of("viscous friction"), rate, 0.2 * usual.torque / usual.rate);
            add(Question::MotorInertia, of("motor's inertia"), inertia, usual.inertia);
            add(Question::TorqueGain, of("torque gain"), "1", 0.3);
            add(Question::TorqueOffset, of("torque offset"), force, 0.2 * usual.torque);
        }
        Self { arm, numbers, usual, question }
    }

    fn asked(&self, number: &Number) -> bool {
        self.question == Question::All || number.question == self.question
    }

    /// 1 + S Xᵀ N⁻¹ X S of a motion: the information in units of the prior.
    fn precision(&self, motion: &Motion) -> DMatrix<f64> {
        let count = self.numbers.len();
        let joints = self.arm.joints().len();
        let readings = (READINGS * motion.seconds()).ceil().max(1.0) as usize;
        let mut rows = DMatrix::zeros(readings * joints, count);
        for reading in 0..readings {
            let time = (reading as f64 + 0.5) * motion.seconds() / readings as f64;
            let columns = self.columns(motion, time);
            for (number, torques) in columns.iter().enumerate() {
                for joint in 0..joints {
                    rows[(reading * joints + joint, number)] =
                        torques[joint] * self.numbers[number].before / (NOISE * self.usual[joint].torque);
                }
            }
        }
        rows.transpose() * rows + DMatrix::identity(count, count)
    }

    /// Torques per unit of each number.
    fn columns(&self, motion: &Motion, time: f64) -> Vec<PerJoint> {
        let samples = motion.at(time);
        let each = |pick: fn(&crate::Sample) -> f64| samples.iter().map(pick).collect::<Vec<f64>>();
        let state = self.arm.motion(&each(|s| s.position), &each(|s| s.rate), &each(|s| s.acceleration), &GRAVITY);
        let joints = samples.len();
        let mut columns: Vec<PerJoint> = (0..joints).flat_map(|link| state.regressor(link)).collect();
        if self.question != Question::Masses {
            columns.extend(state.regressor(joints - 1));
        }
        let torques = state.torques();
        for (joint, sample) in samples.iter().enumerate() {
            let turns = TURNS * self.usual[joint].rate;
            for value in [(sample.rate / turns).tanh(), sample.rate, sample.acceleration, torques[joint], 1.0] {
                let mut column = PerJoint::default();
                column[joint] = value;
                columns.push(column);
            }
        }
        columns
    }

    /// Expected information about what is asked, nats.
    pub(crate) fn nats(&self, motion: &Motion) -> f64 {
        let precision = self.precision(motion);
        let others: Vec<usize> = (0..self.numbers.len()).filter(|i| !self.asked(&self.numbers[*i])).collect();
        let rest = DMatrix::from_fn(others.len(), others.len(), |i, j| precision[(others[i], others[j])]);
        match (log_determinant(precision), log_determinant(rest)) {
            (Some(all), Some(rest)) => 0.5 * (all - rest),
            _ => f64::NEG_INFINITY,
        }
    }

    /// How well each number that is asked for would be known.
    pub(crate) fn spreads(&self, motion: &Motion) -> Vec<Spread> {
        let Some(cholesky) = Cholesky::new(self.precision(motion)) else { return Vec::new() };
        let covariance = cholesky.inverse();
        let asked = self.numbers.iter().enumerate().filter(|(_, number)| self.asked(number));
        asked
            .map(|(i, number)| Spread {
                name: number.name.clone(),
                unit: number.unit,
                before: number.before,
                after: number.before * covariance[(i, i)].sqrt(),
            })
            .collect()
    }
}

fn log_determinant(matrix: DMatrix<f64>) -> Option<f64> {
    let cholesky = Cholesky::new(matrix)?;
    Some(cholesky.l_dirty().diagonal().iter().map(|value| 2.0 * value.ln()).sum())
}
