//! How a diagnosis decides, learnt from logs of other engines: answers of `diagnose` beside the truth of each log.
//!
//! Logs of other engines: a folder holds `log-NNN/` and `truth/log-NNN.json`, as `tests/peers/worlds/make_logs.py` writes them; answers lie in `ANSWERS/FOLDER/log-NNN/report.json`.
//! What is learnt is judged on the engine that was left out, each in turn.
//!
//! Few logs hide what the catalogue lacks. So every log whose effect was compared teaches a second time, as if that effect were not in the catalogue: then
//! something else is missing. All of these together weigh as much as the logs that hide something else.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result};
use discrepancy::decision::{
    Decision, EFFECT_FEATURES, LOG_FEATURES, Probabilities, Scale, Score, effect_features, log_features, standardised,
};
use discrepancy::{are_twins, findings::Findings};
use nalgebra::DVector;
use physics_model::{EffectConfig, EffectKind};
use serde::{Deserialize, Serialize};

use crate::choice::{self, Choice};
use crate::folder::{Identity, name};
use crate::generate::Actions;
use crate::plan::{self, Plan};

/// Prior variances of a weight of a standardised feature, of which the one is taken that predicts engines best that were left out.
const VARIANCES: [f64; 4] = [0.03, 0.1, 0.3, 1.0];
/// No interval says anything that is wider than this many times what our own engine's logs ask for.
const WIDEST: f64 = 100.0;
/// That of an offset: hardly any prior.
const OFFSET: f64 = 100.0;
/// A mean square difference, in those of noise, by which an effect changes its episodes, below which nothing shows.
const DETECTABLE: f64 = 3.0;
/// Episodes of a log of our own benchmark, about.
const OWN_EPISODES: usize = 40;
/// A camera's delay, s, up to which it is a skew of its clock.
const SKEW_SECS: f64 = 0.05;

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
    /// Number of its episodes.
    pub episodes: usize,
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

impl Named {
    /// Whether it is re-tuned like a mass, and no diagnosis names it.
    fn is_re_tuned(&self) -> bool {
        let delay_secs = || self.parameters.get("delay_secs").and_then(serde_json::Value::as_f64);
        match self.name.as_str() {
            "contact_compliance" => true,
            "pose_delay" => delay_secs().is_some_and(|secs| secs <= SKEW_SECS),
            _ => false,
        }
    }
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
        match (self.effects.iter().all(Named::is_re_tuned), self.outside.is_empty()) {
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
    findings: Vec<Vec<Findings>>,
    effects: Vec<Answered>,
    /// By how much its intervals were widened.
    #[serde(default = "plain_width")]
    interval_width: f64,
    rollouts: u64,
    seconds: f64,
}

fn plain_width() -> f64 {
    1.0
}

#[derive(Clone, Debug, Deserialize)]
struct Answered {
    name: String,
    parameters: Vec<Value>,
}

#[derive(Clone, Debug, Deserialize)]
struct Value {
    key: String,
    value: f64,
    /// JSON has no infinity: an end that is none is one.
    interval90: [Option<f64>; 2],
}

impl Value {
    /// How far `truth` is away from the value, as a share of how far the interval reaches to that side.
    fn off(&self, truth: f64) -> f64 {
        let [low, high] = self.interval90;
        let end = if truth > self.value { high } else { low };
        match (truth - self.value, end.map(|end| end - self.value)) {
            (0.0, _) | (_, None) => 0.0,
            (away, Some(reach)) => (away.abs() / reach.abs()).min(f64::INFINITY),
        }
    }
}

/// A log with its answer.
#[derive(Clone, Debug)]
pub struct Example {
    /// Folder and name.
    pub log: String,
    /// What it hides.
    pub truth: Truth,
    /// What speaks for each effect that was compared, but for those that the engine has by nature.
    pub findings: Vec<Findings>,
    /// Of each parameter of a rightly named effect, how far its true value is away, as a share of how far an interval of width 1 reaches to that side.
    pub off: Vec<f64>,
    /// Simulated episodes.
    pub rollouts: u64,
    /// Duration, s.
    pub seconds: f64,
    /// Whether what it hides was withheld from what was compared.
    pub withheld: bool,
}

impl Example {
    /// The same log as if the catalogue had neither what it hides nor what does nearly the same: something else is missing. `None` where the search did not
    /// compare it, or nothing else.
    #[must_use]
    pub fn without_truth(&self) -> Option<Self> {
        if self.truth.kind() != Kind::Effect || self.label() >= self.findings.len() {
            return None;
        }
        let kind = |name: &str| name.parse::<EffectKind>().ok();
        let same = |found: &Findings, hidden: &Named| {
            found.effect == hidden.name
                || kind(&found.effect).zip(kind(&hidden.name)).is_some_and(|(a, b)| are_twins([a, b]))
        };
        let mut other = Self { withheld: true, ..self.clone() };
        let hidden = std::mem::take(&mut other.truth.effects);
        other.findings.retain(|found| !hidden.iter().any(|hidden| same(found, hidden)));
        other.truth.outside = hidden.into_iter().map(|hidden| hidden.name.into()).collect();
        (!other.findings.is_empty()).then_some(other)
    }

    /// The alternative that it teaches: the place of the effect that is right among those that were compared; then nothing, then something else.
    pub(crate) fn label(&self) -> usize {
        let compared = self.findings.len();
        match self.truth.kind() {
            Kind::None => compared,
            Kind::Outside => compared + 1,
            Kind::Effect => {
                let right = self.findings.iter().position(|found| self.truth.names(&found.effect));
                right.unwrap_or(compared + 1)
            }
        }
    }

    /// The probability of what it teaches.
    pub(crate) fn of_label(&self, found: &Probabilities) -> f64 {
        let label = self.label();
        match self.findings.get(label) {
            Some(right) => found.of(&right.effect),
            None if label == self.findings.len() => found.none,
            None => found.unknown,
        }
    }
}

/// Reads the logs of `folder` that have an answer in `answers`.
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

/// Reads a folder of `diagnose-benchmark`, which holds its answers: logs of our own engine with other settings, but for those that hide something else.
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
        // Our benchmark has more of what the catalogue lacks than the logs of other engines: taught by it, `none` would be called `unknown`.
        if own.spec.unknown.is_some() {
            continue;
        }
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
            episodes: OWN_EPISODES,
        };
        examples.extend(example(format!("rapier/{}", name(set)), truth, crate::folder::read(&report)?));
    }
    Ok(examples)
}

/// Nothing of a log whose engine could not say what is hidden changes.
fn example(log: String, truth: Truth, answer: Answer) -> Option<Example> {
    let hides = !truth.effects.is_empty() || !truth.outside.is_empty();
    if hides && truth.detectable.is_none() {
        return None;
    }
    let mut findings = answer.findings.into_iter().next()?;
    findings.retain(|found| {
        let natural = truth.natural.contains(&found.effect) && !truth.names(&found.effect);
        !found.effect.is_empty() && !natural
    });
    let off = (answer.effects.iter())
        .filter_map(|named| Some((named, truth.effects.iter().find(|effect| effect.name == named.name)?)))
        .flat_map(|(named, effect)| {
            let off = |value: &Value| {
                effect.parameters.get(&value.key)?.as_f64().map(|truth| value.off(truth) * answer.interval_width)
            };
            named.parameters.iter().filter_map(off).collect::<Vec<_>>()
        })
        .collect();
    Some(Example { log, truth, findings, off, rollouts: answer.rollouts, seconds: answer.seconds, withheld: false })
}

/// The decision that examples teach. How far weights may go is what predicts best the engines among them that are left out, each in turn.
#[must_use]
pub fn learn(examples: &[&Example], provenance: serde_json::Value) -> Decision {
    let loss = |variance: f64| -> f64 {
        let left_out = |engine: &&str| -> f64 {
            let (own, others): (Vec<&Example>, Vec<&Example>) =
                examples.iter().copied().partition(|example| example.truth.engine == **engine);
            let decision = regress(&others, variance, serde_json::Value::Null);
            own.iter().map(|example| -example.of_label(&decision.probabilities(&example.findings)).ln()).sum()
        };
        engines(examples).iter().map(left_out).sum()
    };
    let best = VARIANCES.into_iter().map(|variance| (loss(variance), variance)).min_by(|a, b| a.0.total_cmp(&b.0));
    regress(examples, best.map_or(VARIANCES[0], |(_, variance)| variance), provenance)
}

/// Share of the true values that an interval is to hold.
const HELD: f64 = 0.9;

/// The width at which intervals hold that share of the true values of a further log like these (split conformal prediction: Vovk et al., "Algorithmic
/// Learning in a Random World", 2005); 1 where nothing is known.
fn width(examples: &[&Example]) -> f64 {
    let mut off: Vec<f64> = examples.iter().flat_map(|example| example.off.iter().copied()).collect();
    off.sort_by(f64::total_cmp);
    let place = (HELD * (off.len() + 1) as f64).ceil() as usize;
    // Of few none is wide enough; the widest has to do.
    off.get(place.min(off.len()).saturating_sub(1)).map_or(1.0, |width| width.clamp(f64::EPSILON, WIDEST))
}

/// The engines of examples, each once.
fn engines<'a>(examples: &[&'a Example]) -> Vec<&'a str> {
    let mut engines: Vec<&str> = examples.iter().map(|example| example.truth.engine.as_str()).collect();
    engines.sort_unstable();
    engines.dedup();
    engines
}

fn scales(names: &[&str], rows: &[Vec<f64>]) -> Vec<Scale> {
    let n = rows.len().max(1) as f64;
    let scale = |index: usize| {
        let mean = rows.iter().map(|row| row[index]).sum::<f64>() / n;
        let variance = rows.iter().map(|row| (row[index] - mean).powi(2)).sum::<f64>() / n;
        // What all examples have in common says nothing.
        (names[index].to_string(), mean, variance.sqrt().max(1e-6))
    };
    (0..names.len()).map(scale).collect()
}

fn regress(examples: &[&Example], variance: f64, provenance: serde_json::Value) -> Decision {
    let of_effects = |example: &Example| -> Vec<Vec<f64>> {
        example.findings.iter().map(|found| effect_features(found, &example.findings).to_vec()).collect()
    };
    let of_log = |example: &Example| log_features(&example.findings).to_vec();
    let rows: Vec<Vec<f64>> = examples.iter().flat_map(|example| of_effects(example)).collect();
    let effect_scales = scales(&EFFECT_FEATURES, &rows);
    let log_scales = scales(&LOG_FEATURES, &examples.iter().map(|example| of_log(example)).collect::<Vec<_>>());
    // Offset and weights of the score of an effect, of nothing and of something else, one after another.
    let sizes = [EFFECT_FEATURES.len(), LOG_FEATURES.len(), LOG_FEATURES.len()].map(|count| 1 + count);
    let firsts = [0, sizes[0], sizes[0] + sizes[1]];
    let alternative = |class: usize, standard: Vec<f64>| {
        let mut x = DVector::zeros(sizes.iter().sum());
        x[firsts[class]] = 1.0;
        x.rows_mut(firsts[class] + 1, standard.len()).copy_from_slice(&standard);
        x
    };
    let choice = |example: &Example, weight: f64| {
        let rows = of_effects(example);
        let effects = rows.iter().map(|row| alternative(0, standardised(row, &effect_scales).collect()));
        let log: Vec<f64> = standardised(&of_log(example), &log_scales).collect();
        let alternatives = effects.chain([alternative(1, log.clone()), alternative(2, log)]).collect();
        Choice { alternatives, chosen: example.label(), weight }
    };
    let withheld: Vec<Example> = examples.iter().filter_map(|example| example.without_truth()).collect();
    let outside = examples.iter().filter(|example| example.truth.kind() == Kind::Outside).count();
    let weight = outside as f64 / withheld.len().max(1) as f64;
    let choices: Vec<Choice> = (examples.iter().map(|example| choice(example, 1.0)))
        .chain(withheld.iter().map(|example| choice(example, weight.min(1.0))))
        .collect();
    let variances: Vec<f64> =
        (0..sizes.iter().sum()).map(|place| if firsts.contains(&place) { OFFSET } else { variance }).collect();
    let theta = choice::fit(&choices, &variances);
    let score = |class: usize| Score {
        offset: theta[firsts[class]],
        weights: theta.rows(firsts[class] + 1, sizes[class] - 1).iter().copied().collect(),
    };
    Decision {
        provenance,
        effect: score(0),
        none: score(1),
        unknown: score(2),
        effect_features: effect_scales,
        log_features: log_scales,
        width: width(examples),
    }
}

/// An example with what a decision says of it.
#[derive(Clone, Debug)]
pub struct Judgement<'a> {
    /// The log and its answer.
    pub example: &'a Example,
    /// What it shows.
    pub found: Probabilities,
    /// Width of its intervals.
    pub width: f64,
}

impl<'a> Judgement<'a> {
    /// By a decision that was made from other logs.
    #[must_use]
    pub fn new(example: &'a Example, decision: &Decision) -> Self {
        Self { example, found: decision.probabilities(&example.findings), width: decision.width }
    }
}

/// Every example of `judged` by what the other engines of `taught` teach.
#[must_use]
pub fn leave_one_engine_out<'a>(taught: &[Example], judged: &'a [Example]) -> Vec<Judgement<'a>> {
    let of_engine = |engine: &str| {
        let others: Vec<&Example> = taught.iter().filter(|example| example.truth.engine != engine).collect();
        let decision = learn(&others, serde_json::Value::Null);
        let own = judged.iter().filter(|example| example.truth.engine == engine);
        own.map(|example| Judgement::new(example, &decision)).collect::<Vec<_>>()
    };
    engines(&judged.iter().collect::<Vec<_>>()).into_iter().flat_map(of_engine).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::judge;

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
            episodes: 30,
        };
        let findings = vec![Findings {
            effect: found.into(),
            log_evidence,
            whole: true,
            coordinates: 2,
            drop_steadiness: 1.0,
            slow_drop: 0.0,
            gain: 0.0,
            median_gain: log_evidence,
            force_gain: 0.0,
            before: 2.0,
            motion_after: 2.0,
            motion_share: [0.1; 2],
            force_share: [0.0; 2],
            episodes: [20, 4],
        }];
        Example { log: "log".into(), truth, findings, off: vec![0.5], rollouts: 100, seconds: 1.0, withheld: false }
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
        let judged = judge(&leave_one_engine_out(&examples, &examples));
        assert_eq!((judged.effects, judged.none, judged.false_alarms), ([30, 30], [30, 30], 0));
        assert!(judged.calibration_error < 0.2 && judged.sure_and_wrong == 0, "{judged:?}");
        // On an engine where evidence says nothing the answers are wrong, and the table says so.
        examples.extend((0..10).map(|_| example("d", false, "tether", 300.0)));
        let judged = leave_one_engine_out(&examples, &examples);
        let own: Vec<_> = judged.into_iter().filter(|judgement| judgement.example.truth.engine == "d").collect();
        assert_eq!(judge(&own).false_alarms, 10);
    }

    #[test]
    fn intervals_are_as_wide_as_nine_in_ten_true_values_ask_for() {
        let mut all = vec![example("a", true, "table_tilt", 100.0); 19];
        all.iter_mut().enumerate().for_each(|(place, example)| example.off = vec![0.1 * place as f64]);
        // Of 19 and a further one 18 lie within: the 18th, 1.7.
        let width_of = |all: &[Example]| width(&all.iter().collect::<Vec<_>>());
        assert!((width_of(&all) - 1.7).abs() < 1e-12);
        assert_eq!((width_of(&all[..3]), width_of(&[])), (0.2, 1.0));
        let value = |interval90| Value { key: "slope_x_rad".into(), value: 1.0, interval90 };
        assert_eq!([0.5, 1.0, 2.0].map(|truth| value([Some(0.0), Some(1.5)]).off(truth)), [0.5, 0.0, 2.0]);
        // An end that is none holds everything; an interval that ends at its value nothing beyond.
        assert_eq!([value([None, Some(2.0)]).off(-9.0), value([Some(1.0), Some(2.0)]).off(0.5)], [0.0, f64::INFINITY]);
    }

    #[test]
    fn a_log_without_its_effect_in_the_catalogue_misses_something_else() {
        let mut log = example("a", true, "table_tilt", 100.0);
        // Nothing else was compared.
        assert!(log.without_truth().is_none());
        for other in ["constant_force", "viscous_damping"] {
            let found = Findings { effect: other.into(), ..log.findings[0].clone() };
            log.findings.push(found);
        }
        let without = log.without_truth().unwrap();
        let left: Vec<&str> = without.findings.iter().map(|found| found.effect.as_str()).collect();
        // A constant force does what a tilt does.
        assert_eq!((left, without.truth.kind(), without.label()), (vec!["viscous_damping"], Kind::Outside, 2));
        assert!(without.withheld && without.without_truth().is_none());
    }

    #[test]
    fn an_effect_that_does_not_show_or_is_re_tuned_is_none() {
        let mut hidden = example("a", true, "table_tilt", 10.0).truth;
        assert_eq!(hidden.kind(), Kind::Effect);
        hidden.detectable = Some(0.5);
        assert_eq!(hidden.kind(), Kind::None);
        hidden = Truth {
            detectable: Some(50.0),
            effects: vec![Named { name: "contact_compliance".into(), parameters: BTreeMap::new() }],
            ..hidden
        };
        assert_eq!(hidden.kind(), Kind::None);
        for (secs, kind) in [(0.03, Kind::None), (0.08, Kind::Effect)] {
            let parameters = [("delay_secs".to_string(), serde_json::Value::from(secs))].into();
            hidden.effects = vec![Named { name: "pose_delay".into(), parameters }];
            assert_eq!(hidden.kind(), kind);
        }
        hidden.effects.clear();
        hidden.outside.push(serde_json::Value::from("magnet"));
        assert_eq!(hidden.kind(), Kind::Outside);
    }
}
