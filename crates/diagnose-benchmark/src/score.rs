//! One answer against the truth.

use std::path::Path;

use anyhow::Result;
use discrepancy::heldout::{self, Explanation};
use discrepancy::{ModelFile, Nominal, rig_tool};
use physics_model::EffectConfig;
use serde::{Deserialize, Serialize};

use crate::folder::{self, Folder};
use crate::generate::Actions;
use crate::plan::{Group, Truth};
use crate::residual;

/// What the scorer reads of `report.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Answer {
    /// `effect`, `none` or `unknown`.
    pub verdict: String,
    /// Named effects.
    pub effects: Vec<Named>,
    /// Names not told apart.
    pub confusion_set: Vec<String>,
    /// Where the gap is, the largest first.
    pub located: Vec<Located>,
    /// Held-out errors.
    pub heldout: HeldOut,
    /// Simulated episodes.
    pub rollouts: u64,
    /// Duration, s.
    pub seconds: f64,
}

/// A named effect.
#[derive(Clone, Debug, Deserialize)]
pub struct Named {
    /// Name.
    pub name: String,
    /// Confidence.
    pub confidence: f64,
    /// Values.
    pub parameters: Vec<Fitted>,
}

/// A fitted value.
#[derive(Clone, Debug, Deserialize)]
pub struct Fitted {
    /// Key of the parameter.
    pub key: String,
    /// Value.
    pub value: f64,
    /// Interval.
    pub interval90: [f64; 2],
}

/// A part of the gap.
#[derive(Clone, Debug, Deserialize)]
pub struct Located {
    /// Channel.
    pub channel: String,
    /// Significance.
    pub p_value: f64,
}

/// Held-out errors.
#[derive(Clone, Debug, Deserialize)]
pub struct HeldOut {
    /// Re-tuned.
    pub before: f64,
    /// With what was named.
    pub after: f64,
}

/// Held-out mean squares, with the errors learnt at the answer's model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// Of the true model.
    pub truth: f64,
    /// Of the nominal model as the log gives it.
    pub untuned: f64,
    /// Of the model re-tuned and corrected by Gaussian processes, where asked for.
    #[serde(default)]
    pub process: Option<f64>,
}

/// An answer scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Set.
    pub set: usize,
    /// Actions.
    pub actions: Actions,
    /// Kind of set.
    pub group: Group,
    /// Names of what was hidden.
    pub truth: Vec<String>,
    /// 0, 1, 2.
    pub strength: usize,
    /// Factor on the noise.
    pub noise: f64,
    /// Verdict.
    pub verdict: String,
    /// Names in the answer.
    pub named: Vec<String>,
    /// Confidence of each.
    pub confidences: Vec<f64>,
    /// Whether the truth was named, and first.
    pub first: bool,
    /// Whether the truth is in the confusion set.
    pub confused: bool,
    /// Number of names in the confusion set.
    pub confusion: usize,
    /// Whether both of a pair were named.
    pub both: bool,
    /// Of each parameter of the hidden effect that was named first, of pairs of both as far as they were named: key and whether its interval holds the true value.
    pub covered: Vec<(String, bool)>,
    /// Held-out error of re-tuning, of the answer, of the truth, of no re-tuning.
    pub heldout: Option<[f64; 4]>,
    /// The same of re-tuning and Gaussian processes of what it leaves.
    pub process: Option<f64>,
    /// Channel of the largest residual that is significant.
    pub channel: Option<String>,
    /// Simulated episodes.
    pub rollouts: u64,
    /// Duration, s.
    pub seconds: f64,
}

/// A gap, in mean squares a sample, that is too small to be closed.
const LEAST_GAP: f64 = 0.02;
/// Significance of a located residual.
const P_VALUE: f64 = 0.05;
/// Confidence of a name that is sure.
const SURE: f64 = 0.9;

impl Score {
    /// Of an answer.
    #[must_use]
    pub fn new(set: usize, truth: &Truth, answer: &Answer, reference: Option<Reference>) -> Self {
        let names = truth.names();
        let named: Vec<String> = answer.effects.iter().map(|effect| effect.name.clone()).collect();
        let effect = answer.verdict == "effect";
        let first = effect && named.first() == names.first();
        let covered = match truth.group {
            Group::Catalogue if first => covered(&truth.spec.effects[0], &answer.effects[0]),
            Group::Pair if effect => (truth.spec.effects.iter())
                .filter_map(|effect| Some((effect, answer.effects.iter().find(|e| e.name == effect.kind().name())?)))
                .flat_map(|(effect, named)| covered(effect, named))
                .collect(),
            _ => Vec::new(),
        };
        Self {
            set,
            actions: truth.spec.actions,
            group: truth.group,
            strength: truth.strength,
            noise: truth.spec.noise,
            first,
            confused: answer.confusion_set.contains(&names[0]),
            confusion: answer.confusion_set.len(),
            both: effect && names.iter().all(|name| named.contains(name)),
            covered,
            heldout: reference.map(|r| [answer.heldout.before, answer.heldout.after, r.truth, r.untuned]),
            process: reference.and_then(|r| r.process),
            channel: answer.located.first().filter(|l| l.p_value < P_VALUE).map(|l| l.channel.clone()),
            confidences: answer.effects.iter().map(|effect| effect.confidence).collect(),
            truth: names,
            verdict: answer.verdict.clone(),
            named,
            rollouts: answer.rollouts,
            seconds: answer.seconds,
        }
    }

    /// Share of the gap between re-tuning and truth that the answer closes, at most 1; `None` where there is hardly any.
    #[must_use]
    pub fn closed(&self) -> Option<f64> {
        self.closed_by(self.heldout?[1])
    }

    /// The same of Gaussian processes instead of the answer.
    #[must_use]
    pub fn closed_by_process(&self) -> Option<f64> {
        self.closed_by(self.process?)
    }

    fn closed_by(&self, after: f64) -> Option<f64> {
        let [before, _, truth, _] = self.heldout?;
        (before - truth > LEAST_GAP).then(|| ((before - after) / (before - truth)).min(1.0))
    }

    /// Shares of the gap between the model as the log gives it and the truth that the answer, and re-tuning alone, close.
    #[must_use]
    pub fn closed_from_untuned(&self) -> Option<[f64; 2]> {
        let [before, after, truth, untuned] = self.heldout?;
        (untuned - truth > LEAST_GAP)
            .then(|| [after, before].map(|left| ((untuned - left) / (untuned - truth)).min(1.0)))
    }

    /// Whether nothing was hidden.
    #[must_use]
    pub fn is_without_effect(&self) -> bool {
        self.truth == ["none"]
    }

    /// Whether something that is not there was named, first or further, surely.
    #[must_use]
    pub fn wrong_and_sure(&self) -> bool {
        self.verdict == "effect" && (0..self.named.len()).any(|place| self.is_wrong_and_sure(place))
    }

    /// Whether the first name is such a one.
    #[must_use]
    pub fn first_is_wrong_and_sure(&self) -> bool {
        self.verdict == "effect" && !self.named.is_empty() && self.is_wrong_and_sure(0)
    }

    fn is_wrong_and_sure(&self, place: usize) -> bool {
        !self.truth.contains(&self.named[place]) && self.confidences[place] >= SURE
    }

    /// What a confusion matrix counts: the first name, `none` or `unknown`.
    #[must_use]
    pub fn says(&self) -> &str {
        match (self.verdict.as_str(), self.named.first()) {
            ("effect", Some(name)) => name,
            (verdict, _) => verdict,
        }
    }
}

fn covered(effect: &EffectConfig, named: &Named) -> Vec<(String, bool)> {
    let mut values = effect.values();
    if effect.kind() == physics_model::EffectKind::AnisotropicFriction {
        // a at φ is −a at φ ± π/2, and φ is φ + π: the one that is meant.
        let at = |key: &str| named.parameters.iter().find(|p| p.key == key).map(|p| p.value);
        if let (Some(amplitude), Some(axis)) = (at("amplitude"), at("axis_rad")) {
            use std::f64::consts::{FRAC_PI_2, PI};
            if amplitude * values[0] < 0.0 {
                (values[0], values[1]) = (-values[0], values[1] + FRAC_PI_2);
            }
            values[1] += ((axis - values[1]) / PI).round() * PI;
        }
    }
    let parameters = effect.kind().parameters().iter().zip(values);
    parameters
        .filter_map(|(parameter, value)| {
            let fitted = named.parameters.iter().find(|fitted| fitted.key == parameter.name)?;
            let [low, high] = fitted.interval90;
            Some((parameter.name.to_owned(), (low..=high).contains(&value)))
        })
        .collect()
}

/// Scores a set; `None` where it has no answer. `baselines`: with what Gaussian processes reach on those of the catalogue.
///
/// # Errors
///
/// Files that cannot be read.
pub fn score(folder: &Folder, set: usize, arms: Option<&Path>, baselines: bool) -> Result<Option<Score>> {
    if !folder.is_answered(set) || !folder.truth(set).exists() {
        return Ok(None);
    }
    let truth: Truth = folder::read(&folder.truth(set))?;
    let answer: Answer = folder::read(&folder.answer(set).join("report.json"))?;
    let reference = match truth.group {
        // No model of ours is true.
        Group::Unknown => None,
        group => Some(reference(folder, set, &truth, arms, baselines && group == Group::Catalogue)?),
    };
    Ok(Some(Score::new(set, &truth, &answer, reference)))
}

#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    /// BLAKE3 of the answer's model.
    model: String,
    reference: Reference,
}

/// Computed once an answer.
fn reference(folder: &Folder, set: usize, truth: &Truth, arms: Option<&Path>, process: bool) -> Result<Reference> {
    let (path, model_path) = (folder.reference(set), folder.answer(set).join("model.toml"));
    let model = blake3::hash(&std::fs::read(&model_path)?).to_hex().to_string();
    if let Ok(kept) = folder::read::<Kept>(&path)
        && kept.model == model
        && (kept.reference.process.is_some() || !process)
    {
        return Ok(kept.reference);
    }
    let log = measured_log::read(&folder.log(set))?;
    let untuned = Nominal::new(&log.header, rig_tool(&log, arms)?)?;
    let mut found = untuned.clone();
    ModelFile::read(&model_path)?.apply(&mut found)?;
    let mut right = Nominal::new(&truth.spec.true_header(), rig_tool(&log, arms)?)?;
    right.effects = truth.spec.effects.clone();
    let squares =
        heldout::mean_squares(&log, &found, &[Explanation::of(&right), Explanation::of(&untuned)], SOLVER_SEED);
    let process = process.then(|| residual::mean_square(&log, &untuned, &found, SOLVER_SEED));
    let reference = Reference { truth: squares[0], untuned: squares[1], process };
    folder::save(&path, &Kept { model, reference })?;
    Ok(reference)
}

/// The solver's default seed, which decides its hold-out split.
const SOLVER_SEED: u64 = 1;

#[cfg(test)]
mod tests {
    use physics_model::EffectKind;

    use super::*;
    use crate::plan::{Options, Plan, VERSION};

    fn truth(kind: EffectKind, values: &[f64]) -> Truth {
        let options = Options {
            version: VERSION,
            seed: 1,
            sets: 1,
            none: 0,
            unknown: 0,
            pairs: 0,
            arms: 0,
            actions: vec![Actions::Designed],
            only: vec![kind],
        };
        let mut truth = Plan::new(options).draw(0, 0);
        truth.spec.effects = vec![kind.from_parameters(values).unwrap()];
        truth
    }

    fn answer(text: &str) -> Answer {
        let rest = r#""located": [{"channel": "object_position", "p_value": 0.001}], "heldout": {"before": 3.0, "after": 1.1},
            "rollouts": 3000, "seconds": 9.0"#;
        serde_json::from_str(&format!("{{{text}, {rest}}}")).unwrap()
    }

    #[test]
    fn a_right_name_counts_and_its_intervals_are_checked() {
        let truth = truth(EffectKind::TableTilt, &[0.02, -0.01]);
        let said = answer(
            r#""verdict": "effect", "confusion_set": ["table_tilt"], "effects": [{"name": "table_tilt", "confidence": 0.99,
            "parameters": [{"key": "slope_x_rad", "value": 0.021, "interval90": [0.019, 0.022]},
                           {"key": "slope_y_rad", "value": -0.02, "interval90": [-0.03, -0.015]}]}]"#,
        );
        let score = Score::new(0, &truth, &said, Some(Reference { truth: 1.0, untuned: 5.0, process: Some(2.0) }));
        assert!(score.first && score.confused && !score.wrong_and_sure());
        assert_eq!(score.covered, [("slope_x_rad".into(), true), ("slope_y_rad".into(), false)]);
        assert!((score.closed().unwrap() - 0.95).abs() < 1e-12);
        assert!((score.closed_by_process().unwrap() - 0.5).abs() < 1e-12);
        let [with, without] = score.closed_from_untuned().unwrap();
        assert!((with - 0.975).abs() < 1e-12 && (without - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_wrong_name_is_wrong_and_unknown_is_no_name() {
        let truth = truth(EffectKind::ConstantForce, &[0.2, 0.0]);
        let wrong = r#""confusion_set": ["table_tilt", "constant_force"],
            "effects": [{"name": "table_tilt", "confidence": 0.95, "parameters": []}]"#;
        let score = Score::new(0, &truth, &answer(&format!(r#""verdict": "effect", {wrong}"#)), None);
        assert!(!score.first && score.confused && score.wrong_and_sure() && score.says() == "table_tilt");
        assert_eq!(score.closed(), None);
        let score = Score::new(0, &truth, &answer(&format!(r#""verdict": "unknown", {wrong}"#)), None);
        assert!(!score.first && !score.wrong_and_sure() && score.says() == "unknown");
        // A further name is as wrong as a first.
        let further = r#""verdict": "effect", "confusion_set": ["constant_force"],
            "effects": [{"name": "constant_force", "confidence": 1.0, "parameters": []},
                        {"name": "time_base", "confidence": 0.92, "parameters": []}]"#;
        let score = Score::new(0, &truth, &answer(further), None);
        assert!(score.first && score.wrong_and_sure() && !score.first_is_wrong_and_sure());
    }

    #[test]
    fn an_axis_of_anisotropic_friction_is_compared_as_an_axis() {
        let truth = truth(EffectKind::AnisotropicFriction, &[0.2, 3.0]);
        let said = answer(
            r#""verdict": "effect", "confusion_set": [], "effects": [{"name": "anisotropic_friction", "confidence": 1.0,
            "parameters": [{"key": "amplitude", "value": -0.2, "interval90": [-0.21, -0.19]},
                           {"key": "axis_rad", "value": 1.42, "interval90": [1.40, 1.45]}]}]"#,
        );
        let score = Score::new(0, &truth, &said, None);
        assert!(score.covered.iter().all(|(_, inside)| *inside), "{:?}", score.covered);
    }
}
