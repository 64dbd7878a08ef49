//! `cargo xtask doctor`: what this machine has of what the project needs. It lives in the menu because it has to run before anything heavy is
//! built, and needs no program of ours.

mod machine;
mod priors;
mod probe;
mod tools;

use std::process::ExitCode;

use anyhow::Result;
use serde_json::json;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 everything that is required is there, 1 something required is missing or broken.\n\n\
                  Examples:\n  cargo xtask doctor\n  cargo xtask doctor --json"
)]
pub(crate) struct Options {
    /// Python whose modules are looked at.
    #[arg(long, default_value = "python3")]
    python: String,
    /// Prints one JSON object.
    #[arg(long)]
    json: bool,
}

/// How a thing was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Ok,
    /// Not there.
    Missing,
    /// There, but of no use.
    Broken,
}

impl State {
    fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Missing => "missing",
            Self::Broken => "broken",
        }
    }
}

/// One thing that the project can use.
#[derive(Debug)]
struct Check {
    name: String,
    state: State,
    /// Whether nothing goes without it.
    required: bool,
    /// Version, amount, or what is wrong.
    found: String,
    needed_for: &'static str,
    /// How to get it.
    remedy: String,
}

impl Check {
    /// A thing that was found good (its version, say), or not.
    fn new(
        name: &str,
        found: Result<String, (State, String)>,
        needed_for: &'static str,
        remedy: impl Into<String>,
    ) -> Self {
        let (state, found) = match found {
            Ok(found) => (State::Ok, found),
            Err(problem) => problem,
        };
        Self { name: name.into(), state, required: false, found, needed_for, remedy: remedy.into() }
    }

    fn required(self) -> Self {
        Self { required: true, ..self }
    }
}

pub(crate) fn run(options: &Options) -> Result<ExitCode> {
    let root = crate::built::root();
    let mut checks = tools::toolchain();
    checks.extend(machine::checks(&root));
    checks.extend(priors::checks(&root));
    checks.extend(tools::optional(&root, &options.python));
    let good = checks.iter().all(|check| check.state == State::Ok || !check.required);
    program::show(&if options.json { as_json(&checks, good) } else { as_text(&checks) });
    if good && !options.json {
        let demo = ["cargo", "xtask", "demo"].map(String::from).to_vec();
        program::next(&[(demo, "builds what it needs, in minutes, and plays one episode")]);
    }
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn as_json(checks: &[Check], good: bool) -> String {
    let list = checks.iter().map(|check| {
        json!({
            "name": check.name,
            "state": check.state.name(),
            "required": check.required,
            "found": check.found,
            "needed_for": check.needed_for,
            "remedy": if check.state == State::Ok { "" } else { &check.remedy },
        })
    });
    format!("{:#}\n", json!({ "ok": good, "checks": list.collect::<Vec<_>>() }))
}

fn as_text(checks: &[Check]) -> String {
    let mut text = String::new();
    let width = |of: fn(&Check) -> &str| checks.iter().map(|check| of(check).chars().count()).max().unwrap_or_default();
    let (name, found) = (width(|check| &check.name), width(|check| &check.found).min(44));
    for check in checks {
        let Check { required, needed_for, .. } = check;
        let weight = if *required { "required" } else { "optional" };
        let state = check.state.name();
        text += &format!("{state:<7}  {:<name$}  {:<found$}  {weight}: {needed_for}\n", check.name, check.found);
        if check.state != State::Ok {
            text += &format!("{:<9}{:<name$}  → {}\n", "", "", check.remedy);
        }
    }
    let bad = |required: bool| {
        let bad = checks.iter().filter(|check| check.required == required && check.state != State::Ok);
        bad.map(|check| check.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    text += "\n";
    text += &match bad(true) {
        bad if bad.is_empty() => "Everything that is required is there.\n".to_string(),
        bad => format!("Required, but missing or broken: {bad}.\n"),
    };
    match bad(false) {
        bad if bad.is_empty() => text,
        bad => text + &format!("Optional, and missing or broken: {bad}.\n"),
    }
}
