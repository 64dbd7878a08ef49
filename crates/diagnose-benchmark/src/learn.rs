//! How a diagnosis decides, learnt from logs of other engines: answers of `diagnose` beside the truth of each log.
//!
//! Logs of other engines: a folder holds `log-NNN/` and `truth/log-NNN.json`, as `tests/peers/worlds/make_logs.py` writes them; answers lie in `ANSWERS/FOLDER/log-NNN/report.json`.
//! What is learnt is judged on the engine that was left out, each in turn.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result};
use discrepancy::decision::{Decision, FEATURES, Probabilities, features};
use discrepancy::findings::Findings;
use physics_model::EffectConfig;
use serde::{Deserialize, Serialize};

use crate::folder::{Identity, name};
use crate::generate::Actions;
use crate::logistic;
use crate::plan::{self, Plan};

/// Prior variances of a weight of a standardised feature, of which the one is taken that predicts engines best that were left out.
const VARIANCES: [f64; 4] = [0.03, 0.1, 0.3, 1.0];
/// A mean square difference, in those of noise, by which an effect changes its episodes, below which nothing shows.
const DETECTABLE: f64 = 3.0;
/// What is re-tuned like a mass is no effect that a diagnosis names.
const RE_TUNED: &str = "contact_compliance";

/// What a log hides.
#[derive(Clone, Debug, Deserialize)]
pub struct Truth {
    /// Engine that made it.
    pub engine: String,
    /// Its contacts.
    pub variant: String,
    /// Seed.
    pub seed: u64,
    /// Effects of the catalogue.
    pub effects: Vec<Named>,
    /// Effects that the catalogue has not.
    pub outside: Vec<serde_json::Value>,
    /// Mean square of what all of these change, in that of noise.
    pub detectable: Option<f64>,
    /// Effects that its engine has by nature, such as the anisotropy of a pyramidal friction cone: neither right nor wrong.
    #[serde(default)]
    pub natural: Vec<String>,
    /// Whether its actions were chosen to tell effects apart.
    pub designed: bool,
}

/// A hidden effect.
#[derive(Clone, Debug, Deserialize)]
pub struct Named {
    /// Name.
    pub name: String,
    /// Values by the keys of its parameters.
    #[serde(default)]
    pub parameters: BTreeMap<String, serde_json::Value>,
}

/// What a right answer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// An effect of the catalogue.
    Effect,
    /// Nothing.
    None,
    /// Something that the catalogue has not.
    Outside,
}

impl Truth {
    /// What a right answer is. An effect that changes less than noise is none, and so is what is re-tuned.
    #[must_use]
    pub fn kind(&self) -> Kind {
        let shows = self.detectable.is_some_and(|size| size >= DETECTABLE);
        let named = |effect: &Named| effect.name != RE_TUNED;
        match (!self.effects.iter().any(named), self.outside.is_empty()) {
            (_, false) if shows => Kind::Outside,
            (false, true) if shows => Kind::Effect,
            _ => Kind::None,
        }
    }

    /// Whether a name is one of what is hidden.
    #[must_use]
    pub fn names(&self, name: &str) -> bool {
        self.effects.iter().any(|effect| effect.name == name)
    }
}

/// What of an answer is read.
#[derive(Clone, Debug, Deserialize)]
struct Answer {
    findings: Vec<Findings>,
    effects: Vec<Answered>,
    rollouts: u64,
    seconds: f64,
}

#[derive(Clone, Debug, Deserialize)]
struct Answered {
    name: String,
    parameters: Vec<Value>,
}

#[derive(Clone, Debug, Deserialize)]
struct Value {
    key: String,
    interval90: [f64; 2],
}

/// A log with its answer.
#[derive(Clone, Debug)]
pub struct Example {
    /// Folder and name.
    pub log: String,
    /// What it hides.
    pub truth: Truth,
    /// What speaks for the best effect of the search.
    pub findings: Findings,
    /// Whether the 90 % interval of each parameter of a rightly named effect holds its value.
    pub covered: Vec<bool>,
    /// Simulated episodes.
    pub rollouts: u64,
    /// Duration, s.
    pub seconds: f64,
}

impl Example {
    /// The class that it teaches: 0, the best effect is right; 1, nothing is missing; 2, something else is.
    fn label(&self) -> usize {
        match self.truth.kind() {
            Kind::Effect if self.truth.names(&self.findings.effect) => 0,
            Kind::None => 1,
            Kind::Effect | Kind::Outside => 2,
        }
    }
}

/// Reads the logs of `folder` that have an answer in `answers`, but for those whose best effect is one that the engine has by nature.
///
/// # Errors
///
/// Where a file cannot be read.
pub fn read(folder: &Path, answers: &Path) -> Result<Vec<Example>> {
    if folder.join("plan.json").exists() {
        return read_own(folder);
    }
    let folder_name = folder.file_name().context("expected the name of a folder of logs")?;
    let truths = folder.join("truth");
    let listed = std::fs::read_dir(&truths).with_context(|| format!("cannot read {}", truths.display()))?;
    let mut paths: Vec<_> = listed.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    paths.sort();
    let mut examples = Vec::new();
    for path in paths {
        let Some(log) = path.file_stem() else { continue };
        let report = answers.join(folder_name).join(log).join("report.json");
        if !report.exists() {
            continue;
        }
        let log = format!("{}/{}", folder_name.display(), log.display());
        examples.extend(example(log, crate::folder::read(&path)?, crate::folder::read(&report)?));
    }
    Ok(examples)
}

/// Reads a folder of `diagnose-benchmark`, which holds its answers: logs of our own engine with other settings.
fn read_own(folder: &Path) -> Result<Vec<Example>> {
    let identity: Identity = crate::folder::read(&folder.join("plan.json"))?;
    let plan = Plan::new(identity.options.clone());
    let mut examples = Vec::new();
    for set in 0..plan.len() {
        let [truth, report] = ["truth", "answers"].map(|part| folder.join(part).join(name(set)));
        let (truth, report) = (truth.with_extension("json"), report.join("report.json"));
        if !truth.exists() || !report.exists() {
            continue;
        }
        let own: plan::Truth = crate::folder::read(&truth)?;
        let named = |effect: &EffectConfig| Named {
            name: effect.kind().name().into(),
            parameters: (effect.kind().parameters().iter().zip(effect.values()))
                .map(|(parameter, value)| (parameter.name.to_string(), value.into()))
                .collect(),
        };
        let truth = Truth {
            engine: "rapier".into(),
            variant: "other settings".into(),
            seed: identity.options.seed,
            effects: own.spec.effects.iter().map(named).collect(),
            outside: own.spec.unknown.iter().map(|unknown| serde_json::Value::from(unknown.name())).collect(),
            // They begin where they show.
            detectable: Some(f64::INFINITY),
            natural: Vec::new(),
            designed: own.spec.actions == Actions::Designed,
        };
        examples.extend(example(format!("rapier/{}", name(set)), truth, crate::folder::read(&report)?));
    }
    Ok(examples)
}

/// Nothing of an answer whose best effect is one that the engine has by nature, or of a log whose engine could not say what is hidden changes.
fn example(log: String, truth: Truth, answer: Answer) -> Option<Example> {
    let hides = !truth.effects.is_empty() || !truth.outside.is_empty();
    if hides && truth.detectable.is_none() {
        return None;
    }
    let findings = answer.findings.into_iter().next()?;
    if truth.natural.contains(&findings.effect) && !truth.names(&findings.effect) {
        return None;
    }
    let covered = (answer.effects.iter())
        .filter_map(|named| Some((named, truth.effects.iter().find(|effect| effect.name == named.name)?)))
        .flat_map(|(named, effect)| {
            let holds = |value: &Value| {
                let [low, high] = value.interval90;
                effect.parameters.get(&value.key)?.as_f64().map(|truth| (low..=high).contains(&truth))
            };
            named.parameters.iter().filter_map(holds).collect::<Vec<_>>()
        })
        .collect();
    Some(Example { log, truth, findings, covered, rollouts: answer.rollouts, seconds: answer.seconds })
}

/// The regression that examples teach. How far weights may go is what predicts best the engines among them that are left out, each in turn.
#[must_use]
pub fn learn(examples: &[&Example], provenance: serde_json::Value) -> Decision {
    let loss = |variance: f64| -> f64 {
        let left_out = |engine: &&str| -> f64 {
            let (own, others): (Vec<&Example>, Vec<&Example>) =
                examples.iter().copied().partition(|example| example.truth.engine == **engine);
            let decision = regress(&others, variance, serde_json::Value::Null);
            own.iter().map(|example| -of_label(&decision.probabilities(&example.findings), example).ln()).sum()
        };
        engines(examples).iter().map(left_out).sum()
    };
    let best = VARIANCES.into_iter().map(|variance| (loss(variance), variance)).min_by(|a, b| a.0.total_cmp(&b.0));
    regress(examples, best.map_or(VARIANCES[0], |(_, variance)| variance), provenance)
}

/// The engines of examples, each once.
fn engines<'a>(examples: &[&'a Example]) -> Vec<&'a str> {
    let mut engines: Vec<&str> = examples.iter().map(|example| example.truth.engine.as_str()).collect();
    engines.sort_unstable();
    engines.dedup();
    engines
}

/// The probability of what an example teaches.
fn of_label(found: &Probabilities, example: &Example) -> f64 {
    [found.effect, found.none, found.unknown][example.label()]
}

fn regress(examples: &[&Example], variance: f64, provenance: serde_json::Value) -> Decision {
    let rows: Vec<[f64; FEATURES.len()]> = examples.iter().map(|example| features(&example.findings)).collect();
    let n = rows.len().max(1) as f64;
    let scale = |index: usize| {
        let mean = rows.iter().map(|row| row[index]).sum::<f64>() / n;
        let variance = rows.iter().map(|row| (row[index] - mean).powi(2)).sum::<f64>() / n;
        // What all examples have in common says nothing.
        (FEATURES[index].to_string(), mean, variance.sqrt().max(1e-6))
    };
    let scales: Vec<(String, f64, f64)> = (0..FEATURES.len()).map(scale).collect();
    let standard = |row: &[f64; FEATURES.len()]| -> Vec<f64> {
        row.iter().zip(&scales).map(|(value, (_, mean, stddev))| (value - mean) / stddev).collect()
    };
    let standard: Vec<Vec<f64>> = rows.iter().map(standard).collect();
    let labels: Vec<usize> = examples.iter().map(|example| example.label()).collect();
    let mut classes = logistic::fit(&standard, &labels, 3, variance).into_iter();
    let mut next = || classes.next().unwrap_or_default();
    Decision { provenance, features: scales, classes: [next(), next(), next()] }
}

/// Every example with the probabilities of what the other engines teach.
#[must_use]
pub fn leave_one_engine_out(examples: &[Example]) -> Vec<(&Example, Probabilities)> {
    let judged = |engine: &str| {
        let others: Vec<&Example> = examples.iter().filter(|example| example.truth.engine != engine).collect();
        let decision = learn(&others, serde_json::Value::Null);
        let own = examples.iter().filter(|example| example.truth.engine == engine);
        own.map(|example| (example, decision.probabilities(&example.findings))).collect::<Vec<_>>()
    };
    engines(&examples.iter().collect::<Vec<_>>()).into_iter().flat_map(judged).collect()
}

/// Counts of what is judged.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Judged {
    /// Logs with an effect of the catalogue that shows, and how many of them it is named in.
    pub effects: [u32; 2],
    /// The same by the name alone, whatever the verdict.
    pub first: u32,
    /// Logs without one, and how many are called `none`.
    pub none: [u32; 2],
    /// Of these how many are called `effect`.
    pub false_alarms: u32,
    /// Logs with something outside the catalogue, and how many are called `unknown`.
    pub outside: [u32; 2],
    /// Wrong names with a confidence of 0.9 and more, of all logs.
    pub sure_and_wrong: u32,
    /// Logs.
    pub logs: u32,
    /// Parameters of what was named rightly, and how many 90 % intervals hold the truth.
    pub intervals: [u32; 2],
    /// Expected calibration error of the probability that the best effect is right, ten bins.
    pub calibration_error: f64,
    /// Of each tenth of that probability: mean, share that was right, number.
    pub reliability: Vec<(f64, f64, u32)>,
    /// Mean −ln probability of the right class.
    pub log_loss: f64,
    /// Means over the logs.
    pub rollouts: f64,
    /// Durations, s.
    pub seconds: f64,
}

/// Counts over judged examples.
#[must_use]
pub fn judge(judged: &[(&Example, Probabilities)]) -> Judged {
    use discrepancy::Verdict;
    let mut counts = Judged { logs: judged.len() as u32, ..Judged::default() };
    let mut bins = [(0.0, 0_u32, 0_u32); 10];
    for (example, found) in judged {
        let (verdict, label) = (found.verdict(), example.label());
        let right = example.truth.names(&example.findings.effect);
        match example.truth.kind() {
            Kind::Effect => {
                counts.effects[0] += 1;
                counts.first += u32::from(right);
                counts.effects[1] += u32::from(right && verdict == Verdict::Effect);
            }
            Kind::None => {
                counts.none[0] += 1;
                counts.none[1] += u32::from(verdict == Verdict::None);
                counts.false_alarms += u32::from(verdict == Verdict::Effect);
            }
            Kind::Outside => {
                counts.outside[0] += 1;
                counts.outside[1] += u32::from(verdict == Verdict::Unknown);
            }
        }
        counts.sure_and_wrong += u32::from(found.effect >= 0.9 && label != 0);
        let bin = &mut bins[((found.effect * 10.0) as usize).min(9)];
        *bin = (bin.0 + found.effect, bin.1 + u32::from(label == 0), bin.2 + 1);
        if right {
            counts.intervals[0] += example.covered.len() as u32;
            counts.intervals[1] += example.covered.iter().filter(|covered| **covered).count() as u32;
        }
        counts.log_loss -= of_label(found, example).ln() / judged.len() as f64;
        counts.rollouts += example.rollouts as f64 / judged.len() as f64;
        counts.seconds += example.seconds / judged.len() as f64;
    }
    for (sum, right, count) in bins.into_iter().filter(|(_, _, count)| *count > 0) {
        let n = f64::from(count);
        let (mean, share) = (sum / n, f64::from(right) / n);
        counts.calibration_error += n / f64::from(counts.logs) * (mean - share).abs();
        counts.reliability.push((mean, share, count));
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(engine: &str, effect: bool, found: &str, log_evidence: f64) -> Example {
        let effects =
            if effect { vec![Named { name: "table_tilt".into(), parameters: BTreeMap::new() }] } else { Vec::new() };
        let truth = Truth {
            engine: engine.into(),
            variant: "default".into(),
            seed: 1,
            effects,
            outside: Vec::new(),
            detectable: Some(if effect { 10.0 } else { 0.0 }),
            natural: Vec::new(),
            designed: true,
        };
        let findings = Findings {
            effect: found.into(),
            log_evidence,
            margin: log_evidence,
            steadiness: 1.0,
            heldout_steadiness: 1.0,
            drop: 0.0,
            before: 2.0,
            after: 2.0,
            motion_after: 2.0,
            force_after: 1.0,
            motion_share: [0.1; 2],
            force_share: [0.0; 2],
            size: 1.0,
            episodes: [20, 4],
        };
        Example { log: "log".into(), truth, findings, covered: vec![true], rollouts: 100, seconds: 1.0 }
    }

    #[test]
    fn what_tells_effects_from_nothing_on_some_engines_is_used_on_another() {
        let mut examples = Vec::new();
        for engine in ["a", "b", "c"] {
            for size in 0..10 {
                examples.push(example(engine, true, "table_tilt", 200.0 + f64::from(size)));
                examples.push(example(engine, false, "tether", 2.0 + f64::from(size)));
            }
        }
        let judged = judge(&leave_one_engine_out(&examples));
        assert_eq!((judged.effects, judged.none, judged.false_alarms), ([30, 30], [30, 30], 0));
        assert!(judged.calibration_error < 0.2 && judged.sure_and_wrong == 0, "{judged:?}");
        // On an engine where evidence says nothing the answers are wrong, and the table says so.
        examples.extend((0..10).map(|_| example("d", false, "tether", 300.0)));
        let judged = leave_one_engine_out(&examples);
        let own: Vec<_> = judged.into_iter().filter(|(example, _)| example.truth.engine == "d").collect();
        assert_eq!(judge(&own).false_alarms, 10);
    }

    #[test]
    fn an_effect_that_does_not_show_or_is_re_tuned_is_none() {
        let mut hidden = example("a", true, "table_tilt", 10.0).truth;
        assert_eq!(hidden.kind(), Kind::Effect);
        hidden.detectable = Some(0.5);
        assert_eq!(hidden.kind(), Kind::None);
        hidden = Truth {
            detectable: Some(50.0),
            effects: vec![Named { name: RE_TUNED.into(), parameters: BTreeMap::new() }],
            ..hidden
        };
        assert_eq!(hidden.kind(), Kind::None);
        hidden.outside.push(serde_json::Value::from("magnet"));
        assert_eq!(hidden.kind(), Kind::Outside);
    }
}
