//! A log of joints: `log.toml`, `samples.csv` and the robot that they name.

use std::path::Path;

use arm_dynamics::{Arm, Selection};

use crate::error::{Error, refuse};
use crate::header::Header;
use crate::samples::read_samples;

/// Readings of one kind: for each joint one value a row, NaN where it is missing; empty where the log has no such column.
pub type Readings = Vec<Vec<f64>>;

/// A log of joints.
#[derive(Debug)]
pub struct Log {
    /// `log.toml`.
    pub header: Header,
    /// The robot.
    pub arm: Arm,
    /// First row of each episode, and the number of rows.
    pub episodes: Vec<usize>,
    /// s from the first row.
    pub time_secs: Vec<f64>,
    /// Measured, rad.
    pub position: Readings,
    /// Measured, rad/s.
    pub velocity: Readings,
    /// Measured, N·m.
    pub torque: Readings,
    /// Commanded, rad.
    pub command: Readings,
    /// Columns that nobody here reads.
    pub unread: Vec<String>,
    /// What was done to the readings; a sentence each.
    pub notes: Vec<String>,
}

/// The middle one, of an even number the upper of the two; NaN without values.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

impl Log {
    /// Reads a folder.
    ///
    /// # Errors
    ///
    /// [`Error`] if a file cannot be read or is not as the format has it, or if the readings are too few to compare torques with.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        let header = Header::read(folder)?;
        let robot = folder.join(&header.robot);
        let arm = Arm::open(&robot, &Selection { joints: header.joints.clone(), tip: header.tip_link.clone() })?;
        header.check_lists(&folder.join("log.toml"), arm.joints().len())?;
        let samples = folder.join("samples.csv");
        let mut log = read_samples(&samples, header, arm)?;
        log.leave_out_dead_torques(&samples)?;
        log.check_readings(&samples)?;
        log.unwrap_angles();
        log.drop_outliers();
        log.check(&samples)?;
        log.shorten();
        log.settle_stamps();
        // What moved only in the stretches that are left out.
        log.leave_out_dead_torques(&samples)?;
        Ok(log)
    }

    /// A joint whose torque is never read, or never changes, says nothing, however exactly: its readings become missing ones. Others go on without it.
    fn leave_out_dead_torques(&mut self, path: &Path) -> Result<(), Error> {
        let mut left = self.torque.len();
        for (values, joint) in self.torque.iter_mut().zip(self.arm.joints()) {
            let mut there = values.iter().filter(|value| value.is_finite());
            let first = there.next();
            if there.any(|value| Some(value) != first) {
                continue;
            }
            let why = if first.is_some() { "never changes" } else { "is never read" };
            let about = format!("the torque of joint \"{}\" ", joint.name);
            if !self.notes.iter().any(|note| note.starts_with(&about)) {
                self.notes.push(format!("{about}{why}: it is left out"));
            }
            values.fill(f64::NAN);
            left -= 1;
        }
        if left > 0 || self.torque.is_empty() {
            return Ok(());
        }
        if self.header.servo.is_some() && !self.command.is_empty() {
            // The servo's law stands in.
            self.torque.clear();
            return Ok(());
        }
        Err(refuse(path, "no torque of any joint changes: expected readings of at least one, in N·m"))
    }

    /// Single readings that stand alone against those around them become missing ones (Hampel's rule): a sensor that fails for one row says nothing.
    fn drop_outliers(&mut self) {
        /// Rows on each side, and how many times the usual distance from the median of those around is too far.
        const BESIDE: usize = 3;
        const FAR: f64 = 30.0;
        let spans: Vec<_> = self.rows().collect();
        for readings in [&mut self.position, &mut self.velocity, &mut self.torque] {
            for values in readings {
                let mut middles = Vec::with_capacity(values.len());
                for span in &spans {
                    for row in span.clone() {
                        // As far on one side as on the other: a motion goes on, and the median of what comes after the first row is none of it.
                        let beside = BESIDE.min(row - span.start).min(span.end - 1 - row);
                        let (first, last) = (row - beside, row + beside + 1);
                        middles.push(match beside {
                            // What the next two lead to.
                            0 if row + 2 < span.end => 2.0 * values[row + 1] - values[row + 2],
                            0 if row >= span.start + 2 => 2.0 * values[row - 1] - values[row - 2],
                            _ => {
                                median(values[first..last].iter().copied().filter(|value| value.is_finite()).collect())
                            }
                        });
                    }
                }
                let distance = |(value, middle): (&f64, &f64)| (value - middle).abs();
                let far: Vec<f64> = values.iter().zip(&middles).map(distance).collect();
                let mean = far.iter().filter(|far| far.is_finite()).sum::<f64>() / far.len().max(1) as f64;
                let usual = median(far.iter().copied().filter(|far| far.is_finite() && *far > 0.0).collect());
                // A mean that a few spikes make is no measure; one that all rows make is.
                let most = FAR * usual.max(mean.min(3.0 * usual));
                for (value, far) in values.iter_mut().zip(far) {
                    if far > most {
                        *value = f64::NAN;
                    }
                }
            }
        }
    }

    /// Keeps stretches of a long log, spread over it: no motion needs hours to show what it shows.
    fn shorten(&mut self) {
        /// What is kept, and in stretches of what length, s.
        const KEPT_SECS: f64 = 240.0;
        const STRETCH_SECS: f64 = 12.0;
        let mut stretches: Vec<std::ops::Range<usize>> = Vec::new();
        for span in self.rows() {
            let times = &self.time_secs[span.clone()];
            let mut start = 0;
            for row in 0..times.len() {
                if times[row] - times[start] >= STRETCH_SECS {
                    stretches.push(span.start + start..span.start + row);
                    start = row;
                }
            }
            stretches.push(span.start + start..span.end);
        }
        let long: f64 = self
            .rows()
            .filter(|span| !span.is_empty())
            .map(|span| self.time_secs[span.end - 1] - self.time_secs[span.start])
            .sum();
        if long <= KEPT_SECS {
            return;
        }
        let count = ((KEPT_SECS / STRETCH_SECS) as usize).min(stretches.len());
        let kept: Vec<_> = (0..count).map(|i| stretches[i * stretches.len() / count].clone()).collect();
        self.notes.push(format!(
            "of {long:.0} s, {count} stretches of {STRETCH_SECS} s that are spread over the log are used"
        ));
        let take =
            |values: &mut Vec<f64>| *values = kept.iter().flat_map(|range| values[range.clone()].to_vec()).collect();
        take(&mut self.time_secs);
        for readings in [&mut self.position, &mut self.velocity, &mut self.torque, &mut self.command] {
            readings.iter_mut().for_each(take);
        }
        self.episodes = vec![0];
        for range in &kept {
            self.episodes.push(self.episodes[self.episodes.len() - 1] + range.len());
        }
    }

    /// What readings of a kind say against each other, or against the header.
    fn check_readings(&self, path: &Path) -> Result<(), Error> {
        let kinds = [
            ("measured positions", &self.position),
            ("velocities", &self.velocity),
            ("torques", &self.torque),
            ("commands", &self.command),
        ];
        for (what, readings) in kinds {
            for (joint, values) in readings.iter().enumerate() {
                let there = values.iter().filter(|value| value.is_finite()).count();
                let left_out = there == 0 && what == "torques";
                if there < values.len() / 2 && !left_out {
                    return Err(refuse(path, &format!("more than half of the {what} of joint {joint} are missing")));
                }
            }
        }
        let step = self.median_step();
        let stated = self.header.period_secs;
        if !(step > stated / 3.0 && step < stated * 3.0) {
            let problem = format!(
                "rows are {step:.6} apart in the median, period_secs of log.toml is {stated}: expected seconds in both"
            );
            return Err(refuse(path, &problem));
        }
        if step > 0.0501 {
            return Err(refuse(path, &format!("rows are {step:.4} s apart, expected at least 20 rows a second")));
        }
        for (joint, velocities) in self.velocity.iter().enumerate() {
            let (mut product, mut square, mut count) = (0.0, 0.0, 0);
            for span in self.rows() {
                // Over some rows, so that noise of positions does not rule.
                const OVER: usize = 5;
                for row in span.start..span.end.saturating_sub(2 * OVER) {
                    let rate = (self.position[joint][row + 2 * OVER] - self.position[joint][row])
                        / (self.time_secs[row + 2 * OVER] - self.time_secs[row]);
                    let read = velocities[row + OVER];
                    if rate.is_finite() && read.is_finite() && rate.abs() < 100.0 {
                        product += rate * read;
                        square += rate * rate;
                        count += 1;
                    }
                }
            }
            let slope = product / square;
            if square > 1e-3 * f64::from(count) && !(0.7..1.4).contains(&slope) {
                let problem = format!(
                    "velocities of joint {joint} are {slope:.3} times the change of its positions, expected 1: units or signs differ"
                );
                return Err(refuse(path, &problem));
            }
        }
        Ok(())
    }

    /// Number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.arm.joints().len()
    }

    /// Median time between rows of an episode, s; where no episode has two, the shortest between any.
    pub(crate) fn median_step(&self) -> f64 {
        let steps = |times: &[f64]| times.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
        let within: Vec<f64> = self.rows().flat_map(|rows| steps(&self.time_secs[rows])).collect();
        if within.is_empty() {
            steps(&self.time_secs).into_iter().fold(f64::INFINITY, f64::min)
        } else {
            median(within)
        }
    }

    /// Rows of each episode.
    pub fn rows(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.episodes.windows(2).map(|pair| pair[0]..pair[1])
    }

    /// Angles that jump by a turn go on.
    fn unwrap_angles(&mut self) {
        let turn = std::f64::consts::TAU;
        for readings in [&mut self.position, &mut self.command] {
            for (joint, values) in readings.iter_mut().enumerate() {
                if self.arm.joints()[joint].slides {
                    continue;
                }
                for pair in self.episodes.windows(2) {
                    let mut last = f64::NAN;
                    for value in &mut values[pair[0]..pair[1]] {
                        if (*value - last).abs() > 0.5 * turn {
                            *value -= turn * ((*value - last) / turn).round();
                        }
                        if value.is_finite() {
                            last = *value;
                        }
                    }
                }
            }
        }
    }

    fn check(&self, path: &Path) -> Result<(), Error> {
        if self.torque.is_empty() && (self.command.is_empty() || self.header.servo.is_none()) {
            let problem = "expected columns joint_torque_0_nm …, or command_joint_0_rad … and a table [servo] in log.toml: without torques or the law that makes them there is nothing to compare";
            return Err(refuse(path, problem));
        }
        let rows = self.time_secs.len();
        if rows < 200 {
            return Err(refuse(path, &format!("has {rows} rows, expected at least 200")));
        }
        for (joint, values) in self.position.iter().enumerate() {
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for value in values.iter().filter(|value| value.is_finite()) {
                least = least.min(*value);
                most = most.max(*value);
            }
            let limit = &self.arm.joints()[joint];
            let room = 2.0 * (limit.upper - limit.lower) + 1.0;
            if !limit.slides && limit.upper.is_finite() && (least < limit.lower - room || most > limit.upper + room) {
                let problem = format!(
                    "joint_{joint}_rad goes from {least:.3} to {most:.3}, {:?} can go from {} to {}: expected radians, in the order of the joints",
                    limit.name, limit.lower, limit.upper
                );
                return Err(refuse(path, &problem));
            }
        }
        Ok(())
    }
}
