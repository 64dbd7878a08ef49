//! The way of commands to the tool and to the joints of a rig.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::effect::signal::CommandChain;
use crate::effect::{CommandSpace, CommandStart, Effect, Hooks};
use crate::motion::JointMoment;
use crate::robot::{IkError, JointVector, Robot};
use crate::state::MAX_JOINTS;

/// Postures of an arm from places of its tool.
#[derive(Clone, Copy)]
pub(super) struct Postures<'a> {
    pub(super) robot: &'a Robot,
    pub(super) orientation: UnitQuaternion<f64>,
    last: JointVector,
}

impl<'a> Postures<'a> {
    pub(super) fn new(robot: &'a Robot, measured_rad: Option<&JointVector>) -> Self {
        let mut last = JointVector::zeros();
        last.as_mut_slice()[..robot.joint_count()].copy_from_slice(robot.home_rad());
        Self { robot, orientation: robot.tool_orientation(), last: measured_rad.copied().unwrap_or(last) }
    }

    /// The joints, rad, that bring the tool to `position_m`, near the last ones.
    pub(super) fn reach(&mut self, position_m: [f64; 3]) -> Result<&[f64], IkError> {
        let target = Isometry3::from_parts(Translation3::from(Vector3::from(position_m)), self.orientation);
        let count = self.robot.joint_count();
        let joints = self.robot.solve_ik(&self.last.as_slice()[..count], &target)?;
        self.last.as_mut_slice()[..count].copy_from_slice(&joints);
        Ok(&self.last.as_slice()[..count])
    }
}

/// Effects on commands, for as long as a run lasts: those of the tool's place first, then those of the joints.
pub(super) struct Drive<'a> {
    tool: Option<CommandChain>,
    joints: Option<(CommandChain, Postures<'a>, JointMoment)>,
}

impl<'a> Drive<'a> {
    /// A tool that has rested at `at_m`, with a command every `period_secs`.
    pub(super) fn new(
        effects: &[Box<dyn Effect>],
        at_m: [f64; 3],
        period_secs: f64,
        arm: Option<Postures<'a>>,
    ) -> Result<Self, IkError> {
        let start = |space, at| CommandStart { space, at, period_secs, play_rad: [0.0; MAX_JOINTS] };
        let in_joints = Hooks::JOINT_COMMAND;
        let tool = CommandChain::of_those(effects, &start(CommandSpace::Tool, &at_m), in_joints, false);
        let mut joints = None;
        if let Some(mut postures) = arm.filter(|_| Hooks::of(effects).contains(in_joints)) {
            let at_rad = postures.reach(at_m)?;
            let chain = CommandChain::of_those(effects, &start(CommandSpace::Joints, at_rad), in_joints, true);
            let moment = JointMoment::resting(at_rad);
            joints = chain.map(|chain| (chain, postures, moment));
        }
        Ok(Self { tool, joints })
    }

    /// Where the command for the end of the coming tick sends the tool.
    pub(super) fn follow(&mut self, mut position_m: [f64; 3]) -> Result<[f64; 3], IkError> {
        if let Some(chain) = &mut self.tool {
            chain.apply(&mut position_m);
        }
        if let Some((chain, postures, moment)) = &mut self.joints {
            *moment = JointMoment::resting(postures.reach(position_m)?);
            chain.apply(moment.position_rad_mut());
            position_m = postures.robot.base_from_tool(moment.position_rad()).translation.vector.into();
        }
        Ok(position_m)
    }

    /// Where the last command has sent the joints, if an effect on them makes that another place than that of the tool alone.
    pub(super) fn joints(&self) -> Option<JointMoment> {
        self.joints.as_ref().map(|(_, _, moment)| *moment)
    }
}
