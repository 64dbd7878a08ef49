//! `report.html`: the report for a reader. One file, no scripts, nothing from elsewhere.

mod effects;
mod gap;
mod heat_map;
mod svg;
#[cfg(test)]
mod tests;

use maud::html;
use page::number::{fixed, percent};
use page::{Markup, Words, document, facts, section, text};

use crate::report::{Report, Verdict};

/// A page about a report on the log `name`.
#[must_use]
pub fn page(name: &str, report: &Report) -> String {
    let words = Words::default();
    let located = html! {
        p {
            "Where the " (words.mark("re-tuned")) " " (words.mark("nominal model"))
            " disagrees with the log, on the episodes that it was fitted to."
        }
        (heat_map::maps(&report.located, &words))
    };
    let map = match report.verdict {
        Verdict::None => text(""),
        _ if report.remaining.is_empty() => html! { p.soft { "Nothing was compared." } },
        _ => heat_map::by_phase(&report.remaining, &words),
    };
    let body = html! {
        (verdict(name, report, &words))
        (section("what", "What", &effects::what(report, &words)))
        (section("where", "Where", &located))
        (section("gap", "Before and after", &gap::before_after(report, &words)))
        (section("rivals", "Rivals", &effects::ranking(report, &words)))
        (section("nominal", "Nominal values, re-tuned", &effects::nominal(&report.retuned, &words)))
        (section("remains", "What remains", &html! { (gap::remains(report)) (map) }))
        (section("reading", "How to read the figures", &foot(report, &words)))
    };
    document(&format!("Diagnosis of {name}"), &body)
}

/// A name of the catalogue or of a channel in words.
fn plain(name: &str) -> String {
    name.replace('_', " ")
}

fn verdict(name: &str, report: &Report, words: &Words) -> Markup {
    let (class, badge, term) = match report.verdict {
        Verdict::Effect => ("effect", "effect found", "effect"),
        Verdict::None => ("none", "nothing missing", "none"),
        Verdict::Unknown => ("unknown", "unknown effect", "unknown"),
    };
    let heldout = &report.heldout;
    let error = || html! { (words.mark("held-out error")) "; 1 is noise" };
    let mut numbers = vec![if report.effects.is_empty() {
        (fixed(heldout.before, 2), error())
    } else {
        (format!("{} → {}", fixed(heldout.before, 2), fixed(heldout.after, 2)), error())
    }];
    if let Some(first) = report.effects.first() {
        numbers.push((percent(heldout.closed_fraction), html! { "of the " (words.mark("gap")) " closed" }));
        if report.verdict == Verdict::Effect {
            let what = html! { (words.mark("confidence")) " in the name" };
            numbers.push((effects::confidence(first.confidence), what));
        }
    }
    numbers.push((report.heldout.episodes.len().to_string(), html! { "episodes " (words.mark("held out")) }));
    let begun = report.model.as_ref().map(|model| {
        let effects: Vec<String> = report.effects_in_model.iter().map(|name| plain(name)).collect();
        let effects = if effects.is_empty() { "no effect".into() } else { effects.join(", ") };
        html! { p.soft { "Begun with " (model) ", which has " (effects) "." } }
    });
    html! {
        header {
            p.log { (name) }
            span.{ "badge " (class) } { (words.mark_as(term, badge)) }
            h1 { (report.summary) }
            @for warning in &report.warnings { p.call { b { "Check the log: " } (warning.sentence) } }
            @if let Some(begun) = begun { (begun) }
            @if let Some(reason) = &report.reason { p.call { "Why unknown: " (reason) "." } }
            @if let Some(description) = &report.description { p.call { "What is left: " (description) "." } }
            @for sentence in report.retuned_sentences() { p.call { (sentence) } }
            (facts(&numbers))
            p { b { "Next:" } " " (report.next_experiment) }
        }
    }
}

fn foot(report: &Report, words: &Words) -> Markup {
    let fold = report.fold.map(|[part, parts]| format!(", part {part} of {parts} held out")).unwrap_or_default();
    let left_out = report.left_out_sentence().map(|sentence| format!(" {sentence}.")).unwrap_or_default();
    let thinned = report.thinned.sentence().map(|sentence| format!(" {sentence}.")).unwrap_or_default();
    // Marked before the list is made.
    let last = html! {
        p.soft {
            (words.mark_as("seed", "Seed")) " " (report.seed) (fold) "; " (report.rollouts) " "
            (words.mark_as("simulated episode", "simulated episodes")) ", " (fixed(report.seconds, 1)) " s. Version "
            (report.version) " of the contract of report.json. " (report.split.sentence()) " " (report.noise_sentence()) (left_out) (thinned)
        }
    };
    html! { (words.list()) (last) }
}
