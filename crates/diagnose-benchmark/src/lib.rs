//! Logs whose missing effect is known to nobody but the scorer.

pub mod actions;
pub mod generate;
