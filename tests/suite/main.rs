//! End-to-end suite.

mod all;
mod architecture;
mod bad_input;
mod closing;
mod cluster;
mod pipeline;
mod world;
