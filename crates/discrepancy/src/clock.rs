//! Clocks of object and force against that of the tool.
//!
//! Recorders stamp what they get, and camera, arm and force sensor come by different ways. A skew is the commonest defect of a rig and no effect: it is
//! re-tuned like a mass, before anything is named, and reported. Poses may be early or late by 50 ms; what is later is `pose_delay`. Forces come by
//! the same wire as the tool's column as a rule, and are late where a sensor filters or queues them: they may be early by 50 ms, which is
//! the tool's column being late, and late by 5 ms; what is later is `force_delay`. A skew gives way where such an effect is tried.

use physics_model::EffectKind;
use physics_model::effect::signal::Blend as _;
use physics_model::rig::RigReading;

use crate::model::STEP;
use crate::trial::Kind;

/// Spacing of the coordinates that are looked at, in standard deviations.
const SPACING: f64 = 0.5;

/// A clock that differs from the tool's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clock {
    /// Of the object's poses and velocities.
    Object,
    /// Of the force at the wrist.
    Force,
}

impl Clock {
    pub(crate) const ALL: [Self; 2] = [Self::Object, Self::Force];

    /// Key in reports and model files.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Object => "clock.object_secs",
            Self::Force => "clock.force_secs",
        }
    }

    /// Standard deviation of its skew, s: a frame of a fast camera, or of a slow one.
    pub(crate) fn stddev_secs(self) -> f64 {
        match self {
            Self::Object => 0.01,
            Self::Force => 0.005,
        }
    }

    /// How far its skew reaches, in standard deviations.
    pub(crate) fn range(self) -> [f64; 2] {
        match self {
            Self::Object => [-5.0, 5.0],
            Self::Force => [-10.0, 1.0],
        }
    }

    /// Step of a finite difference at `z`, away from the border.
    pub(crate) fn step(self, z: f64) -> f64 {
        if z + STEP <= self.range()[1] { STEP } else { -STEP }
    }

    /// Coordinates to begin from: a contact begins within a tick, and a descent does not see one that begins beyond it.
    pub(crate) fn grid(self) -> Vec<f64> {
        let [from, to] = self.range();
        (0..=((to - from) / SPACING) as u32).map(|place| from + SPACING * f64::from(place)).collect()
    }

    /// Whether it stamps a channel.
    pub(crate) fn stamps(self, channel: Kind) -> bool {
        use Kind as K;
        match self {
            Self::Object => {
                matches!(channel, K::ObjectPosition | K::ObjectOrientation | K::ObjectVelocity | K::ObjectSpin)
            }
            Self::Force => matches!(channel, K::WristForce | K::WristTorque),
        }
    }

    /// Whether an effect says the same and more.
    pub(crate) fn gives_way_to(self, kind: EffectKind) -> bool {
        match self {
            Self::Object => kind == EffectKind::PoseDelay,
            Self::Force => kind == EffectKind::ForceDelay,
        }
    }
}

/// Readings as clocks that are late by `skews_secs`, in the order of [`Clock::ALL`], stamp them. Before the start what is there then holds, after the end what was read last.
pub(crate) fn skewed(
    readings: &[RigReading],
    start: &RigReading,
    skews_secs: [f64; 2],
    tick_secs: f64,
) -> Vec<RigReading> {
    let mut skewed = readings.to_vec();
    let at = |tick: usize| if tick == 0 { start } else { &readings[(tick - 1).min(readings.len() - 1)] };
    for (clock, skew_secs) in Clock::ALL.into_iter().zip(skews_secs).filter(|(_, skew_secs)| *skew_secs != 0.0) {
        for (index, reading) in skewed.iter_mut().enumerate() {
            let tick = (index as f64 + 1.0 - skew_secs / tick_secs).max(0.0);
            let (before, after, share) = (at(tick as usize), at(tick as usize + 1), tick.fract());
            match clock {
                Clock::Object => reading.object = before.object.blend(&after.object, share),
                Clock::Force => reading.wrench = before.wrench.blend(&after.wrench, share),
            }
        }
    }
    skewed
}

#[cfg(test)]
mod tests {
    use physics_model::BodyState;
    use physics_model::world::Wrench;

    use super::*;

    fn reading(tick: f64) -> RigReading {
        RigReading {
            tool_m: Some([0.0; 3]),
            joints_rad: Default::default(),
            wrench: Wrench { force_n: [tick, 0.0, 0.0], torque_nm: [0.0; 3] },
            joint_torque_nm: Default::default(),
            object: BodyState::at_rest([0.1 * tick, 0.0, 0.0], 0.0),
            hidden: Vec::new(),
        }
    }

    #[test]
    fn a_late_clock_stamps_what_was_and_an_early_one_what_will_be() {
        let readings: Vec<RigReading> = (1..=10).map(|tick| reading(f64::from(tick))).collect();
        let found = skewed(&readings, &reading(0.0), [0.015, -0.02], 0.01);
        for (index, found) in found.iter().enumerate() {
            let tick = index as f64 + 1.0;
            assert!((found.object.position_m[0] - 0.1 * (tick - 1.5).max(0.0)).abs() < 1e-12, "{tick}: {found:?}");
            assert_eq!(found.wrench.force_n[0], (tick + 2.0).min(10.0));
        }
        assert_eq!(skewed(&readings, &reading(0.0), [0.0; 2], 0.01), readings);
    }
}
