//! Options and commands from the short help of a program. The menu links none of the programs: what it knows of them is what they print.

use clap::{Arg, Command};

/// What a program says of itself.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Help {
    options: Vec<Opt>,
    pub(crate) commands: Vec<(String, String)>,
}

/// An option that begins with two dashes.
#[derive(Debug, Default, PartialEq)]
struct Opt {
    long: String,
    takes_value: bool,
    values: Vec<String>,
    about: String,
}

impl Help {
    /// As a command of that name.
    pub(crate) fn command(&self, name: &str, about: &str) -> Command {
        let options = self.options.iter().filter(|o| !["help", "version"].contains(&o.long.as_str())).map(|option| {
            let arg = Arg::new(kept(&option.long)).long(kept(&option.long)).help(option.about.clone());
            match (option.takes_value, option.values.as_slice()) {
                (false, _) => arg.num_args(0),
                (true, []) => arg.num_args(1),
                (true, values) => arg.num_args(1).value_parser(values.iter().map(|v| kept(v)).collect::<Vec<_>>()),
            }
        });
        Command::new(kept(name)).about(about.to_string()).args(options)
    }
}

/// Names of clap live as long as the program, which ends with the script.
fn kept(text: &str) -> &'static str {
    text.to_string().leak()
}

/// Reads what clap prints for `-h`.
pub(crate) fn parse(text: &str) -> Help {
    let mut help = Help::default();
    let mut section = "";
    for line in text.lines() {
        let (indent, entry) = (line.len() - line.trim_start().len(), line.trim());
        if indent == 0 {
            section = entry;
        } else if section == "Options:" {
            if entry.starts_with('-') && indent < 10 {
                help.options.extend(option(entry));
            } else if let Some(last) = help.options.last_mut() {
                // A description that was wrapped.
                last.about = [&last.about, " ", entry].concat().trim().to_string();
            }
        } else if section == "Commands:" && indent < 4 {
            let (name, about) = entry.split_once("  ").unwrap_or((entry, ""));
            if name != "help" {
                help.commands.push((name.to_string(), about.trim().to_string()));
            }
        }
    }
    for option in &mut help.options {
        if let Some((about, values)) = option.about.clone().split_once("[possible values: ") {
            option.values = values.split(']').next().unwrap_or_default().split(", ").map(String::from).collect();
            option.about = about.trim().to_string();
        }
    }
    help
}

/// `-h, --help  Print help` or `--robot <ROBOT>  Arm`.
fn option(entry: &str) -> Option<Opt> {
    let (names, about) = entry.split_once("  ").unwrap_or((entry, ""));
    let long = names.split(", ").find_map(|name| name.strip_prefix("--"))?;
    let end = long.find([' ', '[', '=', '.']).unwrap_or(long.len());
    let takes_value = names.contains('<') || names.contains("[<");
    Some(Opt { long: long[..end].into(), takes_value, values: Vec::new(), about: about.trim().into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
Times the parts

Usage: bench [OPTIONS] <COMMAND>

Commands:
  physics   Times one action
  help      Print this message or the help of the given subcommand(s)

Options:
      --executor <EXECUTOR>  Who plays [default: local] [possible values: local, slurm,
                             hq]
      --json                 Prints one JSON object
      --set <KEY=VALUE>      Overrides an entry: key=value
  -h, --help                 Print help
";

    #[test]
    fn options_values_and_commands_are_found() {
        let help = parse(TEXT);
        assert_eq!(help.commands, [("physics".to_string(), "Times one action".to_string())]);
        let long: Vec<&str> = help.options.iter().map(|o| o.long.as_str()).collect();
        assert_eq!(long, ["executor", "json", "set", "help"]);
        assert_eq!(help.options[0].values, ["local", "slurm", "hq"]);
        assert_eq!(help.options[0].about, "Who plays [default: local]");
        assert!(!help.options[1].takes_value && help.options[2].takes_value);
    }

    #[test]
    fn a_command_has_the_options() {
        let command = parse(TEXT).command("bench", "Times the parts");
        command.clone().debug_assert();
        let matches = command.try_get_matches_from(["bench", "--executor", "hq", "--json"]).unwrap();
        assert_eq!(matches.get_one::<String>("executor").map(String::as_str), Some("hq"));
    }
}
