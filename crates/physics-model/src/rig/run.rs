//! A run in the making: world, chains and what they remember from tick to tick.

use super::drive::{Drive, Postures};
use super::start::{check_place, check_start, lead_ticks};
use super::{Rig, RigError, RigObject, RigReading, RigStart, RigTool};
use crate::effect::signal::{self, ForceChain, PoseChain};
use crate::effect::{Effect, Effects, Nominal, ToolMoment};
use crate::motion::{JointMoment, ToolMotion, joint_torques};
use crate::robot::{IkError, JointVector, ToolShape};
use crate::world::{Divergence, ToolPose, World, Wrench};

/// How many places of the tool its acceleration follows from.
const MOTION_TICKS: usize = 3;

/// Why a run stops.
pub(super) enum Stop {
    Diverged(Divergence),
    OutOfReach(IkError),
}

impl From<IkError> for Stop {
    fn from(error: IkError) -> Self {
        Self::OutOfReach(error)
    }
}

impl Stop {
    pub(super) fn at(self, tick: usize, readings: Vec<RigReading>) -> RigError {
        match self {
            Self::Diverged(divergence) => RigError::Diverged { tick, divergence, readings },
            Self::OutOfReach(source) => RigError::OutOfReach { tick, source, readings },
        }
    }
}

/// The arm's motion, for its torques.
struct ArmMotion<'a> {
    postures: Postures<'a>,
    moment: JointMoment,
}

pub(super) struct Run<'a> {
    rig: &'a Rig,
    effects: Effects<'a>,
    world: World<'a>,
    drive: Drive<'a>,
    /// Where the tool was sent by the last command, m.
    sent_m: [f64; 3],
    motion: ToolMotion,
    arm: Option<ArmMotion<'a>>,
    forces: Option<ForceChain>,
    poses: PoseChain,
    /// Since the episode began, and of a tick, s, by a true clock.
    time_secs: f64,
    tick_secs: f64,
    /// R(base ← tool).
    orientation: [f64; 4],
    gravity_mps2: f64,
}

impl<'a> Run<'a> {
    pub(super) fn new(
        rig: &'a Rig,
        object: &RigObject,
        effects: &'a [Box<dyn Effect>],
        start: &RigStart<'a>,
    ) -> Result<Self, RigError> {
        object.check()?;
        rig.check()?;
        let (tool, earlier) = (&rig.tool, start.earlier_commands);
        let first_m = match (tool, earlier.first().or(start.tool_m.as_ref())) {
            (RigTool::None, _) => [0.0; 3],
            (_, Some(at)) => *at,
            (_, None) => return Err(RigError::Setup { what: "the tool's place at the start", expected: "one" }),
        };
        Self::begin(rig, object, effects, start, first_m).map_err(|stop| stop.at(0, Vec::new()))
    }

    fn begin(
        rig: &'a Rig,
        object: &RigObject,
        effects: &'a [Box<dyn Effect>],
        start: &RigStart<'a>,
        first_m: [f64; 3],
    ) -> Result<Self, Stop> {
        let effects = Effects::new(effects);
        let (config, theta) = rig.nominal(object);
        let nominal = Nominal::with_effects(&config, &theta, effects.list);
        let nominal = nominal.unwrap_or_else(|| Nominal::new(&config, &theta));
        let tick_secs = nominal.world.control_period_secs * f64::from(rig.tick_steps);
        // The clock of the log may be fast.
        let rate = rig.world.control_period_secs / nominal.world.control_period_secs;

        let mut body = signal::unread(effects.list, &start.object);
        let lead = lead_ticks(effects, tick_secs, start.earlier_commands.len(), &mut body);
        check_start(&body)?;
        let time_secs = start.time_secs / rate - f64::from(lead as u32) * tick_secs;

        let postures = match &rig.tool {
            RigTool::Arm(robot) => Some(Postures::new(robot, start.joints_rad.as_ref())),
            RigTool::None | RigTool::Ball { .. } => None,
        };
        check_place(first_m)?;
        let mut drive = Drive::new(effects.list, first_m, tick_secs, postures)?;
        let mut motion = ToolMotion::new(first_m, tick_secs);
        let (past, lead_commands) = start.earlier_commands.split_at(start.earlier_commands.len() - lead);
        // Without a tool they are only counted.
        let past = if matches!(rig.tool, RigTool::None) { &[] } else { past };
        let (sent_m, arm) = follow_past(past, first_m, (&mut drive, &mut motion), postures, tick_secs)?;

        let measured_m = start.tool_m.filter(|_| lead == 0).unwrap_or(sent_m);
        let orientation = postures.map_or([0.0, 0.0, 0.0, 1.0], |postures| {
            let q = postures.orientation;
            [q.i, q.j, q.k, q.w]
        });
        let ball;
        let shapes: &[ToolShape] = match &rig.tool {
            RigTool::None => &[],
            RigTool::Ball { radius_m } => {
                ball = [ToolShape::Ball { center_m: [0.0; 3], radius_m: *radius_m }];
                &ball
            }
            RigTool::Arm(robot) => robot.tool_shapes(),
        };
        let hangs = nominal.tool_stiffness_npm.is_finite();
        let place = ToolPose { position_m: if hangs { measured_m } else { sent_m }, orientation };
        check_place(place.position_m)?;
        let world = World::restore_rig(&config, effects.list, &theta, object.beyond(), &body, &place, shapes)
            .sliding(rig.tool_slip_mps, rig.cone_exponent)
            .later(time_secs, start.hidden)
            .deflected_from(sent_m);
        motion.shift_to(place.position_m);
        if let Some(divergence) = world.divergence() {
            return Err(Stop::Diverged(divergence));
        }
        let mut run = Self {
            rig,
            effects,
            world,
            drive,
            sent_m,
            motion,
            arm,
            forces: ForceChain::new(effects.list, tick_secs),
            poses: PoseChain::new(effects.list, tick_secs, &body),
            time_secs,
            tick_secs,
            orientation,
            gravity_mps2: nominal.world.gravity_mps2,
        };
        for command in lead_commands {
            run.tick(*command)?;
        }
        Ok(run)
    }

    /// One tick, at whose end the tool is commanded to be at `command_m`.
    pub(super) fn tick(&mut self, command_m: [f64; 3]) -> Result<RigReading, Stop> {
        let has_tool = !matches!(self.rig.tool, RigTool::None);
        if has_tool {
            check_place(command_m)?;
            let sent_m = self.drive.follow(command_m)?;
            check_place(sent_m)?;
            let from_m = std::mem::replace(&mut self.sent_m, sent_m);
            let wrench = self.steps(from_m);
            self.end(Some(wrench))
        } else {
            self.steps(self.sent_m);
            self.end(None)
        }
    }

    /// The engine steps of a tick; the mean wrench on the tool.
    fn steps(&mut self, from_m: [f64; 3]) -> Wrench {
        let (steps, to_m) = (self.rig.tick_steps, self.sent_m);
        let mut mean = Wrench::default();
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            let at_m = std::array::from_fn(|i| to_m[i] + (1.0 - share) * (from_m[i] - to_m[i]));
            mean.add_scaled(&self.world.step(at_m), 1.0 / f64::from(steps));
        }
        mean
    }

    fn end(&mut self, wrench: Option<Wrench>) -> Result<RigReading, Stop> {
        self.time_secs += self.tick_secs;
        if let Some(divergence) = self.world.divergence() {
            return Err(Stop::Diverged(divergence));
        }
        let mut reading = RigReading {
            tool_m: None,
            joints_rad: JointVector::zeros(),
            wrench: Wrench::default(),
            joint_torque_nm: JointVector::zeros(),
            object: self.poses.read(self.effects.list, &self.world.object()),
            hidden: self.world.hidden(),
        };
        let Some(mut wrench) = wrench else { return Ok(reading) };
        let gives_way = self.world.tool_gives_way();
        let tool_m = if gives_way { self.world.tool_position_m() } else { self.sent_m };
        reading.tool_m = Some(tool_m);
        let acceleration_mps2 = self.motion.acceleration(tool_m);
        if let Some(forces) = &mut self.forces {
            let (time_secs, orientation, gravity_mps2) = (self.time_secs, self.orientation, self.gravity_mps2);
            forces.apply(&ToolMoment { time_secs, orientation, acceleration_mps2, gravity_mps2 }, &mut wrench);
        }
        reading.wrench = wrench;
        if let Some(arm) = &mut self.arm {
            let sent = self.drive.joints().filter(|_| !gives_way);
            arm.go(sent, tool_m, self.tick_secs)?;
            let joints = arm.moment.position_rad();
            reading.joints_rad.as_mut_slice()[..joints.len()].copy_from_slice(joints);
            reading.joint_torque_nm = joint_torques(arm.postures.robot, self.effects, &arm.moment, &wrench);
        }
        Ok(reading)
    }
}

/// Follows commands that were given before the run begins. Where the tool is sent then, m, and how the arm moves there.
fn follow_past<'a>(
    past: &[[f64; 3]],
    first_m: [f64; 3],
    (drive, motion): (&mut Drive<'a>, &mut ToolMotion),
    postures: Option<Postures<'a>>,
    tick_secs: f64,
) -> Result<([f64; 3], Option<ArmMotion<'a>>), Stop> {
    let (mut sent_m, mut arm) = (first_m, None);
    for (i, command) in past.iter().enumerate() {
        check_place(*command)?;
        sent_m = drive.follow(*command)?;
        motion.acceleration(sent_m);
        if i + MOTION_TICKS >= past.len() {
            arm = ArmMotion::follow(arm, postures, drive, sent_m, tick_secs)?;
        }
    }
    if arm.is_none() {
        arm = ArmMotion::follow(None, postures, drive, sent_m, tick_secs)?;
    }
    Ok((sent_m, arm))
}

impl<'a> ArmMotion<'a> {
    /// The arm after one more place of the tool, from rest at the first.
    fn follow(
        arm: Option<Self>,
        postures: Option<Postures<'a>>,
        drive: &Drive,
        sent_m: [f64; 3],
        period_secs: f64,
    ) -> Result<Option<Self>, IkError> {
        match (arm, postures) {
            (Some(mut arm), _) => {
                arm.go(drive.joints(), sent_m, period_secs)?;
                Ok(Some(arm))
            }
            (None, Some(mut postures)) => {
                let moment = match drive.joints() {
                    Some(joints) => joints,
                    None => JointMoment::resting(postures.reach(sent_m)?),
                };
                Ok(Some(Self { postures, moment }))
            }
            (None, None) => Ok(None),
        }
    }

    /// To the joints `sent`, or to where they have the tool at `tool_m`.
    fn go(&mut self, sent: Option<JointMoment>, tool_m: [f64; 3], period_secs: f64) -> Result<(), IkError> {
        let mut moment = match sent {
            Some(moment) => moment,
            None => JointMoment::resting(self.postures.reach(tool_m)?),
        };
        moment.follow(&self.moment, period_secs);
        self.moment = moment;
        Ok(())
    }
}
