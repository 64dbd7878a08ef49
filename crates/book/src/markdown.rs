//! Text in Markdown.

/// Says of a page where it comes from.
pub(crate) const MADE: &str = "<!-- Made by `cargo xtask docs --write`. Do not edit. -->";

/// Text as it is: no markup in it means anything.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::new();
    let mut code = false;
    for c in text.chars() {
        code ^= c == '`';
        match c {
            '<' if !code => out += "&lt;",
            '*' | '_' | '[' | ']' if !code => {
                out.push('\\');
                out.push(c);
            }
            c => out.push(c),
        }
    }
    out
}

/// A cell of a table: one line, without the bar that ends cells.
pub(crate) fn cell(text: &str) -> String {
    escaped(text).split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// Code in a cell.
pub(crate) fn code(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("`{}`", text.replace('|', "\\|")) }
}

/// A table whose cells are Markdown.
pub(crate) fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let head: Vec<String> = head.iter().map(ToString::to_string).collect();
    let rule = format!("|{}\n", "---|".repeat(head.len()));
    line(&head) + &rule + &rows.iter().map(|row| line(row)).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_be_markup_is_text() {
        assert_eq!(escaped("a_b <FILE> `x_y <z>` [1]"), "a\\_b &lt;FILE> `x_y <z>` \\[1\\]");
        assert_eq!(cell("one\n two | three"), "one two \\| three");
        assert_eq!(code("a|b"), "`a\\|b`");
        assert_eq!(table(&["a", "b"], &[vec!["1".into(), "2".into()]]), "| a | b |\n|---|---|\n| 1 | 2 |\n");
    }
}
