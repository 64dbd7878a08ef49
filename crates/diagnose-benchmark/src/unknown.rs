//! What no catalogue has: effects that the solver can only call unknown.

use std::sync::atomic::{AtomicU64, Ordering};

use physics_model::effect::{
    BodyRole, BodyView, Effect, ForceFilter, Hooks, Load, Surroundings, TableContact, ToolMoment,
};
use physics_model::world::Wrench;
use pomdp::Rng;
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

/// An effect outside the catalogue. SI units, base frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unknown {
    /// A pull to a point that falls with the cube of the distance, N·m³.
    Magnet {
        /// Where, m.
        place_m: [f64; 2],
        /// Force times the cube of the distance, N·m³.
        strength_nm3: f64,
    },
    /// A horizontal force that comes and goes.
    Gust {
        /// Its amplitude, N.
        force_n: [f64; 2],
        /// Its period, s.
        period_secs: f64,
    },
    /// The table shakes: a force on the object in proportion to its mass.
    TableVibration {
        /// Amplitude of the acceleration, m/s².
        acceleration_mps2: [f64; 2],
        /// Its period, s.
        period_secs: f64,
    },
    /// A force that goes around the origin and grows with the distance from it.
    Swirl {
        /// N/m.
        strength_npm: f64,
    },
    /// Friction that changes along the table in stripes: μ (1 + amplitude · sin(2π x / width)).
    StripedTable {
        /// Amplitude.
        amplitude: f64,
        /// Distance of two stripes, m.
        width_m: f64,
    },
    /// Friction that changes while an episode lasts: μ (1 + rate · t).
    FrictionOverTime {
        /// 1/s.
        rate_ps: f64,
    },
    /// The sensor's z axis also feels what acts along x, and its x axis has another gain than the others.
    ForceCrosstalk {
        /// Share of x that z reads.
        share: f64,
        /// Gain of x.
        gain: f64,
    },
    /// The tool is another ball than the log says.
    ToolRadius {
        /// True radius, m.
        radius_m: f64,
    },
}

impl Unknown {
    /// Number of kinds.
    pub const KINDS: usize = 8;

    /// One of the kind with this number, at three strengths.
    ///
    /// # Panics
    ///
    /// For a number from [`Self::KINDS`] on.
    #[must_use]
    pub fn draw(kind: usize, strength: usize, rng: &mut Rng) -> Self {
        let s = (strength as f64 + rng.random_range(0.0..1.0)) / 3.0;
        let between = |low: f64, high: f64| low + s * (high - low);
        let angle = rng.random_range(0.0..std::f64::consts::TAU);
        let along = |size: f64| [size * angle.cos(), size * angle.sin()];
        match kind {
            // At 5 cm 0.5 to 1.3 N, of the 1.7 N that friction holds.
            0 => Self::Magnet {
                place_m: [rng.random_range(-0.08..0.08), rng.random_range(-0.08..0.08)],
                strength_nm3: between(6e-5, 1.6e-4),
            },
            1 => Self::Gust { force_n: along(between(0.4, 1.0)), period_secs: rng.random_range(0.4..0.9) },
            2 => Self::TableVibration {
                acceleration_mps2: along(between(0.8, 2.0)),
                period_secs: rng.random_range(0.15..0.3),
            },
            3 => Self::Swirl { strength_npm: if angle > 3.0 { between(3.0, 9.0) } else { -between(3.0, 9.0) } },
            4 => Self::StripedTable { amplitude: between(0.3, 0.7), width_m: rng.random_range(0.06..0.1) },
            5 => Self::FrictionOverTime { rate_ps: between(0.1, 0.4) },
            6 => Self::ForceCrosstalk { share: between(0.15, 0.4), gain: 1.0 + between(0.1, 0.3) },
            // Its middle is 25 mm above the table: a larger one would press on that.
            7 => {
                Self::ToolRadius { radius_m: if angle > 3.0 { between(0.0225, 0.0245) } else { between(0.016, 0.012) } }
            }
            _ => panic!("no kind {kind}"),
        }
    }

    /// Name in tables.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Magnet { .. } => "magnet",
            Self::Gust { .. } => "gust",
            Self::TableVibration { .. } => "table_vibration",
            Self::Swirl { .. } => "swirl",
            Self::StripedTable { .. } => "striped_table",
            Self::FrictionOverTime { .. } => "friction_over_time",
            Self::ForceCrosstalk { .. } => "force_crosstalk",
            Self::ToolRadius { .. } => "tool_radius",
        }
    }

    /// For one episode: it keeps the time.
    #[must_use]
    pub fn build(&self) -> Box<dyn Effect> {
        Box::new(Acting { what: self.clone(), time_secs: AtomicU64::new(0) })
    }
}

/// The effect in a world. Forces are not told the time, but the mass is.
#[derive(Debug)]
struct Acting {
    what: Unknown,
    time_secs: AtomicU64,
}

impl Acting {
    fn time_secs(&self) -> f64 {
        f64::from_bits(self.time_secs.load(Ordering::Relaxed))
    }
}

/// Nearer than this, m, a magnet pulls no harder.
const MAGNET_SOFT_M: f64 = 0.04;

impl Effect for Acting {
    fn hooks(&self) -> Hooks {
        let force = Hooks::LOAD.and(Hooks::UNREST).and(Hooks::ASTRAY);
        match self.what {
            Unknown::Magnet { .. } | Unknown::Swirl { .. } => force,
            Unknown::Gust { .. } | Unknown::TableVibration { .. } => force.and(Hooks::MASS),
            Unknown::StripedTable { .. } => Hooks::FRICTION,
            Unknown::FrictionOverTime { .. } => Hooks::FRICTION.and(Hooks::MASS).and(Hooks::UNREST),
            Unknown::ForceCrosstalk { .. } => Hooks::FORCE,
            Unknown::ToolRadius { .. } => Hooks::NONE,
        }
    }

    fn mass_share(&self, time_secs: f64) -> f64 {
        self.time_secs.store(time_secs.to_bits(), Ordering::Relaxed);
        1.0
    }

    fn friction(&self, contact: &TableContact) -> f64 {
        match self.what {
            Unknown::StripedTable { amplitude, width_m } => {
                1.0 + amplitude * (std::f64::consts::TAU * contact.position_m[0] / width_m).sin()
            }
            Unknown::FrictionOverTime { rate_ps } => (1.0 + rate_ps * self.time_secs()).min(2.5),
            _ => 1.0,
        }
    }

    fn load(&self, _surroundings: &Surroundings, body: &BodyView, load: &mut Load) {
        if body.role != BodyRole::Object {
            return;
        }
        let wave = |period_secs: f64| (std::f64::consts::TAU * self.time_secs() / period_secs).sin();
        let [x, y, _] = body.position_m;
        let force = match self.what {
            Unknown::Magnet { place_m, strength_nm3 } => {
                let (dx, dy) = (place_m[0] - x, place_m[1] - y);
                let distance = dx.hypot(dy);
                let size = strength_nm3 / distance.max(MAGNET_SOFT_M).powi(3);
                // In the middle it holds instead of throwing.
                let size = size * (distance / MAGNET_SOFT_M).min(1.0);
                [size * dx / distance.max(1e-6), size * dy / distance.max(1e-6)]
            }
            Unknown::Gust { force_n, period_secs } => force_n.map(|f| f * wave(period_secs)),
            Unknown::TableVibration { acceleration_mps2, period_secs } => {
                acceleration_mps2.map(|a| body.mass_kg * a * wave(period_secs))
            }
            Unknown::Swirl { strength_npm } => [-strength_npm * y, strength_npm * x],
            _ => [0.0; 2],
        };
        load.force_n[0] += force[0];
        load.force_n[1] += force[1];
    }

    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        match self.what {
            Unknown::ForceCrosstalk { share, gain } => Some(Box::new(Crosstalk { share, gain })),
            _ => None,
        }
    }
}

#[derive(Debug)]
struct Crosstalk {
    share: f64,
    gain: f64,
}

impl ForceFilter for Crosstalk {
    fn apply(&mut self, _moment: &ToolMoment, wrench: &mut Wrench) {
        wrench.force_n[2] += self.share * wrench.force_n[0];
        wrench.force_n[0] *= self.gain;
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    #[test]
    fn every_tool_moves_above_the_table() {
        let mut rng = Seed(1).stream(Purpose::World, 0);
        for strength in (0..300).map(|i| i % 3) {
            let Unknown::ToolRadius { radius_m } = Unknown::draw(7, strength, &mut rng) else { panic!("another kind") };
            assert!((0.01..0.0249).contains(&radius_m) && (radius_m - 0.02).abs() > 0.002, "{radius_m}");
        }
    }
}
