//! Where a run can begin, and how much earlier its world does.

use nalgebra::{UnitQuaternion, Vector3};

use super::run::Stop;
use super::{Rig, RigError, RigTool};
use crate::effect::{Effects, Hooks};
use crate::state::{BodyState, unit_quaternion};
use crate::world::Divergence;

/// Farthest place, m, and fastest spin, rad/s, that is looked at: what lies beyond leaves the numbers that the engine can reckon with.
const FARTHEST_M: f64 = 1000.0;
const FASTEST_SPIN_RPS: f64 = 1000.0;
/// How many ticks before the start the world begins because its poses are read late, and `body` moved to where it was then. The reading at the
/// start is that of the delay before, unless the episode has only begun: then it is where everything rested.
pub(super) fn lead_ticks(effects: Effects, tick_secs: f64, earlier: usize, body: &mut BodyState) -> usize {
    if !effects.hooks.contains(Hooks::POSE_DELAY) {
        return 0;
    }
    let delay_secs: f64 = effects.list.iter().map(|effect| effect.pose_delay_secs()).sum();
    let ticks = (delay_secs / tick_secs).ceil();
    if ticks > earlier as f64 {
        return earlier;
    }
    // Less than a tick, in which the velocity hardly changes.
    let back_secs = ticks * tick_secs - delay_secs;
    for (position, velocity) in body.position_m.iter_mut().zip(body.linear_mps) {
        *position -= velocity * back_secs;
    }
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from(body.angular_rps) * -back_secs);
    let turned = turn * unit_quaternion(body.orientation);
    body.orientation = [turned.i, turned.j, turned.k, turned.w];
    ticks as usize
}

pub(super) fn check_place(position_m: [f64; 3]) -> Result<(), Stop> {
    match position_m {
        p if p.iter().any(|v| !v.is_finite()) => Err(Stop::Diverged(Divergence::NotFinite)),
        p if p.iter().any(|v| v.abs() > FARTHEST_M) => Err(Stop::Diverged(Divergence::Flies)),
        _ => Ok(()),
    }
}

pub(super) fn check_start(body: &BodyState) -> Result<(), Stop> {
    check_place(body.position_m)?;
    if !body.to_array().iter().all(|v| v.is_finite()) || body.orientation.iter().all(|v| v.abs() < 1e-3) {
        return Err(Stop::Diverged(Divergence::NotFinite));
    }
    if body.linear_mps.iter().any(|v| v.abs() > FARTHEST_M)
        || body.angular_rps.iter().any(|w| w.abs() > FASTEST_SPIN_RPS)
    {
        return Err(Stop::Diverged(Divergence::Flies));
    }
    Ok(())
}

impl Rig {
    pub(super) fn check(&self) -> Result<(), RigError> {
        let refuse = |what, expected| Err(RigError::Setup { what, expected });
        if self.tick_steps == 0 {
            return refuse("tick_steps", "at least 1");
        }
        if !(self.world.control_period_secs > 0.0 && self.world.control_period_secs <= 1.0) {
            return refuse("control_period_secs", "more than 0, up to 1 s");
        }
        if !(0.0..=1.0).contains(&self.tool_slip_mps) {
            return refuse("tool_slip_mps", "0 to 1 m/s");
        }
        if !(0.01..=100.0).contains(&self.cone_exponent) {
            return refuse("cone_exponent", "0.01 to 100");
        }
        if let RigTool::Ball { radius_m } = self.tool
            && !(1e-4..=10.0).contains(&radius_m)
        {
            return refuse("the tool's radius", "0.1 mm to 10 m");
        }
        Ok(())
    }
}
