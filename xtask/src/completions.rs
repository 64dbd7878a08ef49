//! `cargo xtask completions SHELL`: a script that completes the verbs, and the options of all programs that are built.

pub(crate) mod help;

use std::path::Path;
use std::process::{Command as Process, ExitCode, Stdio};

use anyhow::Result;
use clap::{Command, CommandFactory as _};
use clap_complete::Shell;

use crate::built::{VIEWER, path};

/// Name that shells complete.
const NAME: &str = "xtask";

/// Commands of a program that have commands of their own: as deep as ours go.
const DEPTH: usize = 2;

#[derive(Debug, clap::Args)]
#[command(after_help = INSTALL)]
pub(crate) struct Options {
    /// Shell.
    shell: Shell,
}

const INSTALL: &str = "\
Install:
  bash        cargo xtask completions bash > ~/.local/share/surmise-completions.bash
              and in ~/.bashrc, behind whatever completes cargo:
              source ~/.local/share/surmise-completions.bash
  zsh         cargo xtask completions zsh > ~/.local/share/surmise-completions.zsh
              and in ~/.zshrc, behind compinit:
              source ~/.local/share/surmise-completions.zsh
  fish        cargo xtask completions fish > ~/.config/fish/completions/xtask.fish
  elvish      cargo xtask completions elvish > ~/.config/elvish/lib/xtask.elv, and `use xtask` in rc.elv
  powershell  cargo xtask completions powershell | Out-String | Invoke-Expression, in $PROFILE

In bash and zsh this completes `cargo xtask`; in every shell it completes a command `xtask`, so that
  alias xtask='cargo xtask'
is completed too. Options of the programs are taken from those that are built: once any command has run
(it builds all), write the script again.

Examples:
  cargo xtask completions bash";

/// `cargo xtask` in bash: the words behind `cargo` are those of `xtask`, everything else is left to what completes cargo.
const BASH: &str = r#"
if ! declare -F _cargo >/dev/null && declare -F _completion_loader >/dev/null; then
    _completion_loader cargo
fi
_xtask_of_cargo() {
    if [[ ${COMP_CWORD} -ge 2 && "${COMP_WORDS[1]}" == xtask ]]; then
        local COMP_WORDS=("${COMP_WORDS[@]:1}") COMP_CWORD=$((COMP_CWORD - 1))
        _xtask xtask "$2" "$3"
    elif declare -F _cargo >/dev/null; then
        _cargo "$@"
    fi
}
complete -F _xtask_of_cargo -o bashdefault -o default cargo
"#;

/// The completion of cargo for zsh asks a function of this name what follows `cargo xtask`.
const ZSH: &str = "\n_cargo-xtask() { _xtask \"$@\" }\n";

pub(crate) fn run(options: &Options) -> Result<ExitCode> {
    // The viewer's program is called otherwise than its verb, and is built for those alone who ask for it.
    let (mut menu, mut missing) = menu(|verb| path(if verb == "rerun" { VIEWER } else { verb }));
    missing.retain(|verb| verb != "rerun");
    if !missing.is_empty() {
        program::say!("not built, so without their options: {}", missing.join(", "));
    }
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut menu, NAME, &mut script);
    let more = match options.shell {
        Shell::Bash => BASH,
        Shell::Zsh => ZSH,
        _ => "",
    };
    script.extend(more.as_bytes());
    program::show(&String::from_utf8_lossy(&script));
    Ok(ExitCode::SUCCESS)
}

/// The menu with the options of the programs, and the programs that do not say theirs.
fn menu(path: impl Fn(&str) -> std::path::PathBuf) -> (Command, Vec<String>) {
    let mut menu = crate::Menu::command();
    let programs = menu.get_subcommands().filter(|verb| verb.get_arguments().any(|a| a.get_id() == "arguments"));
    let verbs: Vec<(String, String)> = programs
        .map(|verb| (verb.get_name().into(), verb.get_about().map(ToString::to_string).unwrap_or_default()))
        .collect();
    let mut missing = Vec::new();
    for (verb, about) in verbs {
        match described(&path(&verb), &verb, &[], &about) {
            Some(command) => menu = menu.mut_subcommand(&verb, |_| command),
            None => missing.push(verb),
        }
    }
    (menu, missing)
}

/// A command as the help of its program describes it.
fn described(program: &Path, name: &str, commands: &[&str], about: &str) -> Option<Command> {
    // Without a terminal, whose width would decide where lines break.
    let mut process = Process::new(program);
    let output = process.args(commands).arg("-h").stdin(Stdio::null()).env_remove("COLUMNS").output();
    let output = output.ok().filter(|output| output.status.success())?;
    let help = help::parse(&String::from_utf8_lossy(&output.stdout));
    let mut command = help.command(name, about);
    if commands.len() < DEPTH {
        for (inner, about) in &help.commands {
            let path: Vec<&str> = commands.iter().copied().chain([inner.as_str()]).collect();
            command = command.subcommand(described(program, inner, &path, about)?);
        }
    }
    Some(command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verbs_complete_without_any_program() {
        let (mut menu, missing) = menu(|_| "/nowhere/program".into());
        assert!(
            missing.iter().any(|verb| verb == "eval") && !missing.iter().any(|verb| verb == "doctor"),
            "{missing:?}"
        );
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish, Shell::Elvish, Shell::PowerShell] {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut menu, NAME, &mut script);
            let script = String::from_utf8(script).unwrap();
            assert!(script.contains("diagnose-benchmark") && script.contains("doctor"), "{shell}");
        }
    }
}
