//! What to call it, and which model to keep: from the probabilities of a [`Decision`] to an effect, nothing, or something that the catalogue has not.

use crate::decision::{Decision, Probabilities};
use crate::findings::Findings;
use crate::fit::Fit;
use crate::likelihood::NOISE_FLOOR;
use crate::report::Verdict;
use crate::rival::Round;

/// An unknown gap is shown with the nearest effect if that is right with this probability or more.
const WORTH_TELLING: f64 = 0.2;

pub(crate) fn closed_fraction(before: f64, after: f64) -> f64 {
    let gap = before - NOISE_FLOOR;
    if gap > 0.0 { ((before - after) / gap).min(1.0) } else { 1.0 }
}

/// What was decided.
#[derive(Clone, Debug)]
pub(crate) struct Decided {
    pub(crate) verdict: Verdict,
    /// Of the best effect.
    pub(crate) probabilities: Probabilities,
    /// That each effect of the model is right.
    pub(crate) confidences: Vec<f64>,
    /// The model to keep.
    pub(crate) model: Fit,
    /// Why it is `unknown`.
    pub(crate) reason: Option<String>,
}

/// Decides from what a search accepted and compared. `findings`: what speaks for the first rival of each round, the first of which stands for the log.
pub(crate) fn decide(decision: &Decision, accepted: Fit, rounds: &[Round], findings: &[Findings]) -> Decided {
    let each: Vec<Probabilities> = findings.iter().map(|findings| decision.probabilities(findings)).collect();
    let probabilities = each[0];
    let verdict = probabilities.verdict();
    let null = || rounds[0].base.clone();
    let told = match verdict {
        Verdict::Effect => true,
        Verdict::Unknown => probabilities.effect >= WORTH_TELLING,
        Verdict::None => false,
    };
    let lead = rounds[0].rivals.first().filter(|rival| rival.whole).map(|rival| rival.fit.clone());
    let mut model = match (told, accepted.model.parts.is_empty()) {
        (false, _) => null(),
        (true, false) => accepted,
        (true, true) => lead.unwrap_or_else(null),
    };
    // A further effect is named if it is more probable right than not; several that were found at once stand or fall together.
    let doubted = |place: usize| each.get(place).is_some_and(|further| further.effect <= 0.5);
    if model.model.parts.len() == 2 && doubted(1) && rounds.len() > 1 && !rounds[1].base.model.parts.is_empty() {
        model = rounds[1].base.clone();
    }
    let confidence = |place: usize| each.get(place).map_or(probabilities.effect, |found| found.effect);
    let confidences: Vec<f64> = (0..model.model.parts.len()).map(confidence).collect();
    let reason = (verdict == Verdict::Unknown).then(|| {
        format!(
            "noise and contacts alone explain this log with probability {:.2}, the best effect that was tried ({}) with {:.2}",
            probabilities.none, findings[0].effect, probabilities.effect
        )
    });
    Decided { verdict, probabilities, confidences, model, reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidate::{candidates, tests::context};
    use crate::likelihood::Stack;
    use crate::model::Model;
    use crate::rival::{Heldout, Rival};

    fn fit(effects: usize) -> Fit {
        let all = candidates(&context());
        let model = all.iter().take(effects).fold(Model::nominal(0, 0), |model, candidate| model.with(candidate));
        Fit::new(model, Vec::new(), Vec::new(), Stack::default(), Vec::new())
    }

    /// A round that adds an effect to `base` others.
    fn round(base: usize) -> Round {
        let rival = Rival { fit: fit(base + 1), whole: true, gain: 1.0, heldout: Heldout::default() };
        let (before, passed_over, promises) = (Heldout::default(), Vec::new(), Vec::new());
        Round { promises, rivals: vec![rival], passed_over, base: fit(base), before, hasty: false }
    }

    /// Findings with this ln evidence, of which the decision below reads the probability of an effect.
    fn findings(log_evidence: f64) -> Findings {
        Findings {
            effect: "table_tilt".into(),
            log_evidence,
            margin: 0.0,
            steadiness: 0.0,
            heldout_steadiness: 0.0,
            drop: 0.0,
            before: 1.0,
            after: 1.0,
            motion_after: 1.0,
            force_after: 1.0,
            motion_share: [0.0; 2],
            force_share: [0.0; 2],
            size: 1.0,
            episodes: [20, 4],
        }
    }

    /// Odds of an effect against `other` that are one plus the ln evidence.
    fn decision(other: [f64; 2]) -> Decision {
        let names = crate::decision::FEATURES;
        let weights = |first: f64| [vec![first], vec![0.0; names.len() - 1]].concat();
        let [none, unknown] = other.map(|offset| (offset, weights(0.0)));
        Decision {
            provenance: serde_json::Value::Null,
            features: names.iter().map(|name| ((*name).to_string(), 0.0, 1.0)).collect(),
            classes: [(0.0, weights(1.0)), none, unknown],
        }
    }

    #[test]
    fn what_is_more_probable_than_not_is_named_whatever_the_search_accepted() {
        let none = decision([0.0, -50.0]);
        let named = decide(&none, fit(0), &[round(0)], &[findings(8.0)]);
        assert_eq!((named.verdict, named.model.model.parts.len()), (Verdict::Effect, 1));
        assert!((named.confidences[0] - 0.9).abs() < 1e-9);
        // What the search accepted is taken back where nothing is missing.
        let kept = decide(&none, fit(1), &[round(0)], &[findings(0.0)]);
        assert_eq!((kept.verdict, kept.model.model.parts.len(), kept.reason), (Verdict::None, 0, None));
    }

    #[test]
    fn an_unknown_gap_shows_an_effect_that_is_worth_telling() {
        let unknown = decision([-50.0, 1.0]);
        let near = decide(&unknown, fit(1), &[round(0)], &[findings(0.0)]);
        assert_eq!((near.verdict, near.model.model.parts.len()), (Verdict::Unknown, 1));
        assert!(near.confidences[0] < 0.5 && near.reason.is_some());
        let far = decide(&decision([-50.0, 3.0]), fit(1), &[round(0)], &[findings(0.0)]);
        assert_eq!((far.verdict, far.model.model.parts.len()), (Verdict::Unknown, 0));
    }

    #[test]
    fn a_further_effect_is_named_if_it_is_more_probable_right_than_not() {
        let none = decision([0.0, -50.0]);
        let rounds = [round(0), round(1)];
        let both = decide(&none, fit(2), &rounds, &[findings(8.0), findings(4.0)]);
        assert_eq!(both.confidences.len(), 2);
        let one = decide(&none, fit(2), &rounds, &[findings(8.0), findings(0.0)]);
        assert_eq!((one.verdict, one.model.model.parts.len()), (Verdict::Effect, 1));
    }
}
