//! What a world behind the protocol can do wrong.

use std::net::SocketAddr;

use thiserror::Error;

/// Why an external world cannot be used, or not any longer. Each is one sentence and one line, whatever the world sent.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The address is neither a command nor a loopback socket.
    #[error("world `{text}`: expected {expected}")]
    Address {
        /// What was given.
        text: String,
        /// What would do.
        expected: &'static str,
    },
    /// The command cannot be run.
    #[error("world `{program}`: cannot be started")]
    Start {
        /// Program.
        program: String,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// Nobody answers at the address.
    #[error("world tcp://{address}: cannot be connected to")]
    Connect {
        /// Address.
        address: SocketAddr,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// No answer in time.
    #[error("the world gave no answer to `{request}` within {seconds} s{said}")]
    Silent {
        /// Request.
        request: &'static str,
        /// Time allowed, s.
        seconds: f64,
        /// Its last words on standard error, with what introduces them; empty where it said nothing.
        said: String,
    },
    /// It died or closed its output.
    #[error("the world {how} while its answer to `{request}` was awaited{said}")]
    Ended {
        /// Request.
        request: &'static str,
        /// Exit status, or that it closed its output.
        how: String,
        /// As in [`WorldError::Silent`].
        said: String,
    },
    /// It answers without reading.
    #[error("the world does not read its input: `{request}` could not be sent{said}")]
    Deaf {
        /// Request.
        request: &'static str,
        /// As in [`WorldError::Silent`].
        said: String,
    },
    /// An answer that is too long.
    #[error("the world's answer to `{request}` has no line feed within {limit} bytes")]
    Long {
        /// Request.
        request: &'static str,
        /// Longest line, bytes.
        limit: usize,
    },
    /// An answer that is not what the protocol asks for.
    #[error("the world's answer to `{request}`: `{field}`: {problem}")]
    Answer {
        /// Request.
        request: &'static str,
        /// Path of the field in the answer.
        field: String,
        /// Expectation and what was found.
        problem: String,
    },
    /// The world itself says that it cannot go on.
    #[error("the world answered `{request}` with an error: {message}")]
    Reported {
        /// Request.
        request: &'static str,
        /// Its sentence.
        message: String,
    },
}

/// Text of a world as part of one line: control characters become spaces, what is too long is cut.
pub(super) fn one_line(text: &str, most_chars: usize) -> String {
    let clean: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(most_chars).collect();
    clean.trim().to_string()
}
