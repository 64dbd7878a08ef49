//! A body and valid inputs for each reader.

pub mod checkpoint;
pub mod dataset_shard;
pub mod import_log;
pub mod measured_log;
pub mod model_toml;
pub mod posterior;
pub mod robot;
pub mod scenario_toml;
pub mod world_protocol;
