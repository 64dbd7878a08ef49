//! One file per effect: equation, symbols, units, plausible range and its source, and a test against a closed form.
//!
//! Ranges without a source are engineering judgement. Letters say where an effect acts, as in [`crate::effect`].

mod rolling_resistance;
mod table_tilt;
mod viscous_damping;

pub use rolling_resistance::RollingResistance;
pub use table_tilt::TableTilt;
pub use viscous_damping::ViscousDamping;
