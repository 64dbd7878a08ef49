//! A log with its answer, and what it teaches.
//!
//! Logs of other engines: a folder holds `log-NNN/` and `truth/log-NNN.json`, as `tests/peers/worlds/make_logs.py` writes them; answers lie in
//! `ANSWERS/FOLDER/log-NNN/report.json`. What they teach is kept in a file with one example a line, so that it can be taught again without them.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, anyhow, ensure};
use discrepancy::decision::Probabilities;
use discrepancy::{are_twins_by_name, findings::Findings};
use physics_model::EffectConfig;
use serde::{Deserialize, Serialize};

use crate::folder::{Identity, name};
use crate::generate::Actions;
use crate::plan::{self, Plan};

/// A mean square difference, in those of noise, by which an effect changes its episodes, below which nothing shows.
const DETECTABLE: f64 = 3.0;
/// Episodes of a log of our own benchmark, about.
const OWN_EPISODES: usize = 40;
/// Largest file of examples, bytes: those of a hundred thousand logs.
const LARGEST: u64 = 1 << 28;
/// A camera's delay, s, up to which it is a skew of its clock.
const SKEW_SECS: f64 = 0.05;

/// What a log hides.
#[derive(Clone, Debug, Deserialize, Serialize)]
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
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Named {
    /// Name.
    pub name: String,
    /// Values by the keys of its parameters.
    #[serde(default)]
    pub parameters: BTreeMap<String, serde_json::Value>,
}

impl Named {
    /// Of an effect in a world of ours.
    #[must_use]
    pub fn new(effect: &EffectConfig) -> Self {
        let kind = effect.kind();
        let parameters = (kind.parameters().iter().zip(effect.values()))
            .map(|(parameter, value)| (parameter.name.to_string(), value.into()))
            .collect();
        Self { name: kind.name().into(), parameters }
    }

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
    interval_width: f64,
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
            (away, Some(reach)) => away.abs() / reach.abs(),
        }
    }
}

/// A log with its answer.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
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
    #[serde(skip)]
    pub withheld: bool,
}

impl Example {
    /// The same log as if the catalogue had neither what it hides nor what does nearly the same: something else is missing. `None` where the search did not
    /// compare it, or nothing else.
    #[must_use]
    pub fn without_truth(&self) -> Option<Self> {
        if self.truth.kind() != Kind::Effect || !self.compares_truth() {
            return None;
        }
        let same = |found: &Findings, hidden: &Named| {
            found.effect == hidden.name || are_twins_by_name([&found.effect, &hidden.name])
        };
        let mut other = Self { withheld: true, ..self.clone() };
        let hidden = std::mem::take(&mut other.truth.effects);
        other.findings.retain(|found| !hidden.iter().any(|hidden| same(found, hidden)));
        other.truth.outside = hidden.into_iter().map(|hidden| hidden.name.into()).collect();
        (!other.findings.is_empty()).then_some(other)
    }

    /// Whether the search compared what it hides.
    pub(crate) fn compares_truth(&self) -> bool {
        self.findings.iter().any(|found| self.truth.names(&found.effect))
    }

    /// The alternatives that are right, by their places: the effects that were compared, then nothing, then something else. Of a pair both are. What is
    /// hidden but does not show may be named or not.
    pub(crate) fn right(&self) -> Vec<usize> {
        let compared = self.findings.len();
        let hidden = (0..compared).filter(|&place| self.truth.names(&self.findings[place].effect));
        match self.truth.kind() {
            Kind::None => hidden.chain([compared]).collect(),
            Kind::Effect if self.compares_truth() => hidden.collect(),
            Kind::Effect | Kind::Outside => vec![compared + 1],
        }
    }

    /// The probability of what is right.
    pub(crate) fn of_right(&self, found: &Probabilities) -> f64 {
        let compared = self.findings.len();
        let of = |place: usize| match self.findings.get(place) {
            Some(right) => found.of(&right.effect),
            None if place == compared => found.none,
            None => found.unknown,
        };
        self.right().into_iter().map(of).sum()
    }
}

/// Reads the examples of a file, or of a folder of logs: those that have an answer in `answers`.
///
/// # Errors
///
/// Where a file cannot be read, or a folder of logs comes without answers.
pub fn read(path: &Path, answers: Option<&Path>) -> Result<Vec<Example>> {
    if path.is_file() {
        return read_kept(path);
    }
    ensure!(path.is_dir(), "{}: expected a folder of logs or a file of examples, found no such thing", path.display());
    if path.join("plan.json").exists() {
        return read_own(path);
    }
    let answers =
        answers.with_context(|| format!("{}: logs need --answers, the folder of their answers", path.display()))?;
    read_folder(path, answers)
}

fn read_kept(path: &Path) -> Result<Vec<Example>> {
    let bytes = whole_file::read(path, LARGEST)?;
    let text = std::str::from_utf8(&bytes).with_context(|| format!("{}: expected text", path.display()))?;
    let of_line = |(number, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|_| {
            anyhow!("{}: line {}: expected an example of diagnose-learn --examples", path.display(), number + 1)
        })
    };
    text.lines().enumerate().map(of_line).collect()
}

/// One example a line.
///
/// # Errors
///
/// None: all numbers of an example are finite.
pub fn to_lines(examples: &[Example]) -> Result<String> {
    let line = |example| Ok(serde_json::to_string(example)? + "\n");
    examples.iter().map(line).collect()
}

fn read_folder(folder: &Path, answers: &Path) -> Result<Vec<Example>> {
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
    let folder_name = folder.file_name().context("expected the name of a folder of logs")?.to_string_lossy();
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
        let truth = Truth {
            engine: "rapier".into(),
            variant: "other settings".into(),
            seed: identity.options.seed,
            effects: own.spec.effects.iter().map(Named::new).collect(),
            outside: own.spec.unknown.iter().map(|unknown| serde_json::Value::from(unknown.name())).collect(),
            // They begin where they show.
            detectable: Some(f64::MAX),
            natural: Vec::new(),
            designed: own.spec.actions == Actions::Designed,
            episodes: OWN_EPISODES,
        };
        examples.extend(example(format!("{folder_name}/{}", name(set)), truth, crate::folder::read(&report)?));
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
                let off = value.off(effect.parameters.get(&value.key)?.as_f64()?);
                // JSON has no infinity.
                Some((off * answer.interval_width).min(f64::MAX))
            };
            named.parameters.iter().filter_map(off).collect::<Vec<_>>()
        })
        .collect();
    Some(Example { log, truth, findings, off, rollouts: answer.rollouts, seconds: answer.seconds, withheld: false })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn example(engine: &str, effect: bool, found: &str, log_evidence: f64) -> Example {
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
            lawful_share: [0.0; 2],
            apart_readings: [0.0; 2],
            episodes: [20, 4],
        }];
        Example { log: "log".into(), truth, findings, off: vec![0.5], rollouts: 100, seconds: 1.0, withheld: false }
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
        assert_eq!((left, without.truth.kind(), without.right()), (vec!["viscous_damping"], Kind::Outside, vec![2]));
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

    #[test]
    fn what_is_hidden_and_does_not_show_may_be_named_or_not() {
        let mut log = example("a", true, "table_tilt", 10.0);
        assert_eq!(log.right(), [0]);
        log.truth.detectable = Some(0.5);
        assert_eq!(log.right(), [0, 1]);
        let found =
            |effect, none, unknown| Probabilities { effects: vec![("table_tilt".into(), effect)], none, unknown };
        assert!((log.of_right(&found(0.5, 0.3, 0.2)) - 0.8).abs() < 1e-12);
        (log.truth.effects, log.truth.outside) = (Vec::new(), vec!["magnet".into()]);
        assert_eq!(log.right(), [1]);
        // Nothing is hidden.
        let none = example("a", false, "table_tilt", 10.0);
        assert_eq!(none.right(), [1]);
    }

    #[test]
    fn examples_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("examples.jsonl");
        let mut log = example("a", true, "table_tilt", 1.0 / 3.0);
        log.off = vec![0.1, f64::MAX];
        let lines = to_lines(&[log.clone(), log]).unwrap();
        std::fs::write(&path, &lines).unwrap();
        let read = read(&path, None).unwrap();
        assert_eq!((read.len(), to_lines(&read).unwrap()), (2, lines.clone()));
        std::fs::write(&path, lines + "{}\n").unwrap();
        let error = format!("{:#}", super::read(&path, None).unwrap_err());
        assert!(error.contains("examples.jsonl: line 3"), "{error}");
        let error = super::read(folder.path(), None).unwrap_err().to_string();
        assert!(error.contains("--answers"), "{error}");
    }

    #[test]
    fn how_far_a_value_is_off_is_counted_in_the_reach_of_its_interval() {
        let value = |interval90| Value { key: "slope_x_rad".into(), value: 1.0, interval90 };
        assert_eq!([0.5, 1.0, 2.0].map(|truth| value([Some(0.0), Some(1.5)]).off(truth)), [0.5, 0.0, 2.0]);
        // An end that is none holds everything; an interval that ends at its value nothing beyond.
        assert_eq!([value([None, Some(2.0)]).off(-9.0), value([Some(1.0), Some(2.0)]).off(0.5)], [0.0, f64::INFINITY]);
    }
}
