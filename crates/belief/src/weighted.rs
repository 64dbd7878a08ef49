//! The weighted filter and its parts.

mod advance;
mod config;
mod filter;
mod gaussian;
mod prediction;
mod round;
mod simulate;
mod size;
mod temper;

pub use config::WeightedConfig;
pub use filter::WeightedFilter;
pub use round::Trackable;
