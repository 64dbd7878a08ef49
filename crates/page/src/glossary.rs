//! The words that pages define, from `assets/glossary.toml`.

use std::cell::RefCell;
use std::sync::LazyLock;

use maud::{Markup, html};
use serde::Deserialize;

/// What a word is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Topic {
    /// Acting under uncertainty.
    Planning,
    /// Compared methods.
    Method,
    /// Families of worlds.
    Domain,
    /// Tables of results.
    Results,
    /// The trained network.
    Network,
    /// Simulation against measurement.
    Diagnosis,
}

/// A word with what it means.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Word {
    /// As it is printed.
    pub term: String,
    /// What it is about.
    pub topic: Topic,
    /// One sentence.
    pub means: String,
    /// Other forms that are printed.
    #[serde(default)]
    pub also: Vec<String>,
    /// Further sentences.
    #[serde(default)]
    pub more: String,
    /// Terms that help.
    #[serde(default)]
    pub see: Vec<String>,
}

impl Word {
    /// Its anchor in a page: lower case, with hyphens for all that is neither a letter nor a digit.
    #[must_use]
    pub fn anchor(&self) -> String {
        let words = self.term.to_lowercase();
        words.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty()).collect::<Vec<_>>().join("-")
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Glossary {
    word: Vec<Word>,
}

static GLOSSARY: LazyLock<Vec<Word>> = LazyLock::new(|| {
    let read: Glossary =
        toml::from_str(include_str!("../../../assets/glossary.toml")).expect("a test reads the glossary");
    read.word
});

/// All words, by topic and term.
#[must_use]
pub fn glossary() -> &'static [Word] {
    &GLOSSARY
}

/// The word of this term.
#[must_use]
pub fn word(term: &str) -> Option<&'static Word> {
    GLOSSARY.iter().find(|word| word.term == term)
}

/// Marks the words of one page and keeps which they were, for the list at its foot.
#[derive(Debug, Default)]
pub struct Words(RefCell<Vec<&'static Word>>);

impl Words {
    /// The term with its meaning on hover and a link to the list. A term that the glossary lacks stays plain text of the class `undefined`,
    /// which tests of pages look for.
    #[must_use]
    pub fn mark(&self, term: &str) -> Markup {
        self.mark_as(term, term)
    }

    /// The same for another form of the word.
    #[must_use]
    pub fn mark_as(&self, term: &str, shown: &str) -> Markup {
        let Some(word) = word(term) else { return html! { span.undefined { (shown) } } };
        let mut used = self.0.borrow_mut();
        if !used.contains(&word) {
            used.push(word);
        }
        html! { a.word href={ "#word-" (word.anchor()) } title=(word.means) { (shown) } }
    }

    /// Marked where the glossary has it, else as plain text: for names from files.
    #[must_use]
    pub fn mark_known(&self, shown: &str) -> Markup {
        if word(shown).is_some() {
            self.mark(shown)
        } else {
            html! { (shown) }
        }
    }

    /// The marked words with their meanings, in alphabetical order, for the foot of the page.
    #[must_use]
    pub fn list(&self) -> Markup {
        let mut used = self.0.borrow().clone();
        used.sort_by_key(|word| word.term.to_lowercase());
        html! {
            dl {
                @for word in used {
                    dt id={ "word-" (word.anchor()) } { dfn { (word.term) } }
                    dd { (word.means) @if !word.more.is_empty() { " " (word.more) } }
                }
            }
        }
    }
}
