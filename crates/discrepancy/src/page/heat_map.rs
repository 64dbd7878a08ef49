//! Where: channel × phase, and channel × time.

use std::collections::{BTreeMap, BTreeSet};

use maud::html;
use page::number::mean_square;
use page::{Markup, Words, text};

use super::plain;
use crate::locate::{Cell, TIMES};

/// Rows of the map over time.
const ROWS: usize = 8;

/// Class of a mean square: four to a decade above noise.
fn class(value: f64) -> usize {
    if value > 1.0 { (4.0 * value.log10()).round().min(8.0) as usize } else { 0 }
}

/// `faint`: what does not stand out.
fn cell(value: f64, mark: &str, faint: bool) -> Markup {
    if !value.is_finite() {
        return html! { td.void { "–" (mark) } };
    }
    let faint = if faint && class(value) > 0 { " faint" } else { "" };
    html! { td class=(format!("h{}{faint}", class(value))) { (mean_square(value)) (mark) } }
}

/// Both maps.
pub(super) fn maps(cells: &[Cell], words: &Words) -> Markup {
    if cells.is_empty() {
        return html! { p.soft { "Nothing was compared." } };
    }
    html! { (by_phase(cells, words)) (key(cells, words)) (over_time(cells, words)) }
}

/// Channel × phase.
pub(super) fn by_phase(cells: &[Cell], words: &Words) -> Markup {
    let phases: BTreeSet<_> = cells.iter().map(|cell| cell.phase).collect();
    let mut channels: BTreeMap<_, BTreeMap<_, &Cell>> = BTreeMap::new();
    for cell in cells {
        channels.entry(cell.channel).or_default().insert(cell.phase, cell);
    }
    let shown = |found: Option<&&Cell>| match found {
        Some(found) if found.stands_out() => cell(found.mean_square, "\u{202f}*", false),
        Some(found) => cell(found.mean_square, "", true),
        None => html! { td.void { "·" } },
    };
    html! {
        table.heat {
            thead { tr { th {} @for phase in &phases { th scope="col" { (words.mark_as("phase", phase.name())) } } } }
            tbody {
                @for (channel, row) in &channels {
                    tr {
                        th scope="row" { (plain(channel.name())) }
                        @for phase in &phases { (shown(row.get(phase))) }
                    }
                }
            }
        }
    }
}

/// What the colours and the star mean.
fn key(cells: &[Cell], words: &Words) -> Markup {
    let labels = ["1", "1.8", "3.2", "5.6", "10", "18", "32", "56", "100"];
    let marked = cells.iter().any(Cell::stands_out);
    html! {
        table.heat {
            tbody {
                tr {
                    th { "colour" }
                    @for (class, label) in labels.into_iter().enumerate() { td class=(format!("h{class}")) { (label) } }
                }
            }
        }
        p.soft {
            (words.mark_as("mean square", "Mean square")) " of the " (words.mark_as("residual", "residuals"))
            ": 1 is noise; the darkest or brightest, 100 and more. * stands out in most episodes: "
            (words.mark_as("p value", "p")) " ≤ 0.05, corrected for the number of cells; pale: does not, single episodes or errors of the engine."
            @if !marked { " No cell here does." }
        }
    }
}

/// The cells with the largest shares, over time.
fn over_time(cells: &[Cell], words: &Words) -> Markup {
    let eighth = |value: Option<f64>, found: &Cell| match value {
        Some(value) => cell(value, "", !found.stands_out()),
        None => html! { td.void { "·" } },
    };
    let left = if cells.len() > ROWS {
        html! { " The cells with the largest " (words.mark_as("share", "shares")) " of the gap." }
    } else {
        text("")
    };
    html! {
        h3 { "Over time" }
        table class="heat time" {
            thead { tr { th {} @for eighth in 1..=TIMES { th scope="col" { (eighth) "/" (TIMES) } } } }
            tbody {
                @for found in cells.iter().take(ROWS) {
                    tr {
                        th scope="row" { (plain(found.channel.name())) ", " (found.phase.name()) }
                        @for value in found.over_time { (eighth(value, found)) }
                    }
                }
            }
        }
        p.soft { "Mean square in each eighth of the episodes." (left) }
    }
}
