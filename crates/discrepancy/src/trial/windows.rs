//! What force on the object a simulation lacks, in short windows of an episode.
//!
//! While a tool pushes it feels the other forces on the object: F(tool) = F(friction) + δF − m a, where a slow push has no a to speak of. So δF is the measured
//! less the simulated force at the wrist, less what friction does otherwise: −μ m g (u − u′), where the object goes along u and the simulated one along u′. Out of touch
//! the measured less the simulated place is a parabola with the acceleration a − a′, and δF = m (a − a′) + μ m g (u − u′).

use nalgebra::{DMatrix, DVector};
use physics_model::rig::RigReading;

use super::{Course, Kind, Phase, Trial};

/// Duration of a window in which the tool pushes, s: shorter than what may shake.
const PUSHED_SECS: f64 = 0.05;
/// The same out of touch, where an acceleration has to show: 0.5 mm of noise at 100 Hz are 0.3 m/s².
const FREE_SECS: f64 = 0.12;
/// Velocities are slopes of measured places over the first of these times, s, in which the object is seen to move: pushes may be slow.
const SLOPES_SECS: [f64; 3] = [0.2, 0.4, 0.8];
/// Slower than this, m/s, an object has no direction, and its friction is whatever it has to be.
const LEAST_SPEED_MPS: f64 = 0.001;
/// The same in standard deviations of a velocity.
const LEAST_SPEED_SIGMAS: f64 = 3.0;
/// A tool that feels less than this, N, or so many standard deviations of a window's mean, touches nothing, whatever the simulation says.
const TOUCH_N: f64 = 0.1;
const TOUCH_SIGMAS: f64 = 4.0;
/// Rows of a window out of touch, at least.
const LEAST_ROWS: usize = 5;

/// A window. Base axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Window {
    /// Its middle, as the log has it, s.
    pub(crate) time_secs: f64,
    /// The object as measured, m.
    pub(crate) place_m: [f64; 3],
    /// Its velocity, m/s.
    pub(crate) velocity_mps: [f64; 3],
    /// The object's mass and known weight, kg.
    pub(crate) mass_kg: f64,
    /// Force on the object beyond what the simulation knows of, N.
    pub(crate) lacking_n: [f64; 3],
    /// Variance of its components that the sensor alone makes, N².
    pub(crate) variance_n2: f64,
    /// Force on the tool as simulated, N.
    pub(crate) simulated_n: [f64; 3],
}

/// What a row says.
#[derive(Clone, Copy)]
struct Row {
    time_secs: f64,
    phase: Phase,
    /// Measured place, and measured less simulated, m.
    place: Option<([f64; 3], [f64; 3])>,
    /// Simulated place, m, and velocity, m/s.
    simulated_m: [f64; 3],
    simulated_mps: [f64; 3],
    /// Measured less simulated, and simulated, N.
    force: Option<([f64; 3], [f64; 3])>,
}

impl Trial {
    /// The windows of an episode in which the object moves, touched as long as they last or not at all; of the first moments of a contact none. `friction_n`: μ m g of
    /// what slides on a table, 0 of what rolls or flies.
    pub(crate) fn windows(
        &self,
        start: &RigReading,
        readings: &[RigReading],
        phases: &[Phase],
        mass_kg: f64,
        friction_n: f64,
    ) -> Vec<Window> {
        let rows = self.table(start, readings, phases);
        let sigma = |kind| self.scalars.iter().find(|scalar| scalar.kind == kind).map(|scalar| scalar.sigma);
        let Some(place_sigma) = sigma(Kind::ObjectPosition) else { return Vec::new() };
        let force_sigma = sigma(Kind::WristForce).unwrap_or(0.0);
        let mut found = Vec::new();
        let mut first = 0;
        while first < rows.len() {
            let pushed = self.pushed(rows[first].phase);
            let longest_secs = if pushed == Some(true) { PUSHED_SECS } else { FREE_SECS };
            let same = |row: &Row| {
                self.pushed(row.phase) == pushed && row.time_secs - rows[first].time_secs < longest_secs - 1e-9
            };
            let end = first + rows[first..].iter().take_while(|row| same(row)).count().max(1);
            let inside = &rows[first..end];
            let time_secs = 0.5 * (rows[first].time_secs + rows[end - 1].time_secs);
            let lacking = match pushed {
                Some(true) => pushed_force(inside, force_sigma),
                Some(false) => free_force(inside, mass_kg, place_sigma),
                None => None,
            };
            // Out of touch what slides stops soon: how it moves its own window has to say.
            let near = if pushed == Some(true) { &rows[..] } else { inside };
            let motion = velocity(near, time_secs, place_sigma).or_else(|| simulated_motion(&rows, inside, time_secs));
            let slides = pushed == Some(false) && friction_n > 0.0;
            let stops = slides && inside.iter().any(|row| norm(row.simulated_mps) < LEAST_SPEED_MPS);
            let turned = |velocity: [f64; 3]| otherwise(inside, velocity, friction_n).filter(|_| !stops);
            if let Some((mut lacking_n, variance_n2, simulated_n)) = lacking
                && touched(inside, force_sigma).is_none_or(|touched| Some(touched) == pushed)
                && let Some((place_m, velocity_mps)) = motion
                && let Some(turned_n) = turned(velocity_mps)
            {
                (0..3).for_each(|i| lacking_n[i] += turned_n[i]);
                found.push(Window { time_secs, place_m, velocity_mps, mass_kg, lacking_n, variance_n2, simulated_n });
            }
            first = end;
        }
        found
    }

    /// Whether a tool pushes in a phase; `None` where that is about to change, or nothing has moved yet.
    fn pushed(&self, phase: Phase) -> Option<bool> {
        match (phase, self.tool_m.is_some()) {
            (Phase::ContactOnset, _) | (Phase::FreeMotion, true) => None,
            (Phase::Sliding | Phase::Rolling, true) => Some(true),
            (Phase::AfterContact, true) | (Phase::FreeMotion, false) => Some(false),
            // What meets a table bounces, tips and slides at once.
            (_, false) => None,
        }
    }

    fn table(&self, start: &RigReading, readings: &[RigReading], phases: &[Phase]) -> Vec<Row> {
        let course = Course { start, readings };
        // On a table what acts along z is held by it.
        let components = if self.tool_m.is_some() { 2 } else { 3 };
        let read = |kind: Kind, row: usize| -> Option<([f64; 3], [f64; 3])> {
            let (mut measured, mut simulated) = ([0.0; 3], [0.0; 3]);
            for component in 0..components {
                let scalar = self.scalars.iter().find(|s| (s.kind, s.component) == (kind, component))?;
                measured[component] = scalar.values[row]?;
                simulated[component] = course.value(scalar.channel, self.rows[row]);
            }
            Some((measured, simulated))
        };
        let less = |(a, b): ([f64; 3], [f64; 3])| -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) };
        (0..self.rows.len())
            .map(|row| Row {
                time_secs: self.time_secs[row],
                phase: phases[row],
                place: read(Kind::ObjectPosition, row).map(|both| (both.0, less(both))),
                simulated_m: course.at(self.rows[row].0).object.position_m,
                simulated_mps: course.at(self.rows[row].0).object.linear_mps,
                force: read(Kind::WristForce, row).map(|both| (less(both), both.1)),
            })
            .collect()
    }
}

type Force = ([f64; 3], f64, [f64; 3]);

/// Mean of the surprise at the wrist.
fn pushed_force(rows: &[Row], sigma: f64) -> Option<Force> {
    let read: Vec<[[f64; 3]; 2]> =
        rows.iter().filter_map(|row| row.force.map(|(less, simulated)| [less, simulated])).collect();
    if read.is_empty() {
        return None;
    }
    let n = read.len() as f64;
    let mean =
        |which: usize| -> [f64; 3] { std::array::from_fn(|i| read.iter().map(|both| both[which][i]).sum::<f64>() / n) };
    Some((mean(0), sigma * sigma / n, mean(1)))
}

/// Mass times the acceleration by which the measured place leaves the simulated one.
fn free_force(rows: &[Row], mass_kg: f64, sigma: f64) -> Option<Force> {
    let read: Vec<(f64, [f64; 3])> = rows.iter().filter_map(|row| Some((row.time_secs, row.place?.1))).collect();
    let (curve, variance) = polynomial(&read, 2).filter(|_| read.len() >= LEAST_ROWS)?;
    Some((curve[2].map(|half| 2.0 * half * mass_kg), (2.0 * mass_kg * sigma).powi(2) * variance[2], [0.0; 3]))
}

/// What the simulation's friction does otherwise where its object goes another way: μ m g (u − u′). `None` where it does not move: there friction is whatever it has to
/// be.
fn otherwise(rows: &[Row], velocity_mps: [f64; 3], friction_n: f64) -> Option<[f64; 3]> {
    if friction_n == 0.0 {
        return Some([0.0; 3]);
    }
    let mean = mean(rows, |row| row.simulated_mps);
    let [speed, simulated] = [velocity_mps, mean].map(|[x, y, _]| x.hypot(y));
    let way = |i: usize| velocity_mps[i] / speed - mean[i] / simulated;
    (simulated > LEAST_SPEED_MPS).then(|| [friction_n * way(0), friction_n * way(1), 0.0])
}

/// Place and velocity at a time, of an object that moves.
fn velocity(rows: &[Row], time_secs: f64, sigma: f64) -> Option<([f64; 3], [f64; 3])> {
    SLOPES_SECS.into_iter().find_map(|slope_secs| {
        let from = rows.partition_point(|row| row.time_secs < time_secs - 0.5 * slope_secs);
        let near = rows[from..].iter().take_while(|row| row.time_secs <= time_secs + 0.5 * slope_secs);
        let read: Vec<(f64, [f64; 3])> =
            near.filter_map(|row| Some((row.time_secs - time_secs, row.place?.0))).collect();
        let (curve, variance) = polynomial(&read, 1)?;
        let speed = norm(curve[1]);
        let least = LEAST_SPEED_MPS.max(LEAST_SPEED_SIGMAS * sigma * variance[1].sqrt());
        (speed > least).then_some((curve[0], curve[1]))
    })
}

/// The same as simulated, where hardly any place was measured nearby: of some pushes only the first and the last are.
fn simulated_motion(rows: &[Row], inside: &[Row], time_secs: f64) -> Option<([f64; 3], [f64; 3])> {
    let near = |row: &&Row| row.place.is_some() && (row.time_secs - time_secs).abs() <= 0.5 * SLOPES_SECS[2];
    let velocity_mps = mean(inside, |row| row.simulated_mps);
    (norm(velocity_mps) > LEAST_SPEED_MPS && rows.iter().filter(near).count() < 3)
        .then(|| (mean(inside, |row| row.simulated_m), velocity_mps))
}

/// Whether the sensor says that something touches the tool; `None` without one.
fn touched(rows: &[Row], sigma: f64) -> Option<bool> {
    let read = rows.iter().filter_map(|row| row.force);
    let (count, sum) = read.fold((0.0, [0.0; 3]), |(count, sum): (f64, [f64; 3]), (less, simulated)| {
        (count + 1.0, std::array::from_fn(|i| sum[i] + less[i] + simulated[i]))
    });
    (count > 0.0).then(|| norm(sum) / count > least_force(sigma, count))
}

/// What the mean of so many readings has to be beyond to be a touch, N.
pub(super) fn least_force(sigma: f64, count: f64) -> f64 {
    TOUCH_N.max(TOUCH_SIGMAS * sigma / count.sqrt())
}

fn mean(rows: &[Row], pick: fn(&Row) -> [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| rows.iter().map(|row| pick(row)[i]).sum::<f64>() / rows.len() as f64)
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Least squares through vectors at times, in powers of the time: coefficients, and their variances where readings have variance 1.
fn polynomial(read: &[(f64, [f64; 3])], degree: usize) -> Option<(Vec<[f64; 3]>, Vec<f64>)> {
    if read.len() <= degree + 1 {
        return None;
    }
    let middle = read[read.len() / 2].0;
    // About the middle where the highest power is asked for, which does not depend on it; about 0 where the value is.
    let about = if degree > 1 { middle } else { 0.0 };
    let design = DMatrix::from_fn(read.len(), degree + 1, |i, j| (read[i].0 - about).powi(j as i32));
    let inverse = (design.transpose() * &design).try_inverse()?;
    let columns: [DVector<f64>; 3] = std::array::from_fn(|axis| {
        &inverse * design.transpose() * DVector::from_fn(read.len(), |i, _| read[i].1[axis])
    });
    let coefficients = (0..=degree).map(|j| std::array::from_fn(|axis| columns[axis][j])).collect();
    Some((coefficients, (0..=degree).map(|j| inverse[(j, j)]).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_read_off_its_points() {
        let read: Vec<(f64, [f64; 3])> =
            (0..8).map(|i| f64::from(i) * 0.02).map(|t| (t, [0.1 + 0.3 * t - 2.0 * t * t, 0.0, t])).collect();
        let (curve, _) = polynomial(&read, 2).unwrap();
        assert!((2.0 * curve[2][0] + 4.0).abs() < 1e-9 && curve[2][1].abs() < 1e-12 && curve[2][2].abs() < 1e-9);
        assert!(polynomial(&read[..2], 1).is_none());
    }

    #[test]
    fn what_leaves_its_path_by_an_acceleration_is_pulled() {
        let rows: Vec<Row> = (0..12)
            .map(|i| f64::from(i) * 0.01)
            .map(|t| Row {
                time_secs: t,
                phase: Phase::AfterContact,
                place: Some(([t, 0.0, 0.0], [0.0, 0.5 * 1.5 * t * t, 0.0])),
                simulated_m: [t, 0.0, 0.0],
                simulated_mps: [1.0, 0.0, 0.0],
                force: None,
            })
            .collect();
        let (force, variance, _) = free_force(&rows, 0.4, 0.000_5).unwrap();
        assert!((force[1] - 0.6).abs() < 1e-9 && force[0].abs() < 1e-9, "{force:?}");
        // What no sensor saw on its way goes where it is simulated to go; what is seen does not.
        assert!(simulated_motion(&rows, &rows, 0.05).is_none());
        let unseen: Vec<Row> = rows.iter().map(|row| Row { place: None, ..*row }).collect();
        let (place, velocity) = simulated_motion(&unseen, &unseen, 0.05).unwrap();
        assert!((place[0] - 0.055).abs() < 1e-12 && velocity == [1.0, 0.0, 0.0], "{place:?}");
        // A tool that reads 2 N where 3 were simulated touches something, one that reads nothing lost it.
        let feels = |less: f64| {
            let force = Some(([less, 0.0, 0.0], [3.0, 0.0, 0.0]));
            touched(&rows.iter().map(|row| Row { force, ..*row }).collect::<Vec<_>>(), 0.05)
        };
        assert_eq!((feels(-1.0), feels(-3.0), touched(&rows, 0.05)), (Some(true), Some(false), None));
        // Where it goes along y what its friction does along x is missing, and the other way round.
        let turned = otherwise(&rows, [0.0, 0.02, 0.0], 2.0).unwrap();
        assert!((turned[0] + 2.0).abs() < 1e-12 && (turned[1] - 2.0).abs() < 1e-12, "{turned:?}");
        // Of N readings Δt apart a parabola's second derivative has the variance 720 σ² / (Δt⁴ N (N² − 1) (N² − 4)).
        let exact = 720.0 * (0.4_f64 * 0.000_5).powi(2) / (0.01_f64.powi(4) * 12.0 * 143.0 * 140.0);
        assert!((variance / exact - 1.0).abs() < 1e-9, "{variance} {exact}");
    }
}
