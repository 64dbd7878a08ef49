//! Logs whose missing effect is known to nobody but the scorer, and how well `diagnose` names it.
//!
//! A set is a log and a truth. The solver runs as a process of its own that is told where the log lies and where its answer goes ([`folder`]); the
//! truth lies elsewhere and is read by the scorer alone ([`score`]). What a benchmark holds is a function of its options ([`plan`]): effects of the
//! catalogue at three strengths ([`draw`]), none, two, and some that no catalogue has ([`unknown`]), in worlds that another engine setting
//! simulates than the model's ([`generate`]), from actions chosen to tell effects apart or as they come ([`actions`]).

pub mod actions;
pub mod draw;
pub mod folder;
pub mod generate;
pub mod plan;
pub mod recording;
pub mod rehearsal;
pub mod score;
pub mod table;
pub mod unknown;
