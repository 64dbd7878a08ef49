//! Self-contained HTML pages: one file, no scripts, nothing from elsewhere.
//!
//! Pages are written with the templates of [`maud`], which escape whatever is put into them. This crate gives the frame of a page with its one
//! style sheet, the parts that pages share, numbers with sensible digits ([`number`]), and [`Words`], which marks special words and defines
//! them at the foot of the page.
//!
//! # Example
//! ```
//! use maud::html;
//! use page::{Words, document, facts, section};
//!
//! let words = Words::default();
//! let body = html! {
//!     (facts(&[("21".into(), words.mark("action"))]))
//!     (section("note", "Note", &html! { p { "From a file: " ("<b>") } }))
//!     (section("words", "Words", &words.list()))
//! };
//! let page = document("An episode", &body);
//! assert!(page.contains("From a file: &lt;b&gt;") && page.contains("One move of the tool by 2 cm"));
//! ```

mod glossary;
pub mod number;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::Path;

use maud::{PreEscaped, html};

pub use glossary::{Topic, Word, Words, glossary, word};
pub use maud::{Markup, Render};

/// What every page begins with.
const BEGINNING: &str = "<!DOCTYPE html>";

/// Whether a page may be written there: nothing is, or an older page, or what cannot be opened, which writing will say.
#[must_use]
pub fn may_be_replaced(file: &Path) -> bool {
    let mut start = [0; BEGINNING.len()];
    match File::open(file) {
        Ok(mut found) => {
            file.is_file() && found.read_exact(&mut start).is_ok() && start.as_slice() == BEGINNING.as_bytes()
        }
        Err(error) => error.kind() == ErrorKind::NotFound || !file.is_file(),
    }
}

/// A page with this title for the browser's tab; what is on it is `body`. Control characters become spaces.
#[must_use]
pub fn document(title: &str, body: &Markup) -> String {
    let page = html! {
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body { main { (body) } }
        }
    };
    let clean = |c: char| if c.is_control() && c != '\n' { ' ' } else { c };
    let text: String = page.into_string().chars().map(clean).collect();
    format!("{BEGINNING}\n{text}\n")
}

/// A part of a page, with an anchor.
#[must_use]
pub fn section(id: &str, heading: &str, body: &Markup) -> Markup {
    html! { section id=(id) { h2 { (heading) } (body) } "\n" }
}

/// Numbers that say it at a glance, each with what it counts.
#[must_use]
pub fn facts(facts: &[(String, Markup)]) -> Markup {
    html! {
        ul.facts {
            @for (number, what) in facts { li { b { (number) } span { (what) } } }
        }
    }
}

/// A picture drawn on white, from its SVG; `what` says it to those who do not see it.
#[must_use]
pub fn picture(svg: &str, what: &str) -> Markup {
    // What is before the element is for a file of its own.
    let svg = svg.find("<svg").map_or(svg, |at| &svg[at..]).trim_end();
    html! { figure.drawn role="img" aria-label=(what) { (PreEscaped(svg)) } "\n" }
}

/// A table in a box of its own, which scrolls where it is wider than the page; the first cell of a row names it.
#[must_use]
pub fn table(heads: &[Markup], rows: &[Vec<Markup>]) -> Markup {
    html! {
        div.scroll {
            table {
                // Without heads the first column names what stands in the second.
                @if heads.iter().any(|head| !head.0.is_empty()) {
                    thead { tr { @for head in heads { th scope="col" { (head) } } } }
                }
                tbody {
                    @for row in rows {
                        tr {
                            @for (i, cell) in row.iter().enumerate() {
                                @if i == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                        "\n"
                    }
                }
            }
        }
    }
}

/// Text as markup.
#[must_use]
pub fn text(text: impl Render) -> Markup {
    html! { (text) }
}
