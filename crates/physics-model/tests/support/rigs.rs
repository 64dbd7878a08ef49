//! A rig with a table and whatever tool.

use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::rig::{Rig, RigTool};

/// Gravity, m/s².
pub(crate) const G: f64 = 9.81;

/// Two steps a tick of 0.01 s.
pub(crate) fn rig(tool: RigTool) -> Rig {
    let world = WorldConfig {
        control_period_secs: 0.005,
        control_steps: 1,
        solver_iterations: 2,
        contact_frequency_hz: 60.0,
        contact_damping_ratio: 5.0,
        table_height_m: 0.0,
        gravity_mps2: G,
        tool_friction: 0.1,
        obstacle_friction: 0.5,
        arm_stiffness_npm: 50_000.0,
        restitution: 0.0,
        obstacle_mobility: ObstacleMobility::Fixed,
    };
    Rig { world, tick_steps: 2, tool, tool_slip_mps: 0.0, cone_exponent: 1.0 }
}
