//! The seam for physical effects that a rigid-body world lacks: the true world and the model each have their own list.

use serde::{Deserialize, Serialize};

use crate::effects::{RollingResistance, TableTilt, ViscousDamping};

/// A free body as an effect sees it, before each control step. SI units, base axes.
#[derive(Clone, Copy, Debug)]
pub struct BodyView {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Radius, m, of a body that rolls (sphere); `None` for others.
    pub rolling_radius_m: Option<f64>,
    /// Whether the body rests on or touches the table.
    pub on_table: bool,
    /// Velocity of the centre of mass, m/s.
    pub linear_mps: [f64; 3],
    /// Angular velocity, rad/s.
    pub angular_rps: [f64; 3],
}

/// Force and torque that an effect exerts on a body at its centre of mass, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Torque, N·m.
    pub torque_nm: [f64; 3],
}

/// What an effect may know of the world.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Magnitude of gravity, m/s².
    pub gravity_mps2: f64,
    /// Duration of a control step, s.
    pub period_secs: f64,
}

/// One named effect.
pub trait Effect: Send + Sync + std::fmt::Debug {
    /// Gravity vector, m/s², base axes: changed in place.
    fn gravity(&self, _gravity_mps2: &mut [f64; 3]) {}

    /// Load on a free body during the next control step; added to `load`.
    fn load(&self, _surroundings: &Surroundings, _body: &BodyView, _load: &mut Load) {}
}

/// An effect as a scenario names it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EffectConfig {
    /// F = −c v.
    ViscousDamping(ViscousDamping),
    /// Torque c_rr N against rolling.
    RollingResistance(RollingResistance),
    /// The table is not level.
    TableTilt(TableTilt),
}

impl EffectConfig {
    /// What is wrong with the parameters, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let (key, value, limit, unit) = match self {
            Self::ViscousDamping(e) => ("viscous_damping.coefficient_nspm", e.coefficient_nspm, [0.0, 1000.0], "N·s/m"),
            Self::RollingResistance(e) => ("rolling_resistance.lever_m", e.lever_m, [0.0, 0.1], "m"),
            Self::TableTilt(e) => {
                let steeper = if e.slope_x_rad.abs() > e.slope_y_rad.abs() { e.slope_x_rad } else { e.slope_y_rad };
                ("table_tilt.slope_x_rad and slope_y_rad", steeper, [-0.7, 0.7], "rad")
            }
        };
        let [low, high] = limit;
        // Also false for NaN.
        let good = (low..=high).contains(&value);
        (!good).then(|| format!("{key}: expected {low} to {high} {unit}, found {value}"))
    }

    /// The effect, ready to use.
    #[must_use]
    pub fn build(&self) -> Box<dyn Effect> {
        match self {
            Self::ViscousDamping(effect) => Box::new(effect.clone()),
            Self::RollingResistance(effect) => Box::new(effect.clone()),
            Self::TableTilt(effect) => Box::new(effect.clone()),
        }
    }
}
