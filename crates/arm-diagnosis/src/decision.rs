//! From what speaks for an effect to how probable it is: three logistic regressions, fitted to simulated logs of several engines by
//! `cargo xtask arm-learn`.
//!
//! The first says of each effect that the evidence is for whether it is right, all kinds of friction taken for one; the second, whether the kind is. The third
//! says, where no effect is right, whether something else is missing or nothing that matters. Their numbers stand in `assets/diagnose/arm-decision.json` with what they were made from.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::effect::Effect;
use crate::group::{Findings, Leftover, is_friction};

/// Names of the features of an effect, in order.
pub const EFFECT_FEATURES: [&str; 8] =
    ["ln evidence", "ln ahead", "held-out steadiness", "closed", "ln size", "ln after", "ln left", "foretold"];

/// Names of the features of a kind of friction, in order.
pub const FORM_FEATURES: [&str; 4] = ["ln form ahead", "form share", "plain", "ln left"];

/// Names of the features of a log, in order.
pub const LOG_FEATURES: [&str; 3] = ["ln after", "ln left", "foretold"];

/// What a log may show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// An effect that is named.
    Effect,
    /// Nothing that matters is missing.
    None,
    /// Something is missing that no effect of the catalogue explains.
    Unknown,
}

fn logarithm(value: f64, least: f64, most: f64) -> f64 {
    if value.is_nan() { most.ln() } else { value.clamp(least, most).ln() }
}

/// The features of a log.
#[must_use]
pub fn log_features(left: &Leftover) -> Vec<f64> {
    vec![logarithm(left.after, 0.5, 1e5), logarithm(left.left, 1e-4, 10.0), left.foretold.clamp(0.0, 1.0)]
}

/// The features of an effect.
#[must_use]
pub fn effect_features(findings: &Findings, left: &Leftover) -> Vec<f64> {
    let own = [
        logarithm(1.0 + findings.log_evidence.max(0.0), 1.0, 1e6),
        logarithm(1.0 + findings.ahead.max(0.0), 1.0, 1e6),
        findings.heldout_steadiness.clamp(-4.0, 6.0),
        findings.closed.clamp(-0.5, 1.0),
        logarithm(findings.size, 1e-4, 10.0),
    ];
    own.into_iter().chain(log_features(left)).collect()
}

/// The features of a kind of friction.
#[must_use]
pub fn form_features(findings: &Findings, name: &str, left: &Leftover) -> Vec<f64> {
    vec![
        logarithm(1.0 + findings.form_ahead.max(0.0), 1.0, 1e6),
        findings.form_share.clamp(0.0, 1.0),
        f64::from(u8::from(name == "joint_friction")),
        logarithm(left.left, 1e-4, 10.0),
    ]
}

/// A logistic regression.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Logistic {
    /// Names of the features.
    pub features: Vec<String>,
    /// Their means.
    pub center: Vec<f64>,
    /// Their standard deviations.
    pub spread: Vec<f64>,
    /// Offset, then a weight for each.
    pub weights: Vec<f64>,
}

impl Logistic {
    /// Probability of yes.
    #[must_use]
    pub fn probability(&self, features: &[f64]) -> f64 {
        let score: f64 = self.row(features).iter().zip(&self.weights).map(|(a, b)| a * b).sum();
        1.0 / (1.0 + (-score).exp())
    }

    /// 1, then the features in their units.
    #[must_use]
    pub fn row(&self, features: &[f64]) -> Vec<f64> {
        let scaled = features
            .iter()
            .zip(&self.center)
            .zip(&self.spread)
            .map(|((value, center), spread)| (value - center) / spread);
        std::iter::once(1.0).chain(scaled).collect()
    }
}

/// All regressions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// What it was made from.
    pub learnt_from: Vec<String>,
    /// Whether an effect is right.
    pub right: Logistic,
    /// Whether a kind of friction is right, where friction is.
    pub form: Logistic,
    /// Whether something is missing, where no effect is right.
    pub missing: Logistic,
    /// Factors by which 90 % intervals are wider than the fit's own, by effect; `all` for those without one.
    pub widen: BTreeMap<String, f64>,
}

impl Decision {
    /// The one that is shipped.
    ///
    /// # Panics
    ///
    /// If the file of the repository is not as it should be.
    #[must_use]
    pub fn shipped() -> &'static Self {
        static SHIPPED: OnceLock<Decision> = OnceLock::new();
        SHIPPED.get_or_init(|| {
            let decision: Self = serde_json::from_str(include_str!("../../../assets/diagnose/arm-decision.json"))
                .expect("assets/diagnose/arm-decision.json is a decision");
            let fits = decision.right.features == EFFECT_FEATURES
                && decision.form.features == FORM_FEATURES
                && decision.missing.features == LOG_FEATURES;
            assert!(fits, "assets/diagnose/arm-decision.json has other features: run arm-learn again");
            decision
        })
    }

    /// That an effect is right, whatever kind of friction it is.
    #[must_use]
    pub fn right(&self, findings: &Findings, left: &Leftover) -> f64 {
        self.right.probability(&effect_features(findings, left))
    }

    /// That its kind is right, where it is.
    #[must_use]
    pub fn kind(&self, findings: &Findings, name: &str, left: &Leftover) -> f64 {
        let friction = Effect::find(name).is_some_and(is_friction);
        if friction { self.form.probability(&form_features(findings, name, left)) } else { 1.0 }
    }

    /// Factor by which intervals of an effect's values are wider than the fit's own.
    #[must_use]
    pub fn wider(&self, effect: &str) -> f64 {
        self.widen.get(effect).or_else(|| self.widen.get("all")).copied().unwrap_or(1.0)
    }

    /// Probabilities of effect, none and unknown, with `best` that of the most probable effect.
    #[must_use]
    pub fn verdict(&self, best: f64, left: &Leftover) -> [f64; 3] {
        let missing = self.missing.probability(&log_features(left));
        [best, (1.0 - best) * (1.0 - missing), (1.0 - best) * missing]
    }
}
