//! What: the named effects, their rivals, and the re-tuned nominal model.

use physics_model::EffectKind;
use physics_model::effect::Neutral;

use super::html::{escape, fixed, log_evidence, significant, words};
use super::svg::{Axis, strip, strip_labels};
use crate::diagnosis::Settings;
use crate::interval::decimals;
use crate::report::{NamedEffect, RankedEffect, Report, Retuned, Value, Verdict};

/// The named effects.
pub(super) fn what(report: &Report) -> String {
    if report.effects.is_empty() {
        let text = match report.verdict {
            Verdict::Unknown => {
                "No effect of the catalogue explains the gap. Where it acts is said under <a href=\"#remains\">what remains</a>."
            }
            _ => "No effect is needed: the re-tuned nominal model explains the log as well as its noise allows.",
        };
        return format!("<p>{text}</p>");
    }
    report.effects.iter().map(effect).collect()
}

fn effect(effect: &NamedEffect) -> String {
    let mut out = format!(
        "<div class=\"card\"><h3>{} <code class=\"soft\">{}</code></h3><p>{} Confidence {}; ln evidence {} over the model without it.</p>",
        words(effect.name),
        escape(effect.name),
        escape(effect.description),
        confidence(effect.confidence),
        log_evidence(effect.log_evidence),
    );
    for value in &effect.parameters {
        out += &parameter(effect, value);
    }
    out + "</div>"
}

/// A probability; nothing is certain.
pub(super) fn confidence(share: f64) -> String {
    if share > 0.995 { "&gt; 99 %".into() } else { format!("{} %", fixed(100.0 * share, 0)) }
}

/// Where the parameter has no effect.
fn neutral(effect: &str, key: &str) -> Option<f64> {
    let kind = EffectKind::ALL.iter().find(|kind| kind.name() == effect)?;
    let parameter = kind.parameters().iter().find(|parameter| parameter.name == key)?;
    match parameter.neutral {
        Neutral::Value(value) if value.is_finite() => Some(value),
        _ => None,
    }
}

fn parameter(effect: &NamedEffect, value: &Value) -> String {
    let [low, high] = value.interval90;
    let none = neutral(effect.name, &value.key);
    let axis = match none {
        // One scale for all that has one unit and one neutral value.
        Some(none) => {
            let alike = |other: &&Value| other.unit == value.unit && neutral(effect.name, &other.key) == Some(none);
            let values = effect.parameters.iter().filter(alike);
            Axis::linear(values.flat_map(|other| [other.value, other.interval90[0], other.interval90[1]]).chain([none]))
        }
        // The interval within as much again on either side.
        None => Axis::linear([value.value, low - (high - low), high + (high - low)]),
    };
    let mut inside = String::new();
    if let Some(none) = none {
        let x = axis.percent(none);
        inside += &format!("<line class=\"mark\" x1=\"{x}\" x2=\"{x}\" y1=\"0\" y2=\"26\"/>");
    }
    let (left, width) = (axis.percent(low), 100.0 * (axis.at(high) - axis.at(low)).max(0.006));
    inside += &format!("<rect class=\"bar\" x=\"{left}\" y=\"4\" width=\"{width:.2}%\" height=\"18\" rx=\"2\"/>");
    inside += &format!("<circle class=\"a\" cx=\"{}\" cy=\"13\" r=\"4\"/>", axis.percent(value.value));
    let digits = decimals(value.interval90, value.value);
    let unit = escape(value.unit);
    let degrees = if value.unit == "rad" {
        format!(" ({}°)", fixed(value.value.to_degrees(), digits.saturating_sub(2)))
    } else {
        String::new()
    };
    let no_effect = none.map(|none| format!("; {} is no effect", significant(none, 2))).unwrap_or_default();
    format!(
        "<div class=\"row param\"><span>{}</span><div>{}{}</div><span><b>{} {unit}</b>{degrees}<br/><span class=\"soft\">90 %: {} to {}{no_effect}</span></span></div>",
        words(&value.name),
        strip(&axis, 4, 26, &inside),
        strip_labels(&axis, 4),
        fixed(value.value, digits),
        fixed(low, digits),
        fixed(high, digits),
    )
}

/// Fitted rivals by ln evidence, and what to do about those that are near.
pub(super) fn ranking(report: &Report) -> String {
    let mut out = String::new();
    if report.ranking.is_empty() {
        out += "<p class=\"soft\">No rival was fitted.</p>";
    } else {
        let axis = Axis::linear(report.ranking.iter().map(|rival| rival.log_evidence).chain([0.0]));
        let best = report.ranking.iter().map(|rival| rival.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        out += "<div class=\"row rank soft\"><span>effect</span><span></span><span><span>gain</span><span>behind</span><span>held-out</span></span></div>";
        out += &report.ranking.iter().map(|rival| bar(&axis, rival, best)).collect::<String>();
        out += &format!(
            "<div class=\"row rank axis\"><span></span><div>{}</div><span></span></div>",
            strip_labels(&axis, 4)
        );
        let settings = Settings::default();
        let [near, odds] = [settings.near(), settings.confusion];
        out += &format!(
            "<p class=\"soft\">Gain in ln evidence over the re-tuned nominal model; behind: how much less than the best ({near:.0} is {odds:.0} to 1, see confidence); held-out: mean square with it. A name needs both: the gain, and held-out episodes that agree.</p>"
        );
    }
    let names: Vec<String> = report.confusion_set.iter().map(|name| words(name)).collect();
    let names = names.join(", ");
    out += &match (report.effects.is_empty(), report.confusion_set.len()) {
        (true, 0) => String::new(),
        (true, _) => format!("<p><b>What the evidence leans to, not enough for a name:</b> {names}.</p>"),
        (false, 0 | 1) => "<p><b>Confusion set:</b> no other effect explains this log as well.</p>".into(),
        (false, _) => format!("<p><b>Not told apart by this log:</b> {names}.</p>"),
    };
    out
}

fn bar(axis: &Axis, rival: &RankedEffect, best: f64) -> String {
    let gain = if rival.log_evidence.is_finite() { rival.log_evidence } else { 0.0 };
    let (a, b) = (axis.at(gain.min(0.0)), axis.at(gain.max(0.0)));
    let class = if gain < 0.0 { "neg" } else { "a" };
    let zero = axis.percent(0.0);
    let inside = format!(
        "<rect class=\"{class}\" x=\"{:.2}%\" y=\"5\" width=\"{:.2}%\" height=\"14\" rx=\"2\"/><line class=\"frame\" x1=\"{zero}\" x2=\"{zero}\" y1=\"0\" y2=\"24\"/>",
        100.0 * a,
        100.0 * (b - a).max(0.004),
    );
    let behind = best - rival.log_evidence;
    let behind = if behind > 0.0 { log_evidence(-behind) } else { "–".into() };
    format!(
        "<div class=\"row rank\"><span>{}</span><div>{}</div><span><span>{}</span><span>{behind}</span><span>{}</span></span></div>",
        words(rival.name),
        strip(axis, 4, 24, &inside),
        log_evidence(rival.log_evidence),
        fixed(rival.heldout, 2),
    )
}

/// Prior standard deviations that the chart of z scores spans on either side.
const Z_REACH: f64 = 4.0;

/// The nominal values against their prior.
pub(super) fn nominal(retuned: &[Retuned]) -> String {
    if retuned.is_empty() {
        return "<p class=\"soft\">The log gives no nominal value a prior: nothing was re-tuned.</p>".into();
    }
    let axis = Axis::linear([-Z_REACH, Z_REACH]);
    let mut out: String = retuned.iter().map(|value| z_row(&axis, value)).collect();
    out += &format!(
        "<div class=\"row nominal axis\"><span></span><div>{}</div><span></span></div>",
        strip_labels(&axis, 8)
    );
    out + "<p class=\"soft\">z: distance from the prior's mean in its standard deviations, with the 90 % interval; beyond 2 the nominal value was off, \
           which is no missing effect.</p>"
}

fn z_row(axis: &Axis, value: &Retuned) -> String {
    let [mean, stddev] = value.prior;
    let z = |v: f64| if stddev > 0.0 { (v - mean) / stddev } else { 0.0 };
    let [low, high] = value.interval90;
    let (score, left) = (z(value.value), axis.at(z(low)));
    let width = (axis.at(z(high)) - left).max(0.006);
    let zero = axis.percent(0.0);
    let inside = format!(
        "<line class=\"mark\" x1=\"{zero}\" x2=\"{zero}\" y1=\"0\" y2=\"24\"/><rect class=\"bar\" x=\"{:.2}%\" y=\"4\" width=\"{:.2}%\" height=\"16\" rx=\"2\"/>\
         <circle class=\"a\" cx=\"{}\" cy=\"12\" r=\"4\"/>",
        100.0 * left,
        100.0 * width,
        axis.percent(score),
    );
    let class = if score.abs() > 2.0 { " class=\"alarm\"" } else { "" };
    format!(
        "<div class=\"row nominal\"><span>{}<br/><span class=\"soft\">prior {} ± {}</span></span><div>{}</div><span><b>{}</b><br/><span{class}>z {}</span></span></div>",
        escape(&value.key),
        significant(mean, 3),
        significant(stddev, 2),
        strip(axis, 8, 24, &inside),
        fixed(value.value, decimals(value.interval90, value.value)),
        fixed(score, 1),
    )
}
