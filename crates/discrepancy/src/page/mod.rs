//! `report.html`: the report for a reader. One file, no scripts, nothing from elsewhere.

mod effects;
mod gap;
mod heat_map;
mod html;
mod svg;
#[cfg(test)]
mod tests;

use crate::diagnosis::Settings;
use crate::report::{Report, Verdict};
use html::{escape, fixed};

/// A page about a report on the log `name`.
#[must_use]
pub fn page(name: &str, report: &Report) -> String {
    let title = escape(name);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
         <title>Diagnosis of {title}</title>\n<style>\n{}</style></head>\n<body><main>",
        include_str!("style.css")
    );
    out += &verdict(&title, report);
    let mut section = |id: &str, heading: &str, body: &str| {
        out += &format!("\n<section id=\"{id}\"><h2>{heading}</h2>{body}</section>");
    };
    section("what", "What", &effects::what(report));
    let before =
        "<p>Where the re-tuned nominal model disagrees with the log, on the episodes that it was fitted to.</p>";
    section("where", "Where", &(before.to_string() + &heat_map::maps(&report.located)));
    section("gap", "Before and after", &gap::before_after(report));
    section("rivals", "Rivals", &effects::ranking(report));
    section("nominal", "Nominal values, re-tuned", &effects::nominal(&report.retuned));
    let map = match report.verdict {
        Verdict::None => String::new(),
        _ if report.remaining.is_empty() => "<p class=\"soft\">Nothing was compared.</p>".into(),
        _ => heat_map::by_phase(&report.remaining),
    };
    section("remains", "What remains", &(gap::remains(report) + &map));
    section("reading", "How to read the figures", &foot(report));
    out + "</main></body></html>\n"
}

fn verdict(title: &str, report: &Report) -> String {
    let (class, badge) = match report.verdict {
        Verdict::Effect => ("effect", "effect found"),
        Verdict::None => ("none", "nothing missing"),
        Verdict::Unknown => ("unknown", "unknown effect"),
    };
    let heldout = &report.heldout;
    let mut facts = vec![if report.effects.is_empty() {
        (fixed(heldout.before, 2), "held-out error; 1 is noise")
    } else {
        (format!("{} → {}", fixed(heldout.before, 2), fixed(heldout.after, 2)), "held-out error; 1 is noise")
    }];
    if let Some(first) = report.effects.first() {
        facts.push((format!("{} %", fixed(100.0 * heldout.closed_fraction, 0)), "of the gap closed"));
        if report.verdict == Verdict::Effect {
            facts.push((effects::confidence(first.confidence), "confidence in the name"));
        }
    }
    facts.push((report.heldout.episodes.len().to_string(), "episodes held out"));
    let facts: String =
        facts.iter().map(|(number, what)| format!("<li><b>{number}</b><span>{what}</span></li>")).collect();
    let mut call = String::new();
    if let Some(reason) = &report.reason {
        call += &format!("<p class=\"call\">Why unknown: {}.</p>", escape(reason));
    }
    if let Some(description) = &report.description {
        call += &format!("<p class=\"call\">What is left: {}.</p>", escape(description));
    }
    let begun = report.model.as_ref().map_or(String::new(), |model| {
        let effects: Vec<String> = report.effects_in_model.iter().map(|name| html::words(name)).collect();
        let effects = if effects.is_empty() { "no effect".into() } else { effects.join(", ") };
        format!("<p class=\"soft\">Begun with {}, which has {effects}.</p>", escape(model))
    });
    format!(
        "<header><p class=\"log\">{title}</p><span class=\"badge {class}\">{badge}</span><h1>{}</h1>{begun}{call}<ul class=\"facts\">{facts}</ul><p><b>Next:</b> {}</p></header>",
        escape(&report.summary),
        escape(&report.next_experiment)
    )
}

fn foot(report: &Report) -> String {
    let settings = Settings::default();
    let confidence = format!(
        "Probability of the name among the fitted rivals and the nominal model, of ln evidences divided by {:.0}: what the engine gets wrong many readings \
         share, and each is counted. {:.0} ahead is {:.0} to 1.",
        settings.temperature,
        settings.near(),
        settings.confusion
    );
    let lines = [
        (
            "residual",
            "(measured − simulated) / noise, over a block of rows; white: freed of what the solver's settings and the start's error would do.",
        ),
        ("mean square", "Of white residuals; 1 is noise alone, 4 is an error twice as large as the noise."),
        (
            "held-out",
            "Episodes that no value was fitted to (where a body or a patch may be, and which name is kept, they have a say in); before: nominal model re-tuned; after: with the named effects.",
        ),
        ("ln evidence", "How much more probable the log is under a model, its free values integrated over."),
        ("confidence", confidence.as_str()),
        (
            "90 % interval",
            "By bootstrap over episodes, widened by what the engine's errors add: nine of ten hold the true value.",
        ),
        ("p value", "Chance that some cell stands out as much by luck, by flips of signs between episodes."),
        ("share", "Part of all that is beyond noise."),
    ];
    let lines: String = lines.iter().map(|(name, text)| format!("<dt>{name}</dt><dd>{text}</dd>")).collect();
    let fold = report.fold.map(|[part, parts]| format!(", part {part} of {parts} held out")).unwrap_or_default();
    let left_out = report.left_out_sentence().map(|sentence| format!(" {sentence}.")).unwrap_or_default();
    format!(
        "<dl>{lines}</dl><p class=\"soft\">Seed {}{fold}; {} simulated episodes, {} s. Version {} of the contract of report.json.{left_out}</p>",
        report.seed,
        report.rollouts,
        fixed(report.seconds, 1),
        report.version
    )
}
