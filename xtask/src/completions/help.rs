//! Options and commands from the short help of a program. The menu links none of the programs: what it knows of them is what they print.

use clap::{Arg, Command};

/// What a program says of itself.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Help {
    /// What it is for: the first paragraph.
    pub(crate) about: String,
    /// The first command behind the options that can be typed.
    pub(crate) example: Option<String>,
    options: Vec<Opt>,
    /// Arguments without a name, and what they are.
    pub(crate) arguments: Vec<(String, String)>,
    pub(crate) commands: Vec<(String, String)>,
}

/// An option that begins with two dashes.
#[derive(Debug, Default, PartialEq)]
struct Opt {
    /// As the help has it: `--robot <ROBOT>`.
    usage: String,
    long: String,
    takes_value: bool,
    values: Vec<String>,
    about: String,
}

impl Help {
    /// Options as they are typed and what they are for, but for those that all programs have.
    pub(crate) fn usages(&self) -> impl Iterator<Item = (String, String)> + '_ {
        let own = self.options.iter().filter(|option| !["help", "version"].contains(&option.long.as_str()));
        own.map(|option| {
            let values = match &option.values[..] {
                [] => String::new(),
                values => format!(". Values: {}.", values.join(", ")),
            };
            (option.usage.clone(), format!("{}{values}", option.about.trim_end_matches('.')))
        })
    }

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

/// Reads what clap prints for `-h` and for `--help`.
pub(crate) fn parse(text: &str) -> Help {
    let mut help = Help::default();
    let first = text.split("\n\n").next().unwrap_or_default();
    if !first.starts_with("Usage:") {
        help.about = first.split_whitespace().collect::<Vec<_>>().join(" ");
    }
    let (mut section, mut examples) = ("", 0);
    for line in text.lines() {
        let (indent, entry) = (line.len() - line.trim_start().len(), line.trim());
        if entry.is_empty() {
            continue;
        }
        // What follows two spaces is a remark.
        let without_remark = entry.split("  ").next().unwrap_or_default().trim();
        if entry.starts_with("cargo xtask ") && section != "Options:" {
            help.example.get_or_insert(without_remark.into());
            examples += 1;
        } else if let (Some(example), 1) = (&mut help.example, examples)
            && indent > 0
            && section.starts_with("Example")
        {
            // Long ones go on in the next line.
            more(example, without_remark);
        }
        if indent == 0 {
            section = entry;
        } else if section == "Options:" {
            if entry.starts_with('-') && indent < 10 {
                help.options.extend(option(entry));
            } else if let Some(last) = help.options.last_mut() {
                more(&mut last.about, entry);
            }
        } else if section == "Arguments:" {
            if entry.starts_with(['<', '[']) && indent < 10 {
                let (usage, about) = entry.split_once("  ").unwrap_or((entry, ""));
                help.arguments.push((usage.into(), about.trim().into()));
            } else if let Some((_, about)) = help.arguments.last_mut() {
                more(about, entry);
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
            let (values, rest) = values.split_once(']').unwrap_or((values, ""));
            option.values = values.split(", ").map(String::from).collect();
            option.about = [about.trim(), rest.trim()].join(" ").trim().to_string();
        } else if let Some((about, values)) = option.about.clone().split_once("Possible values:") {
            // One a line, with what it means: `- local: on this machine`.
            let (values, default) = match values.split_once("[default: ") {
                Some((values, default)) => (values, format!(" [default: {default}")),
                None => (values, String::new()),
            };
            let names = values.split("- ").filter_map(|value| value.split(':').next());
            option.values = names.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty()).collect();
            option.about = about.trim().to_string() + &default;
        }
    }
    help
}

/// A description that was wrapped.
fn more(about: &mut String, entry: &str) {
    *about = [about.as_str(), " ", entry].concat().trim().to_string();
}

/// `-h, --help  Print help` or `--robot <ROBOT>  Arm`.
fn option(entry: &str) -> Option<Opt> {
    let (names, about) = entry.split_once("  ").unwrap_or((entry, ""));
    let long = names.split(", ").find_map(|name| name.strip_prefix("--"))?;
    let end = long.find([' ', '[', '=', '.']).unwrap_or(long.len());
    let takes_value = names.contains('<') || names.contains("[<");
    let (usage, long) = (names.trim().into(), long[..end].into());
    Some(Opt { usage, long, takes_value, values: Vec::new(), about: about.trim().into() })
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

    const LONG: &str = "\
Checks a
file.

Usage: check [OPTIONS] <FILE>

Arguments:
  <FILE>
          What to check.

Options:
      --engine <ENGINE>
          Who plays. As in cargo xtask eval.

          Possible values:
          - local: on this machine
          - slurm: on a cluster

  -h, --help
          Print help

Examples:
  cargo xtask scenario check D4 --robot sawyer --out
  runs/checked  # a remark
  cargo xtask scenario check D5 --robot
  jaco
";

    #[test]
    fn the_long_help_says_the_same_and_an_example() {
        let help = parse(LONG);
        assert_eq!(help.about, "Checks a file.");
        assert_eq!(help.example.as_deref(), Some("cargo xtask scenario check D4 --robot sawyer --out runs/checked"));
        assert_eq!(help.arguments, [("<FILE>".to_owned(), "What to check.".to_owned())]);
        let usages: Vec<_> = help.usages().collect();
        let about = "Who plays. As in cargo xtask eval. Values: local, slurm.";
        assert_eq!(usages, [("--engine <ENGINE>".to_owned(), about.to_owned())]);
    }

    #[test]
    fn a_command_has_the_options() {
        let command = parse(TEXT).command("bench", "Times the parts");
        command.clone().debug_assert();
        let matches = command.try_get_matches_from(["bench", "--executor", "hq", "--json"]).unwrap();
        assert_eq!(matches.get_one::<String>("executor").map(String::as_str), Some("hq"));
    }
}
