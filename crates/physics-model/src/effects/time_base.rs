//! A clock of the readings that is fast or slow: Δt_read = r Δt.
//!
//! Velocities are read as v / r and accelerations as a / r². Poses at rest are not touched, which tells it from a wrong scale.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | r | `rate` | – | 0.94 to 1.06 | a camera that drops or doubles frames, engineering judgement |
//!
//! Shows in the pose when nothing drives the object: it seems to fall or to slow down too fast or too slowly.
//!
//! Acts on the duration of a control step (N), which really lasts 1 / r of what the clock says, and on the velocity readings (O). Commands and
//! forces of a log have the same clock.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks, Nominal};
use crate::state::BodyState;

/// The clock of the readings is fast or slow; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeBase {
    /// r: above 1 the clock is fast.
    pub rate: f64,
}

parametric!(TimeBase, "time_base", {
    rate: Parameter::new("", [0.94, 1.06], [0.1, 10.0], Neutral::Value(1.0)),
});

impl TimeBase {
    fn speed_up(body: &mut BodyState, factor: f64) {
        for value in body.linear_mps.iter_mut().chain(&mut body.angular_rps) {
            *value *= factor;
        }
    }
}

impl Effect for TimeBase {
    fn hooks(&self) -> Hooks {
        Hooks::NOMINAL.and(Hooks::POSE).when(self.rate != 1.0)
    }

    fn nominal(&self, nominal: &mut Nominal) {
        nominal.world.control_period_secs /= self.rate;
    }

    fn read(&self, body: &mut BodyState) {
        Self::speed_up(body, self.rate.recip());
    }

    fn unread(&self, body: &mut BodyState) {
        Self::speed_up(body, self.rate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::{assert_unread, nominal};

    #[test]
    fn apparent_gravity_is_that_of_the_fast_clock() {
        let effect = TimeBase { rate: 1.25 };
        let mut world = nominal();
        let read_secs = world.world.control_period_secs;
        effect.nominal(&mut world);
        // A fall from rest: positions are true, times are the clock's.
        let steps = 30.0;
        let true_secs = steps * world.world.control_period_secs;
        let apparent = 2.0 * (0.5 * 9.81 * true_secs * true_secs) / (steps * read_secs).powi(2);
        assert!((apparent - 9.81 / (1.25 * 1.25)).abs() < 1e-12, "{apparent}");
        let mut body = BodyState::at_rest([0.1; 3], 0.0);
        body.linear_mps = [0.0, 0.0, -9.81 * true_secs];
        effect.read(&mut body);
        assert!((body.linear_mps[2] + apparent * steps * read_secs).abs() < 1e-12);
        assert_eq!(body.position_m, [0.1; 3]);
        assert_unread(&effect);
    }
}
