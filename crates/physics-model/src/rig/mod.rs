//! The rig of a measured log, tick by tick: logged commands in, one reading per row out.
//!
//! The pushing task (crate `push-task`) simulates discrete actions of an arm between which everything settles. A log is one long stretch of commands instead:
//! its signal chains live as long as the run, and a run may begin anywhere in an episode, from what was measured there and from the commands
//! before. A run is a pure function of its arguments.
//!
//! # Time
//!
//! A tick is a row of the log: `tick_steps` engine steps of `control_period_secs`. Commands and readings belong to the end of a tick. Within one
//! the tool goes straight and evenly from where it was sent before to where it is sent now; a force reading is the mean over the tick. Effects
//! on signals see one value a tick.
//!
//! # Beginning in the middle of an episode
//!
//! The commands before the start go through the chain of commands, so that delays, play and gains stand where they would; a gain counts from
//! the first command given. A late pose sensor shows where the object was: the world then begins as many ticks earlier and runs up to the
//! start with the commands of that time. Three things are not known: the past of a slow force sensor (it begins settled), impulses within
//! contacts (found anew in the first steps) and, unless [`RigStart::hidden`] says, where movable hidden bodies have got to.
//!
//! At the start the tool is where its commands have brought it, not at [`RigStart::tool_m`]: a kinematic tool would make a jump of the
//! reading's noise or of the model's error and kick the object. The measured place counts where there are no commands before, and as the
//! deflection of an arm that gives way.
//!
//! # Bounces
//!
//! A contact is seen when it overlaps, up to a step's way late: a toss at 2.5 m/s needs steps of about 1 ms for its restitution (at 5 ms half
//! of e = 0.2 is lost). A sphere then bounces by e within 1 %, a box that lands flat on four points by 0.88 e. What friction takes in a bounce is
//! right within a quarter, by where in a step it begins, and within a tenth in the mean.

mod drive;
mod object;
mod run;
mod start;

use std::sync::Arc;

use thiserror::Error;

use crate::config::WorldConfig;
use crate::effect::Effect;
use crate::robot::{IkError, JointVector, Robot};
use crate::state::BodyState;
use crate::world::{Divergence, Wrench};

pub use crate::prism::Prism;
pub use object::{RigObject, RigShape};

/// What stands behind a log, as far as no hypothesis changes it.
#[derive(Clone, Debug)]
pub struct Rig {
    /// World. `control_period_secs` is the engine's step; `control_steps` and what is about obstacles of Θ do not count. `tool_friction` is that
    /// of the pair tool–object.
    pub world: WorldConfig,
    /// Engine steps in a tick of the log, at least 1.
    pub tick_steps: u32,
    /// What moves by command.
    pub tool: RigTool,
    /// Slip, m/s, below which the friction of tool and object is in proportion to it, so that it lets go of what does not slip; 0: Coulomb's, which
    /// sticks.
    pub tool_slip_mps: f64,
    /// Shape of the cone of friction on the table: 1 is Coulomb's; above, a pyramid with its edges on x and y, whose friction is less between them; below, one
    /// with its faces across them, whose friction is more. Engines that solve friction by axes have such pyramids.
    pub cone_exponent: f64,
}

/// What moves by command.
#[derive(Clone, Debug)]
pub enum RigTool {
    /// Nothing: a free body. Of commands only the number counts.
    None,
    /// A ball without an arm.
    Ball {
        /// Radius, m.
        radius_m: f64,
    },
    /// A kinematic arm with its hand, commanded by the place of its tool centre.
    Arm(Arc<Robot>),
}

/// Where a run begins: what was measured at that moment.
#[derive(Clone, Debug)]
pub struct RigStart<'a> {
    /// The object as the pose sensor showed it: what pose effects have made of it is undone.
    pub object: BodyState,
    /// Tool centre, m, base frame; needed for rigs with a tool where there are no earlier commands.
    pub tool_m: Option<[f64; 3]>,
    /// Measured joints, rad, if the log has them: which of many postures the arm is in.
    pub joints_rad: Option<JointVector>,
    /// Since the episode began, s, by the clock of the log.
    pub time_secs: f64,
    /// Commands of the ticks up to the start, oldest first, m, base frame: all since the episode began, or as many as matter. Empty at the start
    /// of an episode.
    pub earlier_commands: &'a [[f64; 3]],
    /// Bodies that only effects know of, in the order of the effects, as an earlier run left them; empty: as at the start of an episode.
    pub hidden: &'a [BodyState],
}

impl RigStart<'_> {
    /// The start of an episode.
    #[must_use]
    pub fn of_episode(object: BodyState, tool_m: Option<[f64; 3]>) -> Self {
        Self { object, tool_m, joints_rad: None, time_secs: 0.0, earlier_commands: &[], hidden: &[] }
    }
}

/// A row of the log, without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct RigReading {
    /// Tool centre, m, base frame; `None` for a free body.
    pub tool_m: Option<[f64; 3]>,
    /// Joints, rad; 0 without an arm.
    pub joints_rad: JointVector,
    /// What the world exerts on the tool at its centre, base axes, as a sensor at the wrist reports it; 0 without a tool.
    pub wrench: Wrench,
    /// Torques of the motors, N·m, with gravity and motion of the arm; 0 without an arm.
    pub joint_torque_nm: JointVector,
    /// The object as the pose sensor shows it.
    pub object: BodyState,
    /// Bodies that only effects know of, where they are.
    pub hidden: Vec<BodyState>,
}

/// Why there is no run, or only a part of one.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum RigError {
    /// The object cannot be a body.
    #[error("{what} of the object: expected {expected}")]
    Object {
        /// Which value.
        what: &'static str,
        /// What it should be.
        expected: &'static str,
    },
    /// The rig or the start lacks something.
    #[error("{what}: expected {expected}")]
    Setup {
        /// Which value.
        what: &'static str,
        /// What it should be.
        expected: &'static str,
    },
    /// The world went where no rig does, or a command led there.
    #[error("tick {tick}: the simulation diverged ({divergence:?})")]
    Diverged {
        /// The tick, from 0, at whose end that shows, or before which it does for the start.
        tick: usize,
        /// How.
        divergence: Divergence,
        /// Readings of the ticks before.
        readings: Vec<RigReading>,
    },
    /// The arm cannot go where its tool is sent.
    #[error("tick {tick}: the tool is sent out of reach")]
    OutOfReach {
        /// The tick, from 0.
        tick: usize,
        /// Why.
        #[source]
        source: IkError,
        /// Readings of the ticks before.
        readings: Vec<RigReading>,
    },
}

impl RigError {
    /// The readings before the error.
    #[must_use]
    pub fn readings(&self) -> &[RigReading] {
        match self {
            Self::Diverged { readings, .. } | Self::OutOfReach { readings, .. } => readings,
            _ => &[],
        }
    }
}

impl Rig {
    /// Duration of a tick, s, by the clock of the log.
    #[must_use]
    pub fn tick_secs(&self) -> f64 {
        self.world.control_period_secs * f64::from(self.tick_steps)
    }

    /// Runs the hypothesis `object`, `effects` from `start` on: a reading at the end of each tick of `commands` (places of the tool centre, m, base
    /// frame).
    ///
    /// # Errors
    ///
    /// [`RigError`]: an object that cannot be a body, a start without a place of the tool, or a world or a command that goes where it must not, with
    /// the readings up to there.
    pub fn run(
        &self,
        object: &RigObject,
        effects: &[Box<dyn Effect>],
        start: &RigStart,
        commands: &[[f64; 3]],
    ) -> Result<Vec<RigReading>, RigError> {
        let mut readings = Vec::with_capacity(commands.len());
        let mut run = run::Run::new(self, object, effects, start)?;
        for (tick, command) in commands.iter().enumerate() {
            match run.tick(*command) {
                Ok(reading) => readings.push(reading),
                Err(stop) => return Err(stop.at(tick, readings)),
            }
        }
        Ok(readings)
    }
}
