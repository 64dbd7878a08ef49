//! What the documents say of an effect, read from the docs of its module: there is no second text.
//!
//! The docs of a module in [`crate::effects`] have this form, a blank line between the parts:
//!
//! 1. one sentence: what it is;
//! 2. the equation, with what it needs to be read;
//! 3. a table of the parameters, with the columns symbol, key, unit, plausible, source;
//! 4. a paragraph that begins with "Shows": in which channel, and when;
//! 5. paragraphs on how it acts.

use serde::Serialize;

use super::{EffectKind, Neutral, Parameter};
use crate::effects::SOURCES;

/// An effect as the documents describe it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sheet {
    /// Name in scenario files and reports.
    pub name: &'static str,
    /// One sentence on what it is.
    pub summary: String,
    /// The equation, and what its symbols are where the table does not say it.
    pub equation: String,
    /// Parameters, as the table of the docs has them.
    pub parameters: Vec<SheetRow>,
    /// In which channel of a log it shows, and when.
    pub shows: String,
    /// How it acts, in paragraphs.
    pub acts: String,
}

/// A row of the table of parameters: one of them, or several of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SheetRow {
    /// Symbol in the equation.
    pub symbol: String,
    /// Keys in scenario files.
    pub keys: Vec<String>,
    /// Unit, `–` for a ratio.
    pub unit: String,
    /// Range that real set-ups have.
    pub plausible: String,
    /// Value without effect.
    pub neutral: String,
    /// Where the range comes from.
    pub source: String,
}

impl EffectKind {
    /// What the documents say of it.
    #[must_use]
    pub fn sheet(self) -> Sheet {
        let source = SOURCES.iter().find(|(name, _)| *name == self.name()).map_or("", |(_, source)| source);
        read(self, source)
    }
}

fn read(kind: EffectKind, source: &str) -> Sheet {
    let mut sheet = Sheet {
        name: kind.name(),
        summary: String::new(),
        equation: String::new(),
        parameters: Vec::new(),
        shows: String::new(),
        acts: String::new(),
    };
    for (place, paragraph) in paragraphs(source).into_iter().enumerate() {
        if paragraph.starts_with("| symbol |") {
            sheet.parameters = paragraph.lines().skip(2).filter_map(|line| row(kind, line)).collect();
            continue;
        }
        let text = plain(&paragraph.replace('\n', " "));
        let part = match (place, sheet.parameters.is_empty()) {
            (0, _) => &mut sheet.summary,
            (_, true) => &mut sheet.equation,
            _ if text.starts_with("Shows ") => &mut sheet.shows,
            _ => &mut sheet.acts,
        };
        let space = if part.is_empty() { "" } else { " " };
        *part += &format!("{space}{text}");
    }
    sheet
}

/// Paragraphs of the docs at the beginning of a module.
fn paragraphs(source: &str) -> Vec<String> {
    let lines: Vec<&str> = source.lines().map_while(|line| line.strip_prefix("//!")).map(str::trim).collect();
    lines.split(|line| line.is_empty()).filter(|part| !part.is_empty()).map(|part| part.join("\n")).collect()
}

fn row(kind: EffectKind, line: &str) -> Option<SheetRow> {
    let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
    let [symbol, keys, unit, plausible, source] = cells[..] else { return None };
    let keys: Vec<String> = keys.split(", ").map(|key| key.trim_matches('`').to_owned()).collect();
    let neutral = kind.parameters().iter().find(|parameter| stands_for(&keys, parameter)).map_or("–".into(), neutral);
    let [symbol, unit, plausible, source] = [symbol, unit, plausible, source].map(String::from);
    Some(SheetRow { symbol, keys, unit, plausible, neutral, source })
}

/// Whether one of the keys is that of a parameter. A key that holds a list has a parameter for each place: `size_m` has `size_0_m`.
fn stands_for(keys: &[String], parameter: &Parameter) -> bool {
    let digits = |c: char| c.is_ascii_digit();
    let list = parameter.name.split('_').filter(|part| !part.chars().all(digits)).collect::<Vec<_>>().join("_");
    keys.iter().any(|key| key == parameter.name || *key == list)
}

fn neutral(parameter: &Parameter) -> String {
    match parameter.neutral {
        Neutral::Value(value) if value.is_infinite() => "infinite".into(),
        Neutral::Value(value) => value.to_string(),
        Neutral::Free(_) => "any".into(),
        Neutral::Friction => "that of the object".into(),
        Neutral::ContactFrequency | Neutral::ContactDamping | Neutral::Restitution => "that of the world".into(),
    }
}

/// Without the links of rustdoc, and without the letters of the places where effects act.
fn plain(text: &str) -> String {
    let mut text = text.replace("[`crate::effect::", "`").replace("[`super::", "`").replace("`]", "`");
    for letter in ["N", "K", "F", "A", "O"] {
        text = text.replace(&format!(" ({letter})"), "").replace(&format!(" ({letter}, "), " (");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_all_parts_and_one_sentence_that_says_what_it_is() {
        for kind in EffectKind::ALL {
            let sheet = kind.sheet();
            let parts = [&sheet.summary, &sheet.equation, &sheet.shows, &sheet.acts];
            for part in parts {
                assert!(part.len() > 8 && part.ends_with('.'), "{}: {part:?}", sheet.name);
                assert!(!part.contains("[`") && !part.contains("crate::"), "{}: {part:?}", sheet.name);
            }
            assert_eq!(sheet.summary.matches(". ").count(), 0, "{}: {}", sheet.name, sheet.summary);
            assert!(sheet.acts.starts_with("Acts "), "{}: {}", sheet.name, sheet.acts);
        }
    }

    #[test]
    fn tables_have_the_parameters_of_the_code_with_their_units_and_ranges() {
        for kind in EffectKind::ALL {
            let sheet = kind.sheet();
            for parameter in kind.parameters() {
                let rows: Vec<&SheetRow> =
                    sheet.parameters.iter().filter(|row| stands_for(&row.keys, parameter)).collect();
                let [row] = rows[..] else { panic!("{}: {} rows of {}", sheet.name, rows.len(), parameter.name) };
                let unit = if parameter.unit.is_empty() { "–" } else { parameter.unit };
                assert_eq!(row.unit, unit, "{}: {}", sheet.name, parameter.name);
                // Where the docs give a number, its upper end is that of the code.
                let numbers = row.plausible.chars().any(|c| c.is_ascii_digit()) && !row.plausible.contains('π');
                let high = parameter.plausible[1].to_string();
                assert!(!numbers || row.plausible.contains(&high), "{}: {} and {high}", sheet.name, row.plausible);
            }
        }
    }

    #[test]
    fn parts_are_found_by_their_form() {
        let source = "//! A thing.\n//!\n//! |F| ≤\n//! 3.\n//!\n//! | symbol | key | unit | plausible | source |\n//! |---|---|---|---|---|\n\
            //! | k | `pull_off_n` | N | 1 to 2 | a book |\n//!\n//! Shows in\n//! all.\n//!\n//! Acts (F) as\n//! [`crate::effect::Memory`] says.\nuse x;\n";
        let sheet = read(EffectKind::Adhesion, source);
        assert_eq!((sheet.summary.as_str(), sheet.equation.as_str()), ("A thing.", "|F| ≤ 3."));
        assert_eq!((sheet.shows.as_str(), sheet.acts.as_str()), ("Shows in all.", "Acts as `Memory` says."));
        let row = &sheet.parameters[0];
        assert_eq!((row.symbol.as_str(), &row.keys[..]), ("k", &["pull_off_n".to_owned()][..]));
        assert_eq!((row.neutral.as_str(), row.source.as_str()), ("0", "a book"));
    }
}
