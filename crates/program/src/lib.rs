//! What every program of the project does: it reads its command line, prints where a closed pipe is no panic, ends with a code that says
//! why, says what to do next, and stops at an interrupt.
//!
//! Exit codes: 0 done; 1 failed although the input was good ([`Failed`]); 2 bad input; 130 interrupted.
//!
//! # Example
//!
//! ```
//! use program::Failed;
//!
//! const FAILED: Failed = Failed::new("the run stopped, finished trials are kept");
//! assert_eq!(program::code(&anyhow::anyhow!("the disk is full").context(FAILED)), 1);
//! assert_eq!(program::code(&anyhow::anyhow!("--trials: expected at least 1, found 0")), 2);
//! ```

mod arguments;
mod ending;
mod next;
mod options;
mod terminal;
#[cfg(feature = "long-work")]
mod work;

pub use arguments::parse;
pub use ending::{Failed, code, end, failed, finish, is_denied, resumable};
pub use next::{next, typed};
pub use options::{Arm, Overrides, Project, Threads};
pub use terminal::{complain, print, say, show};
#[cfg(feature = "long-work")]
pub use work::{interrupts, log_on_request};
