//! Rolling resistance.
//!
//! τ = c_rr N against the rolling part of the angular velocity, with N = m g of a body on the table. Without it a sphere would roll for
//! ever: rigid bodies of rapier have none.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | c_rr | `lever_m` | m | 0.0001 to 0.005 | engineering judgement; steel on steel below, wood on felt above |
//!
//! Shows in the pose of a sphere that was let go: it slows down and stops.
//!
//! Acts as a torque (F) on spheres on the table. A sphere rolling without slip slows down by 5/7 c_rr g / r.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{BodyView, Effect, Hooks, Load, Surroundings};

/// Torque c_rr N against the rolling of spheres; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RollingResistance {
    /// Lever arm c_rr, m.
    pub lever_m: f64,
}

parametric!(RollingResistance, "rolling_resistance", {
    lever_m: Parameter::new("m", [0.0001, 0.005], [0.0, 0.1], Neutral::Value(0.0)),
});

impl Effect for RollingResistance {
    fn hooks(&self) -> Hooks {
        Hooks::LOAD
    }

    fn load(&self, surroundings: &Surroundings, body: &BodyView, load: &mut Load) {
        let Some(radius_m) = body.rolling_radius_m else { return };
        if !body.on_table {
            return;
        }
        let [wx, wy, _] = body.angular_rps;
        let speed = wx.hypot(wy);
        if speed < 1e-9 {
            return;
        }
        // Never more than what brings the rolling sphere (7/5 m r² about the contact) to rest within the step.
        let stop = 1.4 * body.mass_kg * radius_m * radius_m * speed / surroundings.period_secs;
        let torque = (self.lever_m * body.mass_kg * surroundings.gravity_mps2).min(stop);
        load.torque_nm[0] -= torque * wx / speed;
        load.torque_nm[1] -= torque * wy / speed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn torque(angular_rps: [f64; 3], on_table: bool) -> [f64; 3] {
        let body = BodyView { rolling_radius_m: Some(0.04), on_table, angular_rps, ..BodyView::on_table(0.5) };
        let mut load = Load::default();
        let surroundings = Surroundings { gravity_mps2: 10.0, period_secs: 1.0 / 60.0 };
        RollingResistance { lever_m: 0.002 }.load(&surroundings, &body, &mut load);
        load.torque_nm
    }

    #[test]
    fn torque_is_lever_times_weight_against_the_rolling_direction() {
        let [x, y, z] = torque([3.0, 4.0, 7.0], true);
        assert!((x + 0.01 * 0.6).abs() < 1e-12 && (y + 0.01 * 0.8).abs() < 1e-12 && z == 0.0, "{x} {y} {z}");
        assert_eq!(torque([3.0, 4.0, 0.0], false), [0.0; 3]);
    }

    #[test]
    fn a_slow_sphere_is_stopped_and_not_turned_round() {
        let w = 1e-4;
        let stop = 1.4 * 0.5 * 0.04 * 0.04 * w * 60.0;
        assert!((torque([w, 0.0, 0.0], true)[0] + stop).abs() < 1e-15);
    }
}
