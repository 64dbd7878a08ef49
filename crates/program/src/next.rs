//! What a program says last: what to do next.

use std::path::Path;

use crate::say;

/// Says on standard error what somebody may do next: each a command that works as it stands, and what it does. Standard output is for
/// results.
///
/// ```
/// program::next(&[(["cargo", "xtask", "report", "runs/my run"].map(String::from).to_vec(), "makes a page of it")]);
/// ```
pub fn next(commands: &[(Vec<String>, &str)]) {
    if commands.is_empty() {
        return;
    }
    say("next:");
    for (words, what) in commands {
        say(&format!("  {}  # {what}", line(words)));
    }
}

/// The words of a command as a shell takes them.
fn line(words: &[String]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A path as it is typed here: relative to the current folder where it lies in it.
#[must_use]
pub fn typed(path: &Path) -> String {
    let here = std::env::current_dir().ok();
    let inside = here.as_ref().and_then(|here| path.strip_prefix(here).ok());
    let path = inside.filter(|inside| !inside.as_os_str().is_empty()).unwrap_or(path);
    path.display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_what_a_shell_takes() {
        let words = ["cargo", "xtask", "eval", "--set", "effects.truth=[{ a = 1 }]", "it's", "runs/my run", "D4", ""];
        assert_eq!(
            line(&words.map(String::from)),
            "cargo xtask eval --set 'effects.truth=[{ a = 1 }]' 'it'\\''s' 'runs/my run' D4 ''"
        );
    }

    #[test]
    fn a_path_below_the_current_folder_is_typed_without_it() {
        let here = std::env::current_dir().unwrap();
        assert_eq!(typed(&here.join("runs/a")), "runs/a");
        assert_eq!(typed(Path::new("runs/a")), "runs/a");
        assert_eq!(typed(Path::new("/nowhere/a")), "/nowhere/a");
        assert_eq!(typed(&here), here.display().to_string());
    }
}
