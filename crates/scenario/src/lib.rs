//! Scenario files: TOML layers to one resolved scenario, a resolved scenario to a ready problem.
//!
//! # Example
//!
//! ```no_run
//! use scenario::{Problem, Selection};
//! let scenario = Selection { domain: "D4".into(), ..Selection::new(".") }.load()?;
//! let problem = Problem::assemble(&scenario, ".".as_ref())?;
//! assert_eq!(problem.truth.joint_count(), 7);
//! # Ok::<(), scenario::Error>(())
//! ```

mod assemble;
mod check;
mod error;
mod explain;
mod file_schema;
mod format;
mod layers;
mod load;
mod provenance;
mod schema;
mod suggest;
mod truth;

pub use assemble::Problem;
pub use error::Error;
pub use explain::Explanation;
pub use file_schema::{FileKind, file_schema};
pub use layers::{LayerKind, Source};
pub use load::{PRESET, Selection, find_root, project_root};
pub use provenance::commit;
pub use schema::{
    AgentConfig, ArmsConfig, BeliefConfig, DataConfig, EffectsConfig, EvaluationConfig, Filter, InitialBeliefConfig,
    InitialObstacle, Published, Rollouts, Scenario, SearchSteps, VERSION,
};
