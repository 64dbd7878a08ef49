//! What to call it, and which model to keep: an effect, nothing, or something that the catalogue has not.

use crate::decision::{Decision, Probabilities};
use crate::findings::Findings;
use crate::fit::Fit;
use crate::likelihood::NOISE_FLOOR;
use crate::model::Model;
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
    /// Of the effects that were compared for the first place, of nothing and of something else.
    pub(crate) probabilities: Probabilities,
    /// That each effect of the model is right.
    pub(crate) confidences: Vec<f64>,
    /// The model to keep.
    pub(crate) model: Fit,
    /// Whether that was fitted to the episodes of the screening alone.
    pub(crate) in_part: bool,
    /// Why it is `unknown`.
    pub(crate) reason: Option<String>,
}

/// Decides from what a search accepted and compared. `findings`: what speaks for the rivals of each round, the first of which stands for the log.
pub(crate) fn decide(decision: &Decision, accepted: Fit, rounds: &[Round], findings: &[Vec<Findings>]) -> Decided {
    let each: Vec<Probabilities> = findings.iter().map(|round| decision.probabilities(round)).collect();
    let probabilities = each[0].clone();
    let verdict = probabilities.verdict();
    let (name, probability) = probabilities.best();
    let told = match verdict {
        Verdict::Effect => true,
        Verdict::Unknown => probability >= WORTH_TELLING,
        Verdict::None => false,
    };
    let (mut model, in_part) = match rounds[0].rival(name) {
        // Several that were found at once hide each other: alone another one may look better.
        _ if told && found_at_once(&accepted.model, rounds) => (accepted, false),
        Some(_) if told && has(&accepted.model, name) => (accepted, false),
        Some(rival) if told => (rival.fit.clone(), !rival.whole),
        _ => (rounds[0].base.clone(), false),
    };
    // A further effect is named by the rule of the first; several that were found at once stand or fall together.
    let further = |model: &Fit, place: usize| -> Option<f64> {
        Some(each.get(place)?.of(model.model.parts.get(place)?.kind().name()))
    };
    if model.model.parts.len() == 2
        && each.get(1).is_some_and(|second| second.verdict() != Verdict::Effect)
        && let Some(second) = rounds.get(1).filter(|round| has(&round.base.model, name))
    {
        model = second.base.clone();
    }
    let confidence = |place: usize| match place {
        0 => probabilities.of(model.model.parts[0].kind().name()).max(probability),
        _ => further(&model, place).unwrap_or(probability),
    };
    let confidences: Vec<f64> = (0..model.model.parts.len()).map(confidence).collect();
    let reason = (verdict == Verdict::Unknown).then(|| {
        let best = if name.is_empty() { "none that was tried".to_string() } else { format!("{name}, the best that was tried, with {probability:.2}") };
        format!(
            "noise and contacts alone explain this log with probability {:.2}, an effect of the catalogue with {:.2} ({best})",
            probabilities.none,
            probabilities.effect()
        )
    });
    Decided { verdict, probabilities, confidences, model, in_part, reason }
}

/// Whether its effects were added to the nominal model together, not one to another.
fn found_at_once(model: &Model, rounds: &[Round]) -> bool {
    model.parts.len() > 1 && rounds.get(1).is_some_and(|second| second.base.model.parts.is_empty())
}

fn has(model: &Model, name: &str) -> bool {
    model.parts.iter().any(|part| part.kind().name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidate::{candidates, tests::context};
    use crate::decision::tests::{by_evidence, findings};
    use crate::likelihood::Stack;
    use crate::rival::{Heldout, Rival};

    #[test]
    fn what_no_effect_explains_is_not_closed() {
        let closed = [[37.0, 37.0], [3.0, 2.0], [0.9, 0.9]].map(|[before, after]| closed_fraction(before, after));
        assert_eq!(closed, [0.0, 0.5, 1.0]);
    }

    /// With the first effects of the catalogue from `first` on.
    fn fit(first: usize, effects: usize) -> Fit {
        let all = candidates(&context());
        let chosen = all.iter().skip(first).take(effects);
        let model = chosen.fold(Model::nominal(0, 0), |model, candidate| model.with(candidate));
        Fit::new(model, Vec::new(), Vec::new(), Stack::default(), Vec::new())
    }

    fn rival(fit: Fit, whole: bool) -> Rival {
        Rival { fit, whole, gain: 1.0, heldout: Heldout::default() }
    }

    /// A round that adds an effect to `base` others, the first ones.
    fn round(base: usize) -> Round {
        let (before, passed_over, promises) = (Heldout::default(), Vec::new(), Vec::new());
        let rivals = vec![rival(fit(0, base + 1), true)];
        Round { promises, rivals, passed_over, base: fit(0, base), before, hasty: false }
    }

    fn name(place: usize) -> String {
        fit(place, 1).model.parts[0].kind().name().into()
    }

    fn found(place: usize, log_evidence: f64) -> Findings {
        findings(&name(place), log_evidence)
    }

    #[test]
    fn what_is_more_probable_than_not_is_named_whatever_the_search_accepted() {
        let none = by_evidence([0.0, -50.0]);
        let named = decide(&none, fit(0, 0), &[round(0)], &[vec![found(0, 8.0)]]);
        assert_eq!((named.verdict, named.model.model.parts.len(), named.in_part), (Verdict::Effect, 1, false));
        assert!((named.confidences[0] - 0.9).abs() < 1e-9);
        // What the search accepted is taken back where nothing is missing.
        let kept = decide(&none, fit(0, 1), &[round(0)], &[vec![found(0, 0.0)]]);
        assert_eq!((kept.verdict, kept.model.model.parts.len(), kept.reason), (Verdict::None, 0, None));
    }

    #[test]
    fn what_is_named_need_not_be_what_the_search_took_first() {
        let mut first = round(0);
        let other = (1..).find(|place| name(*place) != name(0)).unwrap();
        first.rivals.push(rival(fit(other, 1), false));
        let compared = vec![found(0, 3.0), found(other, 80.0)];
        let named = decide(&by_evidence([0.0, 0.0]), fit(0, 1), &[first], &[compared]);
        assert_eq!(named.model.model.parts[0].kind().name(), name(other));
        assert!(named.in_part && named.confidences[0] > 0.9, "{named:?}");
    }

    #[test]
    fn an_unknown_gap_shows_an_effect_that_is_worth_telling() {
        let near = decide(&by_evidence([-50.0, 1.0]), fit(0, 1), &[round(0)], &[vec![found(0, 0.0)]]);
        assert_eq!((near.verdict, near.model.model.parts.len()), (Verdict::Unknown, 1));
        assert!(near.confidences[0] < 0.5 && near.reason.is_some());
        let far = decide(&by_evidence([-50.0, 3.0]), fit(0, 1), &[round(0)], &[vec![found(0, 0.0)]]);
        assert_eq!((far.verdict, far.model.model.parts.len()), (Verdict::Unknown, 0));
        let nothing = decide(&by_evidence([-50.0, 3.0]), fit(0, 0), &[round(0)], &[vec![findings("", 0.0)]]);
        assert_eq!((nothing.verdict, nothing.model.model.parts.len()), (Verdict::Unknown, 0));
    }

    #[test]
    fn a_further_effect_is_named_where_it_is_more_probable_than_not_that_there_is_one() {
        let none = by_evidence([0.0, -50.0]);
        let rounds = [round(0), round(1)];
        let second = fit(0, 2).model.parts[1].kind().name();
        let of = |log_evidence| [vec![found(0, 8.0)], vec![findings(second, log_evidence)]];
        let both = decide(&none, fit(0, 2), &rounds, &of(4.0));
        assert_eq!(both.confidences.len(), 2);
        let one = decide(&none, fit(0, 2), &rounds, &of(0.0));
        assert_eq!((one.verdict, one.model.model.parts.len()), (Verdict::Effect, 1));
    }
}
