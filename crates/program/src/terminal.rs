//! What programs say.

use std::fmt::Display;
use std::io::{self, Write as _};

use whole_file::one_line;

/// Prints to standard output. A reader that has seen enough, and closed the pipe, is no error.
///
/// # Errors
///
/// Where the output cannot be written, as on a full disk.
pub fn print(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        printed => printed,
    }
}

/// The same as the last thing that a program does: where the output cannot be written it says so and ends with exit code 1.
pub fn show(text: &str) {
    if let Err(error) = print(text) {
        say(&format!("error: cannot print: {error}"));
        std::process::exit(1);
    }
}

/// Says something on standard error, where anybody listens.
pub fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Says why a program ends: one line, whatever names and files are quoted in it.
pub fn complain(error: &dyn Display) {
    say(&format!("error: {}", one_line(&without_repeats(&without_codes(&format!("{error:#}"))), 4000)));
}

/// An error that says its cause, and has it as its cause, says it twice: `a: b: b`, or `a: b: a: b`.
pub(crate) fn without_repeats(text: &str) -> String {
    let mut said: Vec<&str> = Vec::new();
    for part in text.split(": ") {
        said.push(part);
        let whole = said.len();
        // The longest end that the words before it end with as well.
        let twice = (1..=whole / 2).rev().find(|n| said[whole - n..] == said[whole - 2 * n..whole - n]);
        said.truncate(whole - twice.unwrap_or(0));
    }
    said.join(": ")
}

/// Without the numbers that the operating system's words end with, ` (os error 2)`, which say nothing more.
fn without_codes(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.trim_start_matches(|c: char| c.is_ascii_digit()).strip_prefix(')') {
            Some(rest) => kept.push_str(rest),
            None => kept.extend([" (os error ", part]),
        }
    }
    kept
}

/// [`show`] of a line, as `println!` formats it.
#[macro_export]
macro_rules! out {
    ($($argument:tt)*) => { $crate::show(&(::std::format!($($argument)*) + "\n")) };
}

/// [`say`](fn@say), as `eprintln!` formats it.
#[macro_export]
macro_rules! say {
    ($($argument:tt)*) => { $crate::say(&::std::format!($($argument)*)) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_is_said_once() {
        assert_eq!(without_repeats("cannot read a: no such file: no such file"), "cannot read a: no such file");
        assert_eq!(without_repeats("cannot read a: no file: cannot read a: no file"), "cannot read a: no file");
        assert_eq!(without_repeats("a: b: a"), "a: b: a");
    }

    #[test]
    fn what_the_system_says_comes_without_its_number() {
        let error = io::Error::from_raw_os_error(2).to_string();
        assert!(error.ends_with(" (os error 2)"), "{error}");
        let plain = error.trim_end_matches(" (os error 2)");
        assert_eq!(
            without_codes(&format!("cannot read a: {error}; cannot read b: {error}.")),
            format!("cannot read a: {plain}; cannot read b: {plain}.")
        );
        for other in ["", "a name (os error x)", " (os error "] {
            assert_eq!(without_codes(other), other);
        }
    }
}
