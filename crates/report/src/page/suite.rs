//! All tables of `eval --all`.

use std::path::Path;

use experiments::{Combined, CombinedRow};

use super::{escape, fixed, p_value, page, percent, picture, section, table};
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
                Err(source) if is_some_table(&text) => {
                    return Err(Error::Table { path: folder.join(format!("{name}.json")), source });
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
    let mut body = String::new();
    for (name, combined, pictures) in &suite.tables {
        let mut inside = grid(combined);
        if !combined.missing.is_empty() {
            inside += &format!("<p class=\"bad\">Not finished: {}.</p>\n", escape(&combined.missing.join(", ")));
        }
        for (name, svg) in pictures {
            inside += &picture(svg, name);
        }
        inside += &comparisons(combined);
        inside += &failures(combined);
        inside += &source(combined);
        body += &section(name, &combined.title, &inside);
    }
    page("Results", &body)
}

/// Methods by domains.
fn grid(combined: &Combined) -> String {
    let domains = combined.domains();
    let cell = |row: Option<&CombinedRow>| {
        row.map_or("–".into(), |r| {
            let published = r.row.published.map_or(String::new(), |p| format!(" ({})", p.successes));
            let [low, high] = r.row.interval95;
            format!(
                "<span title=\"95 %: {} to {}\">{} of {}{published}</span>",
                percent(low),
                percent(high),
                r.row.successes,
                r.row.trials
            )
        })
    };
    let rows: Vec<Vec<String>> = combined
        .arms()
        .iter()
        .map(|arm| {
            let mut cells = vec![escape(&arm.label())];
            cells.extend(domains.iter().map(|domain| cell(combined.row(arm, domain))));
            cells
        })
        .collect();
    let mut heads = vec!["reached the goal"];
    heads.extend(domains.iter().map(String::as_str));
    table(&heads, &rows)
        + "<p class=\"soft\">In brackets the paper's. Point at a cell for its 95 % Wilson interval.</p>\n"
}

fn comparisons(combined: &Combined) -> String {
    // Over several domains together: those of one domain are in the files.
    let domains = combined.domains();
    let several = combined.comparisons.iter().filter(|c| domains.len() == 1 || !domains.contains(&c.domains));
    let rows: Vec<Vec<String>> = several
        .map(|c| {
            let (first, second) = c.arms();
            vec![
                format!("{}: {} and {}", escape(&c.domains), escape(&first.label()), escape(&second.label())),
                c.first_only.to_string(),
                c.second_only.to_string(),
                p_value(c.p),
                p_value(c.mcnemar_p),
            ]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let heads =
        ["on the same worlds", "the first alone", "the second alone", "p (each world number one sign)", "McNemar p"];
    format!("<details><summary>Comparisons on the same worlds</summary>{}</details>\n", table(&heads, &rows))
}

fn failures(combined: &Combined) -> String {
    let mut kinds: Vec<_> = combined.rows.iter().flat_map(|row| row.row.failures.keys().copied()).collect();
    kinds.sort();
    kinds.dedup();
    let mut heads = vec!["failed by"];
    heads.extend(kinds.iter().map(|kind| kind.name()));
    let rows: Vec<Vec<String>> = combined
        .rows
        .iter()
        .map(|row| {
            let mut cells = vec![escape(&format!("{}, {}", row.arm().label(), row.row.domain))];
            cells.extend(kinds.iter().map(|kind| row.row.failures.get(kind).unwrap_or(&0).to_string()));
            cells
        })
        .collect();
    format!("<details><summary>Why trials failed</summary>{}</details>\n", table(&heads, &rows))
}

fn source(combined: &Combined) -> String {
    let provenance = &combined.provenance;
    let rows: Vec<Vec<String>> = provenance
        .runs
        .iter()
        .map(|(folder, run)| {
            let hash = run.scenario_hash.get(..12).unwrap_or(&run.scenario_hash);
            vec![escape(folder), escape(&run.commit), escape(hash), run.trials.to_string()]
        })
        .collect();
    let heads = ["run", "commit", "scenario", "trials"];
    let seed = fixed(provenance.common.seed as f64, 0);
    format!("<details><summary>Where this comes from (seed {seed})</summary>{}</details>\n", table(&heads, &rows))
}
