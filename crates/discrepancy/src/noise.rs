//! Standard deviations of the sensors: as `log.toml` says, else estimated from the log.
//!
//! A sensor's noise is what its own readings scatter by, whatever moved. Its rows are those with a reading; a reading that is
//! held until the next one counts once. Of four in a row the third difference is free of any motion with a steady acceleration, however the
//! rows are spaced; what is left of motion, such as impacts, is in few of them, so that the lower quartile of their sizes is the noise's. Where the tool rests
//! before it first moves nothing moves at all: those rows are enough where there are many.

use measured_log::{Channel, Component, Episode, Log, Noise};
use nalgebra::UnitQuaternion;
use serde::Serialize;

use crate::trial::{Kind, orientations};
use crate::units::Units;

/// Of a normal variable: lower quartile, and median, of |x| over its standard deviation.
const QUARTILE_SHARE: f64 = 0.318_639_36;
const MEDIAN_SHARE: f64 = 0.674_489_75;
/// Differences at rest that suffice.
const AT_REST: usize = 100;
/// A given standard deviation that differs from what readings scatter by more than this factor is told.
const CONTRADICTS: f64 = 3.0;

/// Scatter below so many steps of the readings is that of their rounding.
const STEPS: f64 = 3.0;

/// Where a standard deviation comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// `log.toml`.
    Given,
    /// What readings scatter by.
    Estimated,
    /// They do not scatter, or are too few to say: what a rounded column shows.
    Floor,
}

/// The noise of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SensorNoise {
    /// Channel.
    pub channel: Kind,
    /// Unit of a component.
    pub unit: &'static str,
    /// Standard deviation of a component.
    pub stddev: f64,
    /// Where it comes from.
    pub source: Source,
    /// What readings scatter by, if enough of them do, and, beside a given noise, by more than their steps.
    pub scatter: Option<f64>,
}

impl SensorNoise {
    /// In units of which `units` says how much one of today's is.
    pub(crate) fn in_units(self, units: &Units) -> Self {
        let factor = units.factor(self.unit);
        Self { stddev: factor * self.stddev, scatter: self.scatter.map(|scatter| factor * scatter), ..self }
    }

    /// Whether readings scatter by something else than `log.toml` gives.
    pub(crate) fn contradicts(&self) -> bool {
        let ratio = self.scatter.filter(|_| self.source == Source::Given).map(|scatter| scatter / self.stddev);
        ratio.is_some_and(|ratio| !(CONTRADICTS.recip()..=CONTRADICTS).contains(&ratio))
    }

    /// In words: what was used, and what speaks against it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let (name, unit) = (self.channel.name(), self.unit);
        let source = match self.source {
            Source::Given => "given",
            Source::Estimated => "estimated",
            Source::Floor => "smallest that is taken: readings do not say",
        };
        let against = match self.scatter {
            Some(scatter) if self.contradicts() => format!(", but readings scatter by {scatter:.2e} {unit}"),
            _ => String::new(),
        };
        format!("{name} {:.2e} {unit} ({source}{against})", self.stddev)
    }
}

/// Of each kind; `None` where the log has no such column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NoiseLevels([Option<SensorNoise>; 9]);

impl NoiseLevels {
    /// Of a log.
    #[must_use]
    pub fn of_log(log: &Log) -> Self {
        let joints = usize::from(log.header.robot.joints());
        Self(Kind::ALL.map(|kind| {
            let scatter = scatter(log, kind, joints)?.filter(|scatter| *scatter > 0.0);
            let (stddev, source) = match (given(&log.header.noise, kind), scatter) {
                (Some(given), _) => (given, Source::Given),
                (None, Some(scatter)) if scatter > smallest(kind) => (scatter, Source::Estimated),
                (None, _) => (smallest(kind), Source::Floor),
            };
            // What rounding makes of a reading contradicts nothing.
            let fine = |scatter: &f64| {
                source != Source::Given || step(log, kind, joints).is_none_or(|step| *scatter > STEPS * step)
            };
            let scatter = scatter.filter(fine);
            Some(SensorNoise { channel: kind, unit: kind.unit(), stddev, source, scatter })
        }))
    }

    /// Standard deviation of a component of a kind.
    #[must_use]
    pub fn of(&self, kind: Kind) -> Option<f64> {
        self.0[kind as usize].map(|noise| noise.stddev)
    }

    /// Those that the log has.
    pub fn all(&self) -> impl Iterator<Item = SensorNoise> + '_ {
        self.0.iter().flatten().copied()
    }
}

fn given(noise: &Noise, kind: Kind) -> Option<f64> {
    match kind {
        Kind::ObjectPosition => noise.object_position_m,
        Kind::ObjectOrientation => noise.object_orientation_rad,
        Kind::ObjectVelocity => noise.object_velocity_mps,
        Kind::ObjectSpin => noise.object_spin_rps,
        Kind::ToolPosition => noise.tool_position_m,
        Kind::JointPosition => noise.joint_position_rad,
        Kind::WristForce => noise.wrist_force_n,
        Kind::WristTorque => noise.wrist_torque_nm,
        Kind::JointTorque => noise.joint_torque_nm,
    }
}

/// Below this a sensor is exact for our purposes: what a rounded column shows. In the kind's unit.
fn smallest(kind: Kind) -> f64 {
    match kind {
        Kind::ObjectPosition | Kind::ToolPosition => 1e-4,
        Kind::ObjectOrientation => 1e-3,
        Kind::ObjectVelocity => 1e-3,
        Kind::ObjectSpin => 1e-2,
        Kind::JointPosition => 1e-4,
        Kind::WristForce => 1e-2,
        Kind::WristTorque => 1e-3,
        Kind::JointTorque => 1e-2,
    }
}

/// What the readings of a kind scatter by, if enough do; `None` where there are none.
fn scatter(log: &Log, kind: Kind, joints: usize) -> Option<Option<f64>> {
    // Of all rows, and of those at rest.
    let (mut any, mut all, mut resting) = (false, Vec::new(), Vec::new());
    for episode in &log.episodes {
        let rest_secs = rest_secs(episode);
        let mut add = |differences: Vec<(f64, f64)>| {
            resting.extend(differences.iter().filter(|(end_secs, _)| *end_secs < rest_secs).map(|(_, size)| *size));
            all.extend(differences.into_iter().map(|(_, size)| size));
        };
        if kind == Kind::ObjectOrientation {
            let turns = orientations(episode);
            let read: Vec<(f64, UnitQuaternion<f64>)> =
                episode.time_secs.iter().zip(turns).filter_map(|(time, turn)| Some((*time, turn?))).collect();
            any |= !read.is_empty();
            for component in 0..3 {
                // About the first of the four: turns between readings are small.
                let turn = |from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>| {
                    (to * from.inverse()).scaled_axis()[component]
                };
                add(differences(&read, turn));
            }
        }
        for channel in kind.channels(joints) {
            let Some(readings) = episode.channels.get(&channel) else { continue };
            let read: Vec<(f64, f64)> = episode
                .time_secs
                .iter()
                .zip(readings.iter())
                .filter_map(|(time, value)| Some((*time, value?)))
                .collect();
            any |= !read.is_empty();
            add(differences(&read, |from, to| to - from));
        }
    }
    any.then(|| if resting.len() >= AT_REST { size(resting) } else { size(all) })
}

/// The smallest step between readings of a kind that follow each other; `None` where none differ.
fn step(log: &Log, kind: Kind, joints: usize) -> Option<f64> {
    let channels = if kind == Kind::ObjectOrientation {
        Component::ALL.map(Channel::ObjectOrientation).to_vec()
    } else {
        kind.channels(joints)
    };
    let columns =
        log.episodes.iter().flat_map(|episode| channels.iter().filter_map(|channel| episode.channels.get(channel)));
    let steps = columns.flat_map(|readings| {
        let read: Vec<f64> = readings.iter().flatten().collect();
        read.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect::<Vec<f64>>()
    });
    steps.min_by(f64::total_cmp)
}

/// When the tool first moves, s; before any row where it is not commanded.
fn rest_secs(episode: &Episode) -> f64 {
    let sent = |row: usize| episode.vector(Channel::Command, row);
    let moves = (0..episode.rows()).find(|row| sent(*row).is_some() && sent(*row) != sent(0));
    match (sent(0), moves) {
        (Some(_), Some(row)) => episode.time_secs[row],
        _ => f64::NEG_INFINITY,
    }
}

/// Third differences of readings: the time of the last of the four, and the size beside that of white noise of one. `less` is the difference of two.
fn differences<T: PartialEq>(read: &[(f64, T)], less: impl Fn(&T, &T) -> f64) -> Vec<(f64, f64)> {
    let new: Vec<&(f64, T)> = read
        .iter()
        .enumerate()
        .filter(|(i, (_, value))| *i == 0 || read[i - 1].1 != *value)
        .map(|(_, one)| one)
        .collect();
    new.windows(4)
        .map(|four| {
            // Weights of a divided difference: they take out every parabola.
            let weight =
                |i: usize| -> f64 { (0..4).filter(|j| *j != i).map(|j| (four[i].0 - four[j].0).recip()).product() };
            let weights: [f64; 4] = std::array::from_fn(weight);
            let length = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
            let sum: f64 = weights.iter().zip(four).map(|(w, (_, value))| w * less(&four[0].1, value)).sum();
            (four[3].0, (sum / length).abs())
        })
        .collect()
}

/// Standard deviation of normal noise whose differences have these sizes, but for some that motion makes larger.
fn size(mut sizes: Vec<f64>) -> Option<f64> {
    sizes.sort_by(f64::total_cmp);
    let at = |share: f64| sizes.get((share * sizes.len() as f64) as usize).copied();
    let quartile = at(0.25)? / QUARTILE_SHARE;
    // A coarse column does not scatter most of the time.
    Some(if quartile > 0.0 { quartile } else { at(0.5)? / MEDIAN_SHARE })
}

#[cfg(test)]
mod tests {
    use measured_log::{Axis, Readings};
    use pomdp::{Purpose, Seed};
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    /// A log of one episode in which the object is at `place` (m) at times (s) in steps of `period_secs`, read with noise by `read`.
    fn log(period_secs: f64, place: impl Fn(f64) -> f64, read: impl Fn(usize) -> bool) -> Log {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let time_secs: Vec<f64> = (0..2000).map(|row| period_secs * f64::from(row)).collect();
        let mut episode = Episode { time_secs: time_secs.clone(), ..Episode::default() };
        for axis in Axis::ALL {
            let mut cell = |(row, time): (usize, &f64)| {
                let noise: f64 = StandardNormal.sample(&mut rng);
                read(row).then(|| place(*time) + 1e-3 * noise)
            };
            let readings: Readings = time_secs.iter().enumerate().map(&mut cell).collect();
            episode.channels.insert(Channel::ObjectPosition(axis), readings);
        }
        Log { header: crate::nominal::tests::uncertain_mass().header().clone(), episodes: vec![episode] }
    }

    fn found(log: &Log) -> SensorNoise {
        NoiseLevels::of_log(log).all().find(|noise| noise.channel == Kind::ObjectPosition).unwrap()
    }

    #[test]
    fn the_noise_is_found_whatever_moves_and_whichever_rows_are_read() {
        let fall = |time: f64| {
            // Thrown up again and again from the table: parabolas with a kink every half a second.
            let since = time % 0.5;
            2.4525 * since - 4.905 * since * since
        };
        for (period_secs, every) in [(0.002, 1), (0.01, 1), (1.0 / 30.0, 1), (0.01, 2), (0.01, 3)] {
            let noise = found(&log(period_secs, fall, |row| row % every == 0));
            assert_eq!(noise.source, Source::Estimated);
            // At 33 Hz a kink is in one difference of five.
            assert!((noise.stddev - 1e-3).abs() < 2.5e-4, "{period_secs} {every}: {noise:?}");
        }
    }

    #[test]
    fn a_column_that_does_not_scatter_says_so_and_a_given_noise_is_held_against_it() {
        let mut exact = log(0.01, |_| 0.25, |_| true);
        for readings in exact.episodes[0].channels.values_mut() {
            *readings = readings.iter().map(|_| Some(0.25)).collect();
        }
        assert_eq!(found(&exact).source, Source::Floor);
        assert!(found(&exact).sentence().contains("readings do not say"));
        let mut given = log(0.01, |_| 0.0, |_| true);
        given.header.noise.object_position_m = Some(1e-4);
        let noise = found(&given);
        assert_eq!((noise.stddev, noise.source), (1e-4, Source::Given));
        assert!(noise.sentence().contains("but readings scatter by"), "{}", noise.sentence());
    }
}
