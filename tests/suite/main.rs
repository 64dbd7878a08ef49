//! End-to-end suite.

mod architecture;
mod bad_input;
mod pipeline;
mod world;
