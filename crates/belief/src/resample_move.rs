//! The resample–move filter and its parts.

mod config;
mod filter;
mod hypothesis;
mod moves;

pub use config::ResampleMoveConfig;
pub use filter::ResampleMoveFilter;
pub(crate) use filter::systematic;
pub(crate) use hypothesis::{Hypothesis, draw, normal, replay};
pub(crate) use moves::{Proposal, propose};
