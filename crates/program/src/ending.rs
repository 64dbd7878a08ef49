//! How a program ends.

use std::borrow::Cow;
use std::fmt::Display;
use std::io;
use std::process::ExitCode;

use crate::{complain, say};

/// Marks what went wrong after the input was found to be good, by its own words or as the context of a cause: exit code 1 instead of 2.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Failed(pub Cow<'static, str>);

impl Failed {
    /// With what stopped, and what is kept.
    #[must_use]
    pub const fn new(text: &'static str) -> Self {
        Self(Cow::Borrowed(text))
    }
}

/// The exit code of an error: 1 where it is marked as [`Failed`], else 2. A place that may not be read or written is a bad place, whenever that shows.
#[must_use]
pub fn code(error: &anyhow::Error) -> u8 {
    if error.is::<Failed>() && !is_denied(error) { 1 } else { 2 }
}

/// Whether a cause is a place that may not be read or written.
#[must_use]
pub fn is_denied(error: &anyhow::Error) -> bool {
    let denied = |cause: &(dyn std::error::Error + 'static)| {
        cause.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::PermissionDenied)
    };
    error.chain().any(denied)
}

/// Marks what went wrong after the input was found to be good as [`Failed`] by its own words, unless a place may not be written.
pub fn failed(error: impl Into<anyhow::Error>) -> anyhow::Error {
    let error = error.into();
    if is_denied(&error) { error } else { Failed(format!("{error:#}").into()).into() }
}

/// Ends a program: says why where it went wrong.
pub fn finish(result: anyhow::Result<()>) -> ExitCode {
    end(result, code)
}

/// Ends a program that can be started again to go on: `result` is false where it was interrupted. `kept` is what is not lost, such as
/// "trials".
pub fn resumable(kept: &str, result: anyhow::Result<bool>) -> ExitCode {
    match result {
        Ok(false) => {
            say(&format!("interrupted: finished {kept} are kept, run the same command again to go on"));
            ExitCode::from(130)
        }
        done => finish(done.map(drop)),
    }
}

/// Ends a program whose errors are of a kind of its own; `code` is the exit code of one.
pub fn end<E: Display>(result: Result<(), E>, code: impl FnOnce(&E) -> u8) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&error);
            ExitCode::from(code(&error))
        }
    }
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;

    #[test]
    fn a_mark_counts_as_the_error_and_as_the_context_of_a_cause() {
        let mark = Failed::new("the run stopped");
        let with_cause = anyhow!("no space left").context(mark.clone());
        assert_eq!(format!("{with_cause:#}"), "the run stopped: no space left");
        assert_eq!(code(&with_cause.context("trial 3")), 1);
        let denied = anyhow::Error::new(io::Error::from(io::ErrorKind::PermissionDenied)).context(mark.clone());
        assert_eq!(code(&denied), 2);
        assert_eq!(code(&mark.into()), 1);
        let refused = |kind: io::ErrorKind| failed(io::Error::from(kind));
        assert_eq!(code(&refused(io::ErrorKind::PermissionDenied)), 2);
        let full = refused(io::ErrorKind::StorageFull);
        assert_eq!((code(&full), full.to_string()), (1, io::Error::from(io::ErrorKind::StorageFull).to_string()));
        assert_eq!(code(&anyhow!("the run stopped")), 2);
    }
}
