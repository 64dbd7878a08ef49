//! All tables of `eval --all`.

use std::path::Path;

use experiments::{Combined, CombinedRow};

use maud::html;
use page::number::{p_value, percent};
use page::{Markup, Words, picture, section, table, text};

use super::run::failure;
use super::titled;
use crate::Error;

/// Combined tables with their pictures.
#[derive(Clone, Debug, Default)]
pub struct Suite {
    /// Name of each table, what it says, and its pictures with their names.
    tables: Vec<(String, Combined, Vec<Picture>)>,
}

/// File and content of a picture.
type Picture = (String, String);

impl Suite {
    /// The tables in a folder of `eval --all`, in their order; none where it holds none. What is no table is left alone.
    ///
    /// # Errors
    ///
    /// On a table in the format of another version: left out, it would not be missed.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|entry| entry.file_name().into_string().ok())
            .collect();
        names.sort();
        let mut pictures: Vec<Picture> = Vec::new();
        for name in names.iter().filter(|name| name.ends_with(".svg")) {
            pictures.extend(std::fs::read_to_string(folder.join(name)).map(|svg| (name.clone(), svg)));
        }
        let mut tables: Vec<(String, Combined, Vec<Picture>)> = Vec::new();
        for name in names.iter().filter_map(|name| name.strip_suffix(".json")) {
            let text = std::fs::read_to_string(folder.join(format!("{name}.json"))).unwrap_or_default();
            match serde_json::from_str::<Combined>(&text) {
                Ok(combined) => tables.push((name.to_owned(), combined, Vec::new())),
                Err(error) if is_some_table(&text) => {
                    let reason = whole_file::plain(&error.to_string());
                    return Err(Error::Table { path: folder.join(format!("{name}.json")), reason });
                }
                Err(_) => {}
            }
        }
        tables.sort_by_key(|(_, combined, _)| combined.order);
        for (file, svg) in pictures {
            // Named after the table, but for figure 4 of the paper, which shows the first.
            let belongs = |name: &str| {
                file.strip_prefix(name).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
            };
            let owner = tables.iter().position(|(name, ..)| belongs(name));
            let place = owner.or((file == "figure4.svg" && !tables.is_empty()).then_some(0));
            if let Some(place) = place {
                let list = &mut tables[place].2;
                let at = if file == "figure4.svg" || file.contains("success") { 0 } else { list.len() };
                list.insert(at, (file, svg));
            }
        }
        Ok(Self { tables })
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tables.is_empty()
    }
}

/// Whether a file is meant as a combined table, of whatever version.
fn is_some_table(text: &str) -> bool {
    let value: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
    ["rows", "comparisons", "provenance"].iter().all(|key| value.get(key).is_some())
}

/// A page about all tables.
#[must_use]
pub fn suite_page(suite: &Suite) -> String {
    let words = Words::default();
    let tables = suite.tables.iter();
    let sections: Vec<Markup> = tables
        .map(|(name, combined, pictures)| {
            let inside = html! {
                (grid(combined, &words))
                @if !combined.missing.is_empty() {
                    p.bad { "Not finished: " (combined.missing.join(", ")) "." }
                }
                @for (name, svg) in pictures { (picture(svg, name)) }
                (comparisons(combined, &words))
                (failures(combined, &words))
                (source(combined, &words))
            };
            section(name, &combined.title, &inside)
        })
        .collect();
    titled("Results", &html! { @for section in &sections { (section) } (section("words", "Words", &words.list())) })
}

/// Methods by domains.
fn grid(combined: &Combined, words: &Words) -> Markup {
    let domains = combined.domains();
    let cell = |row: Option<&CombinedRow>| {
        let Some(row) = row.map(|combined| &combined.row) else { return text("–") };
        let [low, high] = row.interval95;
        let published = row.published.map_or(String::new(), |p| format!(" ({})", p.successes));
        html! {
            span title=(format!("95 %: {} to {}", percent(low), percent(high))) {
                (row.successes) " of " (row.trials) (published)
            }
        }
    };
    let rows: Vec<Vec<Markup>> = combined
        .arms()
        .iter()
        .map(|arm| {
            let mut cells = vec![text(arm.label())];
            cells.extend(domains.iter().map(|domain| cell(combined.row(arm, domain))));
            cells
        })
        .collect();
    let mut heads = vec![words.mark_as("goal", "reached the goal")];
    heads.extend(domains.iter().map(|domain| words.mark_known(domain)));
    let methods: std::collections::BTreeSet<_> = combined.rows.iter().map(|row| row.row.method).collect();
    html! {
        (table(&heads, &rows))
        p.soft {
            "In brackets the paper's. Point at a cell for its 95 % Wilson interval. Methods: "
            @for (i, method) in methods.iter().enumerate() { @if i > 0 { ", " } (words.mark(method.name())) }
            "."
        }
    }
}

fn comparisons(combined: &Combined, words: &Words) -> Markup {
    // Over several domains together: those of one domain are in the files.
    let domains = combined.domains();
    let several = combined.comparisons.iter().filter(|c| domains.len() == 1 || !domains.contains(&c.domains));
    let rows: Vec<Vec<Markup>> = several
        .map(|c| {
            let (first, second) = c.arms();
            vec![
                text(format!("{}: {} and {}", c.domains, first.label(), second.label())),
                text(c.first_only),
                text(c.second_only),
                text(p_value(c.p)),
                text(p_value(c.mcnemar_p)),
            ]
        })
        .collect();
    if rows.is_empty() {
        return text("");
    }
    let heads = ["on the same worlds", "the first alone", "the second alone", "p (each world number one sign)"];
    let heads: Vec<Markup> = heads.iter().map(text).chain([words.mark("McNemar p")]).collect();
    html! { details { summary { "Comparisons on the same worlds" } (table(&heads, &rows)) } }
}

fn failures(combined: &Combined, words: &Words) -> Markup {
    let mut kinds: Vec<_> = combined.rows.iter().flat_map(|row| row.row.failures.keys().copied()).collect();
    kinds.sort();
    kinds.dedup();
    let mut heads = vec![text("failed by")];
    heads.extend(kinds.iter().map(|kind| failure(kind.name(), words)));
    let rows: Vec<Vec<Markup>> = combined
        .rows
        .iter()
        .map(|row| {
            let mut cells = vec![text(format!("{}, {}", row.arm().label(), row.row.domain))];
            cells.extend(kinds.iter().map(|kind| text(row.row.failures.get(kind).unwrap_or(&0))));
            cells
        })
        .collect();
    html! { details { summary { "Why trials failed" } (table(&heads, &rows)) } }
}

fn source(combined: &Combined, words: &Words) -> Markup {
    let provenance = &combined.provenance;
    let rows: Vec<Vec<Markup>> = provenance
        .runs
        .iter()
        .map(|(folder, run)| {
            let hash = run.scenario_hash.get(..12).unwrap_or(&run.scenario_hash);
            vec![text(folder), text(&run.commit), text(hash), text(run.trials)]
        })
        .collect();
    let heads = [text("run"), text("commit"), words.mark("scenario"), words.mark_as("trial", "trials")];
    html! {
        details {
            summary { "Where this comes from (seed " (provenance.common.seed) ")" }
            (table(&heads, &rows))
        }
    }
}
