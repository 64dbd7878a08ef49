//! What every reader holds to, whatever bytes it is given: it answers with a value that is valid or with an error of one sentence that names the
//! file, never with a panic, and within bounded memory.
//!
//! Each [`Target`] has a body, which is one call: the bounded run in `tests/` and the libFuzzer targets in `fuzz/` share it. A body panics where
//! its reader breaks the rule. [`mutate::case`] makes inputs of the seeds.
//!
//! # Example
//!
//! ```
//! use fuzzing::{TARGETS, Verdict};
//!
//! let target = TARGETS.iter().find(|target| target.name == "model_toml").unwrap();
//! assert_eq!((target.body)(&(target.seeds)()[0]), Verdict::Accepted);
//! assert_eq!((target.body)(b"version = 1\neffects = 1e308"), Verdict::Refused);
//! ```

pub mod mutate;
mod parts;
pub mod targets;
mod verdict;

pub use verdict::Verdict;

/// A reader with its body and valid inputs.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name, here and in `fuzz/`.
    pub name: &'static str,
    /// Reads the bytes; panics where the reader breaks the rule.
    pub body: fn(&[u8]) -> Verdict,
    /// Valid inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All readers.
pub const TARGETS: [Target; 9] = [
    Target { name: "scenario_toml", body: targets::scenario_toml::scenario_toml, seeds: targets::scenario_toml::seeds },
    Target { name: "robot", body: targets::robot::robot, seeds: targets::robot::seeds },
    Target { name: "dataset_shard", body: targets::dataset_shard::dataset_shard, seeds: targets::dataset_shard::seeds },
    Target { name: "checkpoint", body: targets::checkpoint::checkpoint, seeds: targets::checkpoint::seeds },
    Target { name: "posterior", body: targets::posterior::posterior, seeds: targets::posterior::seeds },
    Target { name: "import_log", body: targets::import_log::import_log, seeds: targets::import_log::seeds },
    Target { name: "measured_log", body: targets::measured_log::measured_log, seeds: targets::measured_log::seeds },
    Target { name: "model_toml", body: targets::model_toml::model_toml, seeds: targets::model_toml::seeds },
    Target {
        name: "world_protocol",
        body: targets::world_protocol::world_protocol,
        seeds: targets::world_protocol::seeds,
    },
];
