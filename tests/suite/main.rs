//! End-to-end suite.

mod all;
mod architecture;
mod bad_input;
mod closing;
mod cluster;
mod completions;
mod configuration;
mod docs;
mod doctor;
mod kills;
mod library;
mod licences;
mod log_check;
mod output;
mod pages;
mod pipeline;
mod places;
mod python;
mod world;
