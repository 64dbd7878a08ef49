//! Episodes of a log as what a simulation starts from, and what it is compared with.
//!
//! # Comparison
//!
//! A channel is compared in blocks of `rows` rows: the sum of (measured − simulated) / σ over the block, divided by √rows, so that white noise of
//! standard deviation σ gives residuals of variance 1. Orientations are compared as rotation vectors of measured · simulated⁻¹.
//! Readings between two ticks are compared with what lies between the simulated ones.

mod kind;
mod phase;
mod series;
mod shots;
mod start;
mod touch;
mod windows;

use std::ops::Range;

use measured_log::{Axis, Channel, Component, Episode, Log};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics_model::rig::RigReading;
use physics_model::robot::JointVector;
use physics_model::state::BodyState;

use crate::noise::NoiseLevels;

pub use kind::Kind;
pub use phase::Phase;
pub use series::Compared;
pub(crate) use series::Place;
pub(crate) use touch::Touch;
pub(crate) use windows::Window;

/// Blocks of a channel in an episode, about.
const BLOCKS: usize = 80;

/// What the simulation says of a channel.
fn predicted(reading: &RigReading, channel: Channel) -> f64 {
    let axis = |axis: Axis| axis as usize;
    match channel {
        Channel::Tool(a) => reading.tool_m.map_or(0.0, |tool| tool[axis(a)]),
        Channel::Joint(j) => reading.joints_rad[usize::from(j)],
        Channel::WristForce(a) => reading.wrench.force_n[axis(a)],
        Channel::WristTorque(a) => reading.wrench.torque_nm[axis(a)],
        Channel::JointTorque(j) => reading.joint_torque_nm[usize::from(j)],
        Channel::ObjectPosition(a) => reading.object.position_m[axis(a)],
        Channel::ObjectVelocity(a) => reading.object.linear_mps[axis(a)],
        Channel::ObjectSpin(a) => reading.object.angular_rps[axis(a)],
        Channel::Command(_) | Channel::ObjectOrientation(_) | Channel::AddedMass => 0.0,
    }
}

/// A simulated episode. Where it has ended early its last reading stands for the rest.
struct Course<'a> {
    start: &'a RigReading,
    readings: &'a [RigReading],
}

impl<'a> Course<'a> {
    fn at(&self, tick: usize) -> &'a RigReading {
        match tick {
            0 => self.start,
            tick => self.readings.get(tick - 1).or(self.readings.last()).unwrap_or(self.start),
        }
    }

    /// A channel at a tick and a share of the way to the next.
    fn value(&self, channel: Channel, (tick, share): (usize, f64)) -> f64 {
        let value = predicted(self.at(tick), channel);
        if share > 0.0 { value + share * (predicted(self.at(tick + 1), channel) - value) } else { value }
    }

    /// The object's orientation there.
    fn orientation(&self, (tick, share): (usize, f64)) -> UnitQuaternion<f64> {
        let simulated = orientation(self.at(tick));
        if share > 0.0 { simulated.nlerp(&orientation(self.at(tick + 1)), share) } else { simulated }
    }
}

/// Places of the pieces of each episode, which come one after another.
pub(crate) fn groups<'a>(trials: impl Iterator<Item = &'a Trial>) -> Vec<Range<usize>> {
    let mut groups: Vec<(u64, Range<usize>)> = Vec::new();
    for (place, trial) in trials.enumerate() {
        match groups.last_mut() {
            Some((id, range)) if *id == trial.id => range.end = place + 1,
            _ => groups.push((trial.id, place..place + 1)),
        }
    }
    groups.into_iter().map(|(_, range)| range).collect()
}

/// What an episode counts, of which its pieces have their shares.
pub(crate) const WHOLE: usize = 1_000_000;

/// The pieces of an episode with their shares of it, which come to a whole.
fn shared(mut pieces: Vec<Trial>) -> Vec<Trial> {
    let whole: usize = pieces.iter().map(|piece| piece.ticks).sum();
    let mut ticks = 0;
    for piece in &mut pieces {
        let before = ticks * WHOLE / whole;
        ticks += piece.ticks;
        piece.share = ticks * WHOLE / whole - before;
    }
    pieces
}

/// A block of rows of one component.
#[derive(Clone, Debug)]
pub struct Block {
    /// What.
    pub kind: Kind,
    /// Which component.
    pub component: usize,
    /// First row.
    pub first: usize,
    /// Row after the last.
    pub end: usize,
}

/// An episode.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Number of the episode in the log.
    pub id: u64,
    /// Simulated ticks after the start.
    pub ticks: usize,
    /// Of simulating its episode, in millionths: what of it is in this piece.
    pub(crate) share: usize,
    /// Command at the end of each tick; of the free body only the number counts.
    pub commands: Vec<[f64; 3]>,
    /// Time of the start since the episode began, s.
    pub begin_secs: f64,
    /// Known weight, kg.
    pub added_mass_kg: f64,
    /// The object as first read.
    pub start: BodyState,
    /// Standard deviation of the start's position (m) and orientation (rad), and of its velocities (m/s, rad/s).
    pub start_stddev: [f64; 4],
    /// The tool where it begins, m.
    pub tool_m: Option<[f64; 3]>,
    /// The posture it begins in, rad, where it is known.
    pub joints_rad: Option<JointVector>,
    /// Of each row: tick and share of the way to the next.
    rows: Vec<(usize, f64)>,
    scalars: Vec<Scalar>,
    orientation: Option<(f64, Vec<Option<UnitQuaternion<f64>>>)>,
    /// What is compared, in order.
    pub blocks: Vec<Block>,
    /// Time of each row, s.
    pub time_secs: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Scalar {
    kind: Kind,
    component: usize,
    channel: Channel,
    sigma: f64,
    values: Vec<Option<f64>>,
}

impl Trial {
    /// What an episode of a log is compared by: the whole from its first pose of the object on with a tool, pieces of what a free body does. Nothing where it
    /// has no pose, or no row after it.
    #[must_use]
    pub fn of_episode(log: &Log, episode: &Episode, noise: &NoiseLevels, has_tool: bool) -> Vec<Self> {
        let pieces = if has_tool { Vec::new() } else { shots::shots(log, episode, noise) };
        if pieces.is_empty() {
            let Some(part) = start::from_first_pose(episode) else { return Vec::new() };
            let start = start::start(&part, noise);
            let whole = start.and_then(|start| Self::begun(log, &part, noise, has_tool, start));
            let weight = (0..episode.rows()).find_map(|row| episode.get(Channel::AddedMass, row));
            // A clock may start anywhere.
            let zero_secs = episode.time_secs.first().copied().unwrap_or(0.0);
            let of_episode = |whole: Self| Self {
                added_mass_kg: weight.unwrap_or(0.0),
                begin_secs: if has_tool { whole.begin_secs - zero_secs } else { 0.0 },
                ..whole
            };
            return whole.map(of_episode).into_iter().collect();
        }
        shared(pieces)
    }

    /// With the given start and its standard deviations.
    fn begun(
        log: &Log,
        episode: &Episode,
        noise: &NoiseLevels,
        has_tool: bool,
        (start, start_stddev): (BodyState, [f64; 4]),
    ) -> Option<Self> {
        let period_secs = log.header.period_secs;
        let begin_secs = *episode.time_secs.first()?;
        let rows: Vec<(usize, f64)> = (episode.time_secs.iter())
            .map(|time| {
                let ticks = (time - begin_secs) / period_secs;
                // Clocks jitter: what is nearer to a tick than this was read there.
                let nearest = ticks.round();
                let ticks = if (ticks - nearest).abs() < 0.02 { nearest } else { ticks };
                (ticks.floor() as usize, ticks - ticks.floor())
            })
            .collect();
        let (last, share) = *rows.last()?;
        let ticks = last + usize::from(share > 0.0);
        if ticks == 0 {
            return None;
        }
        let commands = start::commands(episode, noise, begin_secs, period_secs, ticks);
        if has_tool && commands.is_none() {
            return None;
        }
        let tool_m = has_tool.then(|| start::tool(episode, noise));
        let joints = usize::from(log.header.robot.joints());
        let mut scalars = Vec::new();
        for kind in Kind::ALL {
            let Some(sigma) = noise.of(kind) else { continue };
            for (component, channel) in kind.channels(joints).into_iter().enumerate() {
                if let Some(readings) = episode.channels.get(&channel).filter(|readings| readings.count() > 0) {
                    scalars.push(Scalar { kind, component, channel, sigma, values: readings.iter().collect() });
                }
            }
        }
        let orientation = noise.of(Kind::ObjectOrientation).and_then(|sigma| {
            let values = orientations(episode);
            values.iter().any(Option::is_some).then_some((sigma, values))
        });
        let added_mass_kg = episode.get(Channel::AddedMass, 0).unwrap_or(0.0);
        let mut trial = Self {
            id: episode.id,
            ticks,
            share: WHOLE,
            begin_secs: if has_tool { begin_secs } else { 0.0 },
            commands: commands.unwrap_or_else(|| vec![[0.0; 3]; ticks]),
            added_mass_kg,
            start,
            start_stddev,
            tool_m: tool_m.flatten(),
            joints_rad: start::posture(episode, log.header.robot.joints()),
            rows,
            scalars,
            orientation,
            blocks: Vec::new(),
            time_secs: episode.time_secs.clone(),
        };
        trial.blocks = trial.block_list();
        Some(trial)
    }

    /// The tick of a row, the start's being 0.
    #[must_use]
    pub fn tick(&self, row: usize) -> usize {
        self.rows[row].0
    }

    fn block_list(&self) -> Vec<Block> {
        let count = self.rows.len();
        // The first row is where the simulation starts.
        let width = (count - 1).div_ceil(BLOCKS).max(1);
        let mut blocks = Vec::new();
        let mut add = |kind, component, present: &dyn Fn(usize) -> bool| {
            for first in (1..count).step_by(width) {
                let end = (first + width).min(count);
                if (first..end).any(present) {
                    blocks.push(Block { kind, component, first, end });
                }
            }
        };
        for scalar in &self.scalars {
            add(scalar.kind, scalar.component, &|row| scalar.values[row].is_some());
        }
        if let Some((_, values)) = &self.orientation {
            for component in 0..3 {
                add(Kind::ObjectOrientation, component, &|row| values[row].is_some());
            }
        }
        blocks
    }

    /// Simulated readings against the measured ones: standardised residuals, one a block.
    #[must_use]
    pub fn residuals(&self, start: &RigReading, readings: &[RigReading]) -> Vec<f64> {
        let course = Course { start, readings };
        let mut residuals = Vec::with_capacity(self.blocks.len());
        let mut blocks = self.blocks.iter().peekable();
        for scalar in &self.scalars {
            while let Some(block) = blocks.next_if(|b| (b.kind, b.component) == (scalar.kind, scalar.component)) {
                let (mut sum, mut count) = (0.0, 0);
                for row in block.first..block.end {
                    let Some(measured) = scalar.values[row] else { continue };
                    sum += measured - course.value(scalar.channel, self.rows[row]);
                    count += 1;
                }
                residuals.push(sum / (scalar.sigma * f64::from(count).sqrt()));
            }
        }
        if let Some((sigma, values)) = &self.orientation {
            let turns: Vec<Option<Vector3<f64>>> = (values.iter().zip(&self.rows))
                .map(|(measured, row)| {
                    measured.map(|measured| (measured * course.orientation(*row).inverse()).scaled_axis())
                })
                .collect();
            for block in blocks {
                let inside = turns[block.first..block.end].iter().flatten();
                let (sum, count) = inside.fold((0.0, 0), |(sum, n), turn| (sum + turn[block.component], n + 1));
                residuals.push(sum / (sigma * f64::from(count).sqrt()));
            }
        }
        residuals
    }

    /// Mean square of what the readings of a kind do in the episode, in the square of its unit: of places how far they are from the first, of others how
    /// large they are. `None` without such readings.
    pub(crate) fn signal(&self, kind: Kind) -> Option<f64> {
        let place = matches!(kind, Kind::ObjectPosition | Kind::ToolPosition | Kind::JointPosition);
        let (mut square, mut count) = (0.0, 0_usize);
        for scalar in self.scalars.iter().filter(|scalar| scalar.kind == kind) {
            let mut read = scalar.values.iter().flatten();
            let from = if place { read.clone().next().copied().unwrap_or(0.0) } else { 0.0 };
            read.by_ref().for_each(|value| {
                square += (value - from).powi(2);
                count += 1;
            });
        }
        (count > 0).then(|| square / count as f64)
    }

    /// What standardised residuals are in the unit of their channel: the mean of (measured − simulated) over each block.
    pub(crate) fn errors(&self, residuals: &[f64]) -> Vec<(Kind, f64)> {
        let present = |block: &Block| {
            let scalar = self.scalars.iter().find(|s| (s.kind, s.component) == (block.kind, block.component));
            let rows = block.first..block.end;
            match (scalar, &self.orientation) {
                (Some(scalar), _) => (scalar.sigma, scalar.values[rows].iter().flatten().count()),
                (None, Some((sigma, values))) => (*sigma, values[rows].iter().flatten().count()),
                (None, None) => (0.0, 1),
            }
        };
        let error = |(block, residual): (&Block, &f64)| {
            let (sigma, rows) = present(block);
            (block.kind, residual * sigma / (rows as f64).sqrt())
        };
        self.blocks.iter().zip(residuals).map(error).collect()
    }
}

fn orientation(reading: &RigReading) -> UnitQuaternion<f64> {
    rotation(reading.object.orientation)
}

/// What happened in a row, in the plane of the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Happened {
    /// The object as measured, m.
    pub(crate) object: [f64; 2],
    /// The same as simulated.
    pub(crate) simulated: [f64; 2],
    /// Its yaw as simulated, rad.
    pub(crate) yaw_rad: f64,
    /// The tool as simulated, m.
    pub(crate) tool: Option<[f64; 2]>,
    /// Force on the tool as measured, less that as simulated, N; 0 without a sensor.
    pub(crate) surprise_n: [f64; 2],
    /// Force on the tool as simulated, N.
    pub(crate) force_n: [f64; 2],
}

impl Trial {
    /// Rows with a measured place of the object.
    pub(crate) fn happened(&self, readings: &[RigReading]) -> Vec<Happened> {
        let values = |kind, component| {
            let scalar = self.scalars.iter().find(|s| (s.kind, s.component) == (kind, component));
            scalar.map_or(&[][..], |scalar| &scalar.values[..])
        };
        let [object, force] = [Kind::ObjectPosition, Kind::WristForce].map(|kind| [values(kind, 0), values(kind, 1)]);
        let read = |columns: &[&[Option<f64>]; 2], row: usize| {
            Some([*columns[0].get(row)?, *columns[1].get(row)?]).and_then(|[x, y]| Some([x?, y?]))
        };
        (self.rows.iter().enumerate().skip(1))
            .filter_map(|(row, (tick, _))| {
                let reading = readings.get(tick.checked_sub(1)?)?;
                let [x, y, _] = reading.object.position_m;
                let [fx, fy, _] = reading.wrench.force_n;
                Some(Happened {
                    object: read(&object, row)?,
                    simulated: [x, y],
                    yaw_rad: orientation(reading).euler_angles().2,
                    tool: reading.tool_m.map(|[x, y, _]| [x, y]),
                    surprise_n: read(&force, row).map_or([0.0; 2], |[x, y]| [x - fx, y - fy]),
                    force_n: [fx, fy],
                })
            })
            .collect()
    }
}

/// The object's orientation in each row; nothing where the log has none.
pub(crate) fn orientations(episode: &Episode) -> Vec<Option<UnitQuaternion<f64>>> {
    let present = Component::ALL.map(Channel::ObjectOrientation).iter().all(|c| episode.channels.contains_key(c));
    if present { (0..episode.rows()).map(|row| episode.orientation(row).map(rotation)).collect() } else { Vec::new() }
}

/// The rotation of a quaternion x, y, z, w.
fn rotation([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}
