//! The small misfits between the frames of tool and object: where the tracker's frame is, how large the object is, how late its clock is.
//!
//! While the object is pushed, the tool touches it: the distance of their surfaces is 0. An offset of the tracker's frame shows as a distance that depends on the
//! direction of the push, a turn as one that depends on the place, a wrong size as one that is the same everywhere, a late clock as one that grows with the speed. At
//! rest the object's lowest point is on the table. Rows that are no contact, such as coasting, count little: the loss is Cauchy's.
//!
//! The estimate is the maximum a posteriori under wide normal priors about "nothing is off", by Gauss–Newton steps on the reweighted residuals. Its standard deviations
//! are those of a jackknife over groups of episodes, as rows of an episode err alike, and no smaller than what rows that err alone would leave; what a log does not show
//! stays 0, with its prior's. Those of size and clock, and of an offset along the pushes where they go one way, hold the
//! distance that is left as well.

use measured_log::{Log, Shape};
use nalgebra::{SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use physics_model::robot::Robot;
use serde::Serialize;

use crate::arm::tool_m;
use crate::check::tool;
use crate::geometry::{Tool, between_m, median};
use crate::motion::{Motion, Motions, Seen};
use crate::reading::Reading;
use crate::shape::Solid;

/// Of x, y, z (m), turn about the vertical (rad), ln of the size factor, lateness (s).
const COUNT: usize = 6;
/// Prior standard deviations: a tape measure and a hand that glues markers.
const PRIOR: [f64; COUNT] = [0.03, 0.03, 0.03, 0.15, 0.15, 0.03];
/// Steps of the finite differences.
const STEP: [f64; COUNT] = [1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4];
/// Groups of episodes of the jackknife.
const GROUPS: usize = 10;
/// Rows of an episode, at most: the nearest differ by too little.
const ROWS: usize = 60;
/// A tool that is slower stands, m/s.
const STANDS_MPS: f64 = 0.01;
/// Half of what speeds are taken over, s.
const SPAN_SECS: f64 = 0.03;
/// Speeds of a pushed object, in those of the tool.
const PUSHED: [f64; 2] = [0.3, 1.7];
/// Residuals are no smaller than this, m.
const FLOOR_M: f64 = 0.000_5;
/// Scales of the loss, from one that sees contact centimetres away to that of the readings.
const COARSER: [f64; 5] = [32.0, 8.0, 4.0, 2.0, 1.0];
/// Misfits beyond so many standard deviations of the prior are another mistake.
const BELIEVED: f64 = 3.0;
/// Iterations at most, and the step, in standard deviations of the prior, that ends them.
const ITERATIONS: usize = 60;
const ENDS: f64 = 1e-5;
/// Episodes with contact that are needed.
const LEAST: usize = 5;

/// A value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Maximum a posteriori.
    pub value: f64,
    /// Standard deviation.
    pub stddev: f64,
}

impl Estimate {
    /// Whether it is more than chance.
    #[must_use]
    pub fn shows(&self) -> bool {
        self.value.abs() > 3.0 * self.stddev
    }
}

/// What brings a log's object to its tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// Is to be added to the object's positions after the turn, m, base axes.
    pub translation_m: [Estimate; 3],
    /// The object's poses are to be turned by this about the vertical through the origin, rad.
    pub yaw_rad: Estimate,
    /// The object's lengths are to be multiplied by this.
    pub size_factor: Estimate,
    /// The object's readings are stamped so late, s.
    pub late_secs: Estimate,
    /// Episodes with contact.
    pub episodes: usize,
    /// Median distance between the surfaces of tool and object where they touch, as the log has it and as corrected, m.
    pub distance_m: [f64; 2],
    /// What to do: what does not show is left as it is, and the rest fitted without it.
    pub correction: Correction,
}

/// What brings object and tool together; `None`: nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Correction {
    /// The object's poses are turned about the vertical through the origin, rad, then moved, m.
    pub frame: Option<([f64; 3], f64)>,
    /// The object's lengths times this.
    pub size_factor: Option<f64>,
    /// The object's readings are late by this, s.
    pub late_secs: Option<f64>,
}

impl Correction {
    /// What a log has to be read as, without its clock.
    #[must_use]
    pub fn readings(&self) -> Vec<Reading> {
        let moved = self.frame.map(|(translation_m, yaw_rad)| Reading::Moved { translation_m, yaw_rad });
        moved.into_iter().chain(self.size_factor.map(Reading::LengthsScaled)).collect()
    }
}

/// Fits how tool and object of a log lie to each other.
///
/// # Errors
///
/// A sentence where too few episodes have contact, or the object has no pose.
pub fn align(log: &Log, arm: Option<&Robot>) -> Result<Alignment, String> {
    let shape = &log.header.object.shape;
    let width_m = 2.0 * Solid::new(shape).half_m().into_iter().fold(f64::INFINITY, f64::min);
    let motions = Motions::new(log, width_m, |episode, row| tool_m(log, arm, episode, row));
    let rows: Vec<Rows> = motions.episodes.iter().map(Rows::new).filter(|rows| !rows.touching.is_empty()).collect();
    if rows.len() < LEAST {
        return Err(format!(
            "expected at least {LEAST} episodes in which the tool pushes the object, found {}: nothing says how they lie to each other",
            rows.len()
        ));
    }
    let rests: Vec<Seen> = motions
        .episodes
        .iter()
        .filter_map(|motion| Some(motion.seen[*motion.rests.get(motion.rests.len() / 2)?]))
        .collect();
    // Turns are about the middle of what was seen, where they do not look like offsets.
    let all: Vec<Vector3<f64>> =
        rows.iter().flat_map(|rows| &rows.touching).map(|row| row.seen.pose.translation.vector).collect();
    let centre = all.iter().sum::<Vector3<f64>>() / all.len() as f64;
    let tool = tool(log, arm);
    let task = Task { shape, tool: &tool, centre, table_m: log.header.table.height_m.mean(), turns: motions.turns };
    let scale_m = FLOOR_M.max(2.0 * motions.position_m);

    let every: Vec<&Rows> = rows.iter().collect();
    let (found, spread) = task.solve(&every, &rests, scale_m, [true; COUNT]);
    if !is_believed(&found) {
        return Err("tool and object do not meet within the misfits of a measured rig: `log check` looks for wrong units, axes and sizes".into());
    }
    let groups = GROUPS.min(rows.len());
    let without = |group: usize| {
        let kept: Vec<&Rows> =
            rows.iter().enumerate().filter(|(i, _)| i % groups != group).map(|(_, rows)| rows).collect();
        task.solve(&kept, &rests, scale_m, [true; COUNT]).0
    };
    let left: Vec<SVector<f64, COUNT>> = (0..groups).map(without).collect();
    let distances = |x: &SVector<f64, COUNT>| {
        let touching = rows.iter().flat_map(|rows| &rows.touching);
        median(touching.map(|row| task.distance_m(x, row).abs()).collect()).unwrap_or(0.0)
    };
    // What is left where they should touch may be the same everywhere: an object that goes ahead, a hand whose shape is not quite that of its file. A size, and a
    // clock, would explain it as well.
    let left_m = distances(&found);
    let ways: Vec<Vector3<f64>> = rows.iter().flat_map(|rows| &rows.touching).map(|row| row.tool_mps).collect();
    let mps = median(ways.iter().map(Vector3::norm).collect()).unwrap_or(STANDS_MPS);
    // So would an offset, as far as pushes go one way.
    let way = ways.iter().map(Vector3::normalize).sum::<Vector3<f64>>() / ways.len() as f64;
    let systematic = [left_m * way.x, left_m * way.y, 0.0, 0.0, 2.0 * left_m / width_m, left_m / mps];
    let estimates = |at: &dyn Fn(&SVector<f64, COUNT>) -> SVector<f64, COUNT>| -> [Estimate; COUNT] {
        let (value, left): (_, Vec<_>) = (at(&found), left.iter().map(at).collect());
        std::array::from_fn(|i| {
            let mean = left.iter().map(|x| x[i]).sum::<f64>() / groups as f64;
            let squares = left.iter().map(|x| (x[i] - mean).powi(2)).sum::<f64>();
            let jackknife = (groups - 1) as f64 / groups as f64 * squares;
            Estimate { value: value[i], stddev: jackknife.max(spread[(i, i)]).sqrt().hypot(systematic[i]) }
        })
    };
    // About the middle an offset does not hide behind a turn.
    let shows = estimates(&|x| *x).map(|estimate| estimate.shows());
    let frame = shows[..4].iter().any(|shows| *shows);
    let free = [frame, frame, frame, frame, shows[4], shows[5]];
    let (kept, _) = task.solve(&every, &rests, scale_m, free);
    let corrected = task.at_origin(&kept);
    let correction = Correction {
        frame: frame.then(|| ([0, 1, 2].map(|i| corrected[i]), corrected[3])),
        size_factor: free[4].then(|| corrected[4].exp()),
        late_secs: free[5].then_some(corrected[5]),
    };
    let [x, y, z, yaw, size, late] = estimates(&|x| task.at_origin(x));
    let factor = size.value.exp();
    Ok(Alignment {
        translation_m: [x, y, z],
        yaw_rad: yaw,
        size_factor: Estimate { value: factor, stddev: factor * size.stddev },
        late_secs: late,
        episodes: rows.len(),
        distance_m: [distances(&SVector::zeros()), distances(&kept)],
        correction,
    })
}

/// Whether coordinates are those of a measured rig.
fn is_believed(x: &SVector<f64, COUNT>) -> bool {
    (0..COUNT).all(|i| x[i].abs() <= BELIEVED * PRIOR[i])
}

/// A row in which the object is pushed.
struct Row {
    seen: Seen,
    tool_m: Vector3<f64>,
    tool_mps: Vector3<f64>,
}

/// Rows of an episode in which the object is pushed.
struct Rows {
    touching: Vec<Row>,
}

impl Rows {
    fn new(motion: &Motion) -> Self {
        let seen = &motion.seen;
        let mut touching = Vec::new();
        let (mut first, mut last) = (0, 0);
        for (now, here) in seen.iter().enumerate() {
            // The nearest rows that are far enough for noise to be small beside the motion.
            while first + 1 < now && seen[first + 1].secs <= here.secs - SPAN_SECS {
                first += 1;
            }
            while last + 1 < seen.len() && (last <= now || seen[last].secs < here.secs + SPAN_SECS) {
                last += 1;
            }
            let [before, after] = [&seen[first], &seen[last]];
            let (Some(a), Some(b), Some(c)) = (before.tool, here.tool, after.tool) else { continue };
            if !(before.secs < here.secs && here.secs < after.secs) {
                continue;
            }
            let secs = after.secs - before.secs;
            let tool_mps = (c - a) / secs;
            let object_mps = (after.pose.translation.vector - before.pose.translation.vector) / secs;
            let along = tool_mps.norm() > STANDS_MPS && tool_mps.dot(&object_mps) > 0.0;
            if along && (PUSHED[0]..PUSHED[1]).contains(&(object_mps.norm() / tool_mps.norm())) {
                touching.push(Row { seen: *here, tool_m: b, tool_mps });
            }
        }
        let step = touching.len().div_ceil(ROWS).max(1);
        Self { touching: touching.into_iter().step_by(step).collect() }
    }
}

/// What an object that is read ahead of the tool is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ahead {
    /// As far from contact as one that lies in it.
    Doubtful,
    /// It slides or rolls on: nothing lies in a tool, but much goes ahead of it. Welsch's loss, which forgets what is far, for these.
    NoContact,
}

/// Where a descent ends.
struct Found {
    x: SVector<f64, COUNT>,
    /// If rows err alone.
    covariance: SMatrix<f64, COUNT, COUNT>,
    loss: f64,
}

/// What does not depend on the coordinates.
struct Task<'a> {
    shape: &'a Shape,
    tool: &'a Tool,
    centre: Vector3<f64>,
    table_m: f64,
    turns: bool,
}

impl Task<'_> {
    /// Object and its pose at coordinates.
    fn posed(&self, x: &SVector<f64, COUNT>, seen: &Seen) -> (Solid, nalgebra::Isometry3<f64>) {
        let mut shape = self.shape.clone();
        Reading::LengthsScaled(x[4].exp()).shape(&mut shape);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * x[3]);
        let place = self.centre + turn * (seen.pose.translation.vector - self.centre) + Vector3::new(x[0], x[1], x[2]);
        (Solid::new(&shape), nalgebra::Isometry3::from_parts(Translation3::from(place), turn * seen.pose.rotation))
    }

    /// Signed distance of the surfaces, m; the tool is where it was when the object was where it was read.
    fn distance_m(&self, x: &SVector<f64, COUNT>, row: &Row) -> f64 {
        let (solid, pose) = self.posed(x, &row.seen);
        between_m(&solid, &pose, self.tool, row.tool_m - row.tool_mps * x[5])
    }

    /// Height of the lowest point above the table, m.
    fn height_m(&self, x: &SVector<f64, COUNT>, seen: &Seen) -> f64 {
        let (solid, pose) = self.posed(x, seen);
        let vertical = pose.rotation.inverse() * Vector3::z();
        // As it rests: a tilt that is the noise of its turns would make its lowest point lower on average.
        let below_m = if self.turns { solid.below_m(&solid.resting(&vertical)) } else { solid.half_m()[2] };
        pose.translation.vector.z - below_m - self.table_m
    }

    /// The same coordinates with the turn about the origin.
    fn at_origin(&self, x: &SVector<f64, COUNT>) -> SVector<f64, COUNT> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * x[3]);
        let shift = self.centre - turn * self.centre + Vector3::new(x[0], x[1], x[2]);
        let mut moved = *x;
        (0..3).for_each(|i| moved[i] = shift[i]);
        moved
    }

    /// Coordinates that explain rows best, those that are not free being 0, and their covariance if rows err alone.
    fn solve(
        &self,
        rows: &[&Rows],
        rests: &[Seen],
        scale_m: f64,
        free: [bool; COUNT],
    ) -> (SVector<f64, COUNT>, SMatrix<f64, COUNT, COUNT>) {
        let here = SVector::<f64, COUNT>::zeros();
        // Step by step from a coarse scale, and at once: the former leaps over minima, the latter stays where much is no contact.
        let near = self.descend(here, rows, rests, scale_m, Ahead::Doubtful, free);
        let mut far = self.descend(here, rows, rests, COARSER[0] * scale_m, Ahead::Doubtful, free);
        for coarser in &COARSER[1..] {
            far = self.descend(far.x, rows, rests, coarser * scale_m, Ahead::Doubtful, free);
        }
        // A misfit of decimetres can bring any rows together.
        let first = (is_believed(&near.x), -near.loss) > (is_believed(&far.x), -far.loss);
        let best = if first { near } else { far };
        let last = self.descend(best.x, rows, rests, scale_m, Ahead::NoContact, free);
        (last.x, last.covariance)
    }

    /// The same from coordinates on, at a scale of the loss.
    fn descend(
        &self,
        mut x: SVector<f64, COUNT>,
        rows: &[&Rows],
        rests: &[Seen],
        scale_m: f64,
        ahead: Ahead,
        free: [bool; COUNT],
    ) -> Found {
        let residuals = |x: &SVector<f64, COUNT>| -> Vec<f64> {
            let touching = rows.iter().flat_map(|rows| &rows.touching);
            let distances = touching.map(|row| self.distance_m(x, row) / scale_m);
            distances.chain(rests.iter().map(|seen| self.height_m(x, seen) / scale_m)).collect()
        };
        let touching: usize = rows.iter().map(|rows| rows.touching.len()).sum();
        let welsch = |index: usize, residual: f64| ahead == Ahead::NoContact && index < touching && residual > 0.0;
        let weight = |index: usize, residual: f64| {
            let square = residual * residual;
            if welsch(index, residual) { (-0.5 * square).exp() } else { 1.0 / (1.0 + square) }
        };
        let one = |(index, residual): (usize, &f64)| {
            let square = residual * residual;
            if welsch(index, *residual) { 2.0 - 2.0 * (-0.5 * square).exp() } else { square.ln_1p() }
        };
        let loss = |x: &SVector<f64, COUNT>, residuals: &[f64]| {
            residuals.iter().enumerate().map(one).sum::<f64>()
                + (0..COUNT).map(|i| (x[i] / PRIOR[i]).powi(2)).sum::<f64>()
        };
        let mut now = residuals(&x);
        let mut damping = 1e-3;
        let mut precision = SMatrix::<f64, COUNT, COUNT>::identity();
        for _ in 0..ITERATIONS {
            let slopes: [Vec<f64>; COUNT] = std::array::from_fn(|i| {
                // One that is not free changes nothing, and its prior keeps it at 0.
                if !free[i] {
                    return vec![0.0; now.len()];
                }
                let [up, down] = [STEP[i], -STEP[i]].map(|step| {
                    let mut other = x;
                    other[i] += step;
                    residuals(&other)
                });
                up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * STEP[i])).collect()
            });
            precision = SMatrix::from_fn(|i, j| {
                let prior = if i == j { PRIOR[i].powi(-2) } else { 0.0 };
                prior + now.iter().enumerate().map(|(k, r)| weight(k, *r) * slopes[i][k] * slopes[j][k]).sum::<f64>()
            });
            let gradient = SVector::<f64, COUNT>::from_fn(|i, _| {
                x[i] / PRIOR[i].powi(2)
                    + now.iter().enumerate().map(|(k, r)| weight(k, *r) * r * slopes[i][k]).sum::<f64>()
            });
            let mut step = SVector::zeros();
            // Until a step is downhill: Levenberg's damping.
            for _ in 0..20 {
                let damped = precision + SMatrix::from_diagonal(&precision.diagonal()) * damping;
                step = damped.cholesky().map_or_else(SVector::zeros, |factor| -factor.solve(&gradient));
                let next = residuals(&(x + step));
                if loss(&(x + step), &next) <= loss(&x, &now) {
                    x += step;
                    now = next;
                    damping *= 0.3;
                    break;
                }
                step = SVector::zeros();
                damping *= 4.0;
            }
            if (0..COUNT).all(|i| step[i].abs() < ENDS * PRIOR[i]) {
                break;
            }
        }
        let alone = || SMatrix::from_diagonal(&SVector::from(PRIOR.map(|stddev| stddev * stddev)));
        Found { x, covariance: precision.try_inverse().unwrap_or_else(alone), loss: loss(&x, &now) }
    }
}

#[cfg(test)]
mod tests {
    use measured_log::{Axis, Channel, Readings};

    use super::*;

    fn recorded(set: &str) -> Log {
        let logs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
        measured_log::read(&logs.join(set)).unwrap()
    }

    /// Six values with their standard deviations, in the order of the coordinates.
    fn values(found: &Alignment) -> [Estimate; COUNT] {
        let [x, y, z] = found.translation_m;
        [x, y, z, found.yaw_rad, found.size_factor, found.late_secs]
    }

    #[test]
    fn a_log_that_fits_is_left_as_it_is() {
        let found = align(&recorded("set-003"), None).unwrap();
        assert_eq!(found.correction, Correction::default(), "{found:?}");
        for (value, nothing) in values(&found).iter().zip([0.0, 0.0, 0.0, 0.0, 1.0, 0.0]) {
            assert!((value.value - nothing).abs() < 3.0 * value.stddev, "{found:?}");
        }
    }

    #[test]
    fn what_was_moved_turned_scaled_and_delayed_is_found() {
        const LATE_ROWS: usize = 2;
        let mut log = recorded("set-003");
        let plain = align(&log, None).unwrap();
        // Undone by a turn of 4° and a shift, lengths times 1.05.
        let (yaw_rad, shift_m) = (4.0_f64.to_radians(), [0.012, -0.02, 0.003]);
        let back = UnitQuaternion::from_scaled_axis(Vector3::z() * -yaw_rad);
        let undo = Reading::Moved { translation_m: (back * -Vector3::from(shift_m)).into(), yaw_rad: -yaw_rad };
        log = Reading::LengthsScaled(1.05_f64.recip()).apply(&undo.apply(&log));
        for episode in &mut log.episodes {
            for (channel, cells) in &mut episode.channels {
                if matches!(channel, Channel::ObjectPosition(_) | Channel::ObjectOrientation(_)) {
                    *cells = (0..cells.len()).map(|row| cells.get(row.saturating_sub(LATE_ROWS))).collect::<Readings>();
                }
            }
        }
        let found = align(&log, None).unwrap();
        let late_secs = LATE_ROWS as f64 * log.header.period_secs;
        let made = [shift_m[0], shift_m[1], shift_m[2], yaw_rad, 1.05, late_secs];
        let floors: [f64; COUNT] = [3e-4, 3e-4, 5e-4, 3e-3, 5e-3, 2e-3];
        for (((value, made), floor), plain) in values(&found).iter().zip(made).zip(floors).zip(values(&plain)) {
            assert!((value.value - made).abs() < floor.max(3.0 * value.stddev), "{made}: {found:?}");
            assert!(value.stddev < 3.0 * plain.stddev.max(floor), "{made}: {found:?}");
        }
        assert!(found.distance_m[0] > 5.0 * found.distance_m[1], "{found:?}");
        // Read as fitted it fits.
        let mended = found.correction.readings().iter().fold(log, |log, reading| reading.apply(&log));
        let [x, y, ..] = values(&align(&mended, None).unwrap());
        assert!(x.value.abs() < 1e-3 && y.value.abs() < 1e-3, "{x:?} {y:?}");
    }

    #[test]
    fn a_log_whose_tool_touches_nothing_is_refused() {
        let mut log = recorded("set-003");
        for episode in &mut log.episodes {
            for axis in Axis::ALL {
                let still = episode.channels[&Channel::ObjectPosition(axis)].get(0);
                let rows = episode.rows();
                episode.channels.insert(Channel::ObjectPosition(axis), (0..rows).map(|_| still).collect());
            }
        }
        let reason = align(&log, None).unwrap_err();
        assert!(reason.contains("at least 5 episodes in which the tool pushes the object, found 0"), "{reason}");
    }
}
