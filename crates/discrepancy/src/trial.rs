//! Episodes of a log as what a simulation starts from, and what it is compared with.
//!
//! # Comparison
//!
//! A channel is compared in blocks of `rows` rows: the sum of (measured − simulated) / σ over the block, divided by √rows, so that white noise of
//! standard deviation σ gives residuals of variance 1. Orientations are compared as rotation vectors of measured · simulated⁻¹.
//! Readings between two ticks are compared with what lies between the simulated ones.

use measured_log::{Axis, Channel, Component, Episode, Log};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use physics_model::rig::RigReading;
use physics_model::state::BodyState;
use serde::Serialize;

use crate::noise::NoiseLevels;

mod series;

pub use series::Compared;

/// Blocks of a channel in an episode, about.
const BLOCKS: usize = 80;
/// Most rows at rest that the start is averaged over.
const REST_ROWS: usize = 50;
/// How far, in standard deviations of the sensor, a reading at rest may be from the first ones.
const REST_SIGMAS: f64 = 5.0;
/// Rows that a velocity at the start is fitted to where it is not measured.
const VELOCITY_ROWS: usize = 8;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Object's position.
    ObjectPosition,
    /// Object's orientation.
    ObjectOrientation,
    /// Object's velocity.
    ObjectVelocity,
    /// Object's angular velocity.
    ObjectSpin,
    /// Place of the tool.
    ToolPosition,
    /// Joint positions.
    JointPosition,
    /// Force at the wrist.
    WristForce,
    /// Torque at the wrist.
    WristTorque,
    /// Torques of the joints.
    JointTorque,
}

impl Kind {
    /// All, in order.
    pub const ALL: [Self; 9] = [
        Self::ObjectPosition,
        Self::ObjectOrientation,
        Self::ObjectVelocity,
        Self::ObjectSpin,
        Self::ToolPosition,
        Self::JointPosition,
        Self::WristForce,
        Self::WristTorque,
        Self::JointTorque,
    ];

    /// Name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ObjectPosition => "object_position",
            Self::ObjectOrientation => "object_orientation",
            Self::ObjectVelocity => "object_velocity",
            Self::ObjectSpin => "object_spin",
            Self::ToolPosition => "tool_position",
            Self::JointPosition => "joint_position",
            Self::WristForce => "wrist_force",
            Self::WristTorque => "wrist_torque",
            Self::JointTorque => "joint_torque",
        }
    }

    /// Its scalar columns for an arm with `joints` joints; none for the orientation, which is no sum of columns.
    pub(crate) fn channels(self, joints: usize) -> Vec<Channel> {
        let vector = |make: fn(Axis) -> Channel| Axis::ALL.map(make).to_vec();
        let joint = |make: fn(u8) -> Channel| (0..joints as u8).map(make).collect();
        match self {
            Self::ObjectPosition => vector(Channel::ObjectPosition),
            Self::ObjectOrientation => Vec::new(),
            Self::ObjectVelocity => vector(Channel::ObjectVelocity),
            Self::ObjectSpin => vector(Channel::ObjectSpin),
            Self::ToolPosition => vector(Channel::Tool),
            Self::JointPosition => joint(Channel::Joint),
            Self::WristForce => vector(Channel::WristForce),
            Self::WristTorque => vector(Channel::WristTorque),
            Self::JointTorque => joint(Channel::JointTorque),
        }
    }
}

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
    /// Command at the end of each tick; of the free body only the number counts.
    pub commands: Vec<[f64; 3]>,
    /// Known weight, kg.
    pub added_mass_kg: f64,
    /// The object as first read.
    pub start: BodyState,
    /// Standard deviation of the start's position (m) and orientation (rad), and of its velocities (m/s, rad/s).
    pub start_stddev: [f64; 4],
    /// The tool where it begins, m.
    pub tool_m: Option<[f64; 3]>,
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
    /// An episode of a log; `None` where it has no second row or no pose of the object.
    #[must_use]
    pub fn new(log: &Log, episode: &Episode, noise: &NoiseLevels, has_tool: bool) -> Option<Self> {
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
        let commands = commands(episode, begin_secs, period_secs, ticks);
        if has_tool && commands.is_none() {
            return None;
        }
        let tool_m = has_tool.then(|| {
            let first = |make| (0..episode.rows()).find_map(|row| episode.vector(make, row));
            first(Channel::Tool).or_else(|| first(Channel::Command))
        });
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
            let values: Vec<_> = (0..episode.rows())
                .map(|row| {
                    let [x, y, z, w] = episode.orientation(row)?;
                    Some(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)))
                })
                .collect();
            values.iter().any(Option::is_some).then_some((sigma, values))
        });
        let added_mass_kg = episode.get(Channel::AddedMass, 0).unwrap_or(0.0);
        let (start, start_stddev) = start(episode, noise)?;
        let mut trial = Self {
            id: episode.id,
            ticks,
            commands: commands.unwrap_or_else(|| vec![[0.0; 3]; ticks]),
            added_mass_kg,
            start,
            start_stddev,
            tool_m: tool_m.flatten(),
            rows,
            scalars,
            orientation,
            blocks: Vec::new(),
            time_secs: episode.time_secs.clone(),
        };
        trial.blocks = trial.block_list();
        Some(trial)
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

    /// Simulated readings against the measured ones: standardised residuals, one a block. Where the simulation has ended early its last
    /// reading stands for the rest.
    #[must_use]
    pub fn residuals(&self, start: &RigReading, readings: &[RigReading]) -> Vec<f64> {
        let at = |tick: usize| match tick {
            0 => start,
            tick => readings.get(tick - 1).or(readings.last()).unwrap_or(start),
        };
        let mut residuals = Vec::with_capacity(self.blocks.len());
        let mut blocks = self.blocks.iter().peekable();
        for scalar in &self.scalars {
            while let Some(block) = blocks.next_if(|b| (b.kind, b.component) == (scalar.kind, scalar.component)) {
                let (mut sum, mut count) = (0.0, 0);
                for row in block.first..block.end {
                    let Some(measured) = scalar.values[row] else { continue };
                    let (tick, share) = self.rows[row];
                    let mut value = predicted(at(tick), scalar.channel);
                    if share > 0.0 {
                        value += share * (predicted(at(tick + 1), scalar.channel) - value);
                    }
                    sum += measured - value;
                    count += 1;
                }
                residuals.push(sum / (scalar.sigma * f64::from(count).sqrt()));
            }
        }
        if let Some((sigma, values)) = &self.orientation {
            let turns: Vec<Option<Vector3<f64>>> = (values.iter().zip(&self.rows))
                .map(|(measured, (tick, share))| {
                    let mut simulated = orientation(at(*tick));
                    if *share > 0.0 {
                        simulated = simulated.nlerp(&orientation(at(tick + 1)), *share);
                    }
                    measured.map(|measured| (measured * simulated.inverse()).scaled_axis())
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
}

fn orientation(reading: &RigReading) -> UnitQuaternion<f64> {
    let [x, y, z, w] = reading.object.orientation;
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// The command at the end of each tick, m, from the command columns, else from where the tool was measured.
fn commands(episode: &Episode, begin_secs: f64, period_secs: f64, ticks: usize) -> Option<Vec<[f64; 3]>> {
    let given = |make: fn(Axis) -> Channel| {
        let points: Vec<(f64, [f64; 3])> = (0..episode.rows())
            .filter_map(|row| Some((episode.time_secs[row] - begin_secs, episode.vector(make, row)?)))
            .collect();
        (!points.is_empty()).then_some(points)
    };
    let points = given(Channel::Command).or_else(|| given(Channel::Tool))?;
    let mut next = 0;
    Some(
        (1..=ticks)
            .map(|tick| {
                let time = tick as f64 * period_secs;
                while next < points.len() && points[next].0 < time - 1e-9 {
                    next += 1;
                }
                match (next.checked_sub(1).map(|i| points[i]), points.get(next)) {
                    (_, Some((t, point))) if (t - time).abs() < 0.02 * period_secs => *point,
                    (Some((t0, a)), Some((t1, b))) => {
                        let share = (time - t0) / (t1 - t0);
                        std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
                    }
                    (Some((_, point)), None) => point,
                    (None, Some((_, point))) => *point,
                    (None, None) => unreachable!("there is a point"),
                }
            })
            .collect(),
    )
}

/// The object at the start, and the standard deviations of its position, orientation, velocity and angular velocity.
fn start(episode: &Episode, noise: &NoiseLevels) -> Option<(BodyState, [f64; 4])> {
    let first: [f64; 3] = episode.vector(Channel::ObjectPosition, 0)?;
    let [x, y, z, w] = episode.orientation(0).unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let attitude = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let (sigma_m, sigma_rad) = (noise.of(Kind::ObjectPosition)?, noise.of(Kind::ObjectOrientation).unwrap_or(0.0));
    let state = |position_m: Vector3<f64>, turn: Vector3<f64>, linear_mps, angular_rps| {
        let q = UnitQuaternion::from_scaled_axis(turn) * attitude;
        BodyState { position_m: position_m.into(), orientation: [q.i, q.j, q.k, q.w], linear_mps, angular_rps }
    };
    let here = Vector3::from(first);
    if let (Some(linear), Some(angular)) =
        (episode.vector(Channel::ObjectVelocity, 0), episode.vector(Channel::ObjectSpin, 0))
    {
        let moving = Vector3::from(linear).norm() > 0.0 || Vector3::from(angular).norm() > 0.0;
        if moving {
            let speed = noise.of(Kind::ObjectVelocity).unwrap_or(0.0);
            let spin = noise.of(Kind::ObjectSpin).unwrap_or(0.0);
            return Some((state(here, Vector3::zeros(), linear, angular), [sigma_m, sigma_rad, speed, spin]));
        }
    }
    // At rest: the mean of what was read before anything moved.
    let poses: Vec<(f64, Vector3<f64>, Vector3<f64>)> = (0..episode.rows().min(REST_ROWS))
        .map_while(|row| {
            let place = Vector3::from(episode.vector(Channel::ObjectPosition, row)?);
            let turn = match episode.orientation(row) {
                Some([x, y, z, w]) => {
                    let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
                    (q * attitude.inverse()).scaled_axis()
                }
                None => Vector3::zeros(),
            };
            Some((episode.time_secs[row] - episode.time_secs[0], place, turn))
        })
        .collect();
    let resting = poses.iter().take_while(|(_, place, _)| (place - here).amax() < REST_SIGMAS * sigma_m).count();
    if resting > VELOCITY_ROWS / 2 {
        // The later half may already be moving by less than what shows.
        let kept = if resting == poses.len() { resting } else { (resting / 2).max(1) };
        let n = kept as f64;
        let place = poses[..kept].iter().map(|pose| pose.1).sum::<Vector3<f64>>() / n;
        let turn = poses[..kept].iter().map(|pose| pose.2).sum::<Vector3<f64>>() / n;
        let start = state(place, turn, [0.0; 3], [0.0; 3]);
        return Some((start, [sigma_m / n.sqrt(), sigma_rad / n.sqrt(), 0.0, 0.0]));
    }
    // In motion: a parabola through the first poses; its constant and its slope.
    let rows = &poses[..poses.len().min(VELOCITY_ROWS)];
    if rows.len() < 4 {
        return Some((state(here, Vector3::zeros(), [0.0; 3], [0.0; 3]), [sigma_m, sigma_rad, 0.0, 0.0]));
    }
    let design = nalgebra::DMatrix::from_fn(rows.len(), 3, |i, j| rows[i].0.powi(j as i32));
    let inverse = (design.transpose() * &design).try_inverse()?;
    let fit = |pick: &dyn Fn(usize) -> f64| {
        let values = nalgebra::DVector::from_fn(rows.len(), |i, _| pick(i));
        let solution = &inverse * design.transpose() * values;
        (solution[0], solution[1])
    };
    let place: [(f64, f64); 3] = std::array::from_fn(|axis| fit(&|i| rows[i].1[axis]));
    let turn: [(f64, f64); 3] = std::array::from_fn(|axis| fit(&|i| rows[i].2[axis]));
    let (constant, slope) = (inverse[(0, 0)].sqrt(), inverse[(1, 1)].sqrt());
    let start = state(
        Vector3::from(place.map(|fit| fit.0)),
        Vector3::from(turn.map(|fit| fit.0)),
        place.map(|fit| fit.1),
        turn.map(|fit| fit.1),
    );
    Some((start, [sigma_m * constant, sigma_rad * constant, sigma_m * slope, sigma_rad * slope]))
}

/// Whether an episode has what orientation needs.
pub(crate) fn orientations(episode: &Episode) -> Vec<Option<[f64; 4]>> {
    let present = Component::ALL.map(Channel::ObjectOrientation).iter().all(|c| episode.channels.contains_key(c));
    if present { (0..episode.rows()).map(|row| episode.orientation(row)).collect() } else { Vec::new() }
}

impl Trial {
    /// Where something may have pushed the object out of its way: how far it is off in the end, m, and the place, m, `reach_m` from its centre
    /// against the direction in which it first left the simulated path.
    #[must_use]
    pub fn deflected(&self, readings: &[RigReading], reach_m: f64) -> Option<(f64, [f64; 2])> {
        let place = |component: usize, row: usize| {
            let scalar = self.scalars.iter().find(|s| s.kind == Kind::ObjectPosition && s.component == component)?;
            Some((scalar.values[row]?, scalar.sigma))
        };
        let offs = || {
            self.rows.iter().enumerate().skip(1).filter_map(|(row, (tick, _))| {
                let simulated = readings.get(tick.checked_sub(1)?)?.object.position_m;
                let ((x, sigma), (y, _)) = (place(0, row)?, place(1, row)?);
                Some(([x, y], [x - simulated[0], y - simulated[1]], sigma))
            })
        };
        let (_, [dx, dy], _) = offs().next_back()?;
        // Clear of noise, and of what friction alone does.
        let left = offs().find(|(_, [dx, dy], sigma)| dx.hypot(*dy) > 5.0 * sigma + 0.002);
        left.map(|([x, y], [ax, ay], _)| {
            let size = ax.hypot(ay);
            (dx.hypot(dy), [x - reach_m * ax / size, y - reach_m * ay / size])
        })
    }

    /// The largest force on the tool that the simulation does not know of, N, and the place, m, `ahead_m` ahead of the tool against it.
    #[must_use]
    pub fn blocked(&self, readings: &[RigReading], ahead_m: f64) -> Option<(f64, [f64; 2])> {
        let force = |component: usize, row: usize| {
            let scalar = self.scalars.iter().find(|s| s.kind == Kind::WristForce && s.component == component)?;
            scalar.values[row]
        };
        let surprises = self.rows.iter().enumerate().skip(1).filter_map(|(row, (tick, _))| {
            let reading = readings.get(tick.checked_sub(1)?)?;
            let tool = reading.tool_m?;
            let (dx, dy) = (force(0, row)? - reading.wrench.force_n[0], force(1, row)? - reading.wrench.force_n[1]);
            let size = dx.hypot(dy).max(1e-9);
            Some((size, [tool[0] - ahead_m * dx / size, tool[1] - ahead_m * dy / size]))
        });
        surprises.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// What goes on in each row of a simulated episode.
    #[must_use]
    pub fn phases(&self, readings: &[RigReading], rolls: bool) -> Vec<Phase> {
        let onset = (ONSET_SECS / self.tick_secs()).ceil() as usize;
        let (mut since, mut touched, mut by_tick) = (0, false, vec![Phase::FreeMotion]);
        for reading in readings {
            if reading.wrench.force_magnitude_n() > CONTACT_N {
                since = if touched { since + 1 } else { 0 };
                touched = true;
                let moving = if rolls { Phase::Rolling } else { Phase::Sliding };
                by_tick.push(if since < onset { Phase::ContactOnset } else { moving });
            } else {
                let before = touched || by_tick.last().is_some_and(|phase| *phase != Phase::FreeMotion);
                touched = false;
                by_tick.push(if before { Phase::AfterContact } else { Phase::FreeMotion });
            }
        }
        self.rows.iter().map(|(tick, _)| by_tick[(*tick).min(by_tick.len() - 1)]).collect()
    }

    /// Duration of a tick, s, as the rows say.
    fn tick_secs(&self) -> f64 {
        let (last, _) = self.rows[self.rows.len() - 1];
        (self.time_secs[self.time_secs.len() - 1] - self.time_secs[0]) / last.max(1) as f64
    }
}

/// Less than this, N, is no contact.
const CONTACT_N: f64 = 0.02;
/// How long, s, a contact is new.
const ONSET_SECS: f64 = 0.1;

/// What goes on in an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Nothing has touched the tool yet.
    FreeMotion,
    /// The first tenth of a second of a contact.
    ContactOnset,
    /// Tool and object touch, and the object does not roll.
    Sliding,
    /// Tool and a round object touch.
    Rolling,
    /// The tool has touched the object before.
    AfterContact,
}

impl Phase {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::FreeMotion => "free motion",
            Self::ContactOnset => "contact onset",
            Self::Sliding => "sliding",
            Self::Rolling => "rolling",
            Self::AfterContact => "after contact",
        }
    }
}
