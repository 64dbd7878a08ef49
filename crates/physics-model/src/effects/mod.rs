//! One file per effect.

mod rolling_resistance;
mod table_tilt;
mod viscous_damping;

pub use rolling_resistance::RollingResistance;
pub use table_tilt::TableTilt;
pub use viscous_damping::ViscousDamping;
