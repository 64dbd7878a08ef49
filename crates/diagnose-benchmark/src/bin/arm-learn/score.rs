//! Tables of how often the answers are right.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use arm_diagnosis::{Considered, Decision, Verdict};

use crate::Case;

/// A log as it was answered.
struct Judged<'a> {
    case: &'a Case,
    /// With its probability, and its confidence.
    best: Option<(&'a Considered, f64, f64)>,
    verdict: Verdict,
    /// By how much intervals are wider than the fit's own.
    wider: f64,
}

impl<'a> Judged<'a> {
    fn new(case: &'a Case, decision: &Decision) -> Self {
        let left = &case.answer.leftover;
        let rated = case.answer.considered.iter().map(|one| {
            let probability = decision.right(&one.findings, left);
            (one, probability, probability * decision.kind(&one.findings, &one.name, left))
        });
        let best = rated.max_by(|a, b| a.1.total_cmp(&b.1));
        let probability = best.map_or(0.0, |(_, probability, _)| probability);
        let [_, none, unknown] = decision.verdict(probability, left);
        let verdict = match () {
            () if probability > 0.5 => Verdict::Effect,
            () if unknown > none => Verdict::Unknown,
            () => Verdict::None,
        };
        Self { case, best, verdict, wider: decision.wider(&case.truth.effect) }
    }

    fn is_right(&self) -> bool {
        self.verdict == Verdict::Effect && self.best.is_some_and(|(one, _, _)| self.case.truth.is(one))
    }

    fn is_kin(&self) -> bool {
        self.verdict == Verdict::Effect && self.best.is_some_and(|(one, _, _)| self.case.truth.is_kin(one))
    }

    fn names_effect(&self) -> bool {
        self.best.is_some_and(|(one, _, _)| one.name == self.case.truth.effect)
    }

    fn is_sure(&self) -> bool {
        self.best.is_some_and(|(_, _, confidence)| confidence >= 0.9)
    }
}

/// Counts of one kind of logs.
fn share(found: usize, of: usize) -> String {
    if of == 0 {
        return "–".into();
    }
    let [low, high] = statistics::wilson95(found as u32, of as u32);
    format!("{found} of {of} ({:.0} to {:.0} %)", 100.0 * low, 100.0 * high)
}

/// All tables, as Markdown.
pub(crate) fn table(cases: &[(&Case, &Decision)]) -> String {
    let judged: Vec<Judged> = cases.iter().map(|(case, decision)| Judged::new(case, decision)).collect();
    let mut text = String::from(
        "| logs | effect named first | with its joint | kinds of friction as one | none called `none` | false alarm | wrong name, sure | outside called `unknown` | 90 % intervals hold | calibration error |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut groups: Vec<(String, Vec<&Judged>)> = vec![("all".into(), judged.iter().collect())];
    let mut by: BTreeMap<String, Vec<&Judged>> = BTreeMap::new();
    for one in &judged {
        let truth = &one.case.truth;
        let sensor = if truth.servo { "commands alone" } else { "torques" };
        for key in [truth.engine.clone(), format!("{} ", truth.motion), sensor.into()] {
            by.entry(key).or_default().push(one);
        }
    }
    groups.extend(by);
    for (name, logs) in &groups {
        row(&mut text, name.trim(), logs);
    }
    text.push_str("\n| effect | logs | shown | named with its joint | in the confusion set |\n|---|---|---|---|---|\n");
    let mut effects: BTreeMap<&str, Vec<&Judged>> = BTreeMap::new();
    for one in judged.iter().filter(|one| !one.case.truth.is_none()) {
        effects.entry(one.case.truth.effect.as_str()).or_default().push(one);
    }
    for (effect, logs) in effects {
        let shown: Vec<_> = logs.iter().filter(|one| one.case.truth.shows()).collect();
        let right = shown.iter().filter(|one| one.is_right()).count();
        let near = shown.iter().filter(|one| one.case.answer.confusion_set.iter().any(|name| name == effect)).count();
        let _ = writeln!(text, "| `{effect}` | {} | {} | {right} | {near} |", logs.len(), shown.len());
    }
    text
}

fn row(text: &mut String, name: &str, logs: &[&Judged]) {
    let count = |filter: &dyn Fn(&Judged) -> bool| logs.iter().filter(|one| filter(one)).count();
    let inside = |one: &Judged| !one.case.truth.is_none() && !one.case.truth.is_outside() && one.case.truth.shows();
    let none = |one: &Judged| one.case.truth.is_none();
    let outside = |one: &Judged| one.case.truth.is_outside() && one.case.truth.shows();
    let wrong = |one: &Judged| one.verdict == Verdict::Effect && one.is_sure() && !one.names_effect();
    let intervals = logs
        .iter()
        .filter(|one| one.is_right())
        .flat_map(|one| one.case.answer.off.values().map(|off| off.abs() <= one.wider));
    let held = intervals.clone().filter(|held| *held).count();
    let _ = writeln!(
        text,
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2} |",
        share(count(&|one| inside(one) && one.verdict == Verdict::Effect && one.names_effect()), count(&inside)),
        share(count(&|one| inside(one) && one.is_right()), count(&inside)),
        share(count(&|one| inside(one) && one.is_kin()), count(&inside)),
        share(count(&|one| none(one) && one.verdict == Verdict::None), count(&none)),
        share(count(&|one| none(one) && one.verdict == Verdict::Effect && one.is_sure()), count(&none)),
        share(count(&wrong), logs.len()),
        share(count(&|one| outside(one) && one.verdict == Verdict::Unknown), count(&outside)),
        share(held, intervals.count()),
        calibration_error(logs),
    );
}

/// Mean distance between confidence and share of right names, over five ranges of confidence, weighted by their logs (expected calibration error).
fn calibration_error(logs: &[&Judged]) -> f64 {
    let mut bins = [(0.0, 0.0, 0.0); 5];
    for one in logs {
        let Some((best, _, confidence)) = one.best else { continue };
        let bin = &mut bins[((confidence * 5.0) as usize).min(4)];
        bin.0 += 1.0;
        bin.1 += confidence;
        bin.2 += f64::from(u8::from(one.case.truth.is(best)));
    }
    let total: f64 = bins.iter().map(|bin| bin.0).sum();
    bins.iter().filter(|bin| bin.0 > 0.0).map(|bin| (bin.1 - bin.2).abs()).sum::<f64>() / total.max(1.0)
}
