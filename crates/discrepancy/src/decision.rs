//! From what speaks for each effect to how probable it is: a conditional logit, fitted to simulated logs of several engines.
//!
//! One of the effects that a search compared is right, or nothing is missing, or something is that none of them explains. Their probabilities are
//! softmax(s) of the scores s = b + w f of each effect, with the same b and w for all of them and the features f of its [`Findings`], and s = b + w g of
//! the other two, with features g of the log (McFadden, "Conditional logit analysis of qualitative choice behavior", 1974). Offsets b and weights w are made by `diagnose-learn` from
//! logs whose truth is known, and stand in `assets/diagnose/decision.json` with what they were made from. No threshold is set by hand: effects are named
//! where it is more probable than not that one of them is right.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::begin::are_twins_by_name;
use crate::findings::Findings;
use crate::report::Verdict;

/// Names of the features of an effect, in order.
pub const EFFECT_FEATURES: [&str; 15] = [
    "lead",
    "lead, explained",
    "lead over twins",
    "drop steadiness",
    "slow drop",
    "ln gain",
    "median gain",
    "force gain",
    "force gain, explained",
    "ln motion drop",
    "ln motion after",
    "ln force share",
    "coordinates",
    "lawful share",
    "ln apart",
];

/// Names of the features of a log, in order.
pub const LOG_FEATURES: [&str; 6] =
    ["ln before", "ln motion share", "ln force share", "ln episodes", "lawful share", "ln apart"];

/// No gain and no error is larger to a decision.
const MOST: f64 = 1e6;
/// A smaller gain of a residual in ln p says no more.
const LEAST_GAIN: f64 = 1e-4;

// Numbers that say no more beyond a point are held there; what is no number is as far out as can be.
fn held(value: f64, least: f64, most: f64) -> f64 {
    if value.is_nan() { most } else { value.clamp(least, most) }
}

fn logarithm(value: f64, least: f64) -> f64 {
    held(value, least, MOST).ln()
}

/// By how much more ln evidence an effect gains than the best of those that do something else, or than none, as a share of what it gains; and by how many
/// nats more than the best of those that do nearly the same, 0 where none was compared.
fn leads(findings: &Findings, compared: &[Findings]) -> [f64; 2] {
    let is_twin = |other: &Findings| are_twins_by_name([&other.effect, &findings.effect]);
    let others = compared.iter().filter(|other| other.effect != findings.effect);
    let (twins, others): (Vec<&Findings>, Vec<&Findings>) = others.partition(|other| is_twin(other));
    let evidence = |all: &[&Findings], least| all.iter().map(|other| other.log_evidence).fold(least, f64::max);
    let own = findings.log_evidence;
    let over_twins = if twins.is_empty() { 0.0 } else { own - evidence(&twins, f64::NEG_INFINITY) };
    [(own - evidence(&others, 0.0)) / own.max(1.0), over_twins]
}

/// What the feature vector of an effect is, in the order of [`EFFECT_FEATURES`]. `compared`: all that were.
#[must_use]
pub fn effect_features(findings: &Findings, compared: &[Findings]) -> [f64; EFFECT_FEATURES.len()] {
    let bounded = |value: f64, most: f64| held(value, -most, most);
    let signed = |value: f64| bounded(value, MOST).abs().ln_1p().copysign(value);
    let [without, with] = findings.motion_share.map(|share| logarithm(share, 1e-3));
    // Where no more than noise is left of the motion, evidence means what it says.
    let explained = held(findings.motion_after, 1.0, MOST).recip();
    let [lead, over_twins] = leads(findings, compared);
    let lead = bounded(lead, 1.0);
    let force_gain = signed(findings.force_gain);
    [
        lead,
        explained * lead,
        signed(over_twins),
        bounded(findings.drop_steadiness, 8.0),
        bounded(findings.slow_drop, 3.0),
        logarithm(findings.gain.max(0.0) + LEAST_GAIN, LEAST_GAIN),
        signed(findings.median_gain),
        force_gain,
        explained * force_gain,
        bounded(without - with, 3.0),
        logarithm(findings.motion_after, 0.5),
        logarithm(findings.force_share[1], 1e-2),
        held(findings.coordinates as f64, 0.0, 4.0),
        held(findings.lawful_share[1], 0.0, 1.0),
        logarithm(findings.apart_readings[1], 1.0),
    ]
}

/// What the feature vector of a log is, in the order of [`LOG_FEATURES`]; of one without findings as of one that is explained.
#[must_use]
pub fn log_features(findings: &[Findings]) -> [f64; LOG_FEATURES.len()] {
    let of = |number: fn(&Findings) -> f64, least: f64| logarithm(findings.first().map_or(least, number), least);
    [
        of(|first| first.before, 0.5),
        of(|first| first.motion_share[0], 1e-3),
        of(|first| first.force_share[0], 1e-2),
        of(|first| first.episodes.iter().sum::<usize>() as f64, 1.0),
        findings.first().map_or(0.0, |first| held(first.lawful_share[0], 0.0, 1.0)),
        of(|first| first.apart_readings[0], 1.0),
    ]
}

/// Probabilities of what a log shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probabilities {
    /// Of each effect that was compared that it is right, the most probable first.
    pub effects: Vec<(String, f64)>,
    /// Nothing is missing.
    pub none: f64,
    /// Something else is missing.
    pub unknown: f64,
}

impl Probabilities {
    /// That one of the effects is right.
    #[must_use]
    pub fn effect(&self) -> f64 {
        self.effects.iter().map(|(_, probability)| probability).sum()
    }

    /// The most probable effect, and how probable it is; "" and 0 where none was compared.
    #[must_use]
    pub fn best(&self) -> (&str, f64) {
        self.effects.first().map_or(("", 0.0), |(name, probability)| (name.as_str(), *probability))
    }

    /// That an effect is right; 0 of one that was not compared.
    #[must_use]
    pub fn of(&self, name: &str) -> f64 {
        self.effects.iter().find(|(other, _)| other == name).map_or(0.0, |(_, probability)| *probability)
    }

    /// What to call it: what is more probable than not, or else the more probable of the other two.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.effect() > 0.5 {
            Verdict::Effect
        } else if self.none >= self.unknown {
            Verdict::None
        } else {
            Verdict::Unknown
        }
    }
}

/// An offset and the weights of standardised features.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Score {
    /// Offset.
    pub offset: f64,
    /// Weights, in the order of the features.
    pub weights: Vec<f64>,
}

impl Score {
    fn of(&self, standard: impl Iterator<Item = f64>) -> f64 {
        self.offset + self.weights.iter().zip(standard).map(|(weight, value)| weight * value).sum::<f64>()
    }
}

/// Name, mean and standard deviation of a feature.
pub type Scale = (String, f64, f64);

/// The conditional logit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// What it was made from: command, logs, engines, seeds, solver.
    pub provenance: serde_json::Value,
    /// Of the features of an effect.
    pub effect_features: Vec<Scale>,
    /// Of those of a log.
    pub log_features: Vec<Scale>,
    /// Of each effect.
    pub effect: Score,
    /// Of nothing.
    pub none: Score,
    /// Of something else.
    pub unknown: Score,
    /// By how much 90 % intervals are wider than those of the bootstrap: so wide, 90 % of the true values of the logs that
    /// it was made from lie within.
    pub width: f64,
}

/// Features with mean 0 and standard deviation 1.
pub fn standardised<'a>(features: &'a [f64], scales: &'a [Scale]) -> impl Iterator<Item = f64> + 'a {
    features.iter().zip(scales).map(|(value, (_, mean, stddev))| (value - mean) / stddev)
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

    /// Probabilities given what speaks for each effect that was compared; one without a name is none.
    #[must_use]
    pub fn probabilities(&self, findings: &[Findings]) -> Probabilities {
        let compared: Vec<&Findings> = findings.iter().filter(|found| !found.effect.is_empty()).collect();
        let of_effect =
            |found: &&Findings| self.effect.of(standardised(&effect_features(found, findings), &self.effect_features));
        let of_log = |score: &Score| score.of(standardised(&log_features(findings), &self.log_features));
        let mut scores: Vec<f64> = compared.iter().map(of_effect).collect();
        scores.extend([&self.none, &self.unknown].map(of_log));
        let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = scores.iter().map(|score| (score - largest).exp()).collect();
        let sum: f64 = shares.iter().sum();
        let mut effects: Vec<(String, f64)> =
            compared.iter().zip(&shares).map(|(found, share)| (found.effect.clone(), share / sum)).collect();
        effects.sort_by(|a, b| b.1.total_cmp(&a.1));
        let [none, unknown] = [shares[compared.len()] / sum, shares[compared.len() + 1] / sum];
        Probabilities { effects, none, unknown }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Of an effect with this ln evidence.
    pub(crate) fn findings(effect: &str, log_evidence: f64) -> Findings {
        Findings {
            effect: effect.into(),
            log_evidence,
            whole: true,
            coordinates: 2,
            drop_steadiness: 5.0,
            slow_drop: 1.0,
            gain: 0.5,
            // So that the feature is ln(1 + ln evidence).
            median_gain: log_evidence,
            force_gain: 10.0,
            before: 9.0,
            motion_after: 1.1,
            motion_share: [0.1, 0.01],
            force_share: [0.3, 0.1],
            lawful_share: [0.3, 0.1],
            apart_readings: [2.0, 0.5],
            episodes: [20, 4],
        }
    }

    /// A decision by the median episode's gain alone: the score of an effect is ln(1 + gain), those of nothing and something else are these.
    pub(crate) fn by_evidence([none, unknown]: [f64; 2]) -> Decision {
        let plain = |names: &[&str]| names.iter().map(|name| ((*name).to_string(), 0.0, 1.0)).collect::<Vec<Scale>>();
        let offset = |offset: f64| Score { offset, weights: vec![0.0; LOG_FEATURES.len()] };
        Decision {
            provenance: serde_json::Value::Null,
            effect_features: plain(&EFFECT_FEATURES),
            log_features: plain(&LOG_FEATURES),
            effect: Score {
                offset: 0.0,
                weights: EFFECT_FEATURES.map(|name| f64::from(u8::from(name == "median gain"))).to_vec(),
            },
            none: offset(none),
            unknown: offset(unknown),
            width: 1.0,
        }
    }

    #[test]
    fn the_shipped_decision_is_read_and_is_a_distribution_whatever_it_is_told() {
        let shipped = Decision::shipped();
        let names = |scales: &[Scale]| scales.iter().map(|(name, ..)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&shipped.effect_features), EFFECT_FEATURES);
        assert_eq!(names(&shipped.log_features), LOG_FEATURES);
        assert_eq!(shipped.effect.weights.len(), EFFECT_FEATURES.len());
        assert!([&shipped.none, &shipped.unknown].iter().all(|score| score.weights.len() == LOG_FEATURES.len()));
        for size in [0.0, 1.0, 1e300, f64::INFINITY, f64::NAN] {
            let odd = Findings { before: size, motion_after: size, gain: -size, ..findings("table_tilt", size) };
            for compared in [vec![], vec![odd.clone()], vec![odd, findings("tether", 10.0)]] {
                let found = shipped.probabilities(&compared);
                let sum = found.effect() + found.none + found.unknown;
                assert!((sum - 1.0).abs() < 1e-9 && found.effects.len() == compared.len(), "{size}: {found:?}");
            }
        }
    }

    #[test]
    fn effects_compete_with_each_other_and_with_the_rest() {
        let decision = by_evidence([0.0, 0.0]);
        let found = decision.probabilities(&[findings("tether", 3.0), findings("table_tilt", 5.0)]);
        // e^ln(1 + x) of each, over 4 + 6 + 1 + 1.
        assert_eq!(found.best().0, "table_tilt");
        assert!((found.best().1 - 0.5).abs() < 1e-9 && (found.of("tether") - 1.0 / 3.0).abs() < 1e-9);
        assert!((found.none - 1.0 / 12.0).abs() < 1e-9 && found.of("adhesion") == 0.0);
        assert_eq!(found.verdict(), Verdict::Effect);
        // Nothing that was compared is no effect.
        let nothing = decision.probabilities(&[findings("", 0.0)]);
        assert!(nothing.effects.is_empty() && nothing.verdict() == Verdict::None && nothing.best() == ("", 0.0));
    }

    #[test]
    fn twins_are_told_apart_by_their_evidence_and_compete_with_others_together() {
        let all = [findings("table_tilt", 80.0), findings("constant_force", 50.0), findings("adhesion", 20.0)];
        let of = |place: usize| leads(&all[place], &all);
        assert_eq!((of(0), of(1)), ([0.75, 30.0], [0.6, -30.0]));
        // One without a twin is behind the best of the others.
        assert_eq!(of(2), [-3.0, 0.0]);
        assert_eq!(leads(&all[0], &all[..1]), [1.0, 0.0]);
    }

    #[test]
    fn less_probable_than_not_is_no_name() {
        let of = |effect, none, unknown| Probabilities { effects: vec![("tether".into(), effect)], none, unknown };
        assert_eq!(of(0.45, 0.3, 0.25).verdict(), Verdict::None);
        assert_eq!(of(0.45, 0.25, 0.3).verdict(), Verdict::Unknown);
    }
}
