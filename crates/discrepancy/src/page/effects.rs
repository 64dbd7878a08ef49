//! What: the named effects, their rivals, and the re-tuned nominal model.

use maud::html;
use page::number::{fixed, log_evidence, significant};
use page::{Markup, Words};
use physics_model::EffectKind;
use physics_model::effect::Neutral;

use super::plain;
use super::svg::{Axis, strip, strip_labels, upright};
use crate::interval::decimals;
use crate::report::{NamedEffect, RankedEffect, Report, Retuned, Value, Verdict};

/// The named effects.
pub(super) fn what(report: &Report, words: &Words) -> Markup {
    if !report.effects.is_empty() {
        return html! { @for named in &report.effects { (effect(named, words)) } };
    }
    html! {
        p {
            @if report.verdict == Verdict::Unknown {
                "No effect of the catalogue explains the gap. Where it acts is said under " a href="#remains" { "what remains" } "."
            } @else {
                "No " (words.mark("effect")) " is needed: the " (words.mark("re-tuned")) " nominal model explains the log as well as its noise, and contacts of its own, allow."
            }
        }
    }
}

fn effect(effect: &NamedEffect, words: &Words) -> Markup {
    html! {
        div.card {
            h3 { (plain(effect.name)) " " code.soft { (effect.name) } }
            p {
                (effect.description) " " (words.mark_as("confidence", "Confidence")) " " (confidence(effect.confidence)) "; "
                (words.mark("ln evidence")) " " (log_evidence(effect.log_evidence)) " over the model without it."
            }
            @for value in &effect.parameters { (parameter(effect, value, words)) }
        }
    }
}

/// A probability; nothing is certain.
pub(super) fn confidence(share: f64) -> String {
    if share > 0.995 { "> 99 %".into() } else { page::number::percent(share) }
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

fn parameter(effect: &NamedEffect, value: &Value, words: &Words) -> Markup {
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
    let inside = html! {
        @if let Some(none) = none { (upright("mark", &axis, none, 26)) }
        (span(&axis, [low, high], [4, 18]))
        circle.a cx=(axis.percent(value.value)) cy="13" r="4" {}
    };
    let digits = decimals(value.interval90, value.value);
    let degrees = if value.unit == "rad" {
        format!(" ({}°)", fixed(value.value.to_degrees(), digits.saturating_sub(2)))
    } else {
        String::new()
    };
    let no_effect = none.map(|none| format!("; {} is no effect", significant(none, 2))).unwrap_or_default();
    html! {
        div class="row param" {
            span { (plain(&value.name)) }
            div { (strip(&axis, 4, 26, &inside)) (strip_labels(&axis, 4)) }
            span {
                b { (fixed(value.value, digits)) " " (value.unit) } (degrees) br;
                span.soft {
                    (words.mark_as("90 % interval", "90 %")) ": " (fixed(low, digits)) " to " (fixed(high, digits)) (no_effect)
                }
            }
        }
    }
}

/// An interval as a bar, from the top and so high.
fn span(axis: &Axis, [low, high]: [f64; 2], [top, height]: [u32; 2]) -> Markup {
    let (left, width) = (axis.at(low), (axis.at(high) - axis.at(low)).max(0.006));
    html! {
        rect.bar x={ (format!("{:.2}", 100.0 * left)) "%" } y=(top) width={ (format!("{:.2}", 100.0 * width)) "%" } height=(height) rx="2" {}
    }
}

/// Fitted rivals by ln evidence, and what to do about those that are near.
pub(super) fn ranking(report: &Report, words: &Words) -> Markup {
    let names: Vec<String> = report.confusion_set.iter().map(|name| plain(name)).collect();
    let names = names.join(", ");
    let set = |shown: &str| words.mark_as("confusion set", shown);
    html! {
        @if report.ranking.is_empty() { p.soft { "No rival was fitted." } } @else { (bars(&report.ranking, words)) }
        @match (report.effects.is_empty(), report.confusion_set.len()) {
            (true, 0) => {}
            (true, _) => p { b { "What the evidence leans to, not enough for a name:" } " " (names) "." }
            (false, 0 | 1) => p { b { (set("Confusion set")) ":" } " no other effect explains this log as well." }
            (false, _) => p { b { (set("Not told apart")) " by this log:" } " " (names) "." }
        }
    }
}

fn bars(ranking: &[RankedEffect], words: &Words) -> Markup {
    let axis = Axis::linear(ranking.iter().map(|rival| rival.log_evidence).chain([0.0]));
    html! {
        div class="row rank soft" {
            span { "effect" } span {}
            span { span { (words.mark("gain")) } span { (words.mark_as("confidence", "right")) } span { (words.mark_as("held-out error", "held-out")) } }
        }
        @for rival in ranking { (bar(&axis, rival)) }
        div class="row rank axis" { span {} div { (strip_labels(&axis, 4)) } span {} }
        p.soft {
            "Gain in " (words.mark("ln evidence")) " over the re-tuned nominal model; right: how probable it is that this is the effect; held-out: mean square with it."
        }
    }
}

fn bar(axis: &Axis, rival: &RankedEffect) -> Markup {
    let gain = if rival.log_evidence.is_finite() { rival.log_evidence } else { 0.0 };
    let (a, b) = (axis.at(gain.min(0.0)), axis.at(gain.max(0.0)));
    let class = if gain < 0.0 { "neg" } else { "a" };
    let per_cent = |share: f64| format!("{:.2}%", 100.0 * share);
    let inside = html! {
        rect class=(class) x=(per_cent(a)) y="5" width=(per_cent((b - a).max(0.004))) height="14" rx="2" {}
        (upright("frame", axis, 0.0, 24))
    };
    html! {
        div class="row rank" {
            span { (plain(rival.name)) }
            div { (strip(axis, 4, 24, &inside)) }
            span { span { (log_evidence(rival.log_evidence)) } span { (fixed(rival.probability, 2)) } span { (fixed(rival.heldout, 2)) } }
        }
    }
}

/// Prior standard deviations that the chart of z scores spans on either side.
const Z_REACH: f64 = 4.0;

/// The nominal values against their prior.
pub(super) fn nominal(retuned: &[Retuned], words: &Words) -> Markup {
    if retuned.is_empty() {
        return html! { p.soft { "The log gives no nominal value a prior: nothing was re-tuned." } };
    }
    let axis = Axis::linear([-Z_REACH, Z_REACH]);
    html! {
        @for value in retuned { (z_row(&axis, value)) }
        div class="row nominal axis" { span {} div { (strip_labels(&axis, 8)) } span {} }
        p.soft {
            "z: distance from the prior's mean in its standard deviations, with the " (words.mark("90 % interval")) "; beyond 2 the nominal value was off, \
             which is no missing effect."
        }
    }
}

fn z_row(axis: &Axis, value: &Retuned) -> Markup {
    let [mean, stddev] = value.prior;
    // Of contacts the logarithm is normal, within a factor that is too large for a straight line.
    let is_factor = value.key.starts_with("contact.") && mean > 0.0;
    let z = |v: f64| match stddev {
        stddev if stddev <= 0.0 => 0.0,
        stddev if is_factor => (v.max(f64::MIN_POSITIVE) / mean).ln() * mean / stddev,
        stddev => (v - mean) / stddev,
    };
    let score = z(value.value);
    let inside = html! {
        (upright("mark", axis, 0.0, 24))
        (span(axis, value.interval90.map(z), [4, 16]))
        circle.a cx=(axis.percent(score)) cy="12" r="4" {}
    };
    let alarm = (score.abs() > 2.0).then_some("alarm");
    html! {
        div class="row nominal" {
            span { (value.key) br; span.soft { "prior " (significant(mean, 3)) " ± " (significant(stddev, 2)) } }
            div { (strip(axis, 8, 24, &inside)) }
            span {
                b { (fixed(value.value, decimals(value.interval90, value.value))) } br;
                span class=[alarm] { "z " (fixed(score, 1)) }
            }
        }
    }
}
