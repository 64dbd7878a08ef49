//! Intervals, quantiles and exact tests of small samples, each with one definition for all tables of the project.
//!
//! # Example
//!
//! ```
//! // 24 of 30: what the rate may be (Wilson, 95 %).
//! let [low, high] = statistics::wilson95(24, 30);
//! assert!((low - 0.627).abs() < 5e-4 && (high - 0.905).abs() < 5e-4);
//! // The middle of two values lies half way between them.
//! assert_eq!(statistics::quantile(&mut [3.0, 1.0, 2.0, 4.0], 0.5), Some(2.5));
//! ```

mod interval;
mod quantile;
mod sign_flip;
mod uniform;

pub use interval::wilson95;
pub use quantile::{nearest_rank, quantile, weighted_quantile};
pub use sign_flip::sign_flip;
pub use uniform::uniform_p;
