//! The menu, by what somebody wants to do.

use std::fmt::Write as _;

use clap::{Command, CommandFactory as _};

/// What somebody wants, and the verbs for it in the order in which they are needed.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Try it", &["doctor", "demo", "report", "rerun"]),
    ("Plan: how often does it succeed?", &["eval", "scenario"]),
    ("Diagnose a log of a robot", &["import-log", "record-log", "log", "robot", "diagnose"]),
    ("Train a prior", &["datagen", "train", "calibrate", "posterior-data"]),
    ("Measure the project itself", &["bench", "diagnose-benchmark", "diagnose-learn", "arm-learn"]),
    ("Develop", &["docs", "ci", "completions"]),
];

const EXAMPLES: &str = "\
Examples:
  cargo xtask doctor
  cargo xtask demo
  cargo xtask eval --domain D4 --trials 2
  cargo xtask eval --help                  (each verb has options and an example)";

/// The command line, with verbs in groups.
pub(crate) fn menu() -> Command {
    let menu = crate::Menu::command();
    let mut text = String::new();
    for (title, verbs) in GROUPS {
        let _ = writeln!(text, "{title}");
        for verb in verbs {
            let about = menu.find_subcommand(verb).and_then(Command::get_about).map(ToString::to_string);
            let _ = writeln!(text, "  {verb:<18}  {}", about.unwrap_or_default());
        }
        text.push('\n');
    }
    menu.help_template("{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}Options:\n{options}{after-help}")
        .before_help(text)
        .after_help(EXAMPLES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_stands_in_one_group_with_what_it_does() {
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, verbs)| verbs.iter().copied()).collect();
        grouped.sort_unstable();
        let menu = crate::Menu::command();
        let mut verbs: Vec<&str> =
            menu.get_subcommands().filter(|verb| !verb.is_hide_set()).map(Command::get_name).collect();
        verbs.sort_unstable();
        assert_eq!(grouped, verbs);
        let text = super::menu().render_help().to_string();
        assert!(text.contains("eval                Plays trials of methods"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 110), "{text}");
    }
}
