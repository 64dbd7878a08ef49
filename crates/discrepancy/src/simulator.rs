//! Hypotheses against measured episodes: residuals by simulation.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics_model::effect::Effect;
use physics_model::rig::{RigReading, RigStart};
use physics_model::world::Wrench;
use physics_model::{BodyState, EffectConfig, EffectKind};
use rayon::prelude::*;

use crate::cells::{Key, key};
use crate::clock::{Clock, skewed};
use crate::nominal::{Engine, Nominal};
use crate::progress::Progress;
use crate::trial::{Block, Trial, WHOLE};

/// A bounce is over within a step of a slow push: it needs this many times as many.
const BOUNCE_REFINEMENT: u32 = 3;

/// A model of what was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Coordinates of the nominal model's tunables.
    pub z: Vec<f64>,
    /// What the nominal model lacks.
    pub effects: Vec<EffectConfig>,
}

/// A displacement of the start of every episode, in standard deviations of what is known of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nudge {
    /// Along base x, y (m) and about z (rad).
    pub pose: [f64; 3],
    /// Velocities along x, y, z.
    pub linear: [f64; 3],
    /// Angular velocities about x, y, z.
    pub angular: [f64; 3],
    /// Along base z (m) and about x and y (rad): what is thrown may be anywhere.
    pub lift: [f64; 3],
    /// By how much the table is higher (m), and turned about x and y (rad), where this episode meets it; in units, not in standard deviations.
    pub table: [f64; 3],
}

/// Simulates episodes and counts them.
#[derive(Debug)]
pub struct Simulator<'a> {
    /// The nominal model.
    pub nominal: &'a Nominal,
    /// The episodes.
    pub trials: &'a [Trial],
    simulated: AtomicUsize,
    /// Of each episode, what was compared last, with each clock a step away: that takes no simulation.
    ahead: Vec<Mutex<Vec<Ahead>>>,
    /// Simulated episodes that all stages may come to, for those who wait.
    limit: usize,
    progress: &'a dyn Progress,
}

impl<'a> Simulator<'a> {
    /// Of the episodes of a log.
    #[must_use]
    pub fn new(nominal: &'a Nominal, trials: &'a [Trial]) -> Self {
        let ahead = trials.iter().map(|_| Mutex::default()).collect();
        Self { nominal, trials, simulated: AtomicUsize::new(0), ahead, limit: usize::MAX, progress: &() }
    }

    /// Before the eyes of somebody who wants to know how far it is, of so many simulated episodes at most.
    #[must_use]
    pub fn watched_by(self, progress: &'a dyn Progress, limit: usize) -> Self {
        Self { progress, limit, ..self }
    }

    /// Says what begins.
    pub(crate) fn stage(&self, stage: &'static str) {
        self.progress.simulated(self.rollouts(), self.limit);
        self.progress.stage(stage);
    }

    /// Episodes simulated so far; pieces of one count in proportion to their durations.
    #[must_use]
    pub fn rollouts(&self) -> usize {
        self.simulated.load(Ordering::Relaxed).div_ceil(WHOLE)
    }

    /// What a simulation of the episodes `chosen` costs of these.
    #[must_use]
    pub fn cost(&self, chosen: &[usize]) -> usize {
        chosen.iter().map(|index| self.trials[*index].share).sum::<usize>().div_ceil(WHOLE)
    }

    /// Residuals of the episodes `chosen` (see [`Trial::residuals`]), in parallel; the order is that of `chosen`.
    #[must_use]
    pub fn residuals(&self, hypothesis: &Hypothesis, engine: &Engine, nudge: Nudge, chosen: &[usize]) -> Vec<Vec<f64>> {
        chosen.par_iter().map(|index| self.episode(hypothesis, engine, nudge, *index)).collect()
    }

    /// Whether the residuals of all episodes `chosen` are known: a clock differs from what was simulated last.
    pub(crate) fn is_ahead(&self, hypothesis: &Hypothesis, chosen: &[usize]) -> bool {
        self.nominal.clocks() > 0 && chosen.iter().all(|index| self.known(hypothesis, *index).is_some())
    }

    fn known(&self, hypothesis: &Hypothesis, index: usize) -> Option<Vec<f64>> {
        let ahead = self.ahead[index].lock().ok()?;
        ahead.iter().find(|known| known.hypothesis == *hypothesis).map(|known| known.residuals.clone())
    }

    /// Simulated readings of an episode, the start first, as their clocks stamp them.
    #[must_use]
    pub fn readings(
        &self,
        hypothesis: &Hypothesis,
        engine: &Engine,
        nudge: Nudge,
        trial: &Trial,
    ) -> (RigReading, Vec<RigReading>) {
        let (first, readings) = self.run(hypothesis, engine, nudge, trial);
        let readings = self.stamped(hypothesis, &first, readings);
        (first, readings)
    }

    fn stamped(&self, hypothesis: &Hypothesis, first: &RigReading, readings: Vec<RigReading>) -> Vec<RigReading> {
        let effects = self.nominal.effects.iter().chain(&hypothesis.effects);
        let skews_secs = self.nominal.skews_secs(&hypothesis.z, effects);
        if skews_secs == [0.0; 2] || readings.is_empty() {
            return readings;
        }
        skewed(&readings, first, skews_secs, self.nominal.header().period_secs)
    }

    /// The same by a clock without skew.
    fn run(
        &self,
        hypothesis: &Hypothesis,
        engine: &Engine,
        nudge: Nudge,
        trial: &Trial,
    ) -> (RigReading, Vec<RigReading>) {
        self.simulated.fetch_add(trial.share, Ordering::Relaxed);
        self.progress.simulated(self.rollouts(), self.limit);
        let configs = || self.nominal.effects.iter().chain(&hypothesis.effects);
        let bounces = configs().any(|effect| effect.kind() == EffectKind::Restitution) && self.nominal.has_tool();
        let engine = &Engine { refinement: engine.refinement * if bounces { BOUNCE_REFINEMENT } else { 1 }, ..*engine };
        // A contact that damps less bounces as well: beside a restitution contacts are the model's.
        let own = bounces.then(|| self.nominal.with_own_contacts(&hypothesis.z));
        let rig = self.nominal.rig(own.as_deref().unwrap_or(&hypothesis.z), engine);
        let object = self.nominal.object(&hypothesis.z, trial.added_mass_kg, engine);
        let effects: Vec<Box<dyn Effect>> = configs().map(EffectConfig::build).collect();
        let body = nudged(&trial.start, &trial.start_stddev, nudge);
        let start = RigStart {
            joints_rad: trial.joints_rad,
            time_secs: trial.begin_secs,
            ..RigStart::of_episode(body, trial.tool_m)
        };
        // What went wrong on the way is as far from what was measured as the rest of the episode is.
        let mut readings =
            rig.run(&object, &effects, &start, &trial.commands).unwrap_or_else(|error| error.readings().to_vec());
        readings.iter_mut().for_each(|reading| reading.object = raised(&reading.object, nudge.table));
        let first = RigReading {
            tool_m: trial.tool_m,
            joints_rad: Default::default(),
            wrench: Wrench::default(),
            joint_torque_nm: Default::default(),
            object: raised(&body, nudge.table),
            hidden: Vec::new(),
        };
        (first, readings)
    }

    /// The same with the key of each residual's block, by what goes on in the simulated episode.
    pub(crate) fn cells(
        &self,
        hypothesis: &Hypothesis,
        engine: &Engine,
        chosen: &[usize],
    ) -> Vec<(Vec<Key>, Vec<f64>)> {
        let (rolls, gravity_mps2) = (self.nominal.rolls(), self.nominal.header().gravity_mps2);
        let one = |index: &usize| {
            let trial = &self.trials[*index];
            let (first, readings) = self.readings(hypothesis, engine, Nudge::default(), trial);
            let phases = trial.phases(&readings, rolls, gravity_mps2);
            let middle = |block: &Block| phases[usize::midpoint(block.first, block.end - 1)];
            (trial.blocks.iter().map(|block| key(block, middle(block))).collect(), trial.residuals(&first, &readings))
        };
        chosen.par_iter().map(one).collect()
    }

    /// Residuals of the episode at `index` with each clock by itself all along its grid, by one simulation: clock, place on the grid, residuals.
    pub(crate) fn scanned(&self, hypothesis: &Hypothesis, engine: &Engine, index: usize) -> Vec<Vec<Vec<f64>>> {
        let trial = &self.trials[index];
        let (first, readings) = self.run(hypothesis, engine, Nudge::default(), trial);
        let at = |clock: usize, z: f64| {
            let mut hypothesis = hypothesis.clone();
            hypothesis.z[clock] = z;
            trial.residuals(&first, &self.stamped(&hypothesis, &first, readings.clone()))
        };
        let all = |clock: usize| Clock::ALL[clock].grid().into_iter().map(|z| at(clock, z)).collect();
        (0..self.nominal.clocks()).map(all).collect()
    }

    fn episode(&self, hypothesis: &Hypothesis, engine: &Engine, nudge: Nudge, index: usize) -> Vec<f64> {
        let (trial, clocks) = (&self.trials[index], self.nominal.clocks());
        let plain = clocks > 0 && nudge == Nudge::default() && *engine == self.nominal.engine();
        if plain && let Some(known) = self.known(hypothesis, index) {
            return known;
        }
        let (first, readings) = self.run(hypothesis, engine, nudge, trial);
        let residuals = |hypothesis: &Hypothesis, readings: Vec<RigReading>| {
            trial.residuals(&first, &self.stamped(hypothesis, &first, readings))
        };
        if plain && let Ok(mut ahead) = self.ahead[index].lock() {
            ahead.clear();
            ahead.extend((0..clocks).map(|clock| {
                let mut hypothesis = hypothesis.clone();
                hypothesis.z[clock] += Clock::ALL[clock].step(hypothesis.z[clock]);
                Ahead { residuals: residuals(&hypothesis, readings.clone()), hypothesis }
            }));
        }
        residuals(hypothesis, readings)
    }
}

/// Residuals of an episode that were not asked for yet.
#[derive(Debug)]
struct Ahead {
    hypothesis: Hypothesis,
    residuals: Vec<f64>,
}

fn nudged(start: &BodyState, stddev: &[f64; 4], nudge: Nudge) -> BodyState {
    let mut body = *start;
    let [position, orientation, linear, angular] = stddev;
    for i in 0..2 {
        body.position_m[i] += nudge.pose[i] * position;
    }
    for i in 0..3 {
        body.linear_mps[i] += nudge.linear[i] * linear;
        body.angular_rps[i] += nudge.angular[i] * angular;
    }
    let yaw = nudge.pose[2] * orientation;
    if yaw != 0.0 {
        let (sin, cos) = (0.5 * yaw).sin_cos();
        let [x, y, z, w] = body.orientation;
        // Turned about the base's z: (cos + sin k) q.
        body.orientation = [cos * x - sin * y, cos * y + sin * x, cos * z + sin * w, cos * w - sin * z];
    }
    let [up, about_x, about_y] = nudge.lift;
    body = raised(&body, [up * position, about_x * orientation, about_y * orientation]);
    // To a table that is higher the object is lower. It falls and turns as before: only where it comes to lie differs.
    let table = nudge.table.map(|value| -value);
    body = raised(&body, table);
    if table != [0.0; 3] {
        body.angular_rps = (turn(table) * Vector3::from(body.angular_rps)).into();
    }
    body
}

fn turn([_, about_x, about_y]: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::new(about_x, about_y, 0.0))
}

/// A body that is higher (m) and turned about base x and y (rad) in its place.
fn raised(body: &BodyState, [up, about_x, about_y]: [f64; 3]) -> BodyState {
    if [up, about_x, about_y] == [0.0; 3] {
        return *body;
    }
    let [x, y, z, w] = body.orientation;
    let q = turn([up, about_x, about_y]) * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let [x, y, height] = body.position_m;
    BodyState { position_m: [x, y, height + up], orientation: [q.i, q.j, q.k, q.w], ..*body }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_higher_table_is_a_lower_object_that_is_read_where_it_was() {
        let mut body = BodyState::at_rest([0.1, 0.2, 0.3], 0.4);
        body.linear_mps = [1.0, 0.0, -1.0];
        let table = [0.001, 0.02, -0.01];
        let lower = nudged(&body, &[0.0; 4], Nudge { table, ..Nudge::default() });
        assert!((lower.position_m[2] - 0.299).abs() < 1e-12 && lower.linear_mps == body.linear_mps);
        let read = raised(&lower, table);
        let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off(&read.position_m, &body.position_m) < 1e-12 && off(&read.orientation, &body.orientation) < 1e-12);
        // Its start is turned the other way about x.
        let [x, ..] =
            nudged(&BodyState::at_rest([0.0; 3], 0.0), &[0.0; 4], Nudge { table, ..Nudge::default() }).orientation;
        assert!((x + 0.01).abs() < 1e-4, "{x}");
    }
}
