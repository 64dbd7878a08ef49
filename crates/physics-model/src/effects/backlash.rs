//! Play in the joints: after a reversal the drive turns by the gap before the joint follows.
//!
//! q ← clamp(q, m − gap / 2, m + gap / 2), m: position of the drive.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | gap | `gap_rad` | rad | 0.0002 to 0.003 | geared arms, engineering judgement |
//!
//! Shows in the joints after a reversal: they stand still while the command already moves on.
//!
//! Acts on the commanded joint positions (A), the same for every joint. A drive moves by what is commanded, so that a move that goes on in
//! the same direction has its full length. Where each joint stands in its play outlives the action ([`crate::effect::Memory::play_rad`]);
//! an episode starts in the middle of it. Needs joints: it does nothing to a tool without an arm.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{CommandFilter, CommandSpace, CommandStart, Effect, Hooks};
use crate::state::MAX_JOINTS;

/// Joints have play; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Backlash {
    /// Width of the play, rad.
    pub gap_rad: f64,
}

parametric!(Backlash, "backlash", {
    gap_rad: Parameter::new("rad", [0.0002, 0.003], [0.0, 0.1], Neutral::Value(0.0)),
});

impl Effect for Backlash {
    fn hooks(&self) -> Hooks {
        Hooks::COMMAND.and(Hooks::JOINT_COMMAND).and(Hooks::MEMORY).when(self.gap_rad != 0.0)
    }

    fn command(&self, start: &CommandStart) -> Option<Box<dyn CommandFilter>> {
        if start.space != CommandSpace::Joints {
            return None;
        }
        let mut joint = [0.0; MAX_JOINTS];
        joint[..start.at.len()].copy_from_slice(start.at);
        // Commands speak of the joint: the drive starts that much beside it.
        Some(Box::new(Play { half_gap: 0.5 * self.gap_rad, joint, play: start.play_rad, beside: start.play_rad }))
    }
}

#[derive(Debug)]
struct Play {
    half_gap: f64,
    joint: [f64; MAX_JOINTS],
    /// Joint less drive, now and at the start.
    play: [f64; MAX_JOINTS],
    beside: [f64; MAX_JOINTS],
}

impl CommandFilter for Play {
    fn apply(&mut self, signal: &mut [f64]) {
        for (j, value) in signal.iter_mut().enumerate() {
            let drive = *value - self.beside[j];
            self.joint[j] = self.joint[j].clamp(drive - self.half_gap, drive + self.half_gap);
            self.play[j] = self.joint[j] - drive;
            *value = self.joint[j];
        }
    }

    fn play_rad(&self) -> Option<[f64; MAX_JOINTS]> {
        Some(self.play)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dead_band_is_the_gap_and_comes_at_reversals_alone() {
        let effect = Backlash { gap_rad: 0.002 };
        let at = [0.3];
        let mut play_rad = [0.0; MAX_JOINTS];
        play_rad[0] = -0.001;
        let start = CommandStart { space: CommandSpace::Joints, at: &at, period_secs: 0.01, play_rad };
        let mut filter = effect.command(&start).unwrap();
        let mut follow = |command: f64| {
            let mut signal = [command];
            filter.apply(&mut signal);
            signal[0]
        };
        // The play is taken up upwards: a move upwards has its full length.
        assert!((follow(0.305) - 0.305).abs() < 1e-12 && (follow(0.31) - 0.31).abs() < 1e-12);
        // Back by less than the gap: nothing. By more: short by the gap.
        assert!((follow(0.3085) - 0.31).abs() < 1e-12);
        assert!((follow(0.3) - 0.302).abs() < 1e-12);
        assert!((follow(0.29) - 0.292).abs() < 1e-12);
        assert!((filter.play_rad().unwrap()[0] - 0.001).abs() < 1e-12, "taken up downwards");
        assert!(effect.command(&CommandStart { space: CommandSpace::Tool, ..start }).is_none());
    }
}
