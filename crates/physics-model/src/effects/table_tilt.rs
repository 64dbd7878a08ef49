//! A table that is not level.
//!
//! g = g (sin s_x, sin s_y, −√(1 − sin² s_x − sin² s_y)).
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | s_x, s_y | `slope_x_rad`, `slope_y_rad` | rad | up to 0.0524 (3°) either way | engineering judgement |
//!
//! Shows in path and force: what slides drifts downhill, and pushes uphill take more force than those downhill.
//!
//! Acts as the direction of gravity (N): on every body in proportion to its mass.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};

/// Gravity g (s_x, s_y) along the table; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableTilt {
    /// Slope angle along x, rad; positive pulls towards +x.
    pub slope_x_rad: f64,
    /// Slope angle along y, rad; positive pulls towards +y.
    pub slope_y_rad: f64,
}

parametric!(TableTilt, "table_tilt", {
    slope_x_rad: Parameter::new("rad", [-0.0524, 0.0524], [-0.7, 0.7], Neutral::Value(0.0)),
    slope_y_rad: Parameter::new("rad", [-0.0524, 0.0524], [-0.7, 0.7], Neutral::Value(0.0)),
});

impl Effect for TableTilt {
    fn hooks(&self) -> Hooks {
        Hooks::GRAVITY.and(Hooks::UNREST.when(self.slope_x_rad != 0.0 || self.slope_y_rad != 0.0))
    }

    fn gravity(&self, gravity_mps2: &mut [f64; 3]) {
        let g = gravity_mps2.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (sx, sy) = (self.slope_x_rad.sin(), self.slope_y_rad.sin());
        // Added to what is there, so that two tilts make one steeper.
        let (x, y) = (gravity_mps2[0] + g * sx, gravity_mps2[1] + g * sy);
        *gravity_mps2 = [x, y, -(g * g - x * x - y * y).max(0.0).sqrt()];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilt_turns_gravity_and_keeps_its_magnitude() {
        let mut g = [0.0, 0.0, -9.81];
        TableTilt { slope_x_rad: 0.03, slope_y_rad: -0.02 }.gravity(&mut g);
        assert!((g[0] - 9.81 * 0.03_f64.sin()).abs() < 1e-12 && g[1] < 0.0);
        assert!((g.iter().map(|v| v * v).sum::<f64>().sqrt() - 9.81).abs() < 1e-12);
    }
}
