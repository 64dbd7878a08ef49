//! The answer as a page: verdict, where the gap is, what friction looks like, how much is left.

use maud::html;
use page::number::{fixed, percent, significant};
use page::{Markup, document, facts, section, table, text};

use crate::decision::Verdict;
use crate::diagnosis::{Diagnosis, InJoint};
use crate::report::{Report, value};

/// Text of `report.html` for the log called `name`.
#[must_use]
pub fn page(name: &str, report: &Report) -> String {
    let diagnosis = report.diagnosis;
    let body = html! {
        h1 { (name) }
        p { (report.summary) }
        (facts(&figures(diagnosis)))
        @if diagnosis.verdict == Verdict::Effect { (section("effects", "What is missing", &effects(report))) }
        (section("where", "Where the nominal model fails", &located(report)))
        (section("friction", "Torque that is left against speed", &curves(report)))
        (section("joints", "Torque errors by joint", &errors(report)))
        (section("considered", "What was considered", &considered(report)))
        (section("next", "Next", &html! { p { (report.next_experiment) } }))
        @if !diagnosis.notes.is_empty() {
            (section("notes", "What was assumed", &html! { ul { @for note in &diagnosis.notes { li { (note) } } } }))
        }
    };
    document(&format!("Diagnosis of {name}"), &body)
}

fn figures(diagnosis: &Diagnosis) -> Vec<(String, Markup)> {
    let [effect, none, unknown] = diagnosis.probabilities;
    vec![
        (percent(effect), text("probability of the best effect")),
        (percent(none), text("that nothing is missing")),
        (percent(unknown), text("that something else is")),
        (percent(diagnosis.heldout.closed_fraction), text("of the squared torque error gone, held out")),
    ]
}

fn effects(report: &Report) -> Markup {
    let row = |name: &str, confidence: f64, joint: &InJoint| {
        let values = html! { @for parameter in &joint.parameters { (value(parameter)) br; } };
        vec![
            text(name),
            text(joint.joint_name.as_deref().unwrap_or("the arm")),
            text(joint.form),
            text(fixed(confidence, 2)),
            values,
        ]
    };
    let named = &report.diagnosis.effects;
    let rows: Vec<_> = named
        .iter()
        .flat_map(|effect| effect.joints.iter().map(|joint| row(effect.name, effect.confidence, joint)))
        .collect();
    html! {
        (table(&["effect", "joint", "form", "confidence", "values with 90 % intervals"].map(text), &rows))
        (kinds(report))
        @if report.diagnosis.confusion_set.len() > 1 {
            p { "This log does not tell apart: " (report.diagnosis.confusion_set.join(", ")) "." }
        }
    }
}

/// What each kind of friction would leave, for the joints in which one is named.
fn kinds(report: &Report) -> Markup {
    let named =
        report.diagnosis.effects.iter().flat_map(|effect| &effect.joints).filter(|joint| !joint.kinds.is_empty());
    let rows: Vec<Vec<Markup>> = named
        .flat_map(|joint| {
            joint.kinds.iter().map(|kind| {
                vec![
                    text(joint.joint_name.as_deref().unwrap_or_default()),
                    text(kind.name),
                    text(kind.values),
                    text(fixed(kind.log_evidence, 1)),
                    text(significant(kind.heldout_rms_nm, 3)),
                ]
            })
        })
        .collect();
    let heads =
        ["joint", "kind of friction", "values", "ln evidence behind the best", "held-out torque error, N m"].map(text);
    html! {
        @if !rows.is_empty() {
            p {
                "Kinds of friction side by side. Named is the simplest kind whose evidence is within a factor of twenty of the best, or which leaves less than 5 % more "
                "of the squared error on the pieces that were fitted."
            }
            (table(&heads, &rows))
        }
    }
}

/// Share of the gap, joints down and phases across.
fn located(report: &Report) -> Markup {
    let phases = ["standstill", "reversal", "slow", "fast"];
    let cell = |joint: usize, phase: &str| {
        let found = report.diagnosis.located.iter().find(|cell| cell.joint == joint && cell.phase == phase);
        let (share, rows) = found.map_or((0.0, 0.0), |cell| (cell.share, cell.rows));
        html! {
            span style=(format!("background:rgba(214,69,65,{:.2});padding:0.2em 0.6em", 0.8 * share.sqrt())) { (percent(share)) }
            " of " (percent(rows)) " rows"
        }
    };
    let rows: Vec<Vec<Markup>> = report
        .joints
        .iter()
        .enumerate()
        .map(|(joint, name)| std::iter::once(text(*name)).chain(phases.map(|phase| cell(joint, phase))).collect())
        .collect();
    let heads: Vec<Markup> = std::iter::once(text("joint")).chain(phases.map(text)).collect();
    html! {
        p { "Shares of the squared gap between measured torque and re-tuned nominal model, in variances of the noise." }
        (table(&heads, &rows))
    }
}

/// Means over ranges of speed, before and after.
fn curves(report: &Report) -> Markup {
    html! {
        p { "What the re-tuned nominal model leaves (orange) and what the model with all that was found leaves (blue), means over ranges of speed." }
        @for (joint, name) in report.joints.iter().enumerate() {
            figure { (curve(&report.diagnosis.curves[joint])) figcaption { (name) } }
        }
    }
}

fn curve(points: &[[f64; 3]]) -> Markup {
    const BINS: usize = 40;
    const SIZE: [f64; 2] = [520.0, 150.0];
    let fastest = points.iter().map(|point| point[0].abs()).fold(1e-6, f64::max);
    let mut bins = vec![[0.0_f64; 3]; BINS];
    for [rate, before, after] in points.iter().filter(|point| point[1].is_finite()) {
        let bin = (((rate / fastest + 1.0) * 0.5 * BINS as f64) as usize).min(BINS - 1);
        bins[bin][0] += 1.0;
        bins[bin][1] += before;
        bins[bin][2] += after;
    }
    let filled: Vec<(f64, f64, f64)> = bins
        .iter()
        .enumerate()
        .filter(|(_, bin)| bin[0] > 0.0)
        .map(|(i, bin)| ((i as f64 + 0.5) / BINS as f64, bin[1] / bin[0], bin[2] / bin[0]))
        .collect();
    let most = filled.iter().map(|(_, before, after)| before.abs().max(after.abs())).fold(1e-9, f64::max);
    let line = |which: fn(&(f64, f64, f64)) -> f64| -> String {
        let place = |point: &(f64, f64, f64)| {
            format!("{:.1},{:.1}", SIZE[0] * point.0, SIZE[1] * (0.5 - 0.45 * which(point) / most))
        };
        filled.iter().map(place).collect::<Vec<_>>().join(" ")
    };
    let label = format!("± {} rad/s across, ± {} N m up", significant(fastest, 2), significant(most, 2));
    html! {
        svg viewBox="0 0 520 170" width="100%" role="img" aria-label=(label) {
            line x1="0" x2="520" y1="75" y2="75" stroke="currentColor" stroke-opacity="0.3" {}
            line x1="260" x2="260" y1="0" y2="150" stroke="currentColor" stroke-opacity="0.3" {}
            polyline points=(line(|point| point.1)) fill="none" stroke="#e08a3c" stroke-width="2" {}
            polyline points=(line(|point| point.2)) fill="none" stroke="#1f6f8b" stroke-width="2" {}
            text x="4" y="166" font-size="9" fill="currentColor" { (label) }
        }
    }
}

fn errors(report: &Report) -> Markup {
    let heads = ["joint", "as the file says, N m", "re-tuned", "with what is named", "noise", "what nothing explains"]
        .map(text);
    let rows: Vec<Vec<Markup>> = report
        .joints
        .iter()
        .zip(&report.diagnosis.heldout.torque_rms_nm)
        .zip(&report.diagnosis.remainder)
        .map(|((name, rms), left)| {
            let numbers = [rms[0], rms[1], rms[2], left.noise_nm, left.moving_nm];
            std::iter::once(text(*name)).chain(numbers.map(|number| text(significant(number, 2)))).collect()
        })
        .collect();
    html! {
        p { "Root mean squares over windows of 0.04 s, on the pieces that were held out." }
        (table(&heads, &rows))
    }
}

fn considered(report: &Report) -> Markup {
    let heads = ["effect", "joints", "probability", "ln evidence", "held-out steadiness", "size"].map(text);
    let rows: Vec<Vec<Markup>> = report
        .diagnosis
        .considered
        .iter()
        .map(|one| {
            let joints: Vec<&str> = one.joints.iter().map(|joint| report.joints[*joint]).collect();
            vec![
                text(&one.name),
                text(joints.join(", ")),
                text(fixed(one.probability, 2)),
                text(significant(one.findings.log_evidence, 3)),
                text(fixed(one.findings.heldout_steadiness, 1)),
                text(significant(one.findings.size, 2)),
            ]
        })
        .collect();
    html! {
        @if rows.is_empty() { p { "No effect has more evidence than its absence." } }
        @else { (table(&heads, &rows)) }
    }
}
