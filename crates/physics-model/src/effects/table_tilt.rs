//! A table that is not level.

use serde::{Deserialize, Serialize};

use crate::effect::Effect;

/// Gravity g (s_x, s_y) along the table. Plausible: up to 3°.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableTilt {
    /// Slope angle along x, rad; positive pulls towards +x.
    pub slope_x_rad: f64,
    /// Slope angle along y, rad; positive pulls towards +y.
    pub slope_y_rad: f64,
}

impl Effect for TableTilt {
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
