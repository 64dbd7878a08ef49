//! Where: channel × phase, and channel × time.

use std::collections::{BTreeMap, BTreeSet};

use super::html::{mean_square, words};
use crate::locate::{Cell, TIMES};

/// Rows of the map over time.
const ROWS: usize = 8;

/// Class of a mean square: four to a decade above noise.
fn class(value: f64) -> usize {
    if value > 1.0 { (4.0 * value.log10()).round().min(8.0) as usize } else { 0 }
}

/// `faint`: what does not stand out.
fn cell(value: f64, mark: &str, faint: bool) -> String {
    if value.is_finite() {
        let faint = if faint && class(value) > 0 { " faint" } else { "" };
        format!("<td class=\"h{}{faint}\">{}{mark}</td>", class(value), mean_square(value))
    } else {
        format!("<td class=\"void\">–{mark}</td>")
    }
}

/// Both maps.
pub(super) fn maps(cells: &[Cell]) -> String {
    if cells.is_empty() {
        return "<p class=\"soft\">Nothing was compared.</p>".into();
    }
    by_phase(cells) + &key(cells) + &over_time(cells)
}

/// Channel × phase.
pub(super) fn by_phase(cells: &[Cell]) -> String {
    let phases: BTreeSet<_> = cells.iter().map(|cell| cell.phase).collect();
    let mut channels: BTreeMap<_, BTreeMap<_, &Cell>> = BTreeMap::new();
    for cell in cells {
        channels.entry(cell.channel).or_default().insert(cell.phase, cell);
    }
    let mut out = String::from("<table class=\"heat\"><thead><tr><th></th>");
    for phase in &phases {
        out += &format!("<th scope=\"col\">{}</th>", phase.name());
    }
    out += "</tr></thead><tbody>";
    for (channel, row) in &channels {
        out += &format!("<tr><th scope=\"row\">{}</th>", words(channel.name()));
        for phase in &phases {
            out += &match row.get(phase) {
                Some(found) if found.stands_out() => cell(found.mean_square, "&#8239;*", false),
                Some(found) => cell(found.mean_square, "", true),
                None => "<td class=\"void\">·</td>".into(),
            };
        }
        out += "</tr>";
    }
    out + "</tbody></table>"
}

/// What the colours and the star mean.
fn key(cells: &[Cell]) -> String {
    let mut out = String::from("<table class=\"heat\"><tbody><tr><th>colour</th>");
    for (class, label) in ["1", "1.8", "3.2", "5.6", "10", "18", "32", "56", "100"].into_iter().enumerate() {
        out += &format!("<td class=\"h{class}\">{label}</td>");
    }
    let marked = cells.iter().any(Cell::stands_out);
    let marked = if marked { "" } else { " No cell here does." };
    out + "</tr></tbody></table><p class=\"soft\">Mean square of the residuals: 1 is noise; the darkest or brightest, 100 and more. * stands out in most episodes: p ≤ 0.05, corrected for the \
           number of cells; pale: does not, single episodes or errors of the engine."
        + marked
        + "</p>"
}

/// The cells with the largest shares, over time.
fn over_time(cells: &[Cell]) -> String {
    let mut out = String::from("<h3>Over time</h3><table class=\"heat time\"><thead><tr><th></th>");
    for eighth in 1..=TIMES {
        out += &format!("<th scope=\"col\">{eighth}/{TIMES}</th>");
    }
    out += "</tr></thead><tbody>";
    for found in cells.iter().take(ROWS) {
        let (channel, phase) = (words(found.channel.name()), found.phase.name());
        out += &format!("<tr><th scope=\"row\">{channel}, {phase}</th>");
        for value in found.over_time {
            out +=
                &value.map_or_else(|| "<td class=\"void\">·</td>".into(), |value| cell(value, "", !found.stands_out()));
        }
        out += "</tr>";
    }
    let left = if cells.len() > ROWS { " The cells with the largest shares of the gap." } else { "" };
    out + "</tbody></table><p class=\"soft\">Mean square in each eighth of the episodes." + left + "</p>"
}
