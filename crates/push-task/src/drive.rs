//! The way of a command to the arm where an effect changes it.

use physics_model::effect::signal::CommandChain;
use physics_model::effect::{CommandSpace, CommandStart, Effects};
use physics_model::motion::{JointMoment, JointPath};
use physics_model::robot::Robot;
use physics_model::state::MAX_JOINTS;

use crate::model::Particle;

/// Effects on commands in an action. Commands are joint positions where the joints' way is known, else places of the tool.
pub(crate) struct Drive {
    chain: CommandChain,
    joints: Option<JointMoment>,
}

impl Drive {
    /// `None` where no effect changes commands.
    pub(crate) fn new(
        effects: Effects,
        period_secs: f64,
        start_m: [f64; 3],
        path: Option<&JointPath>,
        particle: &Particle,
    ) -> Option<Self> {
        let (space, at) = match path {
            Some(_) => (CommandSpace::Joints, particle.state.joints_rad.as_slice()),
            None => (CommandSpace::Tool, start_m.as_slice()),
        };
        let play_rad = particle.memory.as_ref().map_or([0.0; MAX_JOINTS], |memory| memory.play_rad);
        let start = CommandStart { space, at, period_secs, play_rad };
        let chain = CommandChain::new(effects.list, &start)?;
        Some(Self { chain, joints: path.map(|path| path.stopped(0.0)) })
    }

    /// Takes the command after `share` of the path, at whose end the tool should be at `position_m`; where tool and joints go.
    pub(crate) fn follow(
        &mut self,
        robot: &Robot,
        path: Option<&JointPath>,
        share: f64,
        mut position_m: [f64; 3],
        period_secs: f64,
    ) -> ([f64; 3], Option<JointMoment>) {
        if let (Some(path), Some(joints)) = (path, &mut self.joints) {
            let mut moment = path.stopped(share);
            self.chain.apply(moment.position_rad_mut());
            moment.follow(joints, period_secs);
            *joints = moment;
            position_m = robot.base_from_tool(moment.position_rad()).translation.vector.into();
        } else {
            self.chain.apply(&mut position_m);
        }
        (position_m, self.joints)
    }

    pub(crate) fn settling_steps(&self) -> u32 {
        self.chain.settling_steps()
    }

    pub(crate) fn play_rad(&self) -> Option<[f64; MAX_JOINTS]> {
        self.chain.play_rad()
    }

    /// Where the last command has brought the joints, rad.
    pub(crate) fn joints_rad(&self) -> Option<Vec<f64>> {
        self.joints.map(|joints| joints.position_rad().to_vec())
    }
}
