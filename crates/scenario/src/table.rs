//! Explanations as an aligned table.

use scenario::Explanation;

/// Widest value that a column makes room for; a longer one is wrapped or stands out.
const VALUE_WIDTH: usize = 30;
/// Narrowest column of meanings: below it a terminal breaks the lines itself.
const MEANING_WIDTH: usize = 24;

/// One row a key, and a line break in a meaning only where a terminal of `width` columns needs one.
pub(crate) fn render(explanations: &[Explanation], width: Option<usize>) -> String {
    let header = ["KEY", "VALUE", "UNIT", "FROM", "MEANING"].map(String::from);
    let rows: Vec<[String; 5]> = explanations.iter().map(row).collect();
    let longest = |column: usize| rows.iter().chain([&header]).map(|row| row[column].chars().count()).max();
    let [key, value, unit, from] = [0, 1, 2, 3].map(|column| longest(column).unwrap_or_default());
    let value = value.min(VALUE_WIDTH);
    let room = width.and_then(|width| width.checked_sub(key + value + unit + from + 8)).filter(|w| *w >= MEANING_WIDTH);
    let widths = [key, value, unit, from, room.unwrap_or(usize::MAX)];
    let mut text = String::new();
    for row in [&header].into_iter().chain(&rows) {
        let cells: Vec<Vec<String>> = row
            .iter()
            .zip(widths)
            // In a file one row is one line.
            .map(|(cell, width)| wrap(cell, if room.is_some() { width } else { usize::MAX }))
            .collect();
        let height = cells.iter().map(Vec::len).max().unwrap_or_default();
        for line in 0..height {
            let mut out = String::new();
            for (cell, width) in cells.iter().zip(&widths[..4]) {
                let part = cell.get(line).map_or("", String::as_str);
                out.push_str(&format!("{part:<width$}  "));
            }
            out.push_str(cells[4].get(line).map_or("", String::as_str));
            text.push_str(out.trim_end());
            text.push('\n');
        }
    }
    text
}

fn row(explanation: &Explanation) -> [String; 5] {
    let Explanation { key, value, unit, meaning, from } = explanation;
    // The rest of a longer explanation is in the JSON.
    let meaning = meaning.split("\n\n").next().unwrap_or_default();
    [key.clone(), value.to_string(), unit.clone(), from.name.clone(), meaning.to_string()]
}

/// Lines of at most `width` characters, broken at spaces where there are any.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().expect("there is a line");
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_string());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_wrapped_at_spaces() {
        assert_eq!(wrap("one two three", 7), ["one two", "three"]);
        assert_eq!(wrap("unbreakable x", 4), ["unbreakable", "x"]);
        assert_eq!(wrap("", 4), [""]);
    }
}
