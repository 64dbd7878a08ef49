//! Standard deviations of the sensors: as `log.toml` says, else estimated from the log.

use measured_log::{Log, Noise};

use crate::trial::{Kind, orientations};

/// Of a normal variable: median of |x| over its standard deviation.
const MEDIAN_SHARE: f64 = 0.674_489_75;

/// Standard deviation of one component of each kind; `None` where the log has no such column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NoiseLevels([Option<f64>; 9]);

impl NoiseLevels {
    /// Of a log. What its header does not say is the median of |x(t−1) − 2 x(t) + x(t+1)| / (0.6745 √6): smooth motion does not count, and
    /// jumps are few.
    #[must_use]
    pub fn of_log(log: &Log) -> Self {
        let joints = usize::from(log.header.robot.joints());
        Self(Kind::ALL.map(|kind| {
            let estimated = estimate(log, kind, joints)?;
            Some(given(&log.header.noise, kind).unwrap_or(estimated))
        }))
    }

    /// Of a kind.
    #[must_use]
    pub fn of(&self, kind: Kind) -> Option<f64> {
        self.0[kind as usize]
    }
}

fn given(noise: &Noise, kind: Kind) -> Option<f64> {
    match kind {
        Kind::ObjectPosition => noise.object_position_m,
        Kind::ObjectOrientation => noise.object_orientation_rad,
        Kind::ObjectVelocity => noise.object_velocity_mps,
        Kind::ObjectSpin => noise.object_spin_rps,
        Kind::ToolPosition => noise.tool_position_m,
        Kind::JointPosition => noise.joint_position_rad,
        Kind::WristForce => noise.wrist_force_n,
        Kind::WristTorque => noise.wrist_torque_nm,
        Kind::JointTorque => noise.joint_torque_nm,
    }
}

/// Below this a sensor is exact for our purposes: what a rounded column shows. In the kind's unit.
fn smallest(kind: Kind) -> f64 {
    match kind {
        Kind::ObjectPosition | Kind::ToolPosition => 1e-4,
        Kind::ObjectOrientation => 1e-3,
        Kind::ObjectVelocity => 1e-3,
        Kind::ObjectSpin => 1e-2,
        Kind::JointPosition => 1e-4,
        Kind::WristForce => 1e-2,
        Kind::WristTorque => 1e-3,
        Kind::JointTorque => 1e-2,
    }
}

fn estimate(log: &Log, kind: Kind, joints: usize) -> Option<f64> {
    let mut curvatures = Vec::new();
    let mut any = false;
    for episode in &log.episodes {
        if kind == Kind::ObjectOrientation {
            let turns = orientations(episode);
            any |= turns.iter().any(Option::is_some);
            for window in turns.windows(3) {
                if let [Some(a), Some(b), Some(c)] = window {
                    let (before, after) = ((a * b.inverse()).scaled_axis(), (c * b.inverse()).scaled_axis());
                    curvatures.extend((before + after).iter().map(|v| v.abs()));
                }
            }
        }
        for channel in kind.channels(joints) {
            let Some(readings) = episode.channels.get(&channel) else { continue };
            any |= readings.count() > 0;
            let values: Vec<Option<f64>> = readings.iter().collect();
            for window in values.windows(3) {
                if let [Some(a), Some(b), Some(c)] = window {
                    curvatures.push((a - 2.0 * b + c).abs());
                }
            }
        }
    }
    if !any {
        return None;
    }
    curvatures.sort_by(f64::total_cmp);
    let median = curvatures.get(curvatures.len() / 2).copied().unwrap_or(0.0);
    Some((median / (MEDIAN_SHARE * 6.0_f64.sqrt())).max(smallest(kind)))
}
