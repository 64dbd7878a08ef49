//! What the parts of Surmise cost and how exact they are, beside their peers.
//!
//! `cargo xtask bench physics` times actions, `cargo xtask bench accuracy` compares them with MuJoCo and with closed forms,
//! `cargo xtask bench planner` plays the standard problems, `cargo xtask bench prior` trains and runs the network. Peers are
//! Python packages: where one is missing, `missing: pip install …` is printed and its columns stay empty. Recorded answers of MuJoCo lie in
//! `crates/physics-model/tests/data`, so that accuracy needs no Python.

pub mod accuracy;
pub mod belief;
pub mod closed_forms;
pub mod peer;
pub mod physics;
pub mod planner;
pub mod prior;
pub mod report;
pub mod scenes;
