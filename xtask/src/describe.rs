//! `xtask describe`: all commands with their options as JSON, from what the programs print as their help. The page of commands is made from it.

use std::process::{Command as Process, ExitCode, Stdio};

use anyhow::{Context as _, Result, bail};
use clap::{Command, CommandFactory as _};
use serde_json::{Value, json};

use crate::built::{VIEWER, path};
use crate::completions::help::{self, Help};

/// Commands of a program that have commands of their own: as deep as ours go.
const DEPTH: usize = 2;

pub(crate) fn run() -> Result<ExitCode> {
    let menu = crate::Menu::command();
    let mut verbs = Vec::new();
    for verb in menu.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        verbs.push(described(verb)?);
    }
    program::show(&format!("{:#}\n", Value::Array(verbs)));
    Ok(ExitCode::SUCCESS)
}

/// A verb of the menu. What it does, the menu says; its options, the program behind it.
fn described(verb: &Command) -> Result<Value> {
    let name = verb.get_name();
    let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
    let behind = verb.get_arguments().any(|argument| argument.get_id() == "arguments");
    let program = path(if name == "rerun" { VIEWER } else { name });
    let mut value = if behind && program.exists() {
        of_program(&program, name, &[])?
    } else if behind && name != "rerun" {
        bail!("{}: expected the program, built by `cargo build --release --workspace --bins`", program.display());
    } else if behind {
        // Built for those alone who ask for it.
        of_help(name, &Help::default(), &[])
    } else {
        of_help(name, &help::parse(&verb.clone().render_long_help().to_string()), &[])
    };
    value["about"] = about.into();
    if value["example"].is_null() {
        value["example"] = example(&verb.clone().render_long_help().to_string()).into();
    }
    Ok(value)
}

fn of_program(program: &std::path::Path, name: &str, commands: &[&str]) -> Result<Value> {
    // Without a terminal, whose width would decide where lines break.
    let mut process = Process::new(program);
    let output = process.args(commands).arg("--help").stdin(Stdio::null()).env_remove("COLUMNS").output();
    let output = output.with_context(|| format!("cannot run {}", program.display()))?;
    if !output.status.success() {
        bail!("{} {} --help fails", program.display(), commands.join(" "));
    }
    let help = help::parse(&String::from_utf8_lossy(&output.stdout));
    let mut inner = Vec::new();
    if commands.len() < DEPTH {
        for (command, _) in &help.commands {
            inner.push(of_program(program, command, &[commands, &[command.as_str()]].concat())?);
        }
    }
    Ok(of_help(name, &help, &inner))
}

fn of_help(name: &str, help: &Help, commands: &[Value]) -> Value {
    let entry = |(usage, about): (String, String)| json!({ "usage": usage, "about": about });
    let options: Vec<Value> = help.usages().map(entry).collect();
    let arguments: Vec<Value> = help.arguments.iter().cloned().map(entry).collect();
    json!({
        "name": name, "about": help.about, "example": help.example, "arguments": arguments, "options": options,
        "commands": commands,
    })
}

fn example(help: &str) -> Option<String> {
    help::parse(help).example
}
