//! The command line of a program, and what is wrong with it in words.

use std::error::Error as _;
use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error, Parser};
use whole_file::{one_line, plain};

use crate::complain;

/// Characters of a value that a message quotes.
const QUOTED: usize = 200;
/// From here on, the end of a range is that of a type and says nothing.
const ENDLESS: u64 = u32::MAX as u64;

/// Reads the command line, as clap's `Parser::parse` does. A value that is not one is answered in one sentence: the option, what was expected
/// and what was found. A negative number is a value, and no option that does not exist.
#[must_use]
pub fn parse<T: Parser>() -> T {
    read(std::env::args_os()).unwrap_or_else(|error| match sentence(&error) {
        Some(sentence) => {
            complain(&sentence);
            std::process::exit(2)
        }
        None => error.exit(),
    })
}

fn read<T: Parser>(arguments: impl IntoIterator<Item = OsString>) -> Result<T, Error> {
    let mut command = with_negative_numbers(T::command());
    let mut matches = command.try_get_matches_from_mut(arguments)?;
    T::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command))
}

fn with_negative_numbers(command: Command) -> Command {
    let command = command.mut_args(|argument| {
        let takes_values = argument.get_action().takes_values();
        if takes_values { argument.allow_negative_numbers(true) } else { argument }
    });
    command.mut_subcommands(with_negative_numbers)
}

/// What is wrong with a value, or lacks, in one sentence; `None` for all else, which clap says in its own words.
fn sentence(error: &Error) -> Option<String> {
    if let (ErrorKind::MissingRequiredArgument, Some(ContextValue::Strings(missing))) =
        (error.kind(), error.get(ContextKind::InvalidArg))
    {
        return Some(format!("expected {}, found none; --help says more", missing.join(" and ")));
    }
    if error.kind() != ErrorKind::ValueValidation {
        return None;
    }
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    let (option, value) = (text(ContextKind::InvalidArg)?, one_line(text(ContextKind::InvalidValue)?, QUOTED));
    let said = error.source()?.to_string();
    // A sign is all that is wrong with it.
    let negative = value.strip_prefix('-').is_some_and(|digits| digits.parse::<u64>().is_ok());
    let expected = match range(&said, &value) {
        Some(range) => range,
        None if negative && said.starts_with("invalid digit") => "expected a whole number, 0 or more".into(),
        None => one_line(&plain(&said), 1000),
    };
    let is_quoted =
        ["found ".to_owned(), format!("`{value}`"), format!("\"{value}\"")].iter().any(|part| expected.contains(part));
    let found = if is_quoted { String::new() } else { format!(", found `{value}`") };
    Some(format!("{option}: {expected}{found}"))
}

/// The range that a number is not in, as `5 is not in 1..=4` says.
fn range(said: &str, value: &str) -> Option<String> {
    let (low, high) = said.split_once(" is not in ")?.1.split_once("..=")?;
    let high: u64 = high.parse().ok()?;
    let is_above = value.parse::<u128>().is_ok_and(|value| value > u128::from(high));
    Some(if high >= ENDLESS && !is_above {
        format!("expected a whole number, {low} or more")
    } else {
        format!("expected a whole number, {low} to {high}")
    })
}

#[cfg(test)]
mod tests {
    use clap::Subcommand;

    use super::*;

    #[derive(Debug, Parser)]
    struct Arguments {
        #[arg(long, default_value_t = 0)]
        trial: u32,
        #[arg(long, default_value_t = 0)]
        seed: u64,
        #[arg(long, value_parser = clap::value_parser!(u32).range(1..=4096))]
        threads: Option<u32>,
        #[arg(long)]
        sets: Option<usize>,
        #[arg(long, default_value_t = 0.0)]
        share: f64,
        #[arg(long, value_parser = fold)]
        fold: Option<u32>,
        #[command(subcommand)]
        inner: Option<Inner>,
    }

    #[derive(Debug, Subcommand)]
    enum Inner {
        Play {
            #[arg(long)]
            times: u8,
        },
    }

    fn fold(text: &str) -> Result<u32, String> {
        Err(format!("expected I/K, found `{text}`"))
    }

    fn read_line(line: &str) -> Result<Arguments, Error> {
        read(std::iter::once("test").chain(line.split(' ')).map(OsString::from))
    }

    #[test]
    fn a_value_that_is_none_is_answered_in_one_sentence() {
        let cases = [
            ("--trial -1", "--trial <TRIAL>: expected a whole number, 0 or more, found `-1`"),
            ("--trial x", "--trial <TRIAL>: expected a whole number, found `x`"),
            ("--trial 1.5", "--trial <TRIAL>: expected a whole number, found `1.5`"),
            ("--trial 5000000000", "--trial <TRIAL>: expected a whole number, 0 to 4294967295, found `5000000000`"),
            ("--seed -1", "--seed <SEED>: expected a whole number, 0 or more, found `-1`"),
            (
                "--seed 99999999999999999999",
                "--seed <SEED>: expected a smaller whole number, found `99999999999999999999`",
            ),
            ("--threads 0", "--threads <THREADS>: expected a whole number, 1 to 4096, found `0`"),
            ("--sets -3", "--sets <SETS>: expected a whole number, 0 or more, found `-3`"),
            ("--share much", "--share <SHARE>: expected a number, found `much`"),
            ("--fold 7", "--fold <FOLD>: expected I/K, found `7`"),
            ("play --times -2", "--times <TIMES>: expected a whole number, 0 to 255, found `-2`"),
        ];
        for (line, expected) in cases {
            let error = read_line(line).unwrap_err();
            assert_eq!(sentence(&error).as_deref(), Some(expected), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
    }

    #[test]
    fn good_values_are_read_and_all_else_is_left_to_clap() {
        let good = read_line("--trial 3 --seed 2 --threads 4 --sets 1 --share -0.5 play --times 2").unwrap();
        assert_eq!((good.trial, good.seed, good.threads, good.sets, good.share), (3, 2, Some(4), Some(1), -0.5));
        assert!(matches!(good.inner, Some(Inner::Play { times: 2 })) && good.fold.is_none());
        let error = read_line("play").unwrap_err();
        assert_eq!(sentence(&error).as_deref(), Some("expected --times <TIMES>, found none; --help says more"));
        for line in ["--nothing", "--help", "nowhere", "--trial"] {
            assert_eq!(sentence(&read_line(line).unwrap_err()), None, "{line}");
        }
    }
}
