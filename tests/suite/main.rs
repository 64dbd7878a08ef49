//! End-to-end suite.

mod all;
mod architecture;
mod bad_input;
mod pipeline;
mod world;
