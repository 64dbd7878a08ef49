//! Logs whose missing effect is known to nobody but the scorer, and how well `diagnose` names it.
//!
//! A set is a log and a truth. The solver runs as a process of its own that is told where the log lies and where its answer goes ([`folder`]); the
//! truth lies elsewhere and is read by the scorer alone ([`score`]). What a benchmark holds is a function of its options ([`plan`]): effects of the
//! catalogue at three strengths ([`draw`]), none, two, and some that no catalogue has ([`unknown`]), in worlds that another engine setting
//! simulates than the model's ([`generate`]), from actions chosen to tell effects apart or as they come ([`actions`]), pushed by a ball, some by an arm.
//!
//! # Example
//!
//! ```
//! use diagnose_benchmark::generate::Actions;
//! use diagnose_benchmark::plan::{Options, Plan, VERSION};
//! use physics_model::EffectKind;
//!
//! let (only, actions) = (vec![EffectKind::TableTilt], vec![Actions::Designed]);
//! let options = Options { version: VERSION, seed: 1, sets: 3, none: 1, unknown: 0, pairs: 0, arms: 0, actions, only };
//! let plan = Plan::new(options);
//! // Which of the four is which, the order does not say.
//! let hidden: Vec<String> = (0..plan.len()).flat_map(|set| plan.draw(set, 0).names()).collect();
//! assert_eq!(hidden.iter().filter(|name| *name == "table_tilt").count(), 3);
//! ```

pub mod actions;
pub mod choice;
pub mod draw;
pub mod example;
pub mod folder;
pub mod gaussian_process;
pub mod generate;
pub mod judge;
pub mod learn;
pub mod plan;
pub mod recording;
pub mod rehearsal;
pub mod residual;
pub mod score;
pub mod table;
pub mod unknown;
