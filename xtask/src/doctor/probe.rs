//! Asking other programs what they are, without waiting for one that hangs.

use std::io::Read as _;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::State;

/// Longest that a program may take to answer: a controller of a cluster that is away lets its clients wait for minutes.
const PATIENCE: Duration = Duration::from_secs(10);
const PAUSE: Duration = Duration::from_millis(20);

/// What a program prints, or whether it is missing or broken.
pub(crate) fn ask(program: &str, arguments: &[&str]) -> Result<String, (State, String)> {
    let broken = |problem: String| (State::Broken, problem);
    let spawned = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = match spawned {
        Ok(child) => child,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err((State::Missing, format!("no {program} in PATH")));
        }
        Err(error) => return Err(broken(format!("{program}: {error}"))),
    };
    let mut waited = Duration::ZERO;
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if waited < PATIENCE => {
                std::thread::sleep(PAUSE);
                waited += PAUSE;
            }
            Ok(None) => {
                // It may have ended just now, which is as good.
                let _ = child.kill();
                let _ = child.wait();
                return Err(broken(format!("{program}: no answer in {} s", PATIENCE.as_secs())));
            }
            Err(error) => return Err(broken(format!("{program}: {error}"))),
        }
    };
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let read = child.stdout.take().map(|mut pipe| pipe.read_to_end(&mut out));
    let read_error = child.stderr.take().map(|mut pipe| pipe.read_to_end(&mut err));
    if let Some(Err(error)) = read.or(read_error) {
        return Err(broken(format!("{program}: {error}")));
    }
    if status.success() {
        return Ok(String::from_utf8_lossy(&out).trim().to_string());
    }
    let text = String::from_utf8_lossy(&err);
    let line = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("failed without a word");
    Err(broken(if line.starts_with(program) { line.to_string() } else { format!("{program}: {line}") }))
}

/// The first number with dots in a text: `rustc 1.95.0 (…)` is 1.95.0.
pub(crate) fn version(text: &str) -> Option<&str> {
    let word = |word: &&str| word.starts_with(|c: char| c.is_ascii_digit()) && word.contains('.');
    text.split_whitespace().find(word).map(|word| word.trim_end_matches([',', ';']))
}

/// Whether a version is at least another one, number by number; what follows a dash does not count.
pub(crate) fn at_least(found: &str, needed: &str) -> bool {
    let numbers = |text: &str| -> Vec<u64> {
        let numbers = text.split('-').next().unwrap_or_default().split('.');
        numbers.map(|number| number.parse().unwrap_or_default()).collect()
    };
    let (mut found, mut needed) = (numbers(found), numbers(needed));
    let length = found.len().max(needed.len());
    found.resize(length, 0);
    needed.resize(length, 0);
    found >= needed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_found_and_compared_by_number() {
        assert_eq!(version("rustc 1.95.0 (59807616e 2026-04-14)"), Some("1.95.0"));
        assert_eq!(version("slurm-wlm"), None);
        assert!(at_least("1.95.0", "1.95") && at_least("1.100.0", "1.95") && at_least("1.95.0-nightly", "1.95"));
        assert!(!at_least("1.94.9", "1.95") && !at_least("1.9", "1.95"));
    }

    #[test]
    fn a_program_that_is_not_there_is_missing_and_one_that_fails_is_broken() {
        assert_eq!(ask("surmise-no-such-program", &[]).unwrap_err().0, State::Missing);
        assert_eq!(ask("rustc", &["--no-such-option"]).unwrap_err().0, State::Broken);
        assert!(ask("rustc", &["--version"]).unwrap().starts_with("rustc"));
    }
}
