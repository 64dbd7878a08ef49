//! What the parts of Surmise cost and how exact they are, beside their peers.
//!
//! `cargo xtask bench physics` times actions, `cargo xtask bench accuracy` compares them with MuJoCo and with closed forms,
//! `cargo xtask bench planner` plays the standard problems, `cargo xtask bench prior` trains and runs the network. Peers are
//! Python packages: where one is missing, `missing: pip install …` is printed and its columns stay empty. Recorded answers of MuJoCo lie in
//! `crates/physics-model/tests/data`, so that accuracy needs no Python.
//!
//! # Example
//!
//! ```no_run
//! use scenario::{Selection, find_root};
//!
//! let root = find_root(env!("CARGO_MANIFEST_DIR").as_ref())?;
//! let world = Selection::new(&root).load()?.world;
//! for quantity in bench::closed_forms::measure(&root, &world)? {
//!     assert!((quantity.ours / quantity.mujoco - 1.0).abs() < 0.2, "{}", quantity.text);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod accuracy;
pub mod calibration;
pub mod closed_forms;
pub mod decision;
pub mod log_faults;
pub mod nudge;
pub mod peer;
pub mod physics;
pub mod planner;
pub mod policy;
pub mod prior;
pub mod report;
pub mod scenes;
pub mod worlds;
