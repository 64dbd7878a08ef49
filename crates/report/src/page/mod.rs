//! Self-contained HTML pages: one file, no scripts, nothing from elsewhere.

mod episode;
mod run;
mod suite;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::Path;

pub use episode::episode_page;
pub use run::run_page;
pub use suite::{Suite, suite_page};

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

/// A page with this title.
fn page(title: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "{BEGINNING}\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/><title>{title}</title>\n\
         <style>\n{}</style></head>\n<body><main>\n<h1>{title}</h1>\n{body}</main></body></html>\n",
        include_str!("style.css")
    )
}

/// A part of a page, with an anchor.
fn section(id: &str, heading: &str, body: &str) -> String {
    format!("<section id=\"{id}\"><h2>{}</h2>\n{body}</section>\n", escape(heading))
}

/// Numbers that say it at a glance.
fn facts(facts: &[(String, &str)]) -> String {
    let items = facts.iter().map(|(number, what)| format!("<li><b>{}</b><span>{what}</span></li>", escape(number)));
    format!("<ul class=\"facts\">{}</ul>\n", items.collect::<String>())
}

/// A picture between the words.
fn picture(svg: &str, what: &str) -> String {
    // What is before the element is for a file of its own.
    let svg = svg.find("<svg").map_or(svg, |at| &svg[at..]).trim_end();
    format!("<figure role=\"img\" aria-label=\"{}\">{svg}</figure>\n", escape(what))
}

/// A table: heads, then rows; cells are HTML, the first of a row names it.
fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let head: String = heads.iter().map(|head| format!("<th scope=\"col\">{}</th>", escape(head))).collect();
    let row = |cells: &Vec<String>| {
        let cells: String = cells
            .iter()
            .enumerate()
            .map(|(i, cell)| if i == 0 { format!("<th scope=\"row\">{cell}</th>") } else { format!("<td>{cell}</td>") })
            .collect();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = rows.iter().map(row).collect();
    format!("<div class=\"scroll\"><table><thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table></div>\n")
}

/// Text between tags or in quoted attributes.
fn escape(text: &str) -> String {
    let clean: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    clean.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").replace('\'', "&#39;")
}

/// With so many decimals; a dash for what is no number.
fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}").replace('-', "−") } else { "–".into() }
}

/// A share as a percentage.
fn percent(share: f64) -> String {
    format!("{} %", fixed(100.0 * share, 0))
}

/// A p value, or a bound where it is small.
fn p_value(p: f64) -> String {
    if p < 0.001 { "&lt; 0.001".into() } else { fixed(p, 3) }
}
