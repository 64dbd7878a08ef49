//! From what speaks for an effect to how sure it is: a multinomial logistic regression, fitted to simulated logs of several engines.
//!
//! The best effect of a search is right, or nothing is missing, or something is that the catalogue does not explain. The probabilities of the three are
//! softmax(b + W f) of the features f of its [`Findings`]. Offsets b and weights W are made by `diagnose-benchmark learn` from logs whose truth is known,
//! and stand in `assets/diagnose/decision.json` with what they were made from. No threshold is set by hand: an effect is named where it is more probable
//! right than not.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::findings::Findings;
use crate::report::Verdict;

/// Names of the features, in order.
pub const FEATURES: [&str; 12] = [
    "ln evidence",
    "ln margin",
    "steadiness",
    "held-out steadiness",
    "drop",
    "ln before",
    "ln motion after",
    "ln force after",
    "ln motion share",
    "ln force share",
    "ln size",
    "contact law",
];

/// Effects in which engines, and real contacts, differ from each other by nature: how a sole bears, sticks, slides, bounces and parts.
const CONTACT_LAWS: [&str; 7] = [
    "pressure_distribution",
    "restitution",
    "static_friction",
    "stribeck_friction",
    "anisotropic_friction",
    "edge_rounding",
    "adhesion",
];

/// No evidence and no error is larger to a decision.
const MOST: f64 = 1e6;

/// What the feature vector of findings is, in the order of [`FEATURES`].
#[must_use]
pub fn features(findings: &Findings) -> [f64; FEATURES.len()] {
    // Numbers that say no more beyond a point are held there; what is no number is as far out as can be.
    let held = |value: f64, least: f64, most: f64| if value.is_nan() { most } else { value.clamp(least, most) };
    let logarithm = |value: f64, least: f64| held(value, least, MOST).ln();
    let gain = |value: f64| held(value, 0.0, MOST).ln_1p();
    let bounded = |value: f64, most: f64| held(value, -most, most);
    [
        gain(findings.log_evidence),
        gain(findings.margin),
        bounded(findings.steadiness, 6.0),
        bounded(findings.heldout_steadiness, 6.0),
        bounded(findings.drop, 3.0),
        logarithm(findings.before, 0.5),
        logarithm(findings.motion_after, 0.5),
        logarithm(findings.force_after, 0.5),
        logarithm(findings.motion_share[1], 1e-3),
        logarithm(findings.force_share[1], 1e-2),
        logarithm(findings.size, 1e-2),
        f64::from(u8::from(CONTACT_LAWS.contains(&findings.effect.as_str()))),
    ]
}

/// Probabilities of what a log shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probabilities {
    /// The best effect of the search is right.
    pub effect: f64,
    /// Nothing is missing.
    pub none: f64,
    /// Something is that is not this effect.
    pub unknown: f64,
}

impl Probabilities {
    /// What to call it: an effect where it is more probable right than not, else the more probable of the other two.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.effect > 0.5 {
            Verdict::Effect
        } else if self.none >= self.unknown {
            Verdict::None
        } else {
            Verdict::Unknown
        }
    }
}

/// The regression.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// What it was made from: command, logs, engines, seeds, solver.
    pub provenance: serde_json::Value,
    /// Mean and standard deviation of each feature, by its name.
    pub features: Vec<(String, f64, f64)>,
    /// Offset and weights of `effect`, `none` and `unknown`, of features with mean 0 and standard deviation 1.
    pub classes: [(f64, Vec<f64>); 3],
}

impl Decision {
    /// The one that diagnoses are made with.
    ///
    /// # Panics
    ///
    /// Never: a test reads it.
    #[must_use]
    pub fn shipped() -> &'static Self {
        static SHIPPED: OnceLock<Decision> = OnceLock::new();
        SHIPPED.get_or_init(|| {
            serde_json::from_str(include_str!("../../../assets/diagnose/decision.json")).expect("a test reads it")
        })
    }

    /// Probabilities given what speaks for the best effect.
    #[must_use]
    pub fn probabilities(&self, findings: &Findings) -> Probabilities {
        let standard: Vec<f64> = (features(findings).iter().zip(&self.features))
            .map(|(value, (_, mean, stddev))| (value - mean) / stddev)
            .collect();
        let score = |(offset, weights): &(f64, Vec<f64>)| {
            offset + weights.iter().zip(&standard).map(|(weight, value)| weight * value).sum::<f64>()
        };
        let scores = self.classes.each_ref().map(score);
        let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares = scores.map(|score| (score - most).exp());
        let sum: f64 = shares.iter().sum();
        let [effect, none, unknown] = shares.map(|share| share / sum);
        Probabilities { effect, none, unknown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings() -> Findings {
        Findings {
            effect: "table_tilt".into(),
            log_evidence: 500.0,
            margin: 100.0,
            steadiness: 5.0,
            heldout_steadiness: 4.0,
            drop: 2.0,
            before: 9.0,
            after: 1.1,
            motion_after: 1.1,
            force_after: 1.0,
            motion_share: [0.1, 0.01],
            force_share: [0.3, 0.1],
            size: 1.0,
            episodes: [20, 4],
        }
    }

    #[test]
    fn the_shipped_decision_is_read_and_is_a_distribution_whatever_it_is_told() {
        let shipped = Decision::shipped();
        let names: Vec<&str> = shipped.features.iter().map(|(name, ..)| name.as_str()).collect();
        assert_eq!(names, FEATURES);
        assert!(shipped.classes.iter().all(|(_, weights)| weights.len() == FEATURES.len()));
        for size in [0.0, 1.0, 1e300, f64::INFINITY] {
            let found = shipped.probabilities(&Findings {
                log_evidence: size,
                before: size,
                motion_after: size,
                steadiness: -size,
                ..findings()
            });
            assert!((found.effect + found.none + found.unknown - 1.0).abs() < 1e-9, "{size}: {found:?}");
        }
    }

    #[test]
    fn a_softmax_of_weighted_standard_features() {
        let weights = |first: f64| [vec![first], vec![0.0; FEATURES.len() - 1]].concat();
        let decision = Decision {
            provenance: serde_json::Value::Null,
            features: FEATURES.iter().map(|name| ((*name).to_string(), 1.0, 2.0)).collect(),
            classes: [(1.0, weights(0.5)), (0.0, weights(0.0)), (0.0, weights(0.0))],
        };
        let expected = (1.0 + 0.5 * (501.0_f64.ln() - 1.0) / 2.0).exp();
        let found = decision.probabilities(&findings());
        assert!((found.effect / found.none - expected).abs() < 1e-9 && found.none == found.unknown);
        assert_eq!(found.verdict(), Verdict::Effect);
        // Less probable right than not is no name.
        assert_eq!(Probabilities { effect: 0.45, none: 0.3, unknown: 0.25 }.verdict(), Verdict::None);
    }
}
