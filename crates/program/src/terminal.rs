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
    say(&format!("error: {}", one_line(&format!("{error:#}"), 4000)));
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
