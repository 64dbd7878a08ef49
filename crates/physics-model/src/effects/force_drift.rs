//! An offset of the force sensor that grows.
//!
//! f_read = f + d t, t: time since the episode began.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | d | `drift_x_nps`, `drift_y_nps`, `drift_z_nps` | N/s | magnitude 0.00017 to 0.0017 | 0.01 to 0.1 N/min, engineering judgement |
//!
//! Shows in the force without contact, late in long episodes.
//!
//! Acts on the force readings (O), along the base axes at the tool centre, as [`super::ForceBias`].

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, ForceFilter, Hooks, ToolMoment};
use crate::world::Wrench;

/// The force sensor's offset grows; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceDrift {
    /// Along x of the base frame, N/s.
    pub drift_x_nps: f64,
    /// Along y, N/s.
    pub drift_y_nps: f64,
    /// Along z, N/s.
    pub drift_z_nps: f64,
}

const DRIFT: Parameter = Parameter::new("N/s", [-0.0017, 0.0017], [-100.0, 100.0], Neutral::Value(0.0));

parametric!(ForceDrift, "force_drift", { drift_x_nps: DRIFT, drift_y_nps: DRIFT, drift_z_nps: DRIFT });

impl Effect for ForceDrift {
    fn hooks(&self) -> Hooks {
        let drifts = [self.drift_x_nps, self.drift_y_nps, self.drift_z_nps] != [0.0; 3];
        Hooks::FORCE.and(Hooks::MEMORY).when(drifts)
    }

    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        Some(Box::new(self.clone()))
    }
}

impl ForceFilter for ForceDrift {
    fn apply(&mut self, moment: &ToolMoment, wrench: &mut Wrench) {
        for (force, drift) in wrench.force_n.iter_mut().zip([self.drift_x_nps, self.drift_y_nps, self.drift_z_nps]) {
            *force += drift * moment.time_secs;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::moment;

    #[test]
    fn the_offset_is_the_drift_times_the_time_since_the_episode_began() {
        let mut filter = ForceDrift { drift_x_nps: 0.001, drift_y_nps: 0.0, drift_z_nps: -0.002 }.force(0.01).unwrap();
        let mut wrench = Wrench::default();
        filter.apply(&moment(30.0), &mut wrench);
        assert!((wrench.force_n[0] - 0.03).abs() < 1e-12 && (wrench.force_n[2] + 0.06).abs() < 1e-12, "{wrench:?}");
    }
}
