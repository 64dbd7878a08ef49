//! The page of commands, from what the programs say of themselves.

use anyhow::{Context as _, Result};
use serde::Deserialize;

use crate::Page;
use crate::markdown::{MADE, cell, code, escaped, table};

/// A command, as `xtask describe` prints it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Command {
    name: String,
    about: String,
    example: Option<String>,
    arguments: Vec<Entry>,
    options: Vec<Entry>,
    commands: Vec<Command>,
}

/// An argument or an option.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// As it is typed: `--robot <ROBOT>`.
    usage: String,
    about: String,
}

pub(crate) fn page(menu: &str) -> Result<Page> {
    let verbs: Vec<Command> = serde_json::from_str(menu).context("what `xtask describe` prints")?;
    let mut text = format!(
        "{MADE}\n# Commands\n\nThis page lists every command with its options and an example. `cargo xtask COMMAND --help` prints the same in a terminal.\n\n"
    );
    let rows: Vec<Vec<String>> =
        verbs.iter().map(|verb| vec![format!("[`{0}`](#{0})", verb.name), cell(&verb.about)]).collect();
    text += &table(&["command", "what it does"], &rows);
    for verb in &verbs {
        section(verb, "", 2, &mut text);
    }
    Ok(Page::new("reference/commands.md", text))
}

fn section(command: &Command, above: &str, level: usize, text: &mut String) {
    let name = format!("{above}{}", command.name);
    *text += &format!("\n{} {name}\n\n{}\n", "#".repeat(level), escaped(&command.about));
    if let Some(example) = &command.example {
        *text += &format!("\n```sh\n{example}\n```\n");
    }
    let entries = command.arguments.iter().chain(&command.options);
    let rows: Vec<Vec<String>> = entries.map(|entry| vec![code(&entry.usage), cell(&entry.about)]).collect();
    if !rows.is_empty() {
        *text += &format!("\n{}", table(&["option", "meaning"], &rows));
    }
    for inner in &command.commands {
        section(inner, &format!("{name} "), level + 1, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_has_its_example_its_options_and_its_commands() {
        let menu = r#"[{"name": "bench", "about": "Times the parts", "example": "cargo xtask bench physics", "arguments": [],
            "options": [{"usage": "--json", "about": "Prints a|b."}],
            "commands": [{"name": "physics", "about": "One action", "example": null, "arguments": [], "options": [], "commands": []}]}]"#;
        let text = page(menu).unwrap().text;
        for part in ["[`bench`](#bench)", "```sh\ncargo xtask bench physics\n```", "| `--json` | Prints a\\|b. |"] {
            assert!(text.contains(part), "{text}");
        }
        assert!(text.contains("\n### bench physics\n"), "{text}");
        assert!(page("[{}]").is_err());
    }
}
